// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace jadc2 {

/// Seconds since 1970.
double utc_now();

/// Logs events on stdout: a line of text, and more lines below it, or a JSON object per line with `utc`, `who`,
/// `event`, `text`, which contains all lines, and `data`. Text may contain what others have sent: it does not begin a
/// line.
class event_log {
  public:
    event_log(std::string who, bool json) : who_(std::move(who)), json_(json) {}

    using lines = std::vector<std::string>;

    void log(std::string_view event, std::string_view text) const { write(event, text, {}, "{}"); }
    template <class T>
    void log(std::string_view event, std::string_view text, const T& data, const lines& more = {}) const {
        write(event, text, more, cles::to_json(data));
    }

  private:
    void write(std::string_view event, std::string_view text, const lines& more, std::string_view data) const;

    std::string who_;
    bool json_;
};

/// A number with that many digits after the decimal point.
std::string fixed(double number, int digits);

/// A random number that identifies this run.
inline std::string run_id() {
    std::random_device chance;
    return std::to_string(chance());
}

} // namespace jadc2
