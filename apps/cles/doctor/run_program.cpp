// SPDX-License-Identifier: BSL-1.0
#include "doctor/run_program.hpp"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <system_error>

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace tool {

using namespace std::chrono_literals;
using steady = std::chrono::steady_clock;

namespace {

constexpr std::size_t most_text = 64 * 1024;

[[noreturn]] void fail(int code) { throw std::system_error{code, std::generic_category()}; }

/// Both ends of a pipe.
class pipe_ends {
  public:
    pipe_ends() {
        if (::pipe2(ends_.data(), O_CLOEXEC) != 0) {
            fail(errno);
        }
    }
    pipe_ends(const pipe_ends&) = delete;
    pipe_ends& operator=(const pipe_ends&) = delete;
    ~pipe_ends() {
        close_writer();
        ::close(ends_[0]);
    }

    [[nodiscard]] int reader() const noexcept { return ends_[0]; }
    [[nodiscard]] int writer() const noexcept { return ends_[1]; }
    void close_writer() noexcept {
        if (ends_[1] != -1) {
            ::close(ends_[1]);
            ends_[1] = -1;
        }
    }

  private:
    std::array<int, 2> ends_{-1, -1};
};

pid_t spawn(const std::vector<std::string>& arguments, int output) {
    std::vector<char*> words;
    words.reserve(arguments.size() + 1);
    for (const auto& each : arguments) {
        words.push_back(const_cast<char*>(each.c_str())); // which posix_spawn leaves as they are
    }
    words.push_back(nullptr);
    posix_spawn_file_actions_t files{};
    ::posix_spawn_file_actions_init(&files);
    ::posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    ::posix_spawn_file_actions_adddup2(&files, output, STDOUT_FILENO);
    ::posix_spawn_file_actions_adddup2(&files, output, STDERR_FILENO);
    pid_t child = 0;
    const int code = ::posix_spawn(&child, words.front(), &files, nullptr, words.data(), environ);
    ::posix_spawn_file_actions_destroy(&files);
    if (code != 0) {
        fail(code);
    }
    return child;
}

// Whether it ended by itself.
bool read_all(int from, steady::time_point until, std::string& text) {
    std::array<char, 4096> part{};
    for (;;) {
        const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - steady::now());
        pollfd ready{from, POLLIN, 0};
        if (left <= 0ms || ::poll(&ready, 1, static_cast<int>(left.count())) != 1) {
            return false;
        }
        const auto size = ::read(from, part.data(), part.size());
        if (size <= 0) {
            return true;
        }
        if (text.size() < most_text) {
            text.append(part.data(), static_cast<std::size_t>(size));
        }
    }
}

bool can_be_run(const std::filesystem::path& program) {
    std::error_code code;
    return std::filesystem::is_regular_file(program, code) && ::access(program.c_str(), X_OK) == 0;
}

} // namespace

program_end run_program(const std::vector<std::string>& arguments, std::chrono::milliseconds limit) {
    pipe_ends output;
    const auto child = spawn(arguments, output.writer());
    output.close_writer();
    program_end end;
    if (!read_all(output.reader(), steady::now() + limit, end.text)) {
        ::kill(child, SIGKILL);
    }
    int status = 0;
    pid_t ended = -1;
    do {
        ended = ::waitpid(child, &status, 0);
    } while (ended == -1 && errno == EINTR);
    end.code = ended == child && WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    return end;
}

std::string find_program(const std::string& name) {
    const char* path = std::getenv("PATH");
    std::istringstream folders{path == nullptr ? "" : path};
    std::string folder;
    while (std::getline(folders, folder, ':')) {
        if (const auto program = std::filesystem::path{folder} / name; !folder.empty() && can_be_run(program)) {
            return program.string();
        }
    }
    std::error_code code;
    const auto beside = std::filesystem::read_symlink("/proc/self/exe", code).parent_path() / name;
    return !code && can_be_run(beside) ? beside.string() : "";
}

} // namespace tool
