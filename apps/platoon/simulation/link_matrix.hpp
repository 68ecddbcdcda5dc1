// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/simulation/gilbert_elliott.hpp"
#include "platoon/simulation/impairment.hpp"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace platoon {

/// The radio links between vehicles: one for each ordered pair, each bad in its own way, determined by a seed.
class link_matrix {
  public:
    /// What a link has carried.
    struct count {
        std::uint64_t delivered = 0, lost = 0;
    };

    link_matrix(const gilbert_elliott& losses, double delay, std::uint64_t seed);

    /// The delay of what is sent now, s; nothing: it is lost.
    std::optional<double> next(std::size_t from, std::size_t to);
    [[nodiscard]] count counted(std::size_t from, std::size_t to) const;

  private:
    struct link {
        impairment how;
        count carried{};
    };

    gilbert_elliott losses_;
    double delay_;
    std::uint64_t seed_;
    std::vector<std::vector<std::optional<link>>> to_; ///< [to][from]
};

} // namespace platoon
