// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <random>
#include <string>
#include <string_view>

namespace jadc2 {

/// Seconds since 1970.
double utc_now();

/// Logs events on stdout: a line of text, or a JSON object per line with `utc`, `who`, `event`, `text` and `data`.
class event_log {
  public:
    event_log(std::string who, bool json) : who_(std::move(who)), json_(json) {}

    void log(std::string_view event, std::string_view text) const { write(event, text, "{}"); }
    template <class T>
    void log(std::string_view event, std::string_view text, const T& data) const {
        write(event, text, cles::to_json(data));
    }

  private:
    void write(std::string_view event, std::string_view text, std::string_view data) const;

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
