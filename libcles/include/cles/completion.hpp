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
#include <boost/asio/executor_work_guard.hpp>

#include <exception>
#include <memory>
#include <optional>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>

/// How an operation's handler is kept and called. Not for applications.
///
/// Every program instantiates these templates once for each operation and type of handler. So they contain only what
/// depends on those types; what does not is compiled in the library.

namespace cles::detail {

/// A call of a handler that waits for the handler's own executor. `call` and `discard` consume it.
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
using remote_call_ptr = std::unique_ptr<remote_call, discarding>;

void dispatch_call(const boost::asio::any_io_executor& executor, remote_call_ptr call);
void post_call(const boost::asio::any_io_executor& executor, remote_call_ptr call);

/// The exception that carries a failure; null for success.
std::exception_ptr failure_of(boost::system::error_code code, std::string_view message);

/// The executor that a handler is called on, where that is not the service's.
class handler_executor {
  public:
    handler_executor(const boost::asio::any_io_executor& own, const boost::asio::any_io_executor& service);

    /// Whether it is none but the service's, which completions run on already.
    [[nodiscard]] bool is_service() const noexcept { return !work_; }
    /// Whether an operation of this handler begins and is withdrawn on another executor than the service's. The
    /// system's, which futures name too, is not one on which anything begins.
    [[nodiscard]] bool elsewhere() const noexcept { return elsewhere_; }
    void dispatch(remote_call_ptr call) &&;

  private:
    // The handler's own context must not run out of work meanwhile.
    std::optional<boost::asio::executor_work_guard<boost::asio::any_io_executor>> work_;
    bool elsewhere_ = false;
};

/// Makes an operation that lives in memory of its handler's allocator.
template <class Operation, class Handler, class... A>
Operation* make_operation(Handler handler, A&&... arguments) {
    using allocator_type =
        typename std::allocator_traits<boost::asio::associated_allocator_t<Handler>>::template rebind_alloc<Operation>;
    allocator_type allocator{boost::asio::get_associated_allocator(handler)};
    auto* memory = std::allocator_traits<allocator_type>::allocate(allocator, 1);
    return ::new (static_cast<void*>(memory)) Operation(std::move(handler), std::forward<A>(arguments)...);
}

/// Destroys an operation and frees its memory, which came from the allocator of this handler.
template <class Operation, class Handler>
void free_operation(Operation* self, const Handler& handler) noexcept {
    typename std::allocator_traits<boost::asio::associated_allocator_t<Handler>>::template rebind_alloc<Operation>
        allocator{boost::asio::get_associated_allocator(handler)};
    std::destroy_at(self);
    std::allocator_traits<decltype(allocator)>::deallocate(allocator, self, 1);
}

/// The slot is emitted on the handler's executor too, and so is released there.
template <class Handler, class... A>
class handler_call final : public remote_call {
  public:
    template <class... B>
    explicit handler_call(Handler handler, B&&... arguments)
        : handler_(std::move(handler)), arguments_(std::forward<B>(arguments)...) {}

    void call() override {
        auto handler = std::move(handler_);
        auto arguments = std::move(arguments_);
        free_operation(this, handler);
        release_slot(handler);
        std::apply([&handler](A&... a) { std::move(handler)(std::move(a)...); }, arguments);
    }
    void discard() noexcept override {
        const auto handler = std::move(handler_);
        free_operation(this, handler);
    }

  private:
    Handler handler_;
    std::tuple<A...> arguments_;
};

template <class Handler, class... A>
remote_call_ptr make_call(Handler handler, A&&... arguments) {
    return remote_call_ptr{
        make_operation<handler_call<Handler, std::decay_t<A>...>>(std::move(handler), std::forward<A>(arguments)...)};
}

/// Completes a handler on its executor: in line where that is the service's own.
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
            release_slot(handler_);
            std::move(handler_)(std::forward<A>(arguments)...);
        } else {
            std::move(executor_).dispatch(make_call(std::move(handler_), std::forward<A>(arguments)...));
        }
    }

    Handler handler_;
    handler_executor executor_;
};

/// Ends an operation: its memory goes before its handler is called, so that the handler's next operation finds it free.
template <class Operation, class Completion, class... A>
void end_operation(Operation* self, Completion& kept, boost::system::error_code code, std::string_view message,
                   A&&... values) {
    auto complete = std::move(kept);
    free_operation(self, complete.handler());
    std::move(complete)(code, message, std::forward<A>(values)...);
}

/// Destroys an operation without calling its handler.
template <class Operation, class Completion>
void discard_operation(Operation* self, Completion& kept) noexcept {
    const auto complete = std::move(kept);
    free_operation(self, complete.handler());
}

/// Fails an operation that cannot begin, never inside the call. Without an executor of its own the handler runs on
/// `executor`; where that is none, on Asio's system executor.
template <bool Throws, class Handler, class... T>
void fail_later(Handler handler, const boost::asio::any_io_executor& executor, boost::system::error_code code,
                std::string_view message, T&&... values) {
    const auto own = executor ? boost::asio::any_io_executor{boost::asio::get_associated_executor(handler, executor)}
                              : boost::asio::any_io_executor{boost::asio::get_associated_executor(handler)};
    if constexpr (Throws) {
        post_call(own, make_call(std::move(handler), failure_of(code, message), std::forward<T>(values)...));
    } else {
        post_call(own, make_call(std::move(handler), code, std::forward<T>(values)...));
    }
}

} // namespace cles::detail
