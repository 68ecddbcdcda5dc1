// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_start_guard.hpp"

#include "output/terminal.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <string_view>

#include <sys/time.h>
#include <unistd.h>

namespace cles::runtime {
namespace {

constexpr std::array signals{SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT, SIGSYS, SIGALRM, SIGTERM, SIGINT};
constexpr std::size_t alternate_stack = 65536;

// Read by signal handlers; not changed while signals may arrive.
struct {
    std::array<char, 4096> who;
    std::size_t size;
    int code;
    volatile sig_atomic_t active;
    std::array<struct sigaction, signals.size()> before;
    stack_t stack_before;
    std::array<char, alternate_stack> stack; // for stack overflows
} guard_state;

void write_out(std::string_view text) { tool::write_within(tool::stream::err, text, std::chrono::seconds{1}); }

[[noreturn]] void exit_with(std::string_view what) {
    write_out({guard_state.who.data(), guard_state.size});
    write_out(": its start ");
    write_out(what);
    write_out("\n");
    ::_exit(guard_state.code);
}

void on_crash(int number) {
    std::array<char, 32> text{"ends the process by signal "};
    const auto digits = std::find(text.begin(), text.end(), '\0');
    const auto [end, code] = std::to_chars(digits, text.end(), number);
    exit_with({text.data(), static_cast<std::size_t>(end - text.data())});
}

void on_timeout(int) { exit_with("does not end"); }

void on_exit() {
    if (guard_state.active != 0) {
        exit_with("ends the process");
    }
}

auto handler_of(int number) -> void (*)(int) {
    switch (number) {
    case SIGALRM: return on_timeout;
    case SIGTERM:
    case SIGINT: return SIG_DFL;
    default: return on_crash;
    }
}

void set_time_limit(std::chrono::seconds limit) {
    const itimerval wanted{.it_interval = {}, .it_value = {.tv_sec = limit.count(), .tv_usec = 0}};
    ::setitimer(ITIMER_REAL, &wanted, nullptr);
}

} // namespace

plugin_start_guard::plugin_start_guard(const std::string& who, int exit_code, std::chrono::seconds limit) {
    guard_state.size = std::min(who.size(), guard_state.who.size());
    std::copy_n(who.begin(), guard_state.size, guard_state.who.begin());
    guard_state.code = exit_code;
    guard_state.active = 1;
    [[maybe_unused]] static const int once = std::atexit(on_exit);
    const stack_t stack{.ss_sp = guard_state.stack.data(), .ss_flags = 0, .ss_size = guard_state.stack.size()};
    ::sigaltstack(&stack, &guard_state.stack_before);
    struct sigaction action {};
    action.sa_flags = SA_ONSTACK;
    for (std::size_t i = 0; i < signals.size(); ++i) {
        action.sa_handler = handler_of(signals[i]);
        ::sigaction(signals[i], &action, &guard_state.before[i]);
    }
    set_time_limit(limit);
}

plugin_start_guard::~plugin_start_guard() {
    set_time_limit(std::chrono::seconds{0});
    guard_state.active = 0;
    for (std::size_t i = 0; i < signals.size(); ++i) {
        ::sigaction(signals[i], &guard_state.before[i], nullptr);
    }
    ::sigaltstack(&guard_state.stack_before, nullptr);
}

} // namespace cles::runtime
