// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/identity.hpp>
#include <cles/json_writer.hpp>
#include <cles/log.hpp>
#include <cles/request.hpp>
#include <cles/verb.hpp>

#include "node/base/deadlines.hpp"
#include "node/base/memory_budget.hpp"
#include "node/node_state.hpp"
#include "node/session/request_checks.hpp"
#include "node/session/task_registry.hpp"
#include "protocol/datagram.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

class call;
struct node_state;

/// Receives the outcome of a call; usually serves the link on which the request arrived. The call has ended by then, so
/// the owner only has to release it.
class call_owner {
  public:
    call_owner() = default;
    call_owner(const call_owner&) = delete;
    call_owner& operator=(const call_owner&) = delete;
    virtual void answer(const call& c, std::string_view json) = 0;
    virtual void refuse(const call& c, const protocol::failure& why) = 0;
    /// `fraction` never decreases. Returns false if nobody waits for progress.
    virtual bool report(const call& c, double fraction, std::string_view json) = 0;
    /// Whether the node has memory for a reply of this size.
    [[nodiscard]] virtual bool can_answer(std::size_t /*bytes*/) { return true; }
    /// The requester's URL; empty if it is this node itself.
    [[nodiscard]] virtual std::string_view peer_address() const noexcept { return {}; }

  protected:
    ~call_owner() = default;
};

/// A request whose handler replies later.
///
/// The first of these ends it: the handler's reply, the deadline, a cancellation, the loss of its link. Unless it was
/// the reply, the handler is then told to stop, and anything it still reports is ignored. The call counts as running
/// until the handler has released it.
class call final : public deadline, public std::enable_shared_from_this<call> {
  public:
    struct terms : protocol::carried_adverbs {
        cles::verb verb = verb::pull;
        std::uint64_t id = 0;
        bool wants_reply = true;
        bool wants_progress = false;
        bool routed = false;        ///< other nodes serve it
        std::string publish_path{}; ///< path of a request to publish; else empty
        std::string publish_body{};
    };

    /// The terms that the request line states.
    static terms terms_of(const protocol::request_line& r);

    call(std::shared_ptr<node_state> host, call_owner& owner, terms wanted, time_point started);
    ~call();

    /// A call that fails at `due`. Reserves memory in `memory` (null: not counted) for the call and `text` bytes of its
    /// request, until the handler releases the call. Null if there is none.
    static std::shared_ptr<call> begin(const std::shared_ptr<node_state>& host, call_owner& owner, terms wanted,
                                       const std::shared_ptr<memory_account>& memory, std::size_t text, time_point due,
                                       time_point now);

    /// The result. A request to publish publishes its body first; if that throws, the call fails.
    void done(std::string_view json);
    void fail(protocol::failure why);
    /// Fails it, and notifies the handler that nobody waits.
    void abort(protocol::failure why);
    /// Returns false if nobody waits for progress (any more).
    bool progress(double fraction, std::string_view json);
    /// `callback` runs once, if anything but the handler ends the call; at once if that has happened.
    void on_stop(std::function<void()> callback);
    /// Removes and returns the `on_stop` callback.
    std::function<void()> forget_on_stop() noexcept { return std::exchange(on_stop_, nullptr); }
    /// Logs a handler's message with the request's id and, until the call ends, the peer's address.
    void write_log(log_level level, std::string_view text) const;
    /// Reserves this much more memory until the handler releases the call. False if there is none.
    [[nodiscard]] bool hold_more(std::size_t bytes) noexcept { return held_.try_resize(held_.size() + bytes); }
    /// Whether there is memory for a reply of this size to wait for the peer.
    [[nodiscard]] bool can_answer(std::size_t bytes) { return owner_ != nullptr && owner_->can_answer(bytes); }
    [[nodiscard]] bool ended() const noexcept { return owner_ == nullptr; }
    [[nodiscard]] bool stopped() const noexcept { return stopped_; }

    [[nodiscard]] const terms& wanted() const noexcept { return terms_; }
    /// Adverbs that precede the result, in wire format.
    void set_head(std::string adverbs) { head_ = std::move(adverbs); }
    [[nodiscard]] const std::string& head() const noexcept { return head_; }
    [[nodiscard]] time_point started() const noexcept { return started_; }

    [[nodiscard]] const std::shared_ptr<node_state>& host() const noexcept { return node_; }
    /// The account in which memory is reserved; null if it is not counted.
    [[nodiscard]] const std::shared_ptr<memory_account>& memory() const noexcept { return held_.account(); }

    // For the owner.
    /// Ends the call: anything the handler still reports is ignored.
    void detach() noexcept;
    /// Notifies the handler that nobody waits.
    void stop();

  private:
    call_owner& end();
    void on_deadline(time_point now) override;

    std::shared_ptr<node_state> node_; // the handler may outlive the service
    call_owner* owner_;
    terms terms_;
    time_point started_;
    memory_reservation held_; // declared after the node, which owns the account
    double reported_ = 0;
    std::string head_;
    std::function<void()> on_stop_;
    bool stopped_ = false;
};

/// Whether the handler may have run: `busy` without `ran` promises that it has not.
[[nodiscard]] bool may_have_started(const protocol::failure& why) noexcept;

} // namespace cles::core
