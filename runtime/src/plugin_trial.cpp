// SPDX-License-Identifier: BSL-1.0
#include "plugin_trial.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <string_view>
#include <system_error>
#include <utility>

#include <dlfcn.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

namespace cles::runtime {
namespace {

// How the child ends. No usual numbers: a library that ends the process may choose any, 0 too.
constexpr int loaded = 123;
constexpr int cannot_load = 124;
constexpr std::size_t most_words = 2000;

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

// In the child. Ends it without what a program does at its end, which is the parent's business.
[[noreturn]] void load_and_end(const char* file, int words) {
    ::dup2(words, STDOUT_FILENO);
    ::dup2(words, STDERR_FILENO);
    ::signal(SIGABRT, SIG_DFL);
    if (::dlopen(file, RTLD_NOW | RTLD_LOCAL) == nullptr) {
        const char* why = ::dlerror();
        [[maybe_unused]] const auto told = why == nullptr ? 0 : ::write(words, why, std::strlen(why));
        ::_exit(cannot_load);
    }
    ::_exit(loaded);
}

// What the child writes until it ends or the time is up. True: it ended.
bool read_words(int from, std::string& words, std::chrono::steady_clock::time_point end) {
    for (;;) {
        const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
        pollfd readable{.fd = from, .events = POLLIN, .revents = 0};
        const auto ready = ::poll(&readable, 1, static_cast<int>(std::max<long>(left.count(), 0)));
        if (ready < 0 && errno == EINTR) {
            continue;
        }
        if (ready <= 0) {
            return false;
        }
        std::array<char, 512> some{};
        const auto size = ::read(from, some.data(), some.size());
        if (size <= 0) {
            return true;
        }
        words.append(some.data(), static_cast<std::size_t>(size));
        words.resize(std::min(words.size(), most_words));
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

} // namespace

std::string try_library(const std::filesystem::path& file, std::chrono::milliseconds limit) {
    const auto end = std::chrono::steady_clock::now() + limit;
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
        throw std::system_error(errno, std::generic_category(), "cannot make a pipe");
    }
    descriptor from{ends[0]};
    descriptor into{ends[1]};
    const auto child = ::fork();
    if (child < 0) {
        throw std::system_error(errno, std::generic_category(), "cannot start a process");
    }
    if (child == 0) {
        load_and_end(file.c_str(), into.get());
    }
    into.close();
    std::string words;
    const bool ended = read_words(from.get(), words, end);
    if (!ended) {
        ::kill(child, SIGKILL);
    }
    int status = 0;
    while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    words = on_one_line(std::move(words));
    if (!ended) {
        return "what it runs when it is loaded does not end" + (words.empty() ? "" : ": " + words);
    }
    if (WIFSIGNALED(status)) {
        return "what it runs when it is loaded ends the process by signal " + std::to_string(WTERMSIG(status)) +
               (words.empty() ? "" : ": " + words);
    }
    if (WEXITSTATUS(status) == cannot_load) {
        return "it cannot be loaded: " + (words.empty() ? "the system does not say why" : words);
    }
    if (WEXITSTATUS(status) != loaded) {
        return "what it runs when it is loaded ends the process" + (words.empty() ? "" : ": " + words);
    }
    return {};
}

} // namespace cles::runtime
