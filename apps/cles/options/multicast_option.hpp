// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace tool {

/// --multicast: by which interfaces the command takes part in multicast. Where it is not given, CLES_MULTICAST says so;
/// where that is not set either, it is loopback, as far as that can be joined.
class multicast_option {
  public:
    /// `help` says what the command does with it.
    void add_to(CLI::App& command, const std::string& help);

    /// On the command line, and not in the environment.
    [[nodiscard]] bool is_given() const noexcept { return !given_.empty(); }
    /// \throws usage_error where it makes no sense
    [[nodiscard]] cles::multicast_options where() const;

    /// As if `off` had been given.
    void turn_off() { given_ = "off"; }
    /// Takes part by these of its interfaces alone; by none: as if `off` had been given.
    void narrow_to(const std::vector<std::string>& interfaces);

  private:
    std::string given_;
};

/// "lo, eth0"
std::string names_of(const std::vector<std::string>& interfaces, const char* between = ", ");

} // namespace tool
