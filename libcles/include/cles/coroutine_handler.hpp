// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/handler_shape.hpp>
#include <cles/registrar.hpp>
#include <cles/request.hpp>
#include <cles/responder.hpp>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/awaitable.hpp>

#include <exception>
#include <memory>
#include <type_traits>
#include <utility>

/// Handlers that are coroutines. Include this to register such a handler; included by `<cles/service.hpp>`.

namespace cles::detail {

/// Runs the coroutine on the service's executor, and cancels it when the request is cancelled.
void spawn_handler(const responder& answer, boost::asio::awaitable<void> work);

/// Adapts a coroutine handler to `async_handler`. The wrapping coroutine owns the function object and the request,
/// because the handler's own frame may refer to both. An exception from the handler becomes the reply, if there is none
/// yet.
template <class F>
struct coroutine_handler {
    using shape = handler_shape<F>;

    std::shared_ptr<F> function;

    void operator()(const request& r, const responder& answer) const {
        spawn_handler(answer, run(function, r, answer));
    }

  private:
    static boost::asio::awaitable<void> run(std::shared_ptr<F> f, request r, responder answer) {
        try {
            if constexpr (shape::takes_responder) {
                co_await (*f)(r, answer);
            } else if constexpr (std::is_void_v<typename awaited<typename shape::result>::type>) {
                co_await detail::invoke_handler(*f, r);
                answer.done();
            } else {
                const auto value = co_await detail::invoke_handler(*f, r);
                answer.done(value);
            }
        } catch (...) {
            answer.fail(std::current_exception());
        }
    }
};

} // namespace cles::detail
