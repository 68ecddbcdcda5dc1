// SPDX-License-Identifier: BSL-1.0
// A plugin whose tasks do what no task should, and one that is as it should be.
#include <cles/plugin.hpp>

#include <chrono>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>

namespace {

using namespace std::chrono_literals;

[[noreturn]] void hang() {
    for (;;) {
        std::this_thread::sleep_for(1h);
    }
}

void register_tasks(cles::registrar& to) {
    to.on_pull("quick", [] { return 42; });
    to.on_pull("hangs", [] { hang(); });
    to.on_pull("lingers", [] { std::this_thread::sleep_for(50ms); }, {.inline_ok = true});
    to.on_delegate("empty", [] {});
    // Does not look whether anybody waits.
    to.on_delegate("never_ends", [](const cles::request&, const cles::responder&) { hang(); });
    to.on_delegate("throws", [](const cles::request&, const cles::responder&) { throw std::runtime_error{"dropped"}; });
    to.on_delegate("throws_anything", [](const cles::request&, const cles::responder&) { throw 7; });
    to.on_delegate("twice", [](const cles::request&, cles::responder answer) {
        answer.done(1);
        answer.done(2);
        answer.fail(cles::errc::failed, "three");
    });
    to.on_delegate("forgets", [](const cles::request&, const cles::responder&) {});
    // Ends when the file is there, which the test makes.
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
}

} // namespace

CLES_PLUGIN("stubborn", "1.0", register_tasks)
