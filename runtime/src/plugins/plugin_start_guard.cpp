// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_start_guard.hpp"

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdlib>
#include <string_view>

#include <sys/time.h>
#include <unistd.h>

namespace cles::runtime {
namespace {

constexpr std::array crashes{SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT, SIGSYS};
constexpr std::array requests{SIGTERM, SIGINT};
constexpr std::size_t alternate_stack = 65536;

// What a handler of signals may read: written before, and left alone while they may come.
struct {
    std::array<char, 4096> who;
    std::size_t size;
    int code;
    volatile sig_atomic_t active;
    std::array<struct sigaction, crashes.size()> crash_before;
    std::array<struct sigaction, requests.size()> request_before;
    struct sigaction alarm_before;
    stack_t stack_before;
    std::array<char, alternate_stack> stack; // of a crash whose own stack is full
} guarded;

void write_out(std::string_view text) {
    [[maybe_unused]] const auto done = ::write(STDERR_FILENO, text.data(), text.size());
}

[[noreturn]] void end_with(std::string_view what) {
    write_out({guarded.who.data(), guarded.size});
    write_out(": its start ");
    write_out(what);
    write_out("\n");
    ::_exit(guarded.code);
}

void on_crash(int number) {
    std::array<char, 32> text{"ends the process by signal "};
    auto at = std::find(text.begin(), text.end(), '\0');
    if (number >= 10) {
        *at++ = static_cast<char>('0' + number / 10);
    }
    *at++ = static_cast<char>('0' + number % 10);
    end_with({text.data(), static_cast<std::size_t>(at - text.begin())});
}

void on_time_over(int) { end_with("does not end"); }

void on_exit() {
    if (guarded.active != 0) {
        end_with("ends the process");
    }
}

void set_time_limit(std::chrono::seconds limit) {
    const itimerval wanted{.it_interval = {}, .it_value = {.tv_sec = limit.count(), .tv_usec = 0}};
    ::setitimer(ITIMER_REAL, &wanted, nullptr);
}

} // namespace

plugin_start_guard::plugin_start_guard(const std::string& who, int exit_code, std::chrono::seconds limit) {
    guarded.size = std::min(who.size(), guarded.who.size());
    std::copy_n(who.begin(), guarded.size, guarded.who.begin());
    guarded.code = exit_code;
    guarded.active = 1;
    [[maybe_unused]] static const int once = std::atexit(on_exit);
    const stack_t stack{.ss_sp = guarded.stack.data(), .ss_flags = 0, .ss_size = guarded.stack.size()};
    ::sigaltstack(&stack, &guarded.stack_before);
    struct sigaction action {};
    action.sa_flags = SA_ONSTACK;
    action.sa_handler = on_crash;
    for (std::size_t i = 0; i < crashes.size(); ++i) {
        ::sigaction(crashes[i], &action, &guarded.crash_before[i]);
    }
    action.sa_handler = on_time_over;
    ::sigaction(SIGALRM, &action, &guarded.alarm_before);
    action.sa_handler = SIG_DFL;
    for (std::size_t i = 0; i < requests.size(); ++i) {
        ::sigaction(requests[i], &action, &guarded.request_before[i]);
    }
    set_time_limit(limit);
}

plugin_start_guard::~plugin_start_guard() {
    set_time_limit(std::chrono::seconds{0});
    guarded.active = 0;
    for (std::size_t i = 0; i < crashes.size(); ++i) {
        ::sigaction(crashes[i], &guarded.crash_before[i], nullptr);
    }
    for (std::size_t i = 0; i < requests.size(); ++i) {
        ::sigaction(requests[i], &guarded.request_before[i], nullptr);
    }
    ::sigaction(SIGALRM, &guarded.alarm_before, nullptr);
    ::sigaltstack(&guarded.stack_before, nullptr);
}

} // namespace cles::runtime
