// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include "core/deadlines.hpp"
#include "core/node.hpp"
#include "core/outlet.hpp"
#include "core/resend.hpp"
#include "protocol/message.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// The requests that a node has sent on one link and that wait for their replies.
///
/// By datagram they are sent again until they are answered or their time is up, and bear ids that begin at random, so
/// that the peer does not take one for a request of an earlier run of this node.
class outbound {
  public:
    using progress_function = std::function<void(double, std::string_view)>;

    outbound(node& host, outlet& out) noexcept
        : node_(host), out_(out), first_id_(out.datagram() == 0 ? 0 : host.first_datagram_id) {}
    outbound(const outbound&) = delete;
    outbound& operator=(const outbound&) = delete;

    /// Sends a request and keeps the operation until its reply, its deadline or the loss of the link. The request bears
    /// an id that is not in flight; how long is left is filled in here.
    void send(protocol::request_text request, time_point deadline, time_point now, detail::pending_ptr operation,
              progress_function progress = {});
    /// Withdraws a request at the peer; its operation fails with `cancelled`, without waiting for anybody. False where
    /// it has ended.
    bool cancel(std::uint64_t id);
    /// Forgets a request without a word to anybody.
    void drop(std::uint64_t id);
    void on_reply(const protocol::reply_line& reply);
    /// A reply that is longer than a line may be.
    void on_overlong(const protocol::reply_line& reply);
    /// Fails all that wait with what the peer said of the link as a whole: it has begun none of them.
    void refuse(const std::string& answer);
    /// Fails all that wait.
    void lose(errc why, std::string_view message);
    /// Takes out all that wait, without a word: to be put into the completion queue, with a reason.
    [[nodiscard]] std::vector<completion::failure> take_all();
    [[nodiscard]] std::size_t in_flight() const noexcept { return waiting_.size(); }

  private:
    struct entry final : deadline {
        explicit entry(outbound& o) : owner(o) {}
        void on_deadline(time_point now) override { owner.on_due(*this, now); }

        outbound& owner;
        std::uint64_t id = 0;
        detail::pending_ptr operation;
        progress_function progress;
        double reported = 0;
        std::optional<resend> copies; // by datagram
        bool too_large = false;
        bool no_memory = false;
    };

    [[nodiscard]] bool is_datagram() const noexcept { return out_.datagram() != 0; }
    /// What a request may have, with its LF.
    [[nodiscard]] std::size_t longest() const noexcept;
    [[nodiscard]] bool has_memory_for(const protocol::request_text& request);
    void on_due(entry& e, time_point now);
    void go_on(std::unique_ptr<entry> e, time_point due);
    std::unique_ptr<entry> take(std::uint64_t id);
    void recycle(std::unique_ptr<entry> e);
    void fail(std::uint64_t id, errc why, std::string_view message);

    node& node_;
    outlet& out_;
    std::uint64_t first_id_;
    boost::unordered_flat_map<std::uint64_t, std::unique_ptr<entry>> waiting_;
    std::vector<std::unique_ptr<entry>> spare_;
};

} // namespace cles::core
