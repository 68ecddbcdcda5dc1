// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>
#include <cles/pending.hpp>

#include "port/environment.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <boost/system/error_code.hpp>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>

namespace cles::core {

using pending_event_ptr = detail::operation_ptr<detail::pending_event>;

/// An event of a feed that owns its texts.
struct kept_event {
    explicit kept_event(const detail::raw_event& e)
        : kind(e.kind), epoch(e.epoch), body(e.body), publisher(e.publisher), seq(e.seq), missed(e.missed),
          text(e.text) {}

    [[nodiscard]] detail::raw_event view() const noexcept {
        return {.kind = kind,
                .body = body,
                .checked = true,
                .publisher = publisher,
                .seq = seq,
                .epoch = epoch,
                .missed = missed,
                .text = text};
    }

    feed_event kind;
    std::uint32_t epoch;
    std::string body;
    std::string publisher;
    std::uint64_t seq;
    std::uint64_t missed;
    std::string text;
};

/// Ends the operation with this result; with a failure if it cannot be read as JSON, because nothing else would end it.
void end_with(detail::pending_ptr operation, std::string_view json);

/// One pending call of user code: an operation with its outcome, or a callback. It is called once; if it is destroyed
/// instead, it discards the operation, as Asio does when an execution context is destroyed.
class completion {
  public:
    /// Kept until the operation has completed, and destroyed after it.
    using progress_function = std::function<void(double, std::string_view)>;

    struct failure {
        detail::pending_ptr operation;
        boost::system::error_code code;
        std::string why;
        progress_function progress{};
    };
    struct result {
        detail::pending_ptr operation;
        std::string json;
    };
    struct event_failure {
        pending_event_ptr operation;
        boost::system::error_code code;
        std::string why;
    };
    /// The event's body is valid JSON.
    struct event {
        pending_event_ptr operation;
        kept_event what;
    };
    struct callback {
        std::function<void()> function;
    };
    /// An exception of user code, to be rethrown.
    struct thrown {
        std::exception_ptr what;
    };

    template <class Kind>
        requires(!std::is_same_v<std::remove_cvref_t<Kind>, completion>)
    explicit completion(Kind kind) : kind_(std::move(kind)) {}

    void operator()();

  private:
    std::variant<failure, result, event_failure, event, callback, thrown> kind_;
};

/// Calls a node's user code: completion handlers, callbacks, and their destructors.
///
/// A library that calls a handler in the middle of its own work may find, when the handler returns, that it has
/// cancelled the next operation, destroyed the service, or thrown. So completions are put here and called separately,
/// with nothing else of the library on the stack. Their exceptions reach the thread that runs the executor, as with
/// Asio's own operations, and affect nothing else.
///
/// `now` is the exception, for the hot path: a reply or an update that was just read, at a place where no loop over the
/// library's own containers is on the stack. What is thrown there is kept until the line has been processed, so that it
/// does not unwind functions of the library; the code that delivers lines then calls `rethrow`.
class completion_queue {
  public:
    /// Calls a completion after the current task, in the order of the calls. If one throws, the others must still be
    /// called.
    using runner = std::function<void(completion)>;

    /// Without a runner, completions are called at once; for use without an executor.
    explicit completion_queue(runner later = {}) : later_(std::move(later)) {}
    completion_queue(const completion_queue&) = delete;
    completion_queue& operator=(const completion_queue&) = delete;

    /// With a runner, does not call it inside this call.
    void put(completion due);
    void call(std::function<void()> function) { put(completion{completion::callback{std::move(function)}}); }

    // The library's own operations complete inside these calls; a user's are put.
    [[gnu::cold]] void fail(detail::pending_ptr operation, boost::system::error_code code, std::string_view why,
                            completion::progress_function progress = {});
    /// Fails it with the peer's failure; `answer` is its text.
    [[gnu::cold]] void refuse(detail::pending_ptr operation, const protocol::failure& why, std::string_view answer,
                              completion::progress_function progress = {});
    void succeed(detail::pending_ptr operation, std::string_view json);
    [[gnu::cold]] void fail(pending_event_ptr operation, boost::system::error_code code, std::string_view why);
    /// \pre the event's body is valid JSON
    void deliver(pending_event_ptr operation, const detail::raw_event& event);

    /// Calls user code now. Unless the caller keeps it, this may be destroyed, with the node, before the call returns.
    template <class F>
    void now(F&& call_user) {
        try {
            std::forward<F>(call_user)();
        } catch (...) {
            keep(std::current_exception());
        }
    }
    /// Whether an exception of user code waits to be rethrown.
    [[nodiscard]] bool has_thrown() const noexcept { return thrown_ != nullptr; }
    void rethrow() {
        if (thrown_ != nullptr) {
            std::rethrow_exception(std::exchange(thrown_, nullptr));
        }
    }

  private:
    template <class Due>
    void complete(Due due);
    void keep(std::exception_ptr thrown);

    runner later_;
    std::exception_ptr thrown_;
};

/// Calls completions as tasks of the environment, in order and never from inside `put`. One task calls those that wait
/// and those that they put, up to `max_at_once` in all, so that what several of them publish or request is written
/// together.
///
/// While any waits, a further task is always posted. So an exception from one leaves the environment's loop and the
/// others are still called, and one that runs that loop itself gets the others called. If the environment is destroyed
/// before the task runs, the completions are destroyed too: they may own the owner of the queue.
class completion_drain final : public task, public std::enable_shared_from_this<completion_drain> {
  public:
    static constexpr std::size_t max_at_once = 8;

    explicit completion_drain(std::shared_ptr<environment> by) : environment_(std::move(by)) {}

    void put(completion due);
    void run() override;
    [[gnu::cold]] void discard() noexcept override;

  private:
    void post();

    std::shared_ptr<environment> environment_;
    std::deque<completion> due_;
    bool is_posted_ = false;
};

} // namespace cles::core
