// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_shape.hpp>
#include <cles/cancellation.hpp>
#include <cles/completion.hpp>
#include <cles/feed_event.hpp>
#include <cles/pending.hpp>
#include <cles/reply_operation.hpp>

#include <boost/asio/associated_cancellation_slot.hpp>
#include <boost/asio/async_result.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/version.hpp>

#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace cles {

/// An event of a feed.
template <class T>
struct feed_item {
    feed_event kind = feed_event::update;
    T value{};               ///< of `current` and `update`
    std::string publisher{}; ///< the publishing node's name; empty if not known
    std::uint64_t seq = 0;   ///< of `update`: its sequence number in the noun's publications
    std::uint32_t epoch = 0; ///< of what has a `seq`: that of the publisher's run, in which it counts
    std::uint64_t missed = 0;
    std::string text{};

    /// Whether this kind of event has a value.
    [[nodiscard]] bool has_value() const noexcept { return kind == feed_event::current || kind == feed_event::update; }
};

namespace detail {

using event_ptr = operation_ptr<pending_event>;

/// The type-independent part of a feed; implemented by the service.
class feed_control {
  public:
    virtual ~feed_control() = default;
    /// Binds. The operation completes when the publisher has replied; if it fails, the feed is closed.
    virtual void start(pending_ptr bound) = 0;
    /// Closes the feed if the operation of `start` is still pending.
    virtual void cancel_start() = 0;
    /// Delivers the next queued event to the operation, now or when one arrives. Fails if another operation is pending.
    virtual void next(event_ptr operation) = 0;
    /// Cancels this operation if it is still pending.
    virtual void cancel(const pending_event* operation) = 0;
    /// Unbinds.
    virtual void close() = 0;
    [[nodiscard]] virtual const boost::asio::any_io_executor& executor() const = 0;
};

/// The cancellation handler of an `async_next`.
struct next_withdrawal {
    std::weak_ptr<feed_control> feed;
    const pending_event* operation;
    boost::asio::any_io_executor executor; ///< the service's, if the slot is emitted on another

    void operator()() const;
};

/// `control->next`; `hop`: on the service's executor, which is not the caller's.
void begin_next(const std::shared_ptr<feed_control>& control, event_ptr operation, bool hop);
/// Reads an event's body. False if it is not JSON; if it does not fit T, sets `code` and `why` instead.
template <class T>
bool read_body(const raw_event& event, T& value, boost::system::error_code& code, std::string& why) {
    constexpr std::string_view what = "the update";
    if constexpr (std::is_same_v<T, json_text>) {
        value.text = event.body;
        return event.has_json();
    } else if constexpr (comes_wrapped<T>) {
        wrapped<T> carrier{};
        const auto verdict = detail::read_result(event.body, carrier, code, why, what);
        value = std::move(carrier.value);
        return verdict == pending::verdict::completed;
    } else {
        return detail::read_result(event.body, value, code, why, what) == pending::verdict::completed;
    }
}

/// The same, but copies the value if another feed of this type has already read it.
template <class T>
bool read_shared_body(const raw_event& event, T& value, boost::system::error_code& code, std::string& why) {
    if constexpr (shared_reading::keeps<T>) {
        if (event.reading != nullptr) {
            if (const T* known = event.reading->get<T>()) {
                value = *known;
                return true;
            }
            const bool is_json = detail::read_body(event, value, code, why);
            if (is_json && !code) {
                event.reading->put(value);
            }
            return is_json;
        }
    }
    return detail::read_body(event, value, code, why);
}

/// Fills a new item from an event. False if its body is not JSON.
template <class T>
bool fill(const raw_event& event, feed_item<T>& item, boost::system::error_code& code, std::string& why) {
    item.kind = event.kind;
    item.publisher = event.publisher;
    item.seq = event.seq;
    item.epoch = event.epoch;
    item.missed = event.missed;
    if (!event.text.empty()) { // usually it is, and assigning takes longer
        item.text = event.text;
    }
    return !item.has_value() || detail::read_shared_body(event, item.value, code, why);
}

template <class T, bool Throws, class Handler>
class event_operation final : public pending_event {
  public:
    event_operation(Handler handler, const boost::asio::any_io_executor& service)
        : complete_(std::move(handler), service) {}

    bool deliver(const raw_event& event) override {
        feed_item<T> item;
        std::string why;
        boost::system::error_code code;
        if (!detail::fill(event, item, code, why)) {
            return false;
        }
        detail::end_operation(this, complete_, code, why, std::move(item));
        return true;
    }

    void fail(boost::system::error_code code, std::string_view message) override {
        detail::end_operation(this, complete_, code, std::string{message}, feed_item<T>{});
    }

    void discard() noexcept override { detail::discard_operation(this, complete_); }
    [[nodiscard]] bool elsewhere() const noexcept { return complete_.elsewhere(); }

  private:
    completion<Throws, Handler> complete_;
};

/// Where an awaited event is read to.
struct event_target {
    void* value;
    bool (*read)(const raw_event& event, void* value, boost::system::error_code& code, std::string& why);
};

/// Reads an awaited event into an optional `feed_item<T>`. Always into a new item: what is not JSON may have filled the
/// last one in part.
template <class T>
bool read_event(const raw_event& event, void* value, boost::system::error_code& code, std::string& why) {
    return detail::fill(event, static_cast<std::optional<feed_item<T>>*>(value)->emplace(), code, why);
}

/// What an `async_next` needs of its feed, which may be moved or closed before the operation starts.
struct next_source {
    std::shared_ptr<feed_control> control; ///< null if the feed is not open
    boost::asio::any_io_executor fallback; ///< of the feed, if it is not open
    bool elsewhere;
};

inline constexpr std::string_view not_open = "the feed is not open";

/// Starts an `async_next` of an open feed. \tparam Operation made from the handler, the service's executor and the
/// arguments
template <class Operation, class Handler, class... A>
void start_next(const next_source& from, Handler handler, const A&... arguments) {
    const auto& control = from.control;
    const auto slot = boost::asio::get_associated_cancellation_slot(handler);
    auto* operation = detail::make_operation<Operation>(std::move(handler), control->executor(), arguments...);
    const bool hop = from.elsewhere || operation->elsewhere();
    detail::connect_slot(
        slot, next_withdrawal{control, operation, hop ? control->executor() : boost::asio::any_io_executor{}});
    begin_next(control, event_ptr{operation}, hop);
}

/// An `async_next` that a coroutine awaits, as Asio awaits operations. Refers to memory of the coroutine.
struct awaited_next {
    const next_source& from;
    event_target target;

    template <boost::asio::completion_token_for<void(std::exception_ptr)> Token>
    auto operator()(Token&& token) {
        return boost::asio::async_initiate<Token, void(std::exception_ptr)>(
            [this](auto handler) { this->start(std::move(handler)); }, token);
    }

  private:
    template <class Handler>
    void start(Handler handler);
};

/// Awaits an event with the default token; as `reply_coroutine`.
template <class T>
struct next_coroutine {
    static boost::asio::awaitable<feed_item<T>> run(next_source from);
};
template <class T>
boost::asio::awaitable<feed_item<T>> next_coroutine<T>::run(next_source from) {
    std::optional<feed_item<T>> item;
    awaited_next next{from, {std::addressof(item), read_event<T>}};
    co_await std::move(next); // NOLINT(performance-move-const-arg): Asio awaits rvalues
    co_return *std::move(item);
}

// The library contains this, as what service.hpp declares so.
extern template struct next_coroutine<json_text>;

/// Owns a feed's control, for a feed of any type: closes it when destroyed.
class feed_owner {
  public:
    feed_owner() = default;
    feed_owner(std::shared_ptr<feed_control> control, bool elsewhere);
    feed_owner(feed_owner&& other) noexcept;            ///< the other keeps its executor
    feed_owner& operator=(feed_owner&& other) noexcept; ///< closes what it owned
    ~feed_owner() { close(); }

    [[nodiscard]] bool is_open() const noexcept { return control_ != nullptr; }
    [[nodiscard]] next_source source() const;
    void close();
    /// What the feed keeps for its batches, whose type depends on that of the values.
    [[nodiscard]] std::shared_ptr<void>& batch_memory() noexcept { return batch_memory_; }

  private:
    std::shared_ptr<feed_control> control_;
    std::shared_ptr<void> batch_memory_;
    boost::asio::any_io_executor executor_; // kept when the feed is closed
    bool elsewhere_ = false;                // it was passed to a handler on another executor
};

} // namespace detail

template <class T>
class feed;

namespace detail {

/// An `async_bind` operation of a feed of any type.
class binding : public pending {
  public:
    /// Sets the feed's control; called before the operation starts.
    void make_of(std::shared_ptr<feed_control> control) { control_ = std::move(control); }

  protected:
    ~binding() = default;
    std::shared_ptr<feed_control> take_control() noexcept { return std::move(control_); }

  private:
    std::shared_ptr<feed_control> control_;
};
using binding_ptr = operation_ptr<binding>;

/// Completes `async_bind` with the feed.
template <class T, bool Throws, class Handler>
class bind_operation final : public binding {
  public:
    bind_operation(Handler handler, const boost::asio::any_io_executor& service, std::string* diagnostics)
        : complete_(std::move(handler), service), diagnostics_(diagnostics) {}

    verdict offer(std::string_view) override {
        feed<T> bound{feed_owner{take_control(), complete_.elsewhere()}};
        detail::end_operation(this, complete_, {}, {}, std::move(bound));
        return verdict::completed;
    }

    void fail(boost::system::error_code code, std::string_view message) override {
        const std::string text{message};
        if (diagnostics_ != nullptr) {
            *diagnostics_ = text;
        }
        detail::end_operation(this, complete_, code, text, feed<T>{});
    }

    void discard() noexcept override { detail::discard_operation(this, complete_); }
    [[nodiscard]] bool elsewhere() const noexcept { return complete_.elsewhere(); }

  private:
    completion<Throws, Handler> complete_;
    std::string* diagnostics_;
};

/// How batches are fetched; defined in `<cles/feed_batch.hpp>`, of which the compiler's message reminds.
template <class T>
struct needs_feed_batch_hpp;

} // namespace detail

/// A binding from the subscriber's side: it receives the updates of one noun, and changes of the binding's state.
///
/// Events arrive in order. At most `limits::feed` updates wait to be fetched; if more arrive, the oldest are dropped
/// and reported as a gap. When the publisher is lost, the feed reports it once and binds again by itself, with a
/// backoff of 100 ms to 5 s. Destroying the feed unbinds.
///
/// A moved-from feed keeps its executor, on which its `async_next` fails.
///
/// Use it on the executor on which the handler of its `async_bind` was called (the service's, or the handler's own),
/// with one `async_next` at a time. It may outlive the service, and then fails with `stopped`.
template <class T>
class feed {
  public:
    using value_type = T;

    feed() = default;
    explicit feed(detail::feed_owner owner) noexcept : owner_(std::move(owner)) {}

    /// Waits for the next event. An update that does not convert to T fails with `conversion`; the next call continues
    /// with the event after it. Cancellation (terminal, partial or total) does not change the feed. If the feed is not
    /// open, it fails with `closed`; a handler without an associated executor is then called on the service's executor,
    /// or on Asio's system executor if the feed was never bound.
    template <class Token = boost::asio::use_awaitable_t<>>
    auto async_next(Token&& token = {}) {
        if constexpr (!detail::fits_token<Token, feed_item<T>>()) {
            return detail::refuse_call<Token, feed_item<T>>();
        } else if constexpr (detail::is_default_token<Token>) {
            return detail::next_coroutine<T>::run(owner_.source());
        } else {
            return boost::asio::async_initiate<Token, detail::signature_for<Token, feed_item<T>>>(
                [from = owner_.source()](auto handler) {
                    constexpr bool with_exceptions = detail::throws<std::remove_cvref_t<Token>>;
                    if (!from.control) {
                        detail::fail_later<with_exceptions>(std::move(handler), from.fallback, errc::closed,
                                                            detail::not_open, feed_item<T>{});
                        return;
                    }
                    using operation_type = detail::event_operation<T, with_exceptions, decltype(handler)>;
                    detail::start_next<operation_type>(from, std::move(handler));
                },
                token);
        }
    }

    /// As `async_next`, but waits for all events that are there: what one read of a link brings, or what has waited in
    /// the feed. Completes with a `feed_batch<T>`, which is never empty. Where an update does not convert to T, the
    /// batch ends; the next call fails with `conversion`, and the one after it continues. While this waits, events come
    /// in any number, and none is dropped. Include `<cles/feed_batch.hpp>` to call it.
    template <class Token = boost::asio::use_awaitable_t<>>
    auto async_next_batch(Token&& token = {}) {
        return detail::needs_feed_batch_hpp<T>::next(owner_, std::forward<Token>(token));
    }

    /// Unbinds. A pending `async_next` fails with `cancelled`, soon, but never inside this call.
    void close() { owner_.close(); }

    [[nodiscard]] bool is_open() const noexcept { return owner_.is_open(); }

  private:
    detail::feed_owner owner_;
};

} // namespace cles

// The library contains this, so that its users need not compile it. Later versions of Asio than this name the handler
// differently.
#if BOOST_VERSION < 108900
extern template void cles::detail::awaited_next::start(
    boost::asio::detail::awaitable_async_op_handler<void(std::exception_ptr), boost::asio::any_io_executor> handler);
#else
#include <cles/awaited_event.hpp>
#endif
