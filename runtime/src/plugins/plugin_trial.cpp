// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_trial.hpp"

#include <cles/plugin_text.hpp>

#include "config/config.hpp"
#include "isolation/confinement.hpp"
#include "isolation/descriptor.hpp"
#include "isolation/plugin_process.hpp"
#include "plugins/loaded_plugin.hpp"
#include "plugins/plugin_library.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <exception>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

namespace cles::runtime {

using namespace std::string_literals;

namespace {

// The child's exit codes. Unusual numbers, because a library that ends the process may use any, including 0.
constexpr int usable = 123;
constexpr int refused = 124;
constexpr std::chrono::seconds trial_limit{10}; // for loading a plugin and its settings check
constexpr std::size_t max_output = 2000;        // its last bytes, which say why it ended
constexpr std::size_t max_read = 256 * 1024;
// Small enough for the pipe to take a report at once, before it is read.
constexpr std::size_t max_report = 2000;

// The report of the child: a line for each step that has begun; then, if the plugin is refused, a null character, a
// line with the key that is to blame, and the reason.
constexpr auto loading = "its initialization";
constexpr auto describing = "its entry point";
constexpr auto checking = "its settings check";

void write_all(int to, std::string_view text) {
    [[maybe_unused]] const auto written = ::write(to, text.data(), std::min(text.size(), max_report));
}

// As in a new process: without the parent's signal handling, and without a core dump if it crashes.
void reset_process_state(pid_t parent, int output) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL); // it may hang, and the parent may be killed before it kills the child
    if (::getppid() != parent) {
        ::_exit(refused); // it has been killed already
    }
    for (const int number : {SIGABRT, SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGTERM, SIGINT, SIGHUP, SIGPIPE, SIGCHLD}) {
        ::signal(number, SIG_DFL);
    }
    sigset_t none;
    ::sigemptyset(&none);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    const rlimit no_core{};
    ::setrlimit(RLIMIT_CORE, &no_core);
    ::dup2(output, STDOUT_FILENO);
    ::dup2(output, STDERR_FILENO);
}

// In the child. Ends it without exit handlers, which belong to the parent.
[[noreturn]] void run_child(pid_t parent, const plugin_file& file, const std::string& node, const std::string& config,
                            const std::optional<trial_confinement>& confined, int output, int report) {
    reset_process_state(parent, output);
    std::string step;
    const auto begin_step = [&](const char* next) {
        step = next;
        write_all(report, "\n" + step);
    };
    try {
        begin_step(loading);
        if (confined) {
            confine(confined->limits, confined->threads, file.path(), true);
        }
        // Never unloaded, as in the daemon.
        const auto& library = *new auto{open_library("", file)};
        begin_step(describing);
        const auto& described = describe_plugin("", *library);
        begin_step(checking);
        plugin_jobs jobs;
        stop_notifier notifier;
        loaded_plugin plugin{detail::known_part(&described), node, jobs, notifier, {}};
        if (const auto why = plugin.check(config)) {
            throw plugin_error("", why->why, why->key);
        }
        ::_exit(usable);
    } catch (const plugin_error& e) {
        write_all(report, '\0' + e.key() + "\n" + std::string{e.why()});
    } catch (const std::exception& failed) {
        write_all(report, "\0path\n"s + step + " threw: " + failed.what());
    }
    ::_exit(refused);
}

// Keeps the last `max_output` bytes, from the beginning of a character.
void trim_output(std::string& output) {
    if (output.size() <= max_output) {
        return;
    }
    auto begin = output.size() - max_output;
    while (begin < output.size() && (static_cast<unsigned char>(output[begin]) & 0xC0U) == 0x80U) {
        ++begin;
    }
    output.erase(0, begin);
}

// Reads what is available, but no more than a pipe holds, because the child may write faster. False at the end of the
// stream.
bool read_ready(int from, std::string& output) {
    std::array<char, 4096> some{};
    for (std::size_t taken = 0; taken < max_read; taken += some.size()) {
        const auto size = ::read(from, some.data(), some.size());
        if (size == 0) {
            return false;
        }
        if (size < 0) {
            return errno == EAGAIN || errno == EINTR;
        }
        output.append(some.data(), static_cast<std::size_t>(size));
        trim_output(output);
    }
    return true;
}

int open_process(pid_t process) {
    const auto fd = static_cast<int>(::syscall(SYS_pidfd_open, process, 0));
    if (fd < 0) {
        throw std::system_error(errno, std::generic_category(), "cannot watch a process");
    }
    return fd;
}

// Reads the child's output until the child ends or the time is up. Returns whether it ended. The end of the stream is
// not the end of the child: it may close its output and continue, and a process that it started may keep the output
// open.
bool read_output(int from, int process, std::string& output, std::chrono::steady_clock::time_point end) {
    std::array<pollfd, 2> watched{
        {{.fd = process, .events = POLLIN, .revents = 0}, {.fd = from, .events = POLLIN, .revents = 0}}};
    auto& [ended, readable] = watched;
    for (;;) {
        const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
        const auto ready = ::poll(watched.data(), watched.size(), static_cast<int>(std::max<long>(left.count(), 0)));
        if (ready < 0 && errno == EINTR) {
            continue;
        }
        if (ready > 0 && ended.revents == 0) {
            readable.fd = read_ready(from, output) ? from : -1;
        }
        const bool over = left.count() <= 0 && ended.revents == 0;
        if (ready <= 0 || ended.revents != 0 || over) {
            read_ready(from, output);
            return ready > 0 && ended.revents != 0;
        }
    }
}

// On one line, for a log.
std::string single_line(std::string text) {
    while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) {
        text.pop_back();
    }
    std::replace_if(
        text.begin(), text.end(), [](char c) { return c >= 0 && c < ' '; }, ' ');
    return text;
}

// Waits for the child. When the time is up, kills it and returns false.
bool wait_for_end(pid_t child, int from, std::string& output, std::chrono::steady_clock::time_point end, int& status) {
    bool ended = false;
    try {
        const owned_descriptor process{open_process(child)};
        ended = read_output(from, process.get(), output, end);
    } catch (...) {
        ::kill(child, SIGKILL);
        ::waitpid(child, &status, 0);
        throw;
    }
    if (!ended) {
        ::kill(child, SIGKILL);
    }
    while (::waitpid(child, &status, 0) < 0) {
        if (errno != EINTR) {
            throw std::system_error(errno, std::generic_category(), "cannot wait for a process");
        }
    }
    return ended;
}

// The report is complete when the child has ended.
std::string read_report(int from) {
    std::array<char, 2 * max_report> all{};
    const auto size = ::read(from, all.data(), all.size());
    return {all.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0))};
}

[[noreturn]] void refuse(const std::string& path, std::string_view why) {
    const auto key = why.substr(0, why.find('\n'));
    why.remove_prefix(std::min(key.size() + 1, why.size()));
    if (why.empty()) {
        throw plugin_error(path, "its trial failed without a message");
    }
    throw plugin_error(path, single_line(std::string{why}), single_line(std::string{key}));
}

} // namespace

void try_plugin(const std::string& path, const plugin_file& file, const std::string& node, const std::string& config,
                std::chrono::milliseconds limit, const std::optional<trial_confinement>& confined) {
    const auto end = std::chrono::steady_clock::now() + limit;
    auto output_pipe = make_pipe();
    auto report_pipe = make_pipe();
    const auto parent = ::getpid();
    const auto child = ::fork();
    if (child < 0) {
        throw std::system_error(errno, std::generic_category(), "cannot start a process");
    }
    if (child == 0) {
        run_child(parent, file, node, config, confined, output_pipe.into.get(), report_pipe.into.get());
    }
    output_pipe.into.close();
    report_pipe.into.close();
    std::string output;
    int status = 0;
    const bool ended = wait_for_end(child, output_pipe.from.get(), output, end, status);
    output = single_line(std::move(output));
    const auto report = read_report(report_pipe.from.get());
    const auto steps = report.substr(0, report.find('\0'));
    const auto step = steps.empty() ? loading : steps.substr(steps.rfind('\n') + 1);
    const auto fail = [&](const std::string& how) {
        throw plugin_error(path, step + how + (output.empty() ? "" : ": " + output));
    };
    if (!ended) {
        fail(" does not end");
    }
    if (WIFSIGNALED(status)) {
        fail(" ends the process by " + text_of_signal(WTERMSIG(status)));
    }
    const auto code = WEXITSTATUS(status);
    if (code == refused) {
        refuse(path, std::string_view{report}.substr(std::min(steps.size() + 1, report.size())));
    }
    if (code != usable) {
        fail(" ends the process");
    }
}

std::string plugin_error_message(const config& setup, std::size_t plugin, const plugin_error& why) {
    return setup.location_of("plugins[" + std::to_string(plugin) + "]." + why.key()) + ": " + why.what();
}

void try_plugins(config& setup) {
    const auto rules = plugin_rules_of(setup);
    for (std::size_t i = 0; i < setup.plugins.size(); ++i) {
        auto& wanted = setup.plugins[i];
        try {
            const auto path = resolve_plugin_path(setup, wanted);
            const plugin_file file{path, find_plugin(path, rules.folders), rules, wanted.sha256};
            try_plugin(path, file, setup.node, wanted.config, trial_limit,
                       wanted.isolated ? std::optional{trial_confinement{wanted.limits, setup.lanes()}} : std::nullopt);
        } catch (const plugin_error& e) {
            wanted.trial_error = plugin_error_message(setup, i, e);
            if (wanted.required) {
                throw config_error(wanted.trial_error);
            }
        }
    }
}

} // namespace cles::runtime
