// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>

#include "node/base/deadlines.hpp"
#include "node/base/memory_budget.hpp"
#include "node/node_state.hpp"
#include "node/session/task_execution.hpp"
#include "node/sharing/movable_request.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// A request whose handler replies later.
///
/// The first of these ends it: the handler's reply, the deadline, a cancellation, the loss of its link. Unless it was
/// the reply, the handler is then told to stop, and anything it still reports is ignored. The call counts as running
/// until the handler has released it.
class call final : public deadline, public std::enable_shared_from_this<call> {
  public:
    struct publication {
        std::string path;
        std::string body;
    };
    struct terms : protocol::carried_adverbs {
        /// Those that the request line states.
        explicit terms(const protocol::request_line& r)
            : carried_adverbs(r.carried()), verb(r.verb), id(r.id), wants_reply(r.wants_reply),
              wants_progress(r.wants_progress) {}

        cles::verb verb;
        std::uint64_t id;
        bool wants_reply;
        bool wants_progress;
        bool routed = false;   ///< other nodes serve it
        std::string grantee{}; ///< the node that has forwarded it on a valid grant of this one; empty: none
        std::unique_ptr<const publication> to_publish; ///< when the handler replies
    };

    /// For `begin`.
    call(std::shared_ptr<node_state> host, task_sink& owner, terms wanted, std::shared_ptr<memory_account> memory,
         time_point started);
    ~call();

    /// A call that fails at `due`. Reserves memory in `memory` (null: not counted) for the call and `text` bytes of its
    /// request, until the handler releases the call. Null if there is none.
    static std::shared_ptr<call> begin(const std::shared_ptr<node_state>& host, task_sink& owner, terms wanted,
                                       const std::shared_ptr<memory_account>& memory, std::size_t text, time_point due,
                                       time_point now);

    /// The result. A request to publish publishes its body first; if that throws, the call fails.
    void done(std::string_view json);
    [[gnu::cold]] void fail(protocol::failure why);
    /// Fails it, and notifies the handler that nobody waits.
    [[gnu::cold]] void abort(protocol::failure why);
    /// Returns false if nobody waits for progress (any more).
    bool progress(double fraction, std::string_view json);
    /// `callback` runs once, if anything but the handler ends the call; at once if that has happened.
    void on_stop(std::function<void()> callback);
    /// Removes and returns the `on_stop` callback.
    std::function<void()> forget_on_stop() noexcept { return std::exchange(on_stop_, nullptr); }
    /// For `responder::record_times`.
    void record_times(std::chrono::nanoseconds queued, std::chrono::nanoseconds ran);
    /// Logs a handler's message with the request's id and, until the call ends, the peer's address.
    [[gnu::cold]] void write_log(log_level level, std::string_view text) const;
    /// Reserves this much more memory until the handler releases the call. False if there is none.
    [[nodiscard]] bool hold_more(std::size_t bytes) noexcept { return held_.try_resize(held_.size() + bytes); }
    /// Whether there is memory for a reply of this size to wait for the peer.
    [[nodiscard]] bool can_answer(std::size_t bytes) { return owner_ != nullptr && owner_->can_answer(bytes); }
    [[nodiscard]] bool ended() const noexcept { return owner_ == nullptr; }
    [[nodiscard]] bool stopped() const noexcept { return stopped_; }

    [[nodiscard]] const terms& wanted() const noexcept { return terms_; }
    [[nodiscard]] time_point started() const noexcept { return started_; }
    /// The greatest fraction that the handler has reported, whether or not the requester wants reports.
    [[nodiscard]] double reported() const noexcept { return reported_; }
    /// Its number in the list of the node's jobs; 0: it is not listed.
    [[nodiscard]] std::uint64_t job() const noexcept { return job_; }
    void list_as(std::uint64_t number) noexcept { job_ = number; }
    /// Adverbs that precede the result, in wire format.
    void set_head(std::string adverbs) { head_ = std::move(adverbs); }
    [[nodiscard]] const std::string& head() const noexcept { return head_; }

    /// What is needed to move it to another node; null if it stays.
    [[nodiscard]] const movable_request* movable() const noexcept { return movable_ ? &*movable_ : nullptr; }
    void set_movable(std::optional<movable_request> how) { movable_ = std::move(how); }
    /// Another node serves it from now on; or it does not after all.
    void leave_to_others() noexcept;
    void take_back() noexcept;

    [[nodiscard]] const std::shared_ptr<node_state>& host() const noexcept { return node_; }
    /// The account in which memory is reserved; null if it is not counted.
    [[nodiscard]] const std::shared_ptr<memory_account>& memory() const noexcept { return held_.account(); }

    // For the owner.
    /// Ends the call: anything the handler still reports is ignored.
    void detach() noexcept;
    /// Notifies the handler that nobody waits.
    [[gnu::cold]] void stop();

  private:
    task_sink& end();
    [[gnu::cold]] void on_deadline(time_point now) override;

    std::shared_ptr<node_state> node_; // the handler may outlive the service
    task_sink* owner_;
    terms terms_;
    time_point started_;
    memory_reservation held_; // declared after the node, which owns the account
    double reported_ = 0;
    std::string head_;
    std::function<void()> on_stop_;
    std::optional<movable_request> movable_;
    std::uint64_t job_ = 0;
    bool stopped_ = false;
    bool times_recorded_ = false;
};

/// Whether the handler may have run: `busy` without `ran` promises that it has not.
[[nodiscard]] inline bool may_have_started(const protocol::failure& why) noexcept {
    return why.code != errc::busy || why.ran;
}

} // namespace cles::core
