// SPDX-License-Identifier: BSL-1.0
#include "doctor/checks.hpp"

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace tool {

using namespace std::chrono_literals;
using steady = std::chrono::steady_clock;

namespace {

constexpr auto check_limit = 60s; // each plugin may take ten seconds
constexpr std::size_t max_output = 64 * 1024;

[[noreturn]] void throw_system_error(int code) { throw std::system_error{code, std::generic_category()}; }

/// Both ends of a pipe.
class pipe_ends {
  public:
    pipe_ends() {
        if (::pipe2(ends_.data(), O_CLOEXEC) != 0) {
            throw_system_error(errno);
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

std::vector<char*> pointers_to(const std::vector<std::string>& texts) {
    std::vector<char*> out;
    out.reserve(texts.size() + 1);
    for (const auto& each : texts) {
        out.push_back(const_cast<char*>(each.c_str())); // posix_spawn does not change them
    }
    out.push_back(nullptr);
    return out;
}

// The environment of this program, without a variable.
std::vector<std::string> environment_without(std::string_view variable) {
    std::vector<std::string> out;
    for (char** each = environ; *each != nullptr; ++each) {
        const std::string_view entry{*each};
        if (variable.empty() || entry.substr(0, entry.find('=')) != variable) {
            out.emplace_back(entry);
        }
    }
    return out;
}

pid_t spawn(const std::vector<std::string>& arguments, const std::vector<std::string>& environment, int output) {
    auto argv = pointers_to(arguments);
    auto variables = pointers_to(environment);
    posix_spawn_file_actions_t files{};
    ::posix_spawn_file_actions_init(&files);
    ::posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    ::posix_spawn_file_actions_adddup2(&files, output, STDOUT_FILENO);
    ::posix_spawn_file_actions_adddup2(&files, output, STDERR_FILENO);
    pid_t child = 0;
    const int code = ::posix_spawn(&child, argv.front(), &files, nullptr, argv.data(), variables.data());
    ::posix_spawn_file_actions_destroy(&files);
    if (code != 0) {
        throw_system_error(code);
    }
    return child;
}

// Whether it ended in time.
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
        if (text.size() < max_output) {
            text.append(part.data(), static_cast<std::size_t>(size));
        }
    }
}

/// How a program ended.
struct program_result {
    int code = -1;                    ///< -1: a signal or the time limit ended it
    std::vector<std::string> lines{}; ///< of its stdout and stderr together
};

// Runs a program, the first of the arguments; it is killed at the time limit.
// Throws std::system_error if it cannot be started.
program_result run_program(const std::vector<std::string>& arguments, const std::vector<std::string>& environment,
                           std::chrono::milliseconds limit) {
    pipe_ends output;
    const auto child = spawn(arguments, environment, output.writer());
    output.close_writer();
    std::string text;
    if (!read_all(output.reader(), steady::now() + limit, text)) {
        ::kill(child, SIGKILL);
    }
    int status = 0;
    pid_t ended = -1;
    do {
        ended = ::waitpid(child, &status, 0);
    } while (ended == -1 && errno == EINTR);
    program_result result;
    result.code = ended == child && WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    std::istringstream from{text};
    for (std::string line; std::getline(from, line);) {
        result.lines.push_back(line);
    }
    return result;
}

// By a node that was started by hand, for example: who it is, is told for the ports.
bool finds_address_in_use(const program_result& check) {
    return check.code == 1 && !check.lines.empty() &&
           check.lines.back().ends_with(std::generic_category().message(EADDRINUSE));
}

bool is_executable(const std::filesystem::path& program) {
    std::error_code code;
    return std::filesystem::is_regular_file(program, code) && ::access(program.c_str(), X_OK) == 0;
}

// In the PATH, or else in the folder of this program; empty if it is in neither.
std::string find_program(const std::string& name) {
    const char* path = std::getenv("PATH");
    std::istringstream folders{path == nullptr ? "" : path};
    std::string folder;
    while (std::getline(folders, folder, ':')) {
        if (const auto program = std::filesystem::path{folder} / name; !folder.empty() && is_executable(program)) {
            return program.string();
        }
    }
    std::error_code code;
    const auto beside = std::filesystem::read_symlink("/proc/self/exe", code).parent_path() / name;
    return !code && is_executable(beside) ? beside.string() : "";
}

} // namespace

// clesd looks for the file where it would look when started, and knows what is valid.
void check_configuration(findings& found) {
    const auto program = find_program("clesd");
    if (program.empty()) {
        found.ok("config", "clesd is not installed, so there is no configuration to check");
        return;
    }
    try {
        auto check = run_program({program, "--check"}, environment_without(""), check_limit);
        // The variable is also that of the commands, for which it needs no permission.
        const char* group = std::getenv("CLES_MULTICAST");
        std::string advice;
        if (check.code > 0 && group != nullptr && *group != '\0' && !check.lines.empty() &&
            !finds_address_in_use(check)) {
            auto without = run_program({program, "--check"}, environment_without("CLES_MULTICAST"), check_limit);
            if (without.code == 0 || finds_address_in_use(without)) {
                advice = "with CLES_MULTICAST=" + std::string{group} +
                         " in its environment, it does not start: " + check.lines.front();
                check = std::move(without);
            }
        }
        const bool in_use = finds_address_in_use(check);
        auto& [code, lines] = check;
        // The lines before the last one are about what the daemon starts without.
        while ((code == 0 || in_use) && lines.size() > 1) {
            found.warning("config", lines.front(), "correct it, or remove it from the configuration");
            lines.erase(lines.begin());
        }
        const auto text = lines.empty() ? std::string{} : lines.front();
        if (code == 0) {
            found.ok("config", "clesd: " + text, advice);
        } else if (in_use) {
            found.ok("config", text, advice);
        } else if (code == -1) {
            found.failure("config", "clesd --check did not end by itself", "run " + program);
        } else {
            found.failure("config", text.empty() ? "clesd rejects its configuration" : text,
                          "correct it, and run clesd --check; docs/runtime.md describes the configuration");
        }
    } catch (const std::system_error& e) {
        found.failure("config", "cannot run " + program + ": " + e.code().message(),
                      "reinstall it, or remove it from the PATH");
    }
}

} // namespace tool
