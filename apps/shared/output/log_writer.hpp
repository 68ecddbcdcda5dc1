// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "output/terminal.hpp"

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>

namespace tool {

/// Writes the log of a program that must go on whatever the reader of its log does, on a thread of its own. While the
/// reader does not read, or the disk is full, lines wait in a `log_queue`; when they can be written again, a line says
/// how many were dropped. May be used from any thread.
class log_writer {
  public:
    /// How long the last lines are waited for.
    static constexpr std::chrono::milliseconds last_wait{500};

    /// \param dropped makes the line that says that so many were dropped; called on the writer's thread, and perhaps
    /// until the process ends
    log_writer(stream to, std::function<std::string(std::uint64_t)> dropped);
    log_writer(const log_writer&) = delete;
    log_writer& operator=(const log_writer&) = delete;
    ~log_writer() { close(); }

    /// Never waits. \param line with LF
    void write(std::string line);
    /// Waits until all lines are written, or for `last_wait`: before others write there, or may end the process.
    void flush();
    /// Writes what is left, or gives up after `last_wait`. Later lines are ignored.
    void close();

  private:
    struct shared;
    static void run(const std::shared_ptr<shared>& all);

    std::shared_ptr<shared> shared_;
    std::thread thread_;
};

} // namespace tool
