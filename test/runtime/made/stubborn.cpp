// SPDX-License-Identifier: BSL-1.0
// A plugin whose tasks misbehave, except for one.
#include <cles/plugin.hpp>

#include <boost/system/error_code.hpp>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>

#include <fcntl.h>
#include <unistd.h>

namespace {

using namespace std::chrono_literals;

[[noreturn]] void hang() {
    for (;;) {
        std::this_thread::sleep_for(1h);
    }
}

// Callbacks block on this, which is destroyed with the library's global objects unless the process skips that.
std::atomic<int> blocked_callbacks{0};
struct global_state {
    ~global_state() {
        if (blocked_callbacks > 0) {
            std::abort();
        }
    }
} const state;

// Appends the time of the call (of the clock that Python calls `time.monotonic_ns`) in a single write, so that lines of
// several writers do not mix.
void mark(const std::string& file, const std::string& what) {
    const auto now = std::chrono::steady_clock::now().time_since_epoch();
    const auto line = what + " " + std::to_string(std::chrono::nanoseconds{now}.count()) + "\n";
    const int out = ::open(file.c_str(), O_WRONLY | O_APPEND | O_CREAT, 0600);
    if (out < 0 || ::write(out, line.data(), line.size()) != static_cast<ssize_t>(line.size())) {
        throw std::runtime_error{"there is no file for marks"};
    }
    ::close(out);
}

// What jobs do when they are stopped. Noun: task/file/name.
void register_stops(cles::registrar& to) {
    to.on_delegate("listens", [](const cles::request& asked, cles::responder answer) {
        const std::string file{asked.parameter(0)};
        const std::string name{asked.parameter(1)};
        answer.on_stop([answer, file, name] {
            mark(file, name);
            answer.fail(cles::errc::cancelled, "stopped");
        });
        mark(file, "begun");
    });
    to.on_delegate("asks_and_listens", [](const cles::request& asked, cles::responder answer) {
        const std::string file{asked.parameter(0)};
        const std::string name{asked.parameter(1)};
        answer.on_stop([file, name] { mark(file, name); });
        answer.delegate("DELEGATE self:waits/nothing", [answer, file](boost::system::error_code, auto, auto) {
            mark(file, answer.stopped() ? "ended" : "ended_and_not_stopped");
            answer.fail(cles::errc::cancelled, "what was asked has ended");
        });
        mark(file, "begun");
    });
    // It takes a moment to stop.
    to.on_delegate("ends_when_stopped", [](const cles::request& asked, cles::responder answer) {
        const std::string file{asked.parameter(0)};
        mark(file, "begun");
        while (!answer.stopped()) {
            std::this_thread::sleep_for(2ms);
        }
        std::this_thread::sleep_for(20ms);
        mark(file, std::string{asked.parameter(1)});
        answer.fail(cles::errc::cancelled, "stopped");
    });
    to.on_delegate("blocks_when_stopped", [](const cles::request& asked, const cles::responder& answer) {
        const std::string file{asked.parameter(0)};
        answer.on_stop([answer, file] {
            ++blocked_callbacks;
            mark(file, "blocked");
            hang();
        });
        mark(file, "begun");
    });
}

void register_tasks(cles::registrar& to) {
    to.on_pull("quick", [] { return 42; });
    to.on_pull("hangs", [] { hang(); });
    to.on_pull("lingers", [] { std::this_thread::sleep_for(50ms); }, {.inline_ok = true});
    to.on_delegate("empty", [] {});
    // Does not check whether it is stopped.
    to.on_delegate("never_ends", [](const cles::request&, const cles::responder&) { hang(); });
    to.on_delegate("throws", [](const cles::request&, const cles::responder&) { throw std::runtime_error{"dropped"}; });
    to.on_delegate("throws_anything", [](const cles::request&, const cles::responder&) { throw 7; });
    to.on_delegate("throws_elsewhere",
                   [] { std::thread{[] { throw std::runtime_error{"nobody catches it"}; }}.join(); });
    to.on_delegate("twice", [](const cles::request&, cles::responder answer) {
        answer.done(1);
        answer.done(2);
        answer.fail(cles::errc::failed, "three");
    });
    to.on_delegate("forgets", [](const cles::request&, const cles::responder&) {});
    // Ends when the test creates the file.
    to.on_delegate("waits", [](const cles::request& asked, cles::responder answer) {
        const std::string file{asked.parameter(0)};
        answer.log(cles::log_level::info, "waiting");
        while (!std::ifstream{file}) {
            if (answer.stopped()) {
                answer.fail(cles::errc::cancelled, "stopped");
                return;
            }
            std::this_thread::sleep_for(5ms);
        }
        answer.done("found");
    });
    register_stops(to);
}

} // namespace

CLES_PLUGIN("stubborn", "1.0", register_tasks)
