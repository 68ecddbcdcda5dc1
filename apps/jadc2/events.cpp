// SPDX-License-Identifier: BSL-1.0
#include "events.hpp"

#include <cles/printable.hpp>

#include "output/log_line.hpp"

#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <utility>

namespace jadc2 {
namespace {

struct entry {
    double utc = 0;
    std::string who{};
    std::string event{};
    std::string text{};
    cles::json_text data{};
};
BOOST_DESCRIBE_STRUCT(entry, (), (utc, who, event, text, data))

std::string line_of(const std::string& who, bool json, std::string_view event, const std::string& shown,
                    std::string_view data) {
    const double now = utc_now();
    if (json) {
        entry out{.utc = now, .who = who, .event = std::string{event}, .text = shown};
        out.data.text = data;
        return cles::printable(cles::to_json(out)) + "\n";
    }
    const auto second = static_cast<std::time_t>(now);
    std::tm parts{};
    ::gmtime_r(&second, &parts);
    std::array<char, 16> day{};
    std::strftime(day.data(), day.size(), "%H:%M:%S", &parts);
    std::array<char, 32> clock{};
    std::snprintf(clock.data(), clock.size(), "%s.%03d ", day.data(), static_cast<int>((now - std::floor(now)) * 1000));
    return clock.data() + who + ": " + shown + "\n";
}

} // namespace

event_log::event_log(std::string who, bool json, const std::string& audit_path)
    : who_(std::move(who)), json_(json),
      out_(std::make_shared<tool::log_writer>(tool::stream::out,
                                              [who = who_, json](std::uint64_t count) {
                                                  return line_of(who, json, "dropped", tool::dropped_text(count), "{}");
                                              })),
      audit_(audit_path.empty() ? nullptr : std::make_shared<audit_file>(audit_path)) {}

void event_log::audit(std::string_view event, std::string_view text) const {
    if (audit_) {
        audit_->add(line_of(who_, true, event, cles::printable(text), "{}"));
    }
}

double utc_now() { return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count(); }

void event_log::write(std::string_view event, std::string_view text, const lines& more, std::string_view data) const {
    std::string shown = cles::printable(text);
    for (const auto& line : more) {
        shown.append("\n    ").append(cles::printable(line));
    }
    if (audit_ && event != "picture" && event != "silent") {
        audit_->add(line_of(who_, true, event, shown, data));
    }
    out_->write(line_of(who_, json_, event, shown, data));
}

} // namespace jadc2
