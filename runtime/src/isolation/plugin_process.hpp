// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "isolation/descriptor.hpp"

#include <chrono>
#include <cstddef>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sys/types.h>

namespace cles::runtime {

/// The first argument of the program that runs an isolated plugin. The daemon's id, the number of lanes and, for `ps`,
/// the plugin's file follow.
inline constexpr auto plugin_process_mode = "--plugin-process";

/// The descriptors of the process: the socket for control, followed by one socket for each lane.
inline constexpr int control_descriptor = 3;

/// "signal 11 (SIGSEGV)"
std::string text_of_signal(int number);

/// How a process ended.
struct process_end {
    std::string_view how; ///< "was ended by", "ended itself with", "was ended because"
    std::string cause;    ///< "signal 11 (SIGSEGV)", "exit code 3", "it did not start in time"

    [[nodiscard]] std::string text() const { return std::string{how} + " " + cause; }
};

/// The process of an isolated plugin, as its parent sees it. It is killed when this is destroyed.
///
/// It inherits sockets that are connected already, so that no address exists to which another process could connect.
class plugin_process {
  public:
    /// Starts this program again. \param plugin its file \throws std::system_error
    plugin_process(std::string plugin, std::size_t lane_count);
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
    /// Kills it and what it has started. The first reason counts, unless it ends for another one before.
    void kill(std::string_view why);
    /// How it ended. It is expected to have ended, or to do so now: one that does not is killed, because it has closed
    /// a connection, and is given up if even that does not end it.
    process_end end();

  private:
    [[nodiscard]] bool ends_within(std::chrono::milliseconds limit) const;

    pid_t id_ = -1;
    owned_descriptor handle_;
    std::mutex mutex_; // of the rest
    std::string killed_because_;
    std::optional<process_end> end_; // nothing: it has not been waited for
};

} // namespace cles::runtime
