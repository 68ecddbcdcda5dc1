// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/cancellation.hpp>
#include <cles/completion.hpp>
#include <cles/feed_event.hpp>
#include <cles/pending.hpp>
#include <cles/reply_operation.hpp>

#include <boost/asio/associated_cancellation_slot.hpp>
#include <boost/asio/async_result.hpp>

#include <cstdint>
#include <memory>
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

/// `control->next`, on the service's executor.
void dispatch_next(std::shared_ptr<feed_control> control, event_ptr operation);
/// `control->close`, on the service's executor.
void dispatch_close(std::shared_ptr<feed_control> control, const boost::asio::any_io_executor& service);

/// Reads an event's body. False if it is not JSON; if it does not fit T, sets `code` and `why` instead.
template <class T>
bool read_body(const raw_event& event, T& value, boost::system::error_code& code, std::string& why) {
    constexpr std::string_view what = "the update";
    if constexpr (std::is_same_v<T, json_text>) {
        value.text = event.body;
        return event.has_json();
    } else if constexpr (comes_wrapped<T>) {
        wrapped<T> carrier{};
        const auto verdict = read_result(event.body, carrier, code, why, what);
        value = std::move(carrier.value);
        return verdict == pending::verdict::completed;
    } else {
        return read_result(event.body, value, code, why, what) == pending::verdict::completed;
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
            const bool is_json = read_body(event, value, code, why);
            if (is_json && !code) {
                event.reading->put(value);
            }
            return is_json;
        }
    }
    return read_body(event, value, code, why);
}

/// Fills the item from an event. False if its body is not JSON.
template <class T>
bool fill(const raw_event& event, feed_item<T>& item, boost::system::error_code& code, std::string& why) {
    item.kind = event.kind;
    item.publisher = event.publisher;
    item.seq = event.seq;
    item.missed = event.missed;
    item.text = event.text;
    return !item.has_value() || read_shared_body(event, item.value, code, why);
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
        if (!fill(event, item, code, why)) {
            return false;
        }
        end_operation(this, complete_, code, why, std::move(item));
        return true;
    }

    void fail(boost::system::error_code code, std::string_view message) override {
        end_operation(this, complete_, code, std::string{message}, feed_item<T>{});
    }

    void discard() noexcept override { discard_operation(this, complete_); }
    [[nodiscard]] bool elsewhere() const noexcept { return complete_.elsewhere(); }

  private:
    completion<Throws, Handler> complete_;
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
        feed<T> bound{take_control(), complete_.elsewhere()};
        end_operation(this, complete_, {}, {}, std::move(bound));
        return verdict::completed;
    }

    void fail(boost::system::error_code code, std::string_view message) override {
        const std::string text{message};
        if (diagnostics_ != nullptr) {
            *diagnostics_ = text;
        }
        end_operation(this, complete_, code, text, feed<T>{});
    }

    void discard() noexcept override { discard_operation(this, complete_); }
    [[nodiscard]] bool elsewhere() const noexcept { return complete_.elsewhere(); }

  private:
    completion<Throws, Handler> complete_;
    std::string* diagnostics_;
};

} // namespace detail

/// A binding from the subscriber's side: it receives the updates of one noun, and changes of the binding's state.
///
/// Events arrive in order. At most `limits::feed` updates wait to be fetched; if more arrive, the oldest are dropped
/// and reported as a gap. When the publisher is lost, the feed reports it once and binds again by itself, with a
/// backoff of 100 ms to 5 s. Destroying the feed unbinds.
///
/// Use it on the executor on which the handler of its `async_bind` was called (the service's, or the handler's own),
/// with one `async_next` at a time. It may outlive the service, and then fails with `stopped`.
template <class T>
class feed {
  public:
    using value_type = T;

    feed() = default;
    explicit feed(std::shared_ptr<detail::feed_control> control, bool elsewhere = false)
        : control_(std::move(control)), executor_(control_->executor()), elsewhere_(elsewhere) {}
    /// A moved-from feed keeps its executor, on which its `async_next` fails.
    feed(feed&& other) noexcept
        // NOLINTNEXTLINE(performance-move-constructor-init)
        : control_(std::move(other.control_)), executor_(other.executor_), elsewhere_(other.elsewhere_) {}
    feed& operator=(feed&& other) noexcept {
        if (this != &other) {
            close();
            control_ = std::move(other.control_);
            executor_ = other.executor_;
            elsewhere_ = other.elsewhere_;
        }
        return *this;
    }
    feed(const feed&) = delete;
    feed& operator=(const feed&) = delete;
    ~feed() { close(); }

    /// Waits for the next event. An update that does not convert to T fails with `conversion`; the next call continues
    /// with the event after it. Cancellation (terminal, partial or total) does not change the feed. If the feed is not
    /// open, it fails with `closed`; a handler without an associated executor is then called on the service's executor,
    /// or on Asio's system executor if the feed was never bound.
    template <class Token = boost::asio::use_awaitable_t<>>
    auto async_next(Token&& token = {}) {
        constexpr bool with_exceptions = detail::throws<std::remove_cvref_t<Token>>;
        return boost::asio::async_initiate<Token, detail::signature_for<Token, feed_item<T>>>(
            [control = control_, elsewhere = elsewhere_,
             fallback = control_ ? boost::asio::any_io_executor{} : executor_](auto handler) {
                if (!control) {
                    detail::fail_later<with_exceptions>(std::move(handler), fallback, errc::closed,
                                                        "the feed is not open", feed_item<T>{});
                    return;
                }
                using operation_type = detail::event_operation<T, with_exceptions, decltype(handler)>;
                const auto slot = boost::asio::get_associated_cancellation_slot(handler);
                auto* operation = detail::make_operation<operation_type>(std::move(handler), control->executor());
                const bool hop = elsewhere || operation->elsewhere();
                detail::connect_slot(
                    slot, detail::next_withdrawal{control, operation,
                                                  hop ? control->executor() : boost::asio::any_io_executor{}});
                if (hop) {
                    detail::dispatch_next(control, detail::event_ptr{operation});
                } else {
                    control->next(detail::event_ptr{operation});
                }
            },
            token);
    }

    /// Unbinds. A pending `async_next` fails with `cancelled`, soon, but never inside this call.
    void close() {
        if (auto control = std::exchange(control_, nullptr)) {
            if (elsewhere_) {
                detail::dispatch_close(std::move(control), executor_);
            } else {
                control->close();
            }
        }
    }

    [[nodiscard]] bool is_open() const noexcept { return control_ != nullptr; }

  private:
    std::shared_ptr<detail::feed_control> control_;
    boost::asio::any_io_executor executor_; // kept when the feed is closed
    bool elsewhere_ = false;                // it was passed to a handler on another executor
};

} // namespace cles
