// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/backoff.hpp"
#include "node/base/deadlines.hpp"
#include "node/node_state.hpp"
#include "node/publish/feed_mailbox.hpp"
#include "node/publish/group_output.hpp"
#include "node/publish/sequence_tracker.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// A feed that is bound through the multicast group: to one node's noun, or to that of every publisher. New, old and
/// missing updates are tracked for each publisher separately; beyond the limit, the publisher that has been silent for
/// longest is forgotten.
class group_feed {
  public:
    /// `target`: a node's name, or "all".
    group_feed(const limits& bounds, completion_queue& completions, std::string target, std::string path)
        : target_(std::move(target)), path_(std::move(path)), mail_(bounds, completions),
          publishers_(bounds.publishers) {}
    group_feed(const group_feed&) = delete;
    group_feed& operator=(const group_feed&) = delete;

    [[nodiscard]] const std::string& target() const noexcept { return target_; }
    [[nodiscard]] const std::string& path() const noexcept { return path_; }
    [[nodiscard]] bool wants(std::string_view node) const noexcept { return target_ == "all" || target_ == node; }
    /// The node's next update counts as its first.
    void forget(std::string_view node) { publishers_.forget(node); }
    /// Delivers an update that it wants. False if it is old or repeated, or its body is not JSON.
    bool take(const protocol::request_line& update, feed_mailbox::hand_over when = feed_mailbox::hand_over::now);
    [[nodiscard]] feed_mailbox& mail() noexcept { return mail_; }
    [[nodiscard]] std::size_t publishers() const noexcept { return publishers_.size(); }

  private:
    std::string target_;
    std::string path_;
    feed_mailbox mail_;
    publisher_sequences publishers_;
};

/// The feeds of a node that are bound through the multicast group. Sends BIND when the first feed of a noun is added,
/// again after a third of the lease, and with lease=0 when the last is removed; delivers each update to all feeds that
/// want it.
class group_feeds {
  public:
    group_feeds(node_state& host, group_sender& out, std::uint32_t seed) noexcept;

    /// The feed must live until it is removed.
    void add(group_feed& feed, time_point now);
    /// Does nothing if it is not there (any more).
    void remove(group_feed& feed);
    /// Removes and returns all feeds.
    [[nodiscard]] std::vector<group_feed*> remove_all();
    /// The node has restarted and knows no bindings: feeds bound to it, or to `all`, are soon bound again.
    void on_new_incarnation(std::string_view node, time_point now);
    /// Whether a feed is bound to the update's noun.
    [[nodiscard]] bool wants(const protocol::request_line& update) const;
    /// The node's next update counts as its first.
    void forget(std::string_view node);
    /// Delivers an update. False if nobody wants it, or it is new to nobody.
    bool take(const protocol::request_line& update);
    /// Whether there are no feeds.
    [[nodiscard]] bool empty() const noexcept { return by_path_.empty() && bound_.empty(); }

  private:
    class delivery_guard;

    struct bound final : deadline { // armed for its renewal
        bound(group_feeds& all, std::string what) : owner(all), noun(std::move(what)) {}
        void on_deadline(time_point now) override { owner.send_bind(*this, now); }

        group_feeds& owner;
        std::string noun; // in wire format
        std::size_t feeds = 0;
    };

    void send_bind(bound& b, time_point now);
    void send_unbind(const std::string& noun);
    void release(const group_feed& feed);

    node_state& node_;
    group_sender& out_;
    jitter jitter_;
    std::map<std::string, std::unique_ptr<bound>, std::less<>> bound_;
    std::map<std::string, std::vector<group_feed*>, std::less<>> by_path_; // null: removed during delivery
    int depth_ = 0;                                                        // nested deliveries
    bool holes_ = false;                                                   // there are null entries
};

} // namespace cles::core
