// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_trial.hpp"

#include <cles/plugin_text.hpp>

#include "config/config.hpp"
#include "plugins/loaded_plugin.hpp"
#include "plugins/plugin_library.hpp"
#include "plugins/plugin_search.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <exception>
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
namespace {

// How the child ends. No usual numbers: a library that ends the process may choose any, 0 too.
constexpr int usable = 123;
constexpr int refused = 124;
constexpr std::size_t most_words = 2000; // the last ones, which tell why it ended
constexpr std::size_t roomy_pipe = 256 * 1024;
// The system keeps a report in one piece, and takes it though nobody reads yet.
constexpr std::size_t longest_report = 2000;

// What the child is at, which it writes when it begins with it; then, where the plugin is refused, a line with the key
// of the setting that is to blame, and why.
constexpr char loading = 'l';
constexpr char describing = 'd';
constexpr char checking = 'c';
constexpr char blames_setting = 's';
constexpr char blames_plugin = 'p';
constexpr std::string_view verdicts{"sp"};

std::string_view words_for(char step) {
    switch (step) {
    case describing: return "its entry point";
    case checking: return "its check of its settings";
    default: return "what it runs when it is loaded";
    }
}

class descriptor {
  public:
    explicit descriptor(int fd) noexcept : fd_(fd) {}
    descriptor(const descriptor&) = delete;
    descriptor& operator=(const descriptor&) = delete;
    ~descriptor() { close(); }
    [[nodiscard]] int get() const noexcept { return fd_; }
    void close() noexcept {
        if (fd_ >= 0) {
            ::close(std::exchange(fd_, -1));
        }
    }

  private:
    int fd_;
};

void write_all(int to, std::string_view text) {
    [[maybe_unused]] const auto written = ::write(to, text.data(), std::min(text.size(), longest_report));
}

// As in a process that begins: nothing of what the parent does about signals, and no memory image where it crashes.
void become_a_child(int words) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL); // it may hang for ever, and who gives it up may be killed
    for (const int number : {SIGABRT, SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGTERM, SIGINT, SIGHUP, SIGPIPE, SIGCHLD}) {
        ::signal(number, SIG_DFL);
    }
    sigset_t none;
    ::sigemptyset(&none);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    const rlimit no_core{};
    ::setrlimit(RLIMIT_CORE, &no_core);
    ::dup2(words, STDOUT_FILENO);
    ::dup2(words, STDERR_FILENO);
}

// In the child. Ends it without what a program does at its end, which is the parent's business.
[[noreturn]] void try_and_end(const std::filesystem::path& file, const std::string& node, const std::string& config,
                              int words, int report) {
    become_a_child(words);
    char step = loading;
    const auto at = [&](char next) {
        step = next;
        write_all(report, {&step, 1});
    };
    try {
        at(loading);
        // Never unloaded, as in the daemon: what it runs then is of no interest.
        const auto* library = new boost::dll::shared_library{open_library("", file)};
        at(describing);
        const auto& described = describe_plugin("", *library);
        at(checking);
        plugin_jobs jobs;
        stop_notifier notifier;
        loaded_plugin plugin{detail::known_part(&described), node, jobs, notifier, {}};
        if (const auto why = plugin.check(config)) {
            throw plugin_error("", why->why, why->setting);
        }
        ::_exit(usable);
    } catch (const plugin_error& wrong) {
        const std::string why{std::string_view{wrong.what()}.substr(2)}; // after the path, which is the parent's
        write_all(report,
                  (wrong.setting() ? blames_setting + *wrong.setting() : std::string{blames_plugin}) + "\n" + why);
    } catch (const std::exception& failed) {
        const std::string what{words_for(step)};
        write_all(report, blames_plugin + ("\n" + what) + " threw: " + failed.what());
    }
    ::_exit(refused);
}

// Leaves the end of a text, no longer than `most_words`, from the beginning of a character.
void keep_last_words(std::string& words) {
    if (words.size() <= most_words) {
        return;
    }
    auto begin = words.size() - most_words;
    while (begin < words.size() && (static_cast<unsigned char>(words[begin]) & 0xC0U) == 0x80U) {
        ++begin;
    }
    words.erase(0, begin);
}

// Takes what there is to read, but no more than a pipe holds: the child may write faster. False at the end of the
// stream.
bool read_ready(int from, std::string& words) {
    std::array<char, 4096> some{};
    for (std::size_t taken = 0; taken < roomy_pipe; taken += some.size()) {
        const auto size = ::read(from, some.data(), some.size());
        if (size == 0) {
            return false;
        }
        if (size < 0) {
            return errno == EAGAIN || errno == EINTR;
        }
        words.append(some.data(), static_cast<std::size_t>(size));
        keep_last_words(words);
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

// Reads what the child writes until it has ended, or the time is up. True: it has ended. The end of the stream says
// nothing about the child: it may close its output and go on, and a process that it started may keep the output open.
bool read_words(int from, int process, std::string& words, std::chrono::steady_clock::time_point end) {
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
            readable.fd = read_ready(from, words) ? from : -1;
        }
        const bool over = left.count() <= 0 && ended.revents == 0;
        if (ready <= 0 || ended.revents != 0 || over) {
            read_ready(from, words);
            return ready > 0 && ended.revents != 0;
        }
    }
}

// On one line, as it stands in a log.
std::string on_one_line(std::string text) {
    while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) {
        text.pop_back();
    }
    std::replace_if(
        text.begin(), text.end(), [](char c) { return c >= 0 && c < ' '; }, ' ');
    return text;
}

std::string with_words(std::string text, const std::string& words) {
    return words.empty() ? text : text + ": " + words;
}

// Waits for the child, and ends it when the time is up, which is then told by `false`.
bool wait_for_end(pid_t child, int from, std::string& words, std::chrono::steady_clock::time_point end, int& status) {
    bool ended = false;
    try {
        const descriptor process{open_process(child)};
        ended = read_words(from, process.get(), words, end);
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
            throw std::system_error(errno, std::generic_category(), "cannot learn how a process ended");
        }
    }
    return ended;
}

// What is there, now that the child has ended.
std::string read_report(int from) {
    std::array<char, 2 * longest_report> all{};
    const auto size = ::read(from, all.data(), all.size());
    return {all.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0))};
}

[[noreturn]] void refuse(const std::string& path, std::string_view report) {
    const auto begin = report.find_first_of(verdicts);
    const auto end = report.find('\n');
    if (begin == std::string_view::npos || end == std::string_view::npos || end < begin) {
        throw plugin_error(path, "its trial failed without a word");
    }
    const auto why = on_one_line(std::string{report.substr(end + 1)});
    if (report[begin] == blames_setting) {
        throw plugin_error(path, why, on_one_line(std::string{report.substr(begin + 1, end - begin - 1)}));
    }
    throw plugin_error(path, why);
}

std::array<int, 2> make_pipe() {
    std::array<int, 2> ends{};
    // Only the reader's end does not block: what the child writes while nobody reads must not be lost.
    if (::pipe2(ends.data(), O_CLOEXEC) != 0 || ::fcntl(ends[0], F_SETFL, O_NONBLOCK) != 0) {
        throw std::system_error(errno, std::generic_category(), "cannot make a pipe");
    }
    return ends;
}

} // namespace

void try_plugin(const std::string& path, const std::filesystem::path& file, const std::string& node,
                const std::string& config, std::chrono::milliseconds limit) {
    const auto end = std::chrono::steady_clock::now() + limit;
    const auto words_ends = make_pipe();
    descriptor from{words_ends[0]};
    descriptor into{words_ends[1]};
    const auto report_ends = make_pipe();
    const descriptor report_from{report_ends[0]};
    descriptor report_into{report_ends[1]};
    const auto child = ::fork();
    if (child < 0) {
        throw std::system_error(errno, std::generic_category(), "cannot start a process");
    }
    if (child == 0) {
        try_and_end(file, node, config, into.get(), report_into.get());
    }
    into.close();
    report_into.close();
    std::string words;
    int status = 0;
    const bool ended = wait_for_end(child, from.get(), words, end, status);
    words = on_one_line(std::move(words));
    const auto report = read_report(report_from.get());
    const auto steps = report.substr(0, report.find_first_of(verdicts));
    const std::string what{words_for(steps.empty() ? loading : steps.back())};
    if (!ended) {
        throw plugin_error(path, with_words(what + " does not end", words));
    }
    if (WIFSIGNALED(status)) {
        throw plugin_error(path,
                           with_words(what + " ends the process by signal " + std::to_string(WTERMSIG(status)), words));
    }
    if (WEXITSTATUS(status) == refused) {
        refuse(path, report);
    }
    if (WEXITSTATUS(status) != usable) {
        throw plugin_error(path, with_words(what + " ends the process", words));
    }
}

namespace {

// How long a plugin may take to be loaded and to look at its settings.
constexpr std::chrono::seconds trial_limit{10};

} // namespace

std::string complaint_about(const config& setup, std::size_t plugin, const plugin_error& why) {
    const auto of = "plugins[" + std::to_string(plugin) + "]";
    const auto& setting = why.setting();
    const auto key = !setting ? of + ".path" : setting->empty() ? of + ".config" : of + ".config." + *setting;
    return setup.place_of(key) + ": " + why.what();
}

void try_plugins(config& setup) {
    for (std::size_t i = 0; i < setup.plugins.size(); ++i) {
        auto& wanted = setup.plugins[i];
        try {
            const auto path = plugin_file(setup, wanted);
            try_plugin(path, find_plugin(path, plugin_folders(setup)), setup.node, wanted.config, trial_limit);
        } catch (const plugin_error& wrong) {
            wanted.unusable = complaint_about(setup, i, wrong);
            if (wanted.required) {
                throw config_error(wanted.unusable);
            }
        }
    }
}

} // namespace cles::runtime
