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
    /// Returns false if nobody waits for it, or it is malformed: it is dropped.
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
    /// library's own.
    [[gnu::cold]] void stop();
    [[nodiscard]] std::size_t in_flight() const noexcept { return waiting_.size(); }

  private:
    struct entry final : deadline {
        explicit entry(outbound& o) : owner(o) {}
        void on_deadline(time_point now) override { owner.on_due(*this, now); }

        outbound& owner;
        std::uint64_t id = 0;
        cles::verb verb{};
        detail::pending_ptr operation;
        progress_function progress;
        double reported = 0;
        std::optional<retransmission> copies; // over datagrams
        std::optional<errc> refused;          // why it was not sent
    };

    /// The maximum size of a request, with its LF.
    [[nodiscard]] std::size_t longest() const noexcept;
    [[nodiscard]] bool has_memory_for(const protocol::outgoing_request& request);
    [[gnu::cold]] void on_due(entry& e, time_point now);
    [[gnu::cold]] void cancel_at_peer(std::uint64_t id);
    [[gnu::cold]] void resend(entry& e, time_point now);
    void rearm(std::unique_ptr<entry> e, time_point due);
    std::unique_ptr<entry> take(std::uint64_t id);
    void recycle(std::unique_ptr<entry> e);
    [[gnu::cold]] void fail(std::uint64_t id, errc why, std::string_view message);

    node_state& node_;
    line_sink& out_;
    std::uint64_t first_id_;
    boost::unordered_flat_map<std::uint64_t, std::unique_ptr<entry>> waiting_;
    std::vector<std::unique_ptr<entry>> spare_;
};

} // namespace cles::core
