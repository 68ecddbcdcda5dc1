// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <stdexcept>
#include <string>

namespace cles::runtime {

/// A configuration that cannot be used. Says where and why: "clesd.yaml:7: multicast.port: 70000 is not a number from
/// 1 to 65535".
class config_error : public std::runtime_error {
  public:
    explicit config_error(const std::string& words) : std::runtime_error(words) {}
    config_error(const std::string& place, const std::string& why) : std::runtime_error(place + ": " + why) {}
};

} // namespace cles::runtime
