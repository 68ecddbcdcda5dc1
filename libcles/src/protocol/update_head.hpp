// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "protocol/request_line.hpp"

#include <memory>
#include <string>
#include <string_view>

namespace cles::protocol {

/// The head of a publisher's updates, which from one to the next differ in their `seq` alone: recognises the next one
/// without parsing it anew. A stream of updates is read at half the cost so.
class update_head {
  public:
    /// Keeps the head of this line, parsed to `update`, if it is of the form that nodes write.
    void remember(std::string_view line, const request_line& update);
    /// The line as parsed, if its head is the one remembered but for the `seq`; else null. Valid until the next call.
    [[nodiscard]] const request_line* recognise(std::string_view line) noexcept;
    void forget() noexcept { before_.clear(); }

  private:
    std::string before_;                   // "UPDATE car1:localization seq="
    std::string after_;                    // " epoch=5f3a09c1 "
    std::string text_;                     // what `update_` looks into
    std::unique_ptr<request_line> update_; // big, and most links take no updates
};

} // namespace cles::protocol
