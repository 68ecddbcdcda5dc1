// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/asio_error.hpp>
#include <cles/cancellation.hpp>
#include <cles/completion_token.hpp>
#include <cles/error.hpp>
#include <cles/pending.hpp>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/associated_allocator.hpp>
#include <boost/asio/associated_executor.hpp>

#include <exception>
#include <memory>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>

/// Storage and invocation of completion handlers. Not for applications.
///
/// Every program instantiates these templates for each operation and handler type. So they contain only code that
/// depends on those types; the rest is compiled in the library.

namespace cles::detail {

/// A handler call that is queued on the handler's own executor. `call` and `discard` destroy it.
class remote_call {
  public:
    remote_call() = default;
    remote_call(const remote_call&) = delete;
    remote_call& operator=(const remote_call&) = delete;

    virtual void call() = 0;
    virtual void discard() noexcept = 0;

  protected:
    ~remote_call() = default;
};
using remote_call_ptr = operation_ptr<remote_call>;

void dispatch_call(const boost::asio::any_io_executor& executor, remote_call_ptr call);
void post_call(const boost::asio::any_io_executor& executor, remote_call_ptr call);

/// The failure as an exception (`cles::error`); null on success.
std::exception_ptr failure_of(boost::system::error_code code, std::string_view message);

/// The handler's executor, if it is not the service's.
class handler_executor {
  public:
    handler_executor(const boost::asio::any_io_executor& own, const boost::asio::any_io_executor& service);

    /// Whether it is the service's executor, on which completions run anyway.
    [[nodiscard]] bool is_service() const noexcept { return !executor_; }
    /// Whether operations with this handler start, and are cancelled, on another executor than the service's. False for
    /// the system executor (also that of futures), because no operation starts on it.
    [[nodiscard]] bool elsewhere() const noexcept { return elsewhere_; }
    void dispatch(remote_call_ptr call) &&;

  private:
    // Empty if it is the service's. Tracks work: it keeps the handler's execution context running until the handler is
    // called.
    boost::asio::any_io_executor executor_;
    bool elsewhere_ = false;
};

/// Allocates an operation with the handler's associated allocator.
template <class Operation, class Handler, class... A>
Operation* make_operation(Handler handler, A&&... arguments) {
    using allocator_type =
        typename std::allocator_traits<boost::asio::associated_allocator_t<Handler>>::template rebind_alloc<Operation>;
    allocator_type allocator{boost::asio::get_associated_allocator(handler)};
    auto* memory = std::allocator_traits<allocator_type>::allocate(allocator, 1);
    return ::new (static_cast<void*>(memory)) Operation(std::move(handler), std::forward<A>(arguments)...);
}

/// Destroys an operation and frees its memory with the handler's associated allocator.
template <class Operation, class Handler>
void free_operation(Operation* self, const Handler& handler) noexcept {
    typename std::allocator_traits<boost::asio::associated_allocator_t<Handler>>::template rebind_alloc<Operation>
        allocator{boost::asio::get_associated_allocator(handler)};
    std::destroy_at(self);
    std::allocator_traits<decltype(allocator)>::deallocate(allocator, self, 1);
}

/// Releases the slot on the handler's executor, because it is emitted there too.
template <class Handler, class... A>
class handler_call final : public remote_call {
  public:
    template <class... B>
    explicit handler_call(Handler handler, B&&... arguments)
        : handler_(std::move(handler)), arguments_(std::forward<B>(arguments)...) {}

    void call() override {
        auto handler = std::move(handler_);
        auto arguments = std::move(arguments_);
        detail::free_operation(this, handler);
        detail::release_slot(handler);
        std::apply([&handler](A&... a) { std::move(handler)(std::move(a)...); }, arguments);
    }
    void discard() noexcept override {
        const auto handler = std::move(handler_);
        detail::free_operation(this, handler);
    }

  private:
    Handler handler_;
    std::tuple<A...> arguments_;
};

template <class Handler, class... A>
remote_call_ptr make_call(Handler handler, A&&... arguments) {
    return remote_call_ptr{detail::make_operation<handler_call<Handler, std::decay_t<A>...>>(
        std::move(handler), std::forward<A>(arguments)...)};
}

/// Calls a handler on its executor; inline if that is the service's executor.
template <bool Throws, class Handler>
class completion {
  public:
    completion(Handler handler, const boost::asio::any_io_executor& service)
        : handler_(std::move(handler)), executor_(boost::asio::get_associated_executor(handler_, service), service) {}

    [[nodiscard]] const Handler& handler() const noexcept { return handler_; }
    [[nodiscard]] bool elsewhere() const noexcept { return executor_.elsewhere(); }

    template <class... T>
    void operator()(boost::system::error_code code, std::string_view message, T&&... values) && {
        if constexpr (Throws || takes_exception<Handler>) {
            std::move(*this).run(failure_of(code, message), std::forward<T>(values)...);
        } else {
            std::move(*this).run(code, std::forward<T>(values)...);
        }
    }

  private:
    template <class... A>
    void run(A&&... arguments) && {
        if (executor_.is_service()) {
            detail::release_slot(handler_);
            std::move(handler_)(std::forward<A>(arguments)...);
        } else {
            std::move(executor_).dispatch(detail::make_call(std::move(handler_), std::forward<A>(arguments)...));
        }
    }

    Handler handler_;
    handler_executor executor_;
};

/// Completes an operation. Its memory is freed before its handler is called, so that the handler's next operation can
/// reuse it.
template <class Operation, class Completion, class... A>
void end_operation(Operation* self, Completion& kept, boost::system::error_code code, std::string_view message,
                   A&&... values) {
    auto complete = std::move(kept);
    detail::free_operation(self, complete.handler());
    std::move(complete)(code, message, std::forward<A>(values)...);
}

/// Destroys an operation without calling its handler.
template <class Operation, class Completion>
void discard_operation(Operation* self, Completion& kept) noexcept {
    const auto complete = std::move(kept);
    detail::free_operation(self, complete.handler());
}

/// Fails an operation that cannot start; the handler is never called inside this call. A handler without an associated
/// executor runs on `executor`, or on Asio's system executor if `executor` is empty.
template <bool Throws, class Handler, class... T>
void fail_later(Handler handler, const boost::asio::any_io_executor& executor, boost::system::error_code code,
                std::string_view message, T&&... values) {
    const auto own = executor ? boost::asio::any_io_executor{boost::asio::get_associated_executor(handler, executor)}
                              : boost::asio::any_io_executor{boost::asio::get_associated_executor(handler)};
    if constexpr (Throws) {
        post_call(own, detail::make_call(std::move(handler), failure_of(code, message), std::forward<T>(values)...));
    } else {
        post_call(own, detail::make_call(std::move(handler), code, std::forward<T>(values)...));
    }
}

} // namespace cles::detail
