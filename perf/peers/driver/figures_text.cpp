// SPDX-License-Identifier: BSL-1.0
#include "figures.hpp"

#include <cstdio>
#include <string_view>

namespace cles::perf::peers {
namespace {

// Does not use CLES for the JSON, so that a peer's program contains only that peer.
std::string quoted(std::string_view text) {
    std::string made{'"'};
    for (const char each : text) {
        if (each == '"' || each == '\\') {
            made += '\\';
        }
        made += static_cast<unsigned char>(each) < ' ' ? ' ' : each;
    }
    return made + '"';
}

std::string member(const char* name, double value) {
    char text[64];
    std::snprintf(text, sizeof text, "\"%s\":%.9g", name, value);
    return text;
}

const char* name_of(mode which) {
    switch (which) {
    case mode::exchange: return "exchange";
    case mode::task: return "task";
    case mode::fan_out: break;
    }
    return "fanout";
}

} // namespace

std::string to_text(const options& how, const figures& what) {
    std::string text =
        "{\"peer\":" + quoted(about.name) + ",\"over\":" + quoted(how.over) + ",\"mode\":\"" + name_of(how.mode) + "\"";
    const auto add = [&](const char* name, double value) { text += ',' + member(name, value); };
    if (how.mode == mode::fan_out) {
        add("subscribers", how.subscribers);
        add("lost", what.lost);
    } else {
        add("in_flight", how.in_flight);
    }
    add("count", static_cast<double>(what.count));
    add("p50_us", what.latency.p50);
    add("p99_us", what.latency.p99);
    add("p999_us", what.latency.p999);
    add("max_us", what.latency.max);
    add("per_s", what.per_second);
    add("cpu_us", what.cpu_us);
    std::map<std::string, std::uint64_t> libraries;
    text += ",\"memory_kib\":{";
    for (const auto& [role, each] : what.footprints) {
        text += (text.back() == '{' ? "" : ",") + member(role.c_str(), static_cast<double>(each.peak_kib));
        libraries.insert(each.libraries.begin(), each.libraries.end());
    }
    text += "},\"libraries\":{";
    for (const auto& [path, bytes] : libraries) {
        text +=
            (text.back() == '{' ? "" : ",") + quoted(path.substr(path.rfind('/') + 1)) + ':' + std::to_string(bytes);
    }
    text += '}';
    add("program_bytes", static_cast<double>(what.program_bytes));
    return text + '}';
}

std::string about_text() {
    return "{\"peer\":" + quoted(about.name) + ",\"version\":" + quoted(version()) +
           ",\"carriers\":" + quoted(about.carriers) + ",\"settings\":" + quoted(about.settings) + '}';
}

} // namespace cles::perf::peers
