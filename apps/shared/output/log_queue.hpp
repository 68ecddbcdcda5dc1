// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

namespace tool {

/// The lines of a log that wait for its reader. Others can cause lines, and the reader may never come, so they are
/// limited: what does not fit is dropped, and counted. Sans-I/O.
class log_queue {
  public:
    static constexpr std::size_t most_lines = 4096;
    static constexpr std::size_t most_bytes = 262'144; ///< a single line may be longer

    struct entry {
        std::uint64_t dropped = 0; ///< lines before this one
        std::string line{};        ///< empty: none has followed those
    };

    void add(std::string line);
    /// The next one; nothing if there is neither a line nor one that was dropped.
    std::optional<entry> take();
    [[nodiscard]] bool empty() const noexcept { return entries_.empty() && dropped_ == 0; }

  private:
    std::deque<entry> entries_;
    std::size_t bytes_ = 0;
    std::uint64_t dropped_ = 0; // since the last entry
};

} // namespace tool
