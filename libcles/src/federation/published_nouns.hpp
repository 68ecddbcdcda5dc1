// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "federation/bridge_connection.hpp"
#include "federation/bridge_link.hpp"
#include "federation/bridge_output.hpp"
#include "federation/published_updates.hpp"
#include "federation/subject.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::bridging {

/// The nouns of this pool that this bridge publishes for others. Each is bound at the node once for each requester, in
/// that one's name, so that the publisher decides whether it may. Each update is published once, for all of them.
class published_nouns {
  public:
    /// Of one noun: each costs its publisher a binding, and each update a line.
    static constexpr std::size_t max_requesters = 64;

    struct subscriber {
        bridge_id by;
        std::string reply;       ///< the subject for the reply to BIND
        std::string requester{}; ///< in a secured fleet, the member whose rights apply; else empty

        auto operator<=>(const subscriber&) const = default; // NOLINT(modernize-use-nullptr): not about pointers
    };

    published_nouns(bridge_connection& nats, bridge_output& out) noexcept : nats_(nats), out_(out) {}

    void bind(const protocol::request_line& request, subscriber who);
    /// That bridge ends its bindings of the noun, for all requesters.
    void unbind(const std::string& noun, const bridge_id& by);
    /// That bridge ends what one of its BINDs has bound, or waits no more for the reply, which may have been sent.
    void cancel(const bridge_id& by, std::string_view reply);
    void on_lost(const bridge_id& by);
    /// An update of the node, or its reply to BIND.
    void on_line(const bridge_link& from, std::string_view line);
    /// The node has closed the link of a requester, who may not bind one of the nouns any more: those who have bound
    /// for it are told.
    void on_closed(const bridge_link& which);
    /// The connection is lost. Nothing is reported.
    void clear() noexcept { nouns_.clear(); }

  private:
    static constexpr std::size_t max_binds = 64; // of one bridge, noun and requester: the last ones
    /// What is bound for one requester.
    struct part {
        std::map<bridge_id, std::deque<std::string>> bound; ///< with the subjects for replies, since it may bind again
        std::vector<subscriber> waiting;                    ///< for the reply
        std::uint64_t asked = 0;                            ///< the id of the BIND that is not answered; 0: none
    };
    struct entry {
        std::map<std::string, part, std::less<>> parts; ///< by the requester
        published_updates published;
    };
    using entries = std::map<std::string, entry, std::less<>>; // by the noun: "car1:localization/fast"
    using key = std::pair<std::string, std::string>;           // the noun, and the requester

    void publish_update(std::string_view line);
    void on_reply(const bridge_link& from, std::uint64_t id, std::string_view reply);
    [[nodiscard]] part* find(const key& which);
    [[nodiscard]] std::vector<key> all() const;
    void unbind(const key& which, const bridge_id& by);
    void end_if_unused(const key& which);
    void end_if_unknown(const bridge_link& link);
    void lose_all();
    void forget(const key& which);
    [[nodiscard]] bool is_requester_known(std::string_view requester) const;
    static bridge_link link_of(std::string requester) {
        return {.what = bridge_link::role::publications, .member = std::move(requester)};
    }

    bridge_connection& nats_;
    bridge_output& out_;
    entries nouns_;
    std::uint64_t last_id_ = 0;
};

} // namespace cles::bridging
