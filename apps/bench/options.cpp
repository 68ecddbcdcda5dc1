// SPDX-License-Identifier: BSL-1.0
#include "options.hpp"

#include "options/duration.hpp"

#include <unistd.h>

namespace tool {

namespace {

cles::perf::handler_style style_of(const std::string& name) {
    using style = cles::perf::handler_style;
    return name == "callback" ? style::callback : name == "batch" ? style::batch : style::coroutine;
}

} // namespace

bench_options to_options(const bench_arguments& given, measurement what) {
    bench_options options{.transport = carrier_of(given.transport),
                          .style = style_of(given.style),
                          .rounds = given.rounds,
                          .requests = given.requests,
                          .against = given.against,
                          .keys = given.against.starts_with("tls://") ? given.keys.given_directory() : "",
                          .in_flight = given.in_flight,
                          .one_core = given.one_core,
                          .keep = given.keep,
                          .as_json = given.form == "json" || given.form == "raw"};
    if (!given.duration.empty()) {
        options.duration = parse_positive_duration(given.duration);
    }
    options.how.busy_poll = given.busy_poll;
    options.wake_within = given.wake_within;
    if (!given.binders.empty()) {
        options.binders = given.binders;
    } else if (what == measurement::fan_out) {
        options.binders = {1, 8, 64};
    }
    return options;
}

cles::perf::placement places_of(const bench_options& options) {
    auto cores = cles::perf::place_ends();
    if (options.one_core) {
        cores.server = cores.client;
    }
    return cores;
}

std::optional<std::int64_t> wake_within_us(const bench_options& options) {
    const auto& within = options.wake_within;
    return within ? std::optional<std::int64_t>{within->count()} : std::nullopt;
}

std::chrono::nanoseconds limit_of(const bench_options& options) {
    return options.duration ? std::chrono::nanoseconds{*options.duration} : std::chrono::nanoseconds::max();
}

const char* to_string(carrier c) {
    switch (c) {
    case carrier::tcp: return "tcp";
    case carrier::udp: return "udp";
    case carrier::unix_socket: return "unix";
    case carrier::inproc: return "inproc";
    case carrier::multicast: return "multicast";
    }
    return "";
}

const char* to_string(cles::perf::handler_style s) {
    switch (s) {
    case cles::perf::handler_style::coroutine: return "coroutine";
    case cles::perf::handler_style::callback: return "callback";
    case cles::perf::handler_style::batch: return "batch";
    }
    return "";
}

std::string bench_url(carrier c) {
    switch (c) {
    case carrier::tcp:
    case carrier::multicast: return "tcp://127.0.0.1:0";
    case carrier::udp: return "udp://127.0.0.1:0";
    case carrier::unix_socket: return "unix://@cles-bench-" + std::to_string(::getpid());
    case carrier::inproc: return "inproc://cles-bench";
    }
    return {};
}

} // namespace tool
