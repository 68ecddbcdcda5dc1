// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "isolation/descriptor.hpp"

#include <cstddef>
#include <mutex>
#include <string>
#include <vector>

#include <sys/types.h>

namespace cles::runtime {

/// The first argument of the program that runs an isolated plugin; the daemon's id and the number of lanes follow.
inline constexpr auto plugin_process_mode = "--plugin-process";

/// The descriptors of the process: the socket for control, followed by one socket for each lane.
inline constexpr int control_descriptor = 3;

/// The process of an isolated plugin, as its parent sees it. It is killed when this is destroyed.
///
/// It inherits sockets that are connected already, so that no address exists to which another process could connect.
class plugin_process {
  public:
    /// Starts `program`. \throws std::system_error
    plugin_process(const std::string& program, std::size_t lane_count);
    plugin_process(const plugin_process&) = delete;
    plugin_process& operator=(const plugin_process&) = delete;
    ~plugin_process();

    /// The parent's ends. The stream of its output is not blocking; the others are.
    owned_descriptor control;
    owned_descriptor output; ///< what it writes to stdout and stderr
    std::vector<owned_descriptor> lanes;
    /// Readable once it has ended.
    [[nodiscard]] int handle() const noexcept { return handle_.get(); }
    [[nodiscard]] pid_t id() const noexcept { return id_; }

    // From any thread:
    /// Kills it and what it has started.
    void kill() noexcept;
    /// Kills it if it has not ended, waits for its end, and says how it ended: "was ended by signal 11 (SIGSEGV)",
    /// "ended itself with exit code 3".
    std::string end() noexcept;

  private:
    pid_t id_ = -1;
    owned_descriptor handle_;
    std::mutex mutex_;
    std::string how_; // empty: it has not been waited for
};

} // namespace cles::runtime
