// SPDX-License-Identifier: BSL-1.0
#include "doctor/finding.hpp"

#include <cles/json_writer.hpp>

#include "output/terminal.hpp"

#include <algorithm>
#include <cstddef>

namespace tool {
namespace {

std::size_t count(const findings& all, verdict how) {
    return static_cast<std::size_t>(
        std::count_if(all.begin(), all.end(), [&](const finding& each) { return each.how == how; }));
}

std::string padded(std::string_view text, std::size_t width) {
    std::string out{text};
    out.append(width - std::min(width, text.size()), ' ');
    return out;
}

std::string styled(verdict how, const std::string& text) {
    switch (how) {
    case verdict::ok: return text;
    case verdict::warning: return bold(stream::out, text);
    case verdict::failure: return red(stream::out, text);
    }
    return text;
}

} // namespace

std::string_view to_string(verdict how) {
    switch (how) {
    case verdict::ok: return "ok";
    case verdict::warning: return "warning";
    case verdict::failure: return "failure";
    }
    return "";
}

bool has_failure(const findings& all) { return count(all, verdict::failure) != 0; }

std::string to_text(const findings& all) {
    constexpr std::size_t width_of_verdict = 9;
    constexpr std::size_t width_of_check = 12;
    std::string out;
    for (const auto& each : all) {
        out += styled(each.how, padded(to_string(each.how), width_of_verdict));
        out += padded(each.check, width_of_check) + printable(each.text) + "\n";
        if (!each.advice.empty()) {
            out += std::string(width_of_verdict + width_of_check, ' ') + "-> " + printable(each.advice) + "\n";
        }
    }
    return out;
}

std::string to_json(const findings& all) {
    std::string out;
    cles::json_writer w{out};
    w.begin_object();
    w.key("failures");
    w.value(count(all, verdict::failure));
    w.key("warnings");
    w.value(count(all, verdict::warning));
    w.key("findings");
    w.begin_array();
    for (const auto& each : all) {
        w.begin_object();
        w.key("check");
        w.value(each.check);
        w.key("verdict");
        w.value(to_string(each.how));
        w.key("text");
        w.value(std::string_view{each.text});
        if (!each.advice.empty()) {
            w.key("advice");
            w.value(std::string_view{each.advice});
        }
        w.end_object();
    }
    w.end_array();
    w.end_object();
    return out;
}

} // namespace tool
