// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include "node/base/backoff.hpp"
#include "node/node_state.hpp"
#include "node/session/line_sink.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// The reply to a request whose outcome is ignored.
class discarded_reply final : public detail::pending {
  public:
    verdict offer(std::string_view) override {
        delete this;
        return verdict::completed;
    }
    void fail(boost::system::error_code, std::string_view) override { delete this; }
    void discard() noexcept override { delete this; }
    [[nodiscard]] bool calls_user() const noexcept override { return false; }
};

/// The requests that this node has sent on one link and that wait for their replies.
///
/// Over datagrams, a request is retransmitted until it is answered or its deadline passes. The ids start at a random
/// value, so that the peer does not take one for a request of an earlier incarnation of this node.
class outbound {
  public:
    using progress_function = std::function<void(double, std::string_view)>;

    outbound(node_state& host, line_sink& out) noexcept
        : node_(host), out_(out), first_id_(out.is_datagram() ? host.first_datagram_id : 0) {}
    outbound(const outbound&) = delete;
    outbound& operator=(const outbound&) = delete;

    /// Sends a request and keeps the operation until the reply, the deadline or the loss of the link. The id must not
    /// be in flight; the remaining time is filled in here.
    void send(protocol::outgoing_request request, time_point deadline, time_point now, detail::pending_ptr operation,
              progress_function progress = {});
    /// Cancels a request at the peer; its operation fails with `cancelled`, without waiting for the peer. Returns false
    /// if it has ended.
    [[gnu::cold]] bool cancel(std::uint64_t id);
    /// Discards a request and its operation, without notifying anyone.
    [[gnu::cold]] void drop(std::uint64_t id);
    /// Until `release`, a request that not every node would read waits, and so do those that follow it: the peer has
    /// been asked what it reads.
    void hold() noexcept { holds_ = true; }
    /// Sends what waits. From now on, requests that the peer would not read are refused.
    /// \param peer its name, if it is known \param line the longest line that it reads, if it has said so
    [[gnu::cold]] void release(std::string_view peer = {}, std::optional<std::size_t> line = std::nullopt);
    /// Returns false if nobody waits for it, the request was not sent yet, or it is malformed: it is dropped.
    bool on_reply(const protocol::reply_line& reply);
    /// A reply over the line limit.
    [[gnu::cold]] void on_overlong(const protocol::reply_line& reply);
    /// The peer has restarted. Requests that it may have run fail, except PULL and BIND, which are sent again.
    [[gnu::cold]] void on_restart(time_point now);
    /// Fails all pending requests with the peer's refusal of the link as a whole: it has started none of them.
    [[gnu::cold]] void refuse(const std::string& answer);
    /// Fails all pending requests.
    [[gnu::cold]] void lose(errc why, std::string_view message);
    /// Fails all pending requests because the node stops. No operation completes inside the call, not even the
    /// library's own. The peer learns it from the end of the link; over datagrams it is told.
    [[gnu::cold]] void stop();
    [[nodiscard]] std::size_t in_flight() const noexcept { return waiting_.size(); }

    /// Of the lines that wait for `release`.
    [[nodiscard]] std::size_t held_bytes() const noexcept { return held_bytes_; }

  private:
    struct entry final : deadline {
        explicit entry(outbound& o) : owner(o) {}
        void on_deadline(time_point now) override { owner.on_due(*this, now); }

        outbound& owner;
        std::uint64_t id = 0;
        cles::verb verb{};
        bool end_is_told = false; // to the peer, if it has not replied
        detail::pending_ptr operation;
        progress_function progress;
        double reported = 0;
        std::optional<retransmission> copies; // over datagrams
        std::optional<errc> refused;          // why it was not sent
        std::string held{};                   // its line, which waits for `release`; empty: it does not
        bool describes = false;               // the reply says what the peer is
    };

    /// The maximum size of a request, with its LF.
    [[nodiscard]] std::size_t longest() const noexcept;
    /// Why one of another size is refused.
    [[nodiscard, gnu::cold]] std::string too_large_reason() const;
    /// Whether a request of this size waits.
    [[nodiscard]] bool must_wait(std::size_t size) const noexcept;
    [[nodiscard]] bool has_memory_for(const protocol::outgoing_request& request);
    [[gnu::cold]] void on_due(entry& e, time_point now);
    [[gnu::cold]] void cancel_at_peer(std::uint64_t id);
    [[nodiscard]] std::string cancel_noun(std::uint64_t id) const;
    [[gnu::cold]] void resend(entry& e, time_point now);
    void rearm(std::unique_ptr<entry> e, time_point due);
    using entries = boost::unordered_flat_map<std::uint64_t, std::unique_ptr<entry>>;
    std::unique_ptr<entry> take(entries::iterator which);
    std::unique_ptr<entry> take(std::uint64_t id);
    /// The same for a reply with this id of the link: null too if the request was not sent.
    std::unique_ptr<entry> take_answered(std::uint64_t link_id);
    entries take_all();
    void recycle(std::unique_ptr<entry> e);
    [[gnu::cold]] bool on_failure(const protocol::reply_line& reply);
    [[gnu::cold]] void fail(std::uint64_t id, errc why, std::string_view message);

    node_state& node_;
    line_sink& out_;
    std::uint64_t first_id_;
    entries waiting_;
    std::vector<std::unique_ptr<entry>> spare_;
    bool holds_ = false;
    std::vector<std::uint64_t> held_; // in order
    std::size_t held_bytes_ = 0;
    std::string peer_; // its name
    std::size_t peer_line_ = std::numeric_limits<std::size_t>::max();
    /// The last reply says that the peer has not read a request because it was too long. Then the peer ends the link,
    /// and the replies that follow, all of them `cancelled`, are to requests that nobody has cancelled.
    bool ends_after_long_line_ = false;
};

} // namespace cles::core
