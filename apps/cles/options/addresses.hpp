// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "options/multicast_option.hpp"

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
    void add_options(CLI::App& command,
                     const std::string& multicast_help = "By which interface nodes are found by their names");

    /// Checks what was given. \throws usage_error
    void check() const;

    [[nodiscard]] std::map<std::string, std::string> peers() const;
    /// Neither --at nor --peer says where: nodes are found by what they announce, and `self` where they listen unless
    /// something else is said.
    [[nodiscard]] bool finds_by_name() const { return !has_url() && peers_.empty() && group().is_on(); }
    /// --at or the environment says where.
    [[nodiscard]] bool has_url() const { return !at().empty(); }
    /// The multicast group, which only some join.
    [[nodiscard]] cles::multicast_options group() const { return multicast_.where(); }
    /// Takes part in multicast by these interfaces alone from now on; by none: does without it.
    void narrow_group_to(const std::vector<std::string>& interfaces) { multicast_.narrow_to(interfaces); }
    /// --multicast was given.
    [[nodiscard]] bool has_group() const noexcept { return multicast_.is_given(); }
    /// The URL at which requests for this node go; empty where it is one of the peers, or found by its name.
    /// \throws cles::error with `no_target`
    [[nodiscard]] std::string url_for(std::string_view node) const;
    /// As above, but a peer's own URL; still empty where it is found by its name.
    [[nodiscard]] std::string where_is(std::string_view node) const;

    /// On the command line, and not in the environment.
    [[nodiscard]] bool has_at() const noexcept { return !at_.empty(); }
    void set_at(std::string url) { at_ = std::move(url); }

  private:
    [[nodiscard]] std::string at() const;

    std::string at_;
    std::vector<std::string> peers_;
    multicast_option multicast_;
};

} // namespace tool
