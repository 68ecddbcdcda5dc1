// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <random>
#include <string>
#include <string_view>

namespace jadc2 {

/// Seconds since 1970.
double utc_now();

/// Tells on stdout what happens: a line for people, or an object a line with `utc`, `who`, `event`, `text` and `data`.
class events {
  public:
    events(std::string who, bool json) : who_(std::move(who)), json_(json) {}

    void tell(std::string_view event, std::string_view text) const { write(event, text, "{}"); }
    template <class T>
    void tell(std::string_view event, std::string_view text, const T& data) const {
        write(event, text, cles::to_json(data));
    }

  private:
    void write(std::string_view event, std::string_view text, std::string_view data) const;

    std::string who_;
    bool json_;
};

/// A number with so many digits behind the point.
std::string fixed(double number, int digits);

/// No other run has the same, so that what is named after it is no other run's.
inline std::string some_run() {
    std::random_device chance;
    return std::to_string(chance());
}

} // namespace jadc2
