// SPDX-License-Identifier: BSL-1.0
#include "events.hpp"

#include <cles/printable.hpp>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>

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

} // namespace

double utc_now() { return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count(); }

std::string fixed(double number, int digits) {
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), "%.*f", digits, number);
    return text.data();
}

void event_log::write(std::string_view event, std::string_view text, const lines& more, std::string_view data) const {
    const double now = utc_now();
    std::string shown = cles::printable(text);
    for (const auto& line : more) {
        shown.append("\n    ").append(cles::printable(line));
    }
    if (json_) {
        entry out{.utc = now, .who = who_, .event = std::string{event}, .text = shown};
        out.data.text = data;
        std::puts(cles::printable(cles::to_json(out)).c_str());
    } else {
        const auto second = static_cast<std::time_t>(now);
        std::tm parts{};
        ::gmtime_r(&second, &parts);
        std::array<char, 16> clock{};
        std::strftime(clock.data(), clock.size(), "%H:%M:%S", &parts);
        std::printf("%s.%03d %s: %s\n", clock.data(), static_cast<int>((now - std::floor(now)) * 1000), who_.c_str(),
                    shown.c_str());
    }
    std::fflush(stdout); // so that the reader of a pipe gets it at once
}

} // namespace jadc2
