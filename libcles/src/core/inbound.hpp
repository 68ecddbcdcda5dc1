// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "core/bind_requests.hpp"
#include "core/call.hpp"
#include "core/datagram_requests.hpp"
#include "core/node.hpp"
#include "core/outlet.hpp"
#include "core/reply_writer.hpp"
#include "core/router.hpp"
#include "core/waiting_requests.hpp"
#include "protocol/message.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

class execution;

/// Serves the requests that one link brings (docs/protocol.md, "Order" and "Closing a link").
///
/// Requests with an id start at once. Those without wait for each other. Plain handlers are run in line and answered
/// into the link's output; other handlers become calls. Handlers are begun by `on_request` and `serve_more` only.
class inbound final : private call_owner, private call_opener {
  public:
    inbound(std::shared_ptr<node> host, outlet& out, binder& updates, const identity& peer);
    inbound(const inbound&) = delete;
    inbound& operator=(const inbound&) = delete;
    ~inbound();

    /// A request's line with what was read from it.
    void on_request(std::string_view line, const protocol::request_line& request, time_point now);
    /// A line that is no request.
    void on_malformed(std::string_view line, const protocol::malformed_request& what, time_point now);
    /// A line over the limit: answered, then the link ends.
    void on_overlong(std::string_view head, time_point now);
    /// The peer sends no more: what has an id is withdrawn, the rest is still answered, then the link finishes.
    void end(time_point now);
    /// The link is gone.
    void lose() {
        lost_ = true;
        drop_all();
    }
    /// Nothing is begun any more: what comes, and what waits for its turn, is `busy`. What runs is still answered.
    void begin_nothing() noexcept { begins_nothing_ = true; }
    /// Answers what still runs with `unavailable`, and tells it to stop; what waits is `busy`.
    void cut_short();

    /// Whether requests wait whose turn has come, but which are too many for one turn.
    [[nodiscard]] bool has_more() const noexcept { return anonymous_ == nullptr && !waiting_.empty(); }
    /// Serves some of them.
    void serve_more(time_point now) { serve_waiting(now); }
    /// Puts updates that wait to the link, which has room again.
    void drain(time_point now) { bound_.drain(now); }
    [[nodiscard]] std::size_t in_flight() const noexcept {
        return calls_.size() + waiting_.size() + (anonymous_ ? 1 : 0);
    }
    /// Nothing is kept for the peer: nothing runs or waits, nothing is bound, no reply is remembered.
    [[nodiscard]] bool at_rest() const noexcept {
        return in_flight() == 0 && bound_.empty() && (!datagrams_ || datagrams_->empty());
    }
    [[nodiscard]] std::size_t bindings() const noexcept { return bound_.size(); }

  private:
    static constexpr std::size_t longest_frame = 64; // of an answer: "id=7 ", and what closes it

    void serve(const protocol::request_line& request, time_point arrived, time_point now);
    void serve_cancel(const protocol::request_line& request, std::uint64_t id, time_point now);
    void serve_here(const protocol::request_line& request, time_point arrived, time_point now);
    void serve_task(const protocol::request_line& request, time_point arrived, time_point now);
    std::optional<protocol::failure> run_plain(const protocol::request_line& request, execution& task);
    void refuse(const protocol::request_line& request, const protocol::failure& why, time_point due, time_point now);

    /// Null where no memory is left for it; nothing has been answered then.
    std::shared_ptr<call> begin_call(const protocol::request_line& request, call::terms wanted, time_point due,
                                     time_point now);
    std::shared_ptr<call> open_call(const protocol::request_line& request, time_point due, time_point now) override;

    [[nodiscard]] bool must_wait() const noexcept { return anonymous_ != nullptr || !waiting_.empty(); }
    void answer_in_turn(std::string answer, time_point now);
    void refuse_in_turn(const protocol::request_line& request, const protocol::failure& why, time_point now);
    void follow_waiting();
    void serve_waiting(time_point now);
    void withdraw_all();
    void drop_all();
    void finish_if_done();

    void withdraw(std::uint64_t id);
    void answer(call& c, std::string_view json) override;
    void refuse(call& c, const protocol::failure& why) override;
    [[nodiscard]] bool can_answer(std::size_t bytes) override { return out_.reserve(bytes + longest_frame); }
    void report(call& c, double fraction, std::string_view json) override;
    [[nodiscard]] std::string_view peer_address() const noexcept override { return peer_.address; }
    void detach(call& c);

    std::shared_ptr<node> node_;
    outlet& out_;
    const identity& peer_;
    boost::unordered_flat_map<std::uint64_t, std::shared_ptr<call>> calls_;
    std::shared_ptr<call> anonymous_;
    std::shared_ptr<memory_account> memory_; // null: nobody counts
    waiting_requests waiting_;
    reply_writer replies_;
    std::optional<datagram_requests> datagrams_; // where it is no stream
    bind_requests bound_;
    std::string decoded_; // room for the parameters of the noun being served
    bool serving_waiting_ = false;
    bool paused_ = false;
    bool ending_ = false;  // the peer sends no more, or what it sends is no longer read
    bool closing_ = false; // the link ends whatever is bound
    bool finished_ = false;
    bool begins_nothing_ = false; // this node leaves
    bool lost_ = false;           // there is no link any more
};

} // namespace cles::core
