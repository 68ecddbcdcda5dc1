// SPDX-License-Identifier: BSL-1.0
// Jobs that hold a worker for a while: by sleeping, or by computing for so much time of a processor.
#include <cles/plugin.hpp>

#include <boost/describe/class.hpp>

#include <chrono>
#include <cstdint>
#include <ctime>
#include <string>
#include <thread>

namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;

/// Where a job ran.
struct ran {
    std::string node;
};
BOOST_DESCRIBE_STRUCT(ran, (), (node))

nanoseconds processor_time() {
    timespec now{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return std::chrono::seconds{now.tv_sec} + nanoseconds{now.tv_nsec};
}

ran sleep(const cles::request& asked) {
    std::this_thread::sleep_for(milliseconds{asked.parameter<int>(0)});
    return {std::string{asked.node()}};
}

ran compute(const cles::request& asked) {
    const auto end = processor_time() + milliseconds{asked.parameter<int>(0)};
    volatile std::uint32_t state = 1;
    while (processor_time() < end) {
        for (int i = 0; i < 1000; ++i) {
            state = state * 1664525U + 1013904223U;
        }
    }
    return {std::string{asked.node()}};
}

void register_tasks(cles::registrar& to) {
    to.on_pull("nothing", [] { return 0; }, {.inline_ok = true});
    for (const char* const task : {"sleep", "short", "long"}) { // nodes measure each task
        to.on_delegate(task, sleep, {.description = "Sleeps", .parameters = {"ms"}});
    }
    to.on_delegate("compute", compute, {.description = "Computes", .parameters = {"ms"}});
}

} // namespace

CLES_PLUGIN("work", "1.0", register_tasks)
