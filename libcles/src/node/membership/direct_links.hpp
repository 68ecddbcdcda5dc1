// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/backoff.hpp"
#include "node/membership/membership.hpp"

#include <chrono>
#include <map>
#include <set>
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
    /// Whether requests for the node are sent straight to it: the link is not lost.
    [[nodiscard]] bool reaches(std::string_view node, const membership& others) const;
    /// Whether requests for others can be sent through the node: no attempt has failed.
    [[nodiscard]] bool works(std::string_view node, const membership& others) const {
        return !failed_.contains(node) && reaches(node, others);
    }
    /// Whether the node may be asked for its table: the link is not lost, or it is time for another attempt.
    [[nodiscard]] bool may_try(std::string_view node, const membership& others, time_point now) const;
    /// Whether the link has been lost since before that time.
    [[nodiscard]] bool is_lost_since(std::string_view node, const membership& others, time_point before) const;

    /// A link to the node could not be opened, or the node does not reply on it. Returns whether that is new.
    bool on_failure(std::string_view node, time_point now);
    /// It is reached by others.
    void on_alive(std::string_view node);
    /// Nodes to which a link is lost, each once.
    [[nodiscard]] std::vector<std::string> take_lost(const membership& others);
    /// The node has replied on a link. Returns whether the last attempt had failed.
    bool on_success(std::string_view node);
    /// Whether it has replied since the last failure.
    [[nodiscard]] bool is_confirmed(std::string_view node) const noexcept { return confirmed_.contains(node); }
    [[nodiscard]] bool has_failures() const noexcept { return !failed_.empty(); }
    void forget(std::string_view node);

  private:
    struct failure {
        doubling_pause pause{first_pause};
        time_point first{};
        time_point next{};
        bool alive = false;
        bool is_reported = false;
    };
    /// Whether the node has an address, and both nodes' `links` allow it.
    [[nodiscard]] bool may_have(std::string_view node, const membership& others) const;
    [[nodiscard]] bool is_lost(const failure& f, std::string_view node, const membership& others) const;

    const std::string own_name_;
    std::vector<std::string> allowed_;
    std::map<std::string, failure, std::less<>> failed_;
    std::set<std::string, std::less<>> confirmed_;
};

} // namespace cles::core
