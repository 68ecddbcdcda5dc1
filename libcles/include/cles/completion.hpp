// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/asio_error.hpp>
#include <cles/cancellation.hpp>
#include <cles/completion_token.hpp>
#include <cles/error.hpp>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/append.hpp>
#include <boost/asio/associated_allocator.hpp>
#include <boost/asio/associated_executor.hpp>
#include <boost/asio/dispatch.hpp>
#include <boost/asio/execution/context.hpp>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/query.hpp>
#include <boost/asio/system_executor.hpp>
#include <boost/asio/use_awaitable.hpp>

#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

/// How an operation's handler is kept and called. Not for applications.

namespace cles::detail {

/// Completes a handler on its executor: in line where that is the service's own, which completions run on already.
template <bool Throws, class Handler>
class completion {
  public:
    using allocator_type = boost::asio::associated_allocator_t<Handler>;

    completion(Handler handler, const boost::asio::any_io_executor& service)
        : handler_(std::move(handler)), service_(service) {
        const boost::asio::any_io_executor executor{boost::asio::get_associated_executor(handler_, service_)};
        if (executor != service_) {
            work_.emplace(executor); // the handler's own context must not run out of work meanwhile
            // The system's, which futures name too, is no place where anything is begun in particular.
            namespace execution = boost::asio::execution;
            elsewhere_ = &boost::asio::query(executor, execution::context) !=
                         &boost::asio::query(boost::asio::system_executor{}, execution::context);
        }
    }

    [[nodiscard]] const Handler& handler() const noexcept { return handler_; }
    /// Whether the handler is called on another executor than the service's. Then its operation is begun, and
    /// withdrawn, from there too, and has to be handed to the service's executor.
    [[nodiscard]] bool elsewhere() const noexcept { return elsewhere_; }

    template <class... T>
    void operator()(boost::system::error_code code, std::string_view message, T&&... values) && {
        if constexpr (Throws || takes_exception<Handler>) {
            auto thrown = code ? std::make_exception_ptr(error(code, std::string{message})) : std::exception_ptr{};
            std::move(*this).run(std::move(thrown), std::forward<T>(values)...);
        } else {
            std::move(*this).run(code, std::forward<T>(values)...);
        }
    }

  private:
    template <class... A>
    void run(A&&... arguments) && {
        const auto executor = boost::asio::get_associated_executor(handler_, service_);
        if (!work_) {
            release_slot(handler_);
            std::move(handler_)(std::forward<A>(arguments)...);
        } else {
            boost::asio::dispatch(executor, boost::asio::append(slot_releasing<Handler>{std::move(handler_)},
                                                                std::forward<A>(arguments)...));
            work_.reset();
        }
    }

    Handler handler_;
    boost::asio::any_io_executor service_;
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

/// Ends an operation: its memory goes before its handler is called, so that the handler's next operation finds it free.
template <class Operation, class Completion, class... A>
void end_operation(Operation* self, Completion& kept, boost::system::error_code code, std::string_view message,
                   A&&... values) {
    auto complete = std::move(kept);
    typename std::allocator_traits<typename Completion::allocator_type>::template rebind_alloc<Operation> allocator{
        boost::asio::get_associated_allocator(complete.handler())};
    std::destroy_at(self);
    std::allocator_traits<decltype(allocator)>::deallocate(allocator, self, 1);
    std::move(complete)(code, message, std::forward<A>(values)...);
}

/// Fails an operation that cannot begin, never inside the call. Without an executor of its own the handler runs on
/// `executor`; where that is none, on Asio's system executor.
template <bool Throws, class Handler, class... T>
void fail_later(Handler handler, boost::asio::any_io_executor executor, boost::system::error_code code,
                std::string_view message, T&&... values) {
    if (!executor) {
        executor = boost::asio::any_io_executor{boost::asio::get_associated_executor(handler)};
    }
    if constexpr (Throws) {
        boost::asio::post(executor, boost::asio::append(std::move(handler),
                                                        std::make_exception_ptr(error(code, std::string{message})),
                                                        std::forward<T>(values)...));
    } else {
        boost::asio::post(executor, boost::asio::append(std::move(handler), code, std::forward<T>(values)...));
    }
}

/// Destroys an operation without calling its handler.
template <class Operation, class Completion>
void discard_operation(Operation* self, Completion& kept) noexcept {
    const auto complete = std::move(kept);
    typename std::allocator_traits<typename Completion::allocator_type>::template rebind_alloc<Operation> allocator{
        boost::asio::get_associated_allocator(complete.handler())};
    std::destroy_at(self);
    std::allocator_traits<decltype(allocator)>::deallocate(allocator, self, 1);
}

} // namespace cles::detail
