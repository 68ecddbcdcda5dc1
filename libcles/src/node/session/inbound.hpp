// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/publish/bind_requests.hpp"
#include "node/session/datagram_rules.hpp"
#include "node/session/ordered_requests.hpp"
#include "node/session/reply_writer.hpp"
#include "node/session/task_execution.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

/// Serves the requests that arrive on one link (docs/protocol.md, "Order" and "Closing a link").
///
/// Requests with an id start at once; those without run one after another. Plain handlers run inline and write their
/// replies to the link's output; other handlers become calls. Only `on_request` and `serve_more` start handlers.
class inbound final : private task_sink {
  public:
    [[gnu::cold]] inbound(std::shared_ptr<node_state> host, line_sink& out, subscriber& updates, const identity& peer);
    inbound(const inbound&) = delete;
    inbound& operator=(const inbound&) = delete;
    [[gnu::cold]] ~inbound();

    /// A valid request; `line` is its text.
    void on_request(std::string_view line, const protocol::request_line& request, time_point now);
    /// A line that is not a valid request.
    [[gnu::cold]] void on_malformed(const protocol::malformed_request& what);
    /// A line over the limit: it is answered, then a stream ends.
    [[gnu::cold]] void on_overlong(std::string_view head);
    /// The peer sends no more: requests with an id are cancelled, the others are still answered, then the link
    /// finishes.
    [[gnu::cold]] void end();
    /// The link is lost.
    [[gnu::cold]] void lose();
    /// From now on, new and waiting requests are answered with `busy`. Running ones still complete.
    void refuse_new_requests() noexcept { refuses_new_requests_ = true; }
    /// Answers running requests with `unavailable` and stops their handlers; answers waiting ones with `busy`.
    [[gnu::cold]] void abort_running();

    /// A call for a request that is answered later. Null if there are too many; the request has then been refused.
    std::shared_ptr<call> make_call(const protocol::request_line& request, time_point due, time_point now);

    /// Whether requests are ready to run, but exceed what one pass serves.
    [[nodiscard]] bool has_more() const noexcept { return ordered_.has_more(); }
    /// Serves some of them.
    void serve_more(time_point now);
    /// Sends pending updates: the link is writable again.
    void drain(time_point now) { bound_.drain(now); }
    /// Sends pending updates, also those that `every` would let wait: no others may follow.
    void drain_last(time_point now) { bound_.drain_last(now); }
    /// Whether updates of this node wait to be sent.
    [[nodiscard]] bool is_behind() const noexcept { return bound_.is_behind(); }
    [[nodiscard]] std::size_t in_flight() const noexcept { return calls_.size() + ordered_.size(); }
    /// Whether no state is kept for the peer: no running or waiting request, no binding, no remembered reply.
    [[nodiscard]] bool is_idle() const noexcept {
        return in_flight() == 0 && bound_.empty() && (!seen_ || seen_->empty());
    }
    [[nodiscard]] std::size_t bindings() const noexcept { return bound_.size(); }
    /// Whether all bindings are still permitted. True without security.
    [[nodiscard]] bool are_bindings_permitted() const { return bound_.are_permitted(); }
    /// Ends the bindings that are not.
    void drop_forbidden_bindings() { bound_.drop_forbidden(); }

  private:
    static constexpr std::size_t max_frame = 64; // around a reply: "id=7 " and the closing characters

    void serve(const protocol::request_line& request, time_point arrived, time_point now);
    [[gnu::cold]] void serve_traced(const protocol::request_line& request, time_point arrived, time_point now);
    void serve_admitted(const protocol::request_line& request, time_point arrived, time_point now);
    [[gnu::cold]] void serve_cancel(const protocol::request_line& request, std::uint64_t id);
    void serve_locally(const protocol::request_line& request, time_point due, time_point now);
    void keep(const protocol::request_line& request, const std::shared_ptr<call>& c);
    void forget(const call& c);

    /// Whether the reply has to wait for its turn.
    [[nodiscard]] bool must_wait(reply_target where) const noexcept {
        return where.id == 0 && where.wanted && ordered_.must_wait();
    }
    [[gnu::cold]] void refuse_in_turn(reply_target where, const protocol::failure& why);
    [[gnu::cold]] void withdraw(std::uint64_t id);
    /// The peer has broken the protocol: it gets what has been written, and then the link ends.
    [[gnu::cold]] void break_off();
    void finish_if_done();

    // task_sink
    void write_result(task_execution& task) override;
    void refuse(const task_execution& task, const protocol::failure& why) override;
    void keep(const task_execution& task, const std::shared_ptr<call>& c) override { keep(task.line(), c); }
    void answer(const call& c, std::string_view json) override;
    void refuse(const call& c, const protocol::failure& why) override;
    [[nodiscard]] bool can_answer(std::size_t bytes) override { return out_.reserve(bytes + max_frame); }
    bool report(const call& c, double fraction, std::string_view json) override;
    [[nodiscard]] std::string_view peer_address() const noexcept override { return peer_.address; }

    std::shared_ptr<node_state> node_;
    line_sink& out_;
    const identity& peer_;
    boost::unordered_flat_map<std::uint64_t, std::shared_ptr<call>> calls_;
    std::shared_ptr<memory_account> memory_; // null: not counted
    ordered_requests ordered_;               // those without an id
    reply_writer replies_;
    std::optional<dedup> seen_; // only over datagrams
    bind_requests bound_;
    std::string decoded_;  // scratch space for the parameters of the noun being served
    bool ending_ = false;  // the peer sends no more, or its input is no longer read
    bool closing_ = false; // the link ends even if bindings remain
    bool finished_ = false;
    bool refuses_new_requests_ = false; // this node shuts down
    bool lost_ = false;                 // the link is gone
};

} // namespace cles::core
