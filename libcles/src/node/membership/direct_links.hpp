// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/backoff.hpp"
#include "node/membership/membership.hpp"

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// To which nodes this one has a link, or can open one: those that both nodes' `links` allow, unless attempts have
/// failed.
///
/// A node that does not reply may have crashed, and then no route leads to it either. Only if the node is alive all the
/// same, it is the link that is lost.
class direct_links {
  public:
    static constexpr std::chrono::milliseconds first_pause{2'000}; ///< before the next attempt
    static constexpr std::chrono::milliseconds max_pause{60'000};

    explicit direct_links(std::string own_name) : own_name_(std::move(own_name)) {}

    /// The only nodes that this one may have links to; empty: all.
    void allow_only(std::vector<std::string> names) { allowed_ = std::move(names); }
    [[nodiscard]] const std::vector<std::string>& allowed() const noexcept { return allowed_; }

    /// Whether both nodes' `links` allow it.
    [[nodiscard]] bool allows(std::string_view node, const membership& others) const;

    enum class state : std::uint8_t {
        none,    ///< the node has no address, or `links` do not allow it
        untried, ///< no attempt has failed, and none has succeeded
        open,    ///< the node has replied since the last failure
        silent,  ///< an attempt has failed: the node may have crashed
        lost,    ///< an attempt has failed, and the node is alive
    };
    [[nodiscard]] state state_of(std::string_view node, const membership& others) const;
    /// The same for the owner of that name, without looking for it.
    [[nodiscard]] state state_of(std::string_view node, const incarnation& owner) const;
    /// When the first attempt failed, of a link that is silent or lost.
    [[nodiscard]] time_point failed_at(std::string_view node) const;
    /// Whether it is time for another attempt, of a link that is silent or lost.
    [[nodiscard]] bool is_due(std::string_view node, time_point now) const;

    /// A link to the node could not be opened, or the node does not reply on it. Returns whether that is new.
    bool on_failure(std::string_view node, time_point now);
    /// It is reached by others.
    void on_alive(std::string_view node);
    /// Nodes to which a link is lost, each once.
    [[nodiscard]] std::vector<std::string> take_lost(const membership& others);
    /// The node has replied on a link. Returns whether the last attempt had failed.
    bool on_success(std::string_view node);
    [[nodiscard]] bool has_failed(std::string_view node) const noexcept { return find_failure(node) != nullptr; }
    void forget(std::string_view node);

  private:
    struct failure {
        doubling_pause pause{first_pause};
        time_point first{};
        time_point next{};
        bool alive = false;
        bool is_reported = false;
    };
    [[nodiscard]] static bool is_lost(const failure& f, const incarnation* owner);
    /// Null unless an attempt has failed.
    [[nodiscard]] const failure* find_failure(std::string_view node) const noexcept;

    const std::string own_name_;
    std::vector<std::string> allowed_;
    std::map<std::string, std::optional<failure>, std::less<>> tried_; // nothing: it is open
};

} // namespace cles::core
