// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/drive/temporary_folder.hpp"

#include <cstddef>
#include <string>

namespace platoon {

/// The member of a platoon's fleet that watches the vehicles.
inline constexpr const char* operator_name = "operator";

/// A fleet for one drive on this host: the keys of `operator` and each vehicle, in a temporary folder that only this
/// user can read. A vehicle may receive the states of others, and join behind one; the operator may receive states, and
/// make a vehicle leave or split off; neither may do anything else.
class laboratory_fleet {
  public:
    /// \throws tool::usage_error if this program was built without security
    explicit laboratory_fleet(std::size_t vehicles);

    [[nodiscard]] const std::string& folder() const noexcept { return folder_.path(); }

  private:
    temporary_folder folder_; ///< removed with all of it
};

} // namespace platoon
