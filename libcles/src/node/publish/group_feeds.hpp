// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/backoff.hpp"
#include "node/base/deadlines.hpp"
#include "node/node_state.hpp"
#include "node/publish/feed_mailbox.hpp"
#include "node/publish/subscription.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

class group_port;
class multicast_group;

/// A feed that is bound through the multicast group: to one node's noun, or to that of every publisher.
class group_feed final : public subscription {
  public:
    /// `target`: a node's name, or "all".
    group_feed(const limits& bounds, completion_queue& completions, std::string target, std::string path)
        : subscription(std::move(target), std::move(path), false, bounds.publishers), mail_(bounds, completions) {}

    [[nodiscard]] bool wants(std::string_view node) const noexcept { return target() == "all" || target() == node; }
    [[nodiscard]] feed_mailbox& mail() noexcept { return mail_; }

  private:
    bool on_event(const detail::raw_event& event, feed_mailbox::hand_over when) override {
        return mail_.put(event, when);
    }

    feed_mailbox mail_;
};

/// The feeds of a node that are bound through the multicast group. Sends BIND when the first feed of a noun is added,
/// again after a third of the lease, and with lease=0 when the last is removed; delivers each update to all feeds that
/// want it.
class group_feeds {
  public:
    group_feeds(node_state& host, multicast_group& out, std::uint32_t seed) noexcept
        : node_(host), out_(out), jitter_(seed) {}

    /// The feed must live until it is removed.
    void add(group_feed& feed, time_point now);
    /// Does nothing if it is not there (any more).
    [[gnu::cold]] void remove(group_feed& feed);
    /// Removes and returns all feeds.
    [[nodiscard, gnu::cold]] std::vector<group_feed*> remove_all();
    /// The node may know no bindings, since it has restarted, or sends by other interfaces: feeds bound to it, or to
    /// `all`, are soon bound again.
    [[gnu::cold]] void rebind_soon(std::string_view node, time_point now);
    /// This node sends by that port too from now on: those who receive it are asked at once.
    [[gnu::cold]] void bind_on(group_port& added);
    /// Whether a feed is bound to the update's noun.
    [[nodiscard]] bool wants(const protocol::request_line& update) const;
    /// The node's next update counts as its first.
    void forget(std::string_view node);
    /// Delivers an update. False if nobody wants it, or it is new to nobody.
    bool take(const protocol::request_line& update);
    /// Whether there are no feeds.
    [[nodiscard]] bool empty() const noexcept { return by_path_.empty() && bound_.empty(); }

  private:
    struct bound final : deadline { // armed for its renewal
        bound(group_feeds& all, std::string what) : owner(all), noun(std::move(what)) {}
        void on_deadline(time_point now) override { owner.send_bind(*this, now); }

        group_feeds& owner;
        std::string noun; // in wire format
        std::size_t feeds = 0;
    };

    [[nodiscard]] std::chrono::milliseconds lease() const;
    [[nodiscard, gnu::cold]] std::string bind_line(const bound& b) const;
    [[gnu::cold]] void send_bind(bound& b, time_point now);
    [[gnu::cold]] void unbind(const group_feed& last);
    [[nodiscard]] bool has(std::string_view path, const group_feed* feed) const;

    node_state& node_;
    multicast_group& out_;
    jitter jitter_;
    std::map<std::string, bound, std::less<>> bound_;
    std::map<std::string, std::vector<group_feed*>, std::less<>> by_path_;
};

} // namespace cles::core
