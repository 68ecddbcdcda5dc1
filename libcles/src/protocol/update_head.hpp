// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "protocol/request_line.hpp"

#include <memory>
#include <string>
#include <string_view>

namespace cles::protocol {

/// The head of a publisher's updates, of which only `seq` changes from one to the next: recognises the next one without
/// parsing it again, which halves the cost of reading a stream of updates.
class update_head {
  public:
    /// Remembers the head of this line, parsed to `update`, if it has the form that nodes write.
    void remember(std::string_view line, const request_line& update);
    /// The parsed line if its head is the remembered one except for the `seq`; else null. Valid until the next call.
    [[nodiscard]] const request_line* recognise(std::string_view line) noexcept;
    void forget() noexcept { before_.clear(); }

  private:
    std::string before_;                   // "UPDATE car1:localization seq="
    std::string after_;                    // " epoch=5f3a09c1 "
    std::string text_;                     // what `update_` points into
    std::unique_ptr<request_line> update_; // large, and most links receive no updates
};

} // namespace cles::protocol
