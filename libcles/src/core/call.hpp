// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/log.hpp>
#include <cles/verb.hpp>

#include "core/deadlines.hpp"
#include "core/memory_budget.hpp"
#include "protocol/message.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

class call;
struct node;

/// Whom a call answers to: what serves the link that its request came by.
class call_owner {
  public:
    call_owner() = default;
    call_owner(const call_owner&) = delete;
    call_owner& operator=(const call_owner&) = delete;
    /// The call has its result, or has failed; it is let go of.
    virtual void answer(call& c, std::string_view json) = 0;
    virtual void refuse(call& c, const protocol::failure& why) = 0;
    /// How far it is; never less than before.
    virtual void report(call& c, double fraction, std::string_view json) = 0;
    /// Whether the memory of the node allows an answer of so many bytes.
    [[nodiscard]] virtual bool can_answer(std::size_t /*bytes*/) { return true; }
    /// Who asked, as a URL; empty where it was this node itself.
    [[nodiscard]] virtual std::string_view peer_address() const noexcept { return {}; }

  protected:
    ~call_owner() = default;
};

/// A request whose handler answers later.
///
/// Whatever ends it first counts: the handler's answer, the deadline, a withdrawal, the loss of its link. After that
/// the handler is told to stop, and what it still says is ignored. It counts as running until the handler has let go of
/// it.
class call final : public deadline, public std::enable_shared_from_this<call> {
  public:
    struct terms {
        cles::verb verb = verb::pull;
        std::uint64_t id = 0;
        bool wants_reply = true;
        bool wants_progress = false;
        bool urgent = false;
        bool routed = false;        ///< other nodes answer it
        std::string publish_path{}; ///< of a request to publish: where
        std::string publish_body{};
    };

    /// What a request wants, as far as its line says.
    static terms terms_of(const protocol::request_line& r);

    call(std::shared_ptr<node> host, call_owner& owner, terms wanted, time_point started);
    ~call();

    void done(std::string_view json);
    void fail(protocol::failure why);
    /// False where nobody listens (any more).
    bool progress(double fraction, std::string_view json);
    /// Runs once when the call is ended by anything but the handler; at once where it has been.
    void on_stop(std::function<void()> callback);
    /// Takes back what `on_stop` was given.
    std::function<void()> forget_on_stop() noexcept { return std::exchange(on_stop_, nullptr); }
    /// The handler's words for the log, with the request's id, and the peer while it waits.
    void say(log_level level, std::string_view text) const;
    /// Holds the memory that its request and itself take, until its handler lets go of it. False where there is none.
    [[nodiscard]] bool hold(const std::shared_ptr<memory_account>& memory, std::size_t text);
    /// Whether so many bytes more may be held for it; they are from then on.
    [[nodiscard]] bool hold_more(std::size_t bytes) noexcept { return held_.try_resize(held_.size() + bytes); }
    /// Whether an answer of so many bytes may wait for the peer.
    [[nodiscard]] bool can_answer(std::size_t bytes) { return owner_ != nullptr && owner_->can_answer(bytes); }
    [[nodiscard]] bool ended() const noexcept { return owner_ == nullptr; }
    [[nodiscard]] bool stopped() const noexcept { return stopped_; }

    [[nodiscard]] const terms& wanted() const noexcept { return terms_; }
    /// Adverbs that stand before its result, as they stand on the wire.
    void set_head(std::string adverbs) { head_ = std::move(adverbs); }
    [[nodiscard]] const std::string& head() const noexcept { return head_; }
    [[nodiscard]] time_point started() const noexcept { return started_; }

    [[nodiscard]] const std::shared_ptr<node>& host() const noexcept { return node_; }

    // For its owner.
    /// Cuts it off: nothing it says is heard any more.
    void detach() noexcept;
    /// Tells the handler that nobody waits.
    void stop();

  private:
    void on_deadline(time_point now) override;

    std::shared_ptr<node> node_; // the handler may outlive the service
    call_owner* owner_;
    terms terms_;
    time_point started_;
    memory_reservation held_; // after the node, which it is of
    double reported_ = 0;
    std::string head_;
    std::function<void()> on_stop_;
    bool stopped_ = false;
};

} // namespace cles::core
