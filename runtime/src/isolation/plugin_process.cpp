// SPDX-License-Identifier: BSL-1.0
#include "isolation/plugin_process.hpp"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <system_error>

#include <fcntl.h>
#include <sched.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>

namespace cles::runtime {
namespace {

[[noreturn]] void throw_process_error(const char* what, int code = errno) {
    throw std::system_error(code, std::generic_category(), what);
}

struct connection_ends {
    owned_descriptor own;
    owned_descriptor other;
};

// Above the numbers that the child uses, so that moving one end there does not replace another.
owned_descriptor moved_up(owned_descriptor from, int least) {
    const int moved = ::fcntl(from.get(), F_DUPFD_CLOEXEC, least);
    if (moved < 0) {
        throw_process_error("cannot start the process of a plugin");
    }
    return owned_descriptor{moved};
}

connection_ends connected_sockets(int least) {
    std::array<int, 2> pair{};
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair.data()) != 0) {
        throw_process_error("cannot connect the process of a plugin");
    }
    owned_descriptor own{pair[0]};
    return {std::move(own), moved_up(owned_descriptor{pair[1]}, least)};
}

connection_ends output_pipe(int least) {
    std::array<int, 2> pair{};
    if (::pipe2(pair.data(), O_CLOEXEC) != 0) {
        throw_process_error("cannot connect the process of a plugin");
    }
    owned_descriptor own{pair[0]};
    owned_descriptor other{pair[1]};
    ::fcntl(own.get(), F_SETFL, O_NONBLOCK);
    return {std::move(own), moved_up(std::move(other), least)};
}

class spawn_settings {
  public:
    spawn_settings() {
        ::posix_spawn_file_actions_init(&actions);
        ::posix_spawnattr_init(&attributes);
    }
    spawn_settings(const spawn_settings&) = delete;
    spawn_settings& operator=(const spawn_settings&) = delete;
    ~spawn_settings() {
        ::posix_spawnattr_destroy(&attributes);
        ::posix_spawn_file_actions_destroy(&actions);
    }

    posix_spawn_file_actions_t actions{};
    posix_spawnattr_t attributes{};
};

} // namespace

plugin_process::plugin_process(const std::string& program, std::size_t lane_count) {
    const int least = control_descriptor + 1 + static_cast<int>(lane_count);
    auto output_ends = output_pipe(least);
    std::vector<owned_descriptor> theirs;
    const auto connect = [&] {
        auto both = connected_sockets(least);
        theirs.push_back(std::move(both.other));
        return std::move(both.own);
    };
    control = connect();
    for (std::size_t i = 0; i < lane_count; ++i) {
        lanes.push_back(connect());
    }
    output = std::move(output_ends.own);

    spawn_settings how;
    ::posix_spawn_file_actions_addopen(&how.actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    ::posix_spawn_file_actions_adddup2(&how.actions, output_ends.other.get(), STDOUT_FILENO);
    ::posix_spawn_file_actions_adddup2(&how.actions, output_ends.other.get(), STDERR_FILENO);
    for (std::size_t i = 0; i < theirs.size(); ++i) {
        ::posix_spawn_file_actions_adddup2(&how.actions, theirs[i].get(), control_descriptor + static_cast<int>(i));
    }
    sigset_t none;
    ::sigemptyset(&none);
    ::posix_spawnattr_setsigmask(&how.attributes, &none);
    // A session of its own: signals of a terminal are for the daemon, which ends the process in order.
    auto flags = POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSID;
    if (const auto policy = ::sched_getscheduler(0); policy == SCHED_FIFO || policy == SCHED_RR) {
        // The daemon may run in real time (`real_time`), but a plugin must not.
        const sched_param normal{};
        ::posix_spawnattr_setschedpolicy(&how.attributes, SCHED_OTHER);
        ::posix_spawnattr_setschedparam(&how.attributes, &normal);
        flags |= POSIX_SPAWN_SETSCHEDULER;
    }
    ::posix_spawnattr_setflags(&how.attributes, static_cast<short>(flags));
    std::string name{"clesd"};
    std::string mode{plugin_process_mode};
    auto parent = std::to_string(::getpid());
    auto count = std::to_string(lane_count);
    std::array<char*, 5> arguments{name.data(), mode.data(), parent.data(), count.data(), nullptr};
    const int failed = ::posix_spawn(&id_, program.c_str(), &how.actions, &how.attributes, arguments.data(), environ);
    if (failed != 0) {
        throw_process_error("cannot start the process of a plugin", failed);
    }
    handle_ = owned_descriptor{static_cast<int>(::syscall(SYS_pidfd_open, id_, 0))};
    if (handle_.get() < 0) {
        const int code = errno;
        end();
        throw_process_error("cannot watch the process of a plugin", code);
    }
}

plugin_process::~plugin_process() {
    if (id_ > 0) {
        end();
    }
}

void plugin_process::kill() noexcept {
    const std::scoped_lock lock{mutex_};
    if (how_.empty()) { // otherwise its number may be that of another process
        ::kill(-id_, SIGKILL);
        ::kill(id_, SIGKILL);
    }
}

std::string plugin_process::end() noexcept {
    kill();
    const std::scoped_lock lock{mutex_};
    if (!how_.empty()) {
        return how_;
    }
    int status = 0;
    while (::waitpid(id_, &status, 0) < 0 && errno == EINTR) {
    }
    if (WIFSIGNALED(status)) {
        const int number = WTERMSIG(status);
        const char* name = ::sigabbrev_np(number);
        how_ = "was ended by signal " + std::to_string(number) +
               (name == nullptr ? "" : " (SIG" + std::string{name} + ")");
    } else {
        how_ = "ended itself with exit code " + std::to_string(WEXITSTATUS(status));
    }
    return how_;
}

} // namespace cles::runtime
