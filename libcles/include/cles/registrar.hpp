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
#include <vector>

namespace cles {

/// A plain handler writes its result and returns, or throws. It runs inline, without allocation.
using plain_handler = std::function<void(const request&, json_writer&)>;
/// A handler that replies later.
using async_handler = std::function<void(const request&, responder)>;

namespace detail {

/// Calls a plain handler.
/// \throws what it throws, and cles::error with `conversion` if nobody could read its result
inline void run_plain(const plain_handler& handler, const request& r, json_writer& w) {
    handler(r, w);
    require_readable(w);
}

} // namespace detail

/// A task and its handler. At most one of the two handlers is set; none for a task that is only bound.
struct registration {
    cles::verb verb = verb::pull;
    std::string task{};
    task_info info{};
    plain_handler plain{};
    async_handler async{};
    bool coroutine = false; ///< whether `async` runs a coroutine, which needs the service's executor
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

/// Makes a handler that takes the parameters of a request one that takes the request.
template <class F>
auto read_parameters(F f) {
    return [f = std::move(f)](const request& r) mutable {
        std::vector<std::string> parameters(r.parameters().begin(), r.parameters().end());
        if constexpr (handler_shape<F>::takes_request) {
            return f(r, std::move(parameters));
        } else {
            return f(std::move(parameters));
        }
    };
}

/// Runs handlers that are coroutines; defined in `<cles/coroutine_handler.hpp>`, which `<cles/service.hpp>` includes.
template <class F>
struct coroutine_handler;

/// Makes a function object copyable, as `std::function` requires.
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

/// The handler of a registration.
struct handler_functions {
    plain_handler plain{};
    async_handler async{};
    bool coroutine = false;
};

template <class F>
void set_handler(handler_functions& to, F f) {
    using shape = handler_shape<F>;
    if constexpr (shape::is_coroutine) {
        constexpr bool included = requires { sizeof(coroutine_handler<F>); };
        static_assert(included, "a handler that is a coroutine needs #include <cles/coroutine_handler.hpp>");
        if constexpr (included) {
            to.coroutine = true;
            to.async = coroutine_handler<F>{std::make_shared<F>(std::move(f))};
        }
    } else if constexpr (shape::takes_responder) {
        to.async = detail::copyable(std::move(f));
    } else if constexpr (std::is_void_v<typename shape::result>) {
        to.plain = detail::copyable(
            [f = std::move(f)](const request& r, json_writer&) mutable { detail::invoke_handler(f, r); });
    } else {
        to.plain = detail::copyable([f = std::move(f)](const request& r, json_writer& w) mutable {
            detail::write_content(w, detail::invoke_handler(f, r));
        });
    }
}

} // namespace detail

/// Registers tasks: the paper's `register<Verb>Function` (Listing 1.1). Implemented by the service, by the host of a
/// plugin and by tests, so one `void register_tasks(cles::registrar&)` works for all three.
///
/// A handler takes `()`, `(request)`, `(body)`, `(request, body)` or `(request, responder)`, where the body is any type
/// that `<cles/convert.hpp>` reads. PULL and BIND have no body: there a `std::vector<std::string>` in its place is the
/// request's parameters, and other types do not compile. It returns nothing, a value that `<cles/convert.hpp>` writes,
/// or `asio::awaitable` of either. It may be move-only. A plain function runs inline, between two lines of the link,
/// and should be quick; a coroutine may wait (include `<cles/coroutine_handler.hpp>`, or `<cles/service.hpp>`). A
/// handler that takes a responder replies through it; it may also be an `awaitable<void>`. If the body does not fit,
/// the reply is `bad_request`, and the handler does not run. An exception from the handler becomes the reply: a
/// `cles::error` with its code, anything else `failed`.
///
/// In a plugin, handlers (including those of BIND) run on threads of a pool, several at a time, unless the task is
/// `inline_ok`. Coroutines are refused there, because they need the executor of an application.
///
/// \throws cles::error from every function: `invalid_name`, `already_registered`
class registrar {
  public:
    registrar() = default;
    registrar(const registrar&) = delete;
    registrar& operator=(const registrar&) = delete;
    virtual ~registrar() = default;

    virtual void add(registration task) = 0;
    /// Returns a publisher for tasks that publish. It may be kept, and used on any thread.
    [[nodiscard]] virtual publisher make_publisher() = 0;

    template <class F>
    void on_pull(std::string_view task, F handler, task_info info = {}) {
        add_handler<verb::pull>(task, std::move(handler), info);
    }
    template <class F>
    void on_push(std::string_view task, F handler, task_info info = {}) {
        add_handler<verb::push>(task, std::move(handler), info);
    }
    template <class F>
    void on_delegate(std::string_view task, F handler, task_info info = {}) {
        add_handler<verb::delegate>(task, std::move(handler), info);
    }
    /// Runs when a node asks this one to publish (an UPDATE request); the body is published afterwards. Also opens the
    /// task for BIND.
    template <class F>
    void on_update(std::string_view task, F handler, task_info info = {}) {
        add_handler<verb::update>(task, std::move(handler), info);
    }
    /// Opens a task for BIND before its first update.
    void on_bind(std::string_view task, task_info info = {});
    /// Opens a task for BIND. The plain function runs at each BIND and may refuse it by throwing, for example because
    /// of an unknown parameter. Its return value is ignored.
    template <class F>
    void on_bind(std::string_view task, F handler, task_info info = {}) {
        add_handler<verb::bind>(task, std::move(handler), info);
    }

  private:
    /// Registers a task; takes `info` and `functions`.
    void add_task(cles::verb verb, std::string_view task, task_info& info, detail::handler_functions& functions);

    template <cles::verb Verb, class F>
    void add_handler(std::string_view task, F handler, task_info& info) {
        if constexpr (detail::fits_handler<Verb, F>()) {
            detail::handler_functions functions;
            if constexpr (!detail::has_body(Verb) && detail::handler_shape<F>::takes_texts) {
                detail::set_handler(functions, detail::read_parameters(std::move(handler)));
            } else {
                detail::set_handler(functions, std::move(handler));
            }
            add_task(Verb, task, info, functions);
        }
    }
};

} // namespace cles
