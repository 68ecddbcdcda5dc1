// SPDX-License-Identifier: BSL-1.0
#pragma once

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

/// --at and --peer: where the nodes are that the command talks to.
class address_book {
  public:
    void add_options(CLI::App& command);

    /// Checks what was given. \throws usage_error
    void check() const;

    [[nodiscard]] std::map<std::string, std::string> peers() const;
    /// The URL at which requests for this node go; empty where it is one of the peers.
    /// \throws cles::error with `no_target`
    [[nodiscard]] std::string url_for(std::string_view node) const;
    /// As above, but a peer's own URL.
    [[nodiscard]] std::string where_is(std::string_view node) const;

    /// On the command line, and not in the environment.
    [[nodiscard]] bool has_at() const noexcept { return !at_.empty(); }
    void set_at(std::string url) { at_ = std::move(url); }

  private:
    [[nodiscard]] std::string at() const;

    std::string at_;
    std::vector<std::string> peers_;
};

} // namespace tool
