// SPDX-License-Identifier: BSL-1.0
#include "serve/child_process.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/write.hpp>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <spawn.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

namespace tool {

namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr auto time_to_stop = 1s;     // after SIGTERM
constexpr auto time_to_drain = 200ms; // a process that has left the group may keep its stdout open

[[noreturn]] void throw_start_error(int code) {
    throw std::system_error(code, std::generic_category(), "cannot start the command");
}

class open_descriptor {
  public:
    explicit open_descriptor(int number) noexcept : number_(number) {}
    open_descriptor(const open_descriptor&) = delete;
    open_descriptor& operator=(const open_descriptor&) = delete;
    open_descriptor(open_descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
    open_descriptor& operator=(open_descriptor&&) = delete;
    ~open_descriptor() {
        if (number_ >= 0) {
            ::close(number_);
        }
    }
    [[nodiscard]] int get() const noexcept { return number_; }
    int release() noexcept { return std::exchange(number_, -1); }

  private:
    int number_;
};

struct pipe_ends {
    open_descriptor from;
    open_descriptor into;
};

// Above the numbers of the standard streams, which the child replaces.
open_descriptor moved_above_streams(int number) {
    const open_descriptor below{number};
    const int moved = ::fcntl(below.get(), F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
    if (moved < 0) {
        throw_start_error(errno);
    }
    return open_descriptor{moved};
}

pipe_ends make_pipe_ends() {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
        throw_start_error(errno);
    }
    open_descriptor second{ends[1]}; // closed if the first cannot be moved
    auto from = moved_above_streams(ends[0]);
    auto into = moved_above_streams(second.release());
    return {std::move(from), std::move(into)};
}

class spawn_attributes {
  public:
    spawn_attributes() {
        ::posix_spawn_file_actions_init(&actions);
        ::posix_spawnattr_init(&attributes);
    }
    spawn_attributes(const spawn_attributes&) = delete;
    spawn_attributes& operator=(const spawn_attributes&) = delete;
    ~spawn_attributes() {
        ::posix_spawnattr_destroy(&attributes);
        ::posix_spawn_file_actions_destroy(&actions);
    }

    posix_spawn_file_actions_t actions{};
    posix_spawnattr_t attributes{};
};

} // namespace

std::shared_ptr<child_process> child_process::start(asio::io_context& io, const std::vector<std::string>& words,
                                                    std::string input, end_function done) {
    auto made = std::make_shared<child_process>(io, std::move(input), std::move(done));
    made->spawn(words);
    made->wait_for_end();
    made->write_input();
    made->read_output();
    return made;
}

child_process::child_process(asio::io_context& io, std::string input, end_function done)
    : input_(io), output_(io), ended_(io), patience_(io), text_(std::move(input)), done_(std::move(done)) {}

child_process::~child_process() {
    kill();
    if (id_ != 0) {
        ::waitpid(id_, nullptr, WNOHANG);
    }
}

void child_process::spawn(const std::vector<std::string>& words) {
    auto in = make_pipe_ends();
    auto out = make_pipe_ends();
    spawn_attributes how;
    ::posix_spawn_file_actions_adddup2(&how.actions, in.from.get(), STDIN_FILENO);
    ::posix_spawn_file_actions_adddup2(&how.actions, out.into.get(), STDOUT_FILENO);
    // As a program that a shell starts: this one ignores SIGPIPE.
    sigset_t defaults;
    ::sigemptyset(&defaults);
    ::sigaddset(&defaults, SIGPIPE);
    ::posix_spawnattr_setsigdefault(&how.attributes, &defaults);
    ::posix_spawnattr_setpgroup(&how.attributes, 0);
    ::posix_spawnattr_setflags(&how.attributes, static_cast<short>(POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGDEF));
    std::vector<std::string> copies{words};
    std::vector<char*> arguments;
    arguments.reserve(copies.size() + 1);
    for (auto& each : copies) {
        arguments.push_back(each.data());
    }
    arguments.push_back(nullptr);
    const int failed =
        ::posix_spawnp(&id_, arguments.front(), &how.actions, &how.attributes, arguments.data(), ::environ);
    if (failed != 0) {
        id_ = 0;
        throw_start_error(failed);
    }
    open_descriptor handle{static_cast<int>(::syscall(SYS_pidfd_open, id_, 0))};
    if (handle.get() < 0) {
        const int code = errno;
        kill();
        ::waitpid(std::exchange(id_, 0), nullptr, 0);
        throw_start_error(code);
    }
    ended_.assign(handle.release());
    input_.assign(in.into.release());
    output_.assign(out.from.release());
}

void child_process::write_input() {
    asio::async_write(input_, asio::buffer(text_), [self = shared_from_this()](boost::system::error_code, std::size_t) {
        boost::system::error_code ignored; // it may have ended without reading
        self->input_.close(ignored);
    });
}

void child_process::read_output() {
    output_.async_read_some(asio::buffer(chunk_),
                            [self = shared_from_this()](boost::system::error_code code, std::size_t size) {
                                const auto room = most_printed - self->result_.printed.size();
                                self->result_.printed.append(self->chunk_.data(), std::min(size, room));
                                if (size > room) {
                                    self->result_.is_cut = true;
                                    self->kill();
                                }
                                if (!code) {
                                    self->read_output();
                                } else {
                                    self->output_ends_ = true;
                                    self->complete_if_done();
                                }
                            });
}

void child_process::wait_for_end() {
    ended_.async_wait(asio::posix::descriptor_base::wait_read,
                      [self = shared_from_this()](boost::system::error_code code) {
                          if (!code) {
                              self->on_end();
                          }
                      });
}

void child_process::on_end() {
    kill(); // what it has started and left behind
    ::waitpid(std::exchange(id_, 0), &result_.status, 0);
    has_ended_ = true;
    boost::system::error_code ignored;
    ended_.close(ignored);
    input_.cancel(ignored);
    patience_.expires_after(time_to_drain);
    patience_.async_wait([self = shared_from_this()](boost::system::error_code code) {
        if (!code) {
            // Cancelling would not end the reading if a process that has left the group goes on writing.
            boost::system::error_code failed;
            self->output_.close(failed);
        }
    });
    complete_if_done();
}

void child_process::complete_if_done() {
    if (has_ended_ && output_ends_) {
        patience_.cancel();
        if (const auto done = std::exchange(done_, nullptr)) {
            done(result_);
        }
    }
}

void child_process::stop() {
    if (id_ == 0) {
        return;
    }
    ::kill(-id_, SIGTERM);
    patience_.expires_after(time_to_stop);
    patience_.async_wait([self = shared_from_this()](boost::system::error_code code) {
        if (!code) {
            self->kill();
        }
    });
}

void child_process::kill() noexcept {
    if (id_ != 0) {
        ::kill(-id_, SIGKILL);
    }
}

} // namespace tool
