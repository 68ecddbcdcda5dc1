// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/handler_shape.hpp>
#include <cles/publisher.hpp>
#include <cles/request.hpp>
#include <cles/responder.hpp>
#include <cles/standard.hpp>
#include <cles/task_info.hpp>

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

namespace cles {

/// A plain handler writes its result and returns, or throws. It runs in line, without allocation.
using plain_handler = std::function<void(const request&, json_writer&)>;
/// A handler that answers later.
using async_handler = std::function<void(const request&, responder)>;

/// A task with its handler; of the two handlers, one is set (none: a task that is only to be bound).
struct registration {
    cles::verb verb = verb::pull;
    std::string task{};
    task_info info{};
    plain_handler plain{};
    async_handler async{};
    bool coroutine = false; ///< `async` runs a coroutine, and so needs the service's executor
};

namespace detail {

template <class F>
decltype(auto) invoke_handler(F& f, const request& r) {
    using shape = handler_shape<F>;
    if constexpr (shape::takes_body) {
        using body = typename shape::template argument<shape::arity - 1>;
        if constexpr (shape::takes_request) {
            return f(r, r.as<body>());
        } else {
            return f(r.as<body>());
        }
    } else if constexpr (shape::takes_request) {
        return f(r);
    } else {
        return f();
    }
}

/// Runs handlers that are coroutines; defined in `<cles/coroutine_handler.hpp>`, which `<cles/service.hpp>` includes.
template <class F>
struct coroutine_handler;

/// A function object as `std::function` wants it, which copies.
template <class F>
auto copyable(F f) {
    if constexpr (std::is_copy_constructible_v<F>) {
        return f;
    } else {
        return [f = std::make_shared<F>(std::move(f))](auto&&... arguments) -> decltype(auto) {
            return (*f)(std::forward<decltype(arguments)>(arguments)...);
        };
    }
}

template <class F>
void set_handler(registration& to, F f) {
    using shape = handler_shape<F>;
    if constexpr (shape::is_coroutine) {
        constexpr bool included = requires { sizeof(coroutine_handler<F>); };
        static_assert(included, "a handler that is a coroutine needs #include <cles/coroutine_handler.hpp>");
        if constexpr (included) {
            to.coroutine = true;
            to.async = coroutine_handler<F>{std::make_shared<F>(std::move(f))};
        }
    } else if constexpr (shape::takes_responder) {
        to.async = copyable(std::move(f));
    } else if constexpr (std::is_void_v<typename shape::result>) {
        to.plain = copyable([f = std::move(f)](const request& r, json_writer&) mutable { invoke_handler(f, r); });
    } else {
        to.plain = copyable([f = std::move(f)](const request& r, json_writer& w) mutable {
            write_json(w, invoke_handler(f, r));
            require_utf8(w);
        });
    }
}

} // namespace detail

/// Where tasks are registered: the paper's `register<Verb>Function` (Listing 1.1). A service is one; so are the host of
/// a plugin and a test, so that one `void register_tasks(cles::registrar&)` serves all three.
///
/// A handler takes `()`, `(request)`, `(body)`, `(request, body)` or `(request, responder)`, the body being any type
/// that `<cles/convert.hpp>` reads, and gives nothing, a value that it writes, or `asio::awaitable` of either. It may
/// hold what can only be moved. A plain function runs in line, between two lines of the link, and should be quick; a
/// coroutine may wait (include `<cles/coroutine_handler.hpp>`, which comes with `<cles/service.hpp>`). One that takes a
/// responder answers through it and may be a coroutine too, an `awaitable<void>`. A body that does not fit is answered
/// with `bad_request` before the handler runs. What a handler throws becomes the answer: `cles::error` with its code,
/// anything else `failed`.
///
/// In a plugin, handlers, those of BIND too, run on threads of a pool, several at once, unless the task is `inline_ok`;
/// coroutines, which need the executor of an application, are refused there.
///
/// \throws cles::error from every function: `invalid_name`, `already_registered`
class registrar {
  public:
    registrar() = default;
    registrar(const registrar&) = delete;
    registrar& operator=(const registrar&) = delete;
    virtual ~registrar() = default;

    virtual void add(registration task) = 0;
    /// For tasks that publish: what it returns may be kept, and used on any thread.
    [[nodiscard]] virtual publisher make_publisher() = 0;

    template <class F>
    void on_pull(std::string_view task, F handler, task_info info = {}) {
        add_handler(verb::pull, task, std::move(handler), std::move(info));
    }
    template <class F>
    void on_push(std::string_view task, F handler, task_info info = {}) {
        add_handler(verb::push, task, std::move(handler), std::move(info));
    }
    template <class F>
    void on_delegate(std::string_view task, F handler, task_info info = {}) {
        add_handler(verb::delegate, task, std::move(handler), std::move(info));
    }
    /// Runs when somebody asks this node to publish (an UPDATE request); the body is published after it. Opens the task
    /// for BIND too.
    template <class F>
    void on_update(std::string_view task, F handler, task_info info = {}) {
        add_handler(verb::update, task, std::move(handler), std::move(info));
    }
    /// Opens a task for BIND before its first update.
    void on_bind(std::string_view task, task_info info = {}) {
        add({.verb = verb::bind, .task = std::string{task}, .info = std::move(info)});
    }
    /// Opens a task for BIND; the plain function runs at each BIND and may refuse it by throwing, for example because a
    /// parameter is none that it publishes. What it returns is not used.
    template <class F>
    void on_bind(std::string_view task, F handler, task_info info = {}) {
        if constexpr (detail::one_signature<F>) {
            using shape = detail::handler_shape<F>;
            static_assert(!shape::takes_responder && !shape::is_coroutine,
                          "a BIND is decided at once: its handler is a plain function");
        }
        add_handler(verb::bind, task, std::move(handler), std::move(info));
    }

  private:
    template <class F>
    void add_handler(cles::verb verb, std::string_view task, F handler, task_info info) {
        if constexpr (detail::fits_handler<F>()) {
            registration entry{.verb = verb, .task = std::string{task}, .info = std::move(info)};
            detail::set_handler(entry, std::move(handler));
            add(std::move(entry));
        }
    }
};

} // namespace cles
