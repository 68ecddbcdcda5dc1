// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "serve/command_outcome.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/steady_timer.hpp>

#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <sys/types.h>

namespace tool {

/// A program that runs once, without a shell: it reads a text on stdin, what it prints on stdout is collected, and its
/// stderr is that of this program. It has a process group of its own, which ends with it.
class child_process : public std::enable_shared_from_this<child_process> {
  public:
    using end_function = std::function<void(const finished_command&)>;

    /// \param words the program, looked up in PATH, and its arguments \param done called once, when it has ended
    /// \throws std::system_error if it cannot be started
    static std::shared_ptr<child_process> start(boost::asio::io_context& io, const std::vector<std::string>& words,
                                                std::string input, end_function done);

    /// For `start`.
    child_process(boost::asio::io_context& io, std::string input, end_function done);
    child_process(const child_process&) = delete;
    child_process& operator=(const child_process&) = delete;
    /// Kills it if it still runs.
    ~child_process();

    /// Asks it to end (SIGTERM), and kills it if it has not ended after a second.
    void stop();
    /// Kills it.
    void kill() noexcept;

  private:
    void spawn(const std::vector<std::string>& words);
    void write_input();
    void read_output();
    void wait_for_end();
    void on_end();
    void complete_if_done();

    boost::asio::posix::stream_descriptor input_;
    boost::asio::posix::stream_descriptor output_;
    boost::asio::posix::stream_descriptor ended_; // readable when it has ended (pidfd_open(2))
    boost::asio::steady_timer patience_;
    std::string text_; // for its stdin
    end_function done_;
    finished_command result_;
    std::array<char, 16384> chunk_{};
    pid_t id_ = 0; // also that of its group; 0: it does not run, or any more
    bool output_ends_ = false;
    bool has_ended_ = false;
};

} // namespace tool
