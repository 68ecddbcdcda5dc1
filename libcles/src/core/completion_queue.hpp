// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>
#include <cles/pending.hpp>

#include "protocol/message.hpp"

#include <boost/system/error_code.hpp>

#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>

namespace cles::core {

using pending_event_ptr = std::unique_ptr<detail::pending_event, detail::discarding>;

/// An event of a feed with its texts.
struct kept_event {
    explicit kept_event(const detail::raw_event& e)
        : kind(e.kind), body(e.body), publisher(e.publisher), seq(e.seq), missed(e.missed), text(e.text) {}

    [[nodiscard]] detail::raw_event view() const noexcept {
        return {.kind = kind,
                .body = body,
                .checked = true,
                .publisher = publisher,
                .seq = seq,
                .missed = missed,
                .text = text};
    }

    feed_event kind;
    std::string body;
    std::string publisher;
    std::uint64_t seq;
    std::uint64_t missed;
    std::string text;
};

/// One call of the user's code that is due: an operation with its outcome, or a callback. Called once; destroyed
/// without a call it discards the operation, as Asio does when an execution context goes.
class completion {
  public:
    /// Kept until the operation has ended, and destroyed after it.
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
    /// What user code has thrown, to be thrown on.
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

/// Calls the user's code for a node: completion handlers, callbacks, and with them their destructors.
///
/// A library that calls a handler in the middle of its own work finds, when the handler returns, that it has cancelled
/// what was to be told next, destroyed the service, or thrown. So whatever completes is put here, and is called by
/// itself, with nothing of the library below it on the stack but this; what it throws reaches the thread that runs the
/// executor, as with Asio's own operations, and nothing else is affected.
///
/// `now` is the exception, for the hot path: an answer or an update that was just read, at a place where no loop over
/// the library's own containers is on the stack. What is thrown there is kept until the line has been dealt with, so
/// that no function of the library is unwound by it: who hands lines over throws it on, by `rethrow`.
class completion_queue {
  public:
    /// Calls a completion when what runs now has ended, in the order of the calls. What one throws must keep no other
    /// from being called.
    using runner = std::function<void(completion)>;

    /// Without a runner completions are called at once, for those who have no executor.
    explicit completion_queue(runner later = {}) : later_(std::move(later)) {}
    completion_queue(const completion_queue&) = delete;
    completion_queue& operator=(const completion_queue&) = delete;

    /// Not from inside this call.
    void put(completion due);
    void call(std::function<void()> function) { put(completion{completion::callback{std::move(function)}}); }

    // Operations of the library's own, by which it goes on, end inside these calls; a user's are put.
    void fail(detail::pending_ptr operation, boost::system::error_code code, std::string_view why,
              completion::progress_function progress = {});
    /// Fails it as the peer said, in `answer`.
    void refuse(detail::pending_ptr operation, const protocol::failure& why, std::string_view answer,
                completion::progress_function progress = {});
    void succeed(detail::pending_ptr operation, std::string_view json);
    void fail(pending_event_ptr operation, boost::system::error_code code, std::string_view why);
    /// \pre the event's body is valid JSON
    void deliver(pending_event_ptr operation, const detail::raw_event& event);

    /// Calls user code now. This may be gone with the node when it returns, unless the caller keeps it.
    template <class F>
    void now(F&& call_user) {
        try {
            std::forward<F>(call_user)();
        } catch (...) {
            keep(std::current_exception());
        }
    }
    /// Whether something that user code has thrown waits to be thrown on.
    [[nodiscard]] bool has_thrown() const noexcept { return thrown_ != nullptr; }
    void rethrow() {
        if (thrown_ != nullptr) {
            std::rethrow_exception(std::exchange(thrown_, nullptr));
        }
    }

  private:
    void keep(std::exception_ptr thrown);

    runner later_;
    std::exception_ptr thrown_;
};

} // namespace cles::core
