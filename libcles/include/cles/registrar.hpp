// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/publisher.hpp>
#include <cles/request.hpp>
#include <cles/responder.hpp>
#include <cles/task_info.hpp>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/callable_traits/args.hpp>
#include <boost/callable_traits/return_type.hpp>

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <tuple>
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

template <class T>
struct awaited {
    static constexpr bool is_awaitable = false;
    using type = T;
};
template <class T, class E>
struct awaited<boost::asio::awaitable<T, E>> {
    static constexpr bool is_awaitable = true;
    using type = T;
};

template <class Tuple>
struct last {
    using type = void;
};
template <class T>
struct last<std::tuple<T>> {
    using type = T;
};
template <class T, class U>
struct last<std::tuple<T, U>> {
    using type = U;
};

/// How a handler wants its arguments: (), (request), (body), (request, body), (request, responder).
template <class F>
struct handler_shape {
    using arguments = boost::callable_traits::args_t<F, std::tuple>;
    using result = boost::callable_traits::return_type_t<F>;
    static constexpr std::size_t arity = std::tuple_size_v<arguments>;
    static_assert(arity <= 2, "a handler takes (), (request), (body), (request, body) or (request, responder)");

    template <std::size_t I>
    using argument = std::remove_cvref_t<std::tuple_element_t<I, arguments>>;

    static constexpr bool takes_request = [] {
        if constexpr (arity > 0) {
            return std::is_same_v<argument<0>, request>;
        } else {
            return false;
        }
    }();
    static constexpr bool takes_responder = [] {
        if constexpr (arity == 2) {
            return std::is_same_v<argument<1>, responder>;
        } else {
            return false;
        }
    }();
    static constexpr bool takes_body = arity > (takes_request ? 1 : 0) && !takes_responder;
    static_assert(arity < 2 || takes_request, "of two arguments the first is the request");
    static_assert(!(takes_body && awaited<result>::is_awaitable && std::is_reference_v<typename last<arguments>::type>),
                  "a coroutine takes its body by value: a reference would dangle once it waits");
};

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

// The coroutine that runs a coroutine handler. It owns the handler's function object and the request, since the
// handler's own frame may refer to both.
template <class F>
boost::asio::awaitable<void> run_handler(std::shared_ptr<F> f, request r, responder answer) {
    using result = typename awaited<typename handler_shape<F>::result>::type;
    try {
        if constexpr (std::is_void_v<result>) {
            co_await invoke_handler(*f, r);
            answer.done();
        } else {
            const auto value = co_await invoke_handler(*f, r);
            answer.done(value);
        }
    } catch (...) {
        answer.fail(std::current_exception());
    }
}

template <class F>
void set_handler(registration& to, F f) {
    using shape = handler_shape<F>;
    using result = typename shape::result;
    if constexpr (shape::takes_responder) {
        to.async = std::move(f);
    } else if constexpr (awaited<result>::is_awaitable) {
        to.coroutine = true;
        to.async = [f = std::make_shared<F>(std::move(f))](const request& r, responder answer) {
            auto signal = std::make_shared<boost::asio::cancellation_signal>();
            answer.on_stop([signal] { signal->emit(boost::asio::cancellation_type::terminal); });
            const auto executor = answer.get_executor();
            // The completion keeps the signal, which must outlive the coroutine.
            boost::asio::co_spawn(executor, run_handler(f, r, std::move(answer)),
                                  boost::asio::bind_cancellation_slot(signal->slot(), [signal](std::exception_ptr) {}));
        };
    } else if constexpr (std::is_void_v<result>) {
        to.plain = [f = std::move(f)](const request& r, json_writer&) mutable { invoke_handler(f, r); };
    } else {
        to.plain = [f = std::move(f)](const request& r, json_writer& w) mutable {
            write_json(w, invoke_handler(f, r));
        };
    }
}

} // namespace detail

/// Where tasks are registered: the paper's `register<Verb>Function` (Listing 1.1). A service is one; so are the host of
/// a plugin and a test, so that one `void register_tasks(cles::registrar&)` serves all three.
///
/// A handler takes `()`, `(request)`, `(body)`, `(request, body)` or `(request, responder)`, the body being any type
/// that
/// `<cles/convert.hpp>` reads, and gives nothing, a value that it writes, or `asio::awaitable` of either. A plain
/// function runs in line, between two lines of the link, and should be quick; a coroutine may wait. A body that does
/// not fit is answered with `bad_request` before the handler runs. What a handler throws becomes the answer:
/// `cles::error` with its code, anything else `failed`.
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
        static_assert(!detail::handler_shape<F>::takes_responder &&
                          !detail::awaited<typename detail::handler_shape<F>::result>::is_awaitable,
                      "a BIND is decided at once: its handler is a plain function");
        add_handler(verb::bind, task, std::move(handler), std::move(info));
    }

  private:
    template <class F>
    void add_handler(cles::verb verb, std::string_view task, F handler, task_info info) {
        registration entry{.verb = verb, .task = std::string{task}, .info = std::move(info)};
        detail::set_handler(entry, std::move(handler));
        add(std::move(entry));
    }
};

} // namespace cles
