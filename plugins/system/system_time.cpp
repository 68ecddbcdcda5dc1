// SPDX-License-Identifier: BSL-1.0
#include "system_time.hpp"

#include <boost/describe/class.hpp>

#include <chrono>

namespace sysinfo {
namespace {

struct system_time {
    std::chrono::system_clock::time_point now{};
};
BOOST_DESCRIBE_STRUCT(system_time, (), (now))
CLES_NAMES(system_time, (now, "systemTime"))

system_time read_system_time(const cles::request& asked) {
    const auto given = asked.parameters();
    if (given.size() > 1 || (given.size() == 1 && given.front() != "UTC")) {
        throw cles::error(cles::errc::bad_request, "the only time zone of systemTime is UTC, as in systemTime/UTC");
    }
    return {std::chrono::system_clock::now()};
}

} // namespace

void register_system_time(cles::registrar& to) {
    const cles::task_info info{
        .description = "Time of day in a time zone: UTC", .parameters = {"zone"}, .idempotent = true};
    to.on_pull("systemTime", read_system_time, info);
    to.on_delegate("systemTime", read_system_time, info);
}

} // namespace sysinfo
