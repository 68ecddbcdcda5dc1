// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "federation/bridge_connection.hpp"
#include "federation/bridge_output.hpp"
#include "federation/subject.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace cles::bridging {

/// The nouns of this pool that this bridge publishes for others: each is bound once at the node, for all that want it,
/// and each of its updates is published once.
class published_nouns {
  public:
    struct subscriber {
        bridge_id by;
        std::string reply; ///< the subject for the reply to BIND

        auto operator<=>(const subscriber&) const = default; // NOLINT(modernize-use-nullptr): not about pointers
    };

    published_nouns(bridge_connection& nats, bridge_output& out) noexcept : nats_(nats), out_(out) {}

    void bind(const protocol::request_line& request, subscriber who);
    void unbind(const std::string& noun, const bridge_id& by);
    /// Nobody waits any more for the reply to that BIND, which may have been sent.
    void cancel(const subscriber& who);
    void on_lost(const bridge_id& by);
    /// An update of the node, or its reply to BIND.
    void on_line(std::string_view line);
    /// The node has closed the link: those who were bound are told.
    void on_closed();
    /// The connection is lost. Nothing is reported.
    void clear() noexcept { nouns_.clear(); }

  private:
    static constexpr std::size_t max_binds = 64; // of one bridge and noun; more are not told apart
    struct entry {
        std::map<bridge_id, std::set<std::string>> bound; ///< with the subjects for replies, since it may bind again
        std::vector<subscriber> waiting;                  ///< for the reply
        std::uint64_t asked = 0;                          ///< the id of the BIND that is not answered; 0: none
    };
    using entries = std::map<std::string, entry, std::less<>>; // by the noun: "car1:localization/fast"

    void publish_update(std::string_view line);
    void on_reply(std::uint64_t id, std::string_view reply);
    void end(entries::iterator which);
    void deliver(std::string line);

    bridge_connection& nats_;
    bridge_output& out_;
    entries nouns_;
    std::uint64_t last_id_ = 0;
};

} // namespace cles::bridging
