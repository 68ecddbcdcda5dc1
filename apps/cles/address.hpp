// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include "multicast_option.hpp"

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace CLI {
class App;
}

namespace tool {

/// Where a node listens unless something else is said.
inline constexpr std::string_view default_url = "tcp://127.0.0.1:25370";

/// --at, --peer and --multicast: where the nodes are that the command talks to.
class address_book {
  public:
    void add_options(CLI::App& command);

    /// Checks what was given. \throws usage_error
    void check() const;

    [[nodiscard]] std::map<std::string, std::string> peers() const;
    /// Neither --at nor --peer says where: nodes are found by what they announce, and `self` where they listen unless
    /// something else is said.
    [[nodiscard]] bool finds_by_name() const { return !has_url() && peers_.empty() && multicast_.is_on(); }
    /// There is an --at.
    [[nodiscard]] bool has_url() const { return !at_.empty(); }
    /// The group in which nodes are looked for; off where that is not needed.
    [[nodiscard]] cles::multicast_options multicast() const;
    /// The URL at which requests for this node go; empty where it is one of the peers, or found by its name.
    /// \throws cles::error with `no_target`
    [[nodiscard]] std::string url_for(std::string_view node) const;
    /// As above, but a peer's own URL; still empty where it is found by its name.
    [[nodiscard]] std::string where_is(std::string_view node) const;

    void set_at(std::string url) { at_ = std::move(url); }

  private:
    std::string at_;
    std::vector<std::string> peers_;
    cles::multicast_options multicast_ = default_multicast();
};

} // namespace tool
