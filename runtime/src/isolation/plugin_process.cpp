// SPDX-License-Identifier: BSL-1.0
#include "isolation/plugin_process.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <system_error>

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

namespace cles::runtime {

using namespace std::chrono_literals;

namespace {

[[noreturn]] void throw_process_error(const char* what, int code = errno) {
    throw std::system_error(code, std::generic_category(), what);
}

// Above the numbers that the child uses, so that moving one end there does not replace another.
owned_descriptor moved_up(owned_descriptor from, int least) {
    const int moved = ::fcntl(from.get(), F_DUPFD_CLOEXEC, least);
    if (moved < 0) {
        throw_process_error("cannot start the process of a plugin");
    }
    return owned_descriptor{moved};
}

bool is_passed(std::string_view variable) {
    constexpr std::array<std::string_view, 6> names{"HOME", "LANG", "LANGUAGE", "PATH", "TMPDIR", "TZ"};
    return std::ranges::find(names, variable) != names.end() || variable.starts_with("LC_") ||
           variable.starts_with("LD_") || variable.starts_with("MALLOC_") ||
           variable.ends_with("SAN_OPTIONS"); // of sanitizers
}

// The variables of the daemon that the process gets: those of the system and its libraries. The others may contain
// secrets. Ends with a null pointer.
std::vector<char*> plugin_environment() {
    std::vector<char*> passed;
    for (auto** each = environ; *each != nullptr; ++each) {
        const std::string_view variable{*each};
        if (is_passed(variable.substr(0, variable.find('=')))) {
            passed.push_back(*each);
        }
    }
    passed.push_back(nullptr);
    return passed;
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

std::string text_of_signal(int number) {
    const char* name = ::sigabbrev_np(number);
    return "signal " + std::to_string(number) + (name == nullptr ? "" : " (SIG" + std::string{name} + ")");
}

plugin_process::plugin_process(std::string plugin, std::size_t lane_count) {
    const int least = control_descriptor + 1 + static_cast<int>(lane_count);
    auto output_ends = make_pipe();
    output_ends.into = moved_up(std::move(output_ends.into), least);
    std::vector<owned_descriptor> theirs;
    const auto connect = [&] {
        std::array<int, 2> pair{};
        if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair.data()) != 0) {
            throw_process_error("cannot connect the process of a plugin");
        }
        owned_descriptor own{pair[0]};
        theirs.push_back(moved_up(owned_descriptor{pair[1]}, least));
        return own;
    };
    control = connect();
    for (std::size_t i = 0; i < lane_count; ++i) {
        lanes.push_back(connect());
    }
    output = std::move(output_ends.from);

    spawn_settings how;
    ::posix_spawn_file_actions_addopen(&how.actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    ::posix_spawn_file_actions_adddup2(&how.actions, output_ends.into.get(), STDOUT_FILENO);
    ::posix_spawn_file_actions_adddup2(&how.actions, output_ends.into.get(), STDERR_FILENO);
    for (std::size_t i = 0; i < theirs.size(); ++i) {
        ::posix_spawn_file_actions_adddup2(&how.actions, theirs[i].get(), control_descriptor + static_cast<int>(i));
    }
    // It ignores these, because a service manager may send them to all processes of the daemon, which ends it in order.
    // Until it does so, they wait.
    sigset_t waiting;
    ::sigemptyset(&waiting);
    for (const int number : {SIGTERM, SIGINT, SIGHUP}) {
        ::sigaddset(&waiting, number);
    }
    ::posix_spawnattr_setsigmask(&how.attributes, &waiting);
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
    std::array<char*, 6> arguments{name.data(), mode.data(), parent.data(), count.data(), plugin.data(), nullptr};
    const int failed = ::posix_spawn(&id_, "/proc/self/exe", &how.actions, &how.attributes, arguments.data(),
                                     plugin_environment().data());
    if (failed != 0) {
        throw_process_error("cannot start the process of a plugin", failed);
    }
    handle_ = owned_descriptor{static_cast<int>(::syscall(SYS_pidfd_open, id_, 0))};
    if (handle_.get() < 0) {
        const int code = errno;
        ::kill(id_, SIGKILL);
        ::waitpid(id_, nullptr, 0);
        throw_process_error("cannot watch the process of a plugin", code);
    }
}

plugin_process::~plugin_process() {
    kill("the daemon needs it no more");
    end();
}

void plugin_process::kill(std::string_view why) {
    const std::scoped_lock lock{mutex_};
    if (end_) {
        return; // its number may be that of another process
    }
    if (killed_because_.empty()) {
        killed_because_ = why;
    }
    ::kill(-id_, SIGKILL);
    ::kill(id_, SIGKILL);
}

bool plugin_process::ends_within(std::chrono::milliseconds limit) const {
    pollfd ended{.fd = handle_.get(), .events = POLLIN, .revents = 0};
    return ::poll(&ended, 1, static_cast<int>(limit.count())) > 0;
}

process_end plugin_process::end() {
    {
        const std::scoped_lock lock{mutex_};
        if (end_) {
            return *end_;
        }
    }
    // Its connections are closed a moment before it ends. The kernel may delay the end, even if it is killed.
    if (!ends_within(100ms)) {
        kill("it closed a connection");
        static_cast<void>(ends_within(1s));
    }
    const std::scoped_lock lock{mutex_};
    if (end_) {
        return *end_;
    }
    int status = 0;
    if (::waitpid(id_, &status, WNOHANG) != id_) {
        end_ = {"does not end although it was killed because", killed_because_};
    } else if (WIFEXITED(status)) {
        end_ = {"ended itself with", "exit code " + std::to_string(WEXITSTATUS(status))};
    } else if (WTERMSIG(status) == SIGKILL && !killed_because_.empty()) {
        end_ = {"was ended because", killed_because_};
    } else {
        end_ = {"was ended by", text_of_signal(WTERMSIG(status))};
    }
    return *end_;
}

} // namespace cles::runtime
