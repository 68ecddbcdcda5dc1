// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <utility>

namespace cles::security {

/// Differs in a child process from what it was in its parent. Two processes must not go on with the same keys and
/// counters, because each nonce may be used once. \throws std::bad_alloc at the first call
[[nodiscard]] std::uint32_t fork_count();

/// Detects that the process has become a child process.
class fork_detector {
  public:
    /// True once in each child process.
    [[nodiscard]] bool forked() {
        const auto now = fork_count();
        return std::exchange(seen_, now) != now;
    }

  private:
    std::uint32_t seen_ = fork_count();
};

} // namespace cles::security
