// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "descriptor.hpp"

#include <functional>
#include <string>
#include <string_view>

#include <sys/types.h>

namespace cles::perf {

/// The other end of a measurement: a process forked from this one, which ends with this object, or with its parent.
///
/// \pre the parent has not started threads or event loops
class child_process {
  public:
    /// Sends the parent the URL at which the child listens.
    using announce = std::function<void(std::string_view)>;
    /// Runs in the child on that core. `announced` throws its exception in the parent.
    using work = std::function<void(const announce&)>;

    child_process(int core, const work& run);
    child_process(const child_process&) = delete;
    child_process& operator=(const child_process&) = delete;
    ~child_process();

    /// Waits for the announcement.
    /// \throws std::runtime_error with the child's message if it failed
    std::string announced();
    [[nodiscard]] pid_t id() const noexcept { return id_; }

  private:
    pid_t id_ = -1;
    descriptor from_child_;
};

} // namespace cles::perf
