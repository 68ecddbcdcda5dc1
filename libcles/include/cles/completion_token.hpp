// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>

#include <boost/asio/async_result.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/system/error_code.hpp>
#include <boost/version.hpp>

#include <cstdint>
#include <exception>
#include <tuple>
#include <type_traits>
#include <utility>

/// How completion tokens report failures. Not for applications.

namespace boost::asio {
template <typename Allocator>
class use_future_t;
class deferred_t;
template <typename T, typename Executor>
class executor_binder;
template <typename T, typename Allocator>
class allocator_binder;
template <typename T, typename CancellationSlot>
class cancellation_slot_binder;
template <typename T, typename Executor>
class immediate_executor_binder;
template <typename CompletionToken, typename... Values>
class append_t;
template <typename CompletionToken, typename... Values>
class consign_t;
template <typename T>
struct is_deferred;
} // namespace boost::asio

namespace cles::detail {

enum class outcome : std::uint8_t {
    code,      ///< the handler takes an error code
    exception, ///< the handler takes an exception with the peer's message
    later,     ///< not known yet: the operation starts later, with another token
};

/// Token adapters that pass results on unchanged have the outcome of their inner token. All others, such as `as_tuple`,
/// `redirect_error` and functions, have `code`.
template <class Token>
inline constexpr outcome outcome_of = outcome::code;
template <class E>
inline constexpr outcome outcome_of<boost::asio::use_awaitable_t<E>> = outcome::exception;
template <class A>
inline constexpr outcome outcome_of<boost::asio::use_future_t<A>> = outcome::exception;
template <>
inline constexpr outcome outcome_of<boost::asio::deferred_t> = outcome::later;
template <class T, class E>
inline constexpr outcome outcome_of<boost::asio::executor_binder<T, E>> = outcome_of<T>;
template <class T, class A>
inline constexpr outcome outcome_of<boost::asio::allocator_binder<T, A>> = outcome_of<T>;
template <class T, class S>
inline constexpr outcome outcome_of<boost::asio::cancellation_slot_binder<T, S>> = outcome_of<T>;
template <class T, class E>
inline constexpr outcome outcome_of<boost::asio::immediate_executor_binder<T, E>> = outcome_of<T>;
template <class T, class... V>
inline constexpr outcome outcome_of<boost::asio::append_t<T, V...>> = outcome_of<T>;
template <class T, class... V>
inline constexpr outcome outcome_of<boost::asio::consign_t<T, V...>> = outcome_of<T>;

template <class Token>
inline constexpr bool throws = outcome_of<Token> == outcome::exception;

template <class Token>
inline constexpr bool is_default_token = std::is_same_v<std::remove_cvref_t<Token>, boost::asio::use_awaitable_t<>>;

/// The return type of the completion signature for `deferred`. It selects the specialisation of `async_result` below,
/// which returns a `deferred_operation`.
struct put_off;

template <outcome Outcome, class... T>
struct signature {
    using type = void(boost::system::error_code, T...);
};
template <class... T>
struct signature<outcome::exception, T...> {
    using type = void(std::exception_ptr, T...);
};
template <class... T>
struct signature<outcome::later, T...> {
    using type = put_off(boost::system::error_code, T...);
};
template <class Token, class... T>
using signature_for = typename signature<outcome_of<std::remove_cvref_t<Token>>, T...>::type;

/// Whether the result of a call with this token can be awaited directly.
template <class Token>
inline constexpr bool is_awaited = false;
template <class E>
inline constexpr bool is_awaited<boost::asio::use_awaitable_t<E>> = true;
template <>
inline constexpr bool is_awaited<boost::asio::deferred_t> = true;
template <template <class, class...> class Wrapper, class Token, class... More>
inline constexpr bool is_awaited<Wrapper<Token, More...>> = is_awaited<Token>;

/// Whether the arguments after a body make a call that is awaited: by the last one as its token, or by the default
/// token.
template <class... Rest>
struct awaited_call : std::true_type {};
template <class Last>
struct awaited_call<Last> : std::bool_constant<is_awaited<std::remove_cvref_t<Last>> ||
                                               std::is_base_of_v<call_options, std::remove_cvref_t<Last>>> {};
template <class First, class Second>
struct awaited_call<First, Second> : awaited_call<Second> {};

/// A temporary that g++ 12 destroys twice in an expression with `co_await`.
template <class T>
concept fragile_temporary = !std::is_reference_v<T> && std::is_aggregate_v<T> && !std::is_trivially_destructible_v<T>;

// -- operations that are started later --------------------------------------------------------------------------------

/// Wraps a handler that takes an exception for an operation that was created for an error code.
template <class Handler>
struct throwing_handler {
    Handler handler;

    template <class... A>
    void operator()(std::exception_ptr thrown, A&&... values) {
        std::move(handler)(std::move(thrown), std::forward<A>(values)...);
    }
};
template <class Handler>
inline constexpr bool takes_exception = false;
template <class Handler>
inline constexpr bool takes_exception<throwing_handler<Handler>> = true;
template <template <class, class...> class Wrapper, class Handler, class... More>
inline constexpr bool takes_exception<Wrapper<Handler, More...>> = takes_exception<Handler>;

template <class Initiation>
struct throwing_initiation {
    Initiation initiation;

    template <class Handler, class... A>
    void operator()(Handler&& handler, A&&... arguments) {
        std::move(initiation)(throwing_handler<std::decay_t<Handler>>{std::forward<Handler>(handler)},
                              std::forward<A>(arguments)...);
    }
};

template <class... T>
struct results {};

/// The result of a call with `asio::deferred`. Started with another token, it behaves as if the call had been made with
/// that token.
template <class Results, class Initiation, class... A>
class deferred_operation;

template <class... T, class Initiation, class... A>
class [[nodiscard]] deferred_operation<results<T...>, Initiation, A...> {
  public:
    template <class I, class... B>
    explicit deferred_operation(I&& initiation, std::tuple<B...> arguments)
        : initiation_(std::forward<I>(initiation)), arguments_(std::move(arguments)) {}

    template <class Token>
        requires(boost::asio::completion_token_for<Token, signature_for<Token, T...>>)
    decltype(auto) operator()(Token&& token) && {
        return begin<Token>(std::move(initiation_), std::move(arguments_), token);
    }
    template <class Token>
        requires(boost::asio::completion_token_for<Token, signature_for<Token, T...>>)
    decltype(auto) operator()(Token&& token) const& {
        return begin<Token>(Initiation{initiation_}, std::tuple<A...>{arguments_}, token);
    }

  private:
    template <class Token>
    static decltype(auto) begin(Initiation initiation, std::tuple<A...> arguments,
                                std::remove_reference_t<Token>& token) {
        return std::apply(
            [&](A&... a) -> decltype(auto) {
                using chosen = signature_for<Token, T...>;
                if constexpr (throws<std::remove_cvref_t<Token>>) {
                    return boost::asio::async_initiate<Token, chosen>(
                        throwing_initiation<Initiation>{std::move(initiation)}, token, std::move(a)...);
                } else {
                    return boost::asio::async_initiate<Token, chosen>(std::move(initiation), token, std::move(a)...);
                }
            },
            arguments);
    }

    Initiation initiation_;
    std::tuple<A...> arguments_;
};

template <class... T>
struct only {
    using type = std::tuple<T...>;
};
template <class T>
struct only<T> {
    using type = T;
};
template <>
struct only<> {
    using type = void;
};

} // namespace cles::detail

namespace boost::asio {

template <typename... T>
class async_result<deferred_t, cles::detail::put_off(boost::system::error_code, T...)> {
  public:
    using return_type = void; // not the type that is returned, but Asio's binders require it

    template <typename Initiation, typename Token, typename... A>
    static auto initiate(Initiation&& initiation, Token&&, A&&... arguments) {
        using operation =
            cles::detail::deferred_operation<cles::detail::results<T...>, std::decay_t<Initiation>, std::decay_t<A>...>;
        return operation{std::forward<Initiation>(initiation),
                         std::tuple<std::decay_t<A>...>{std::forward<A>(arguments)...}};
    }
};

template <typename Results, typename Initiation, typename... A>
struct is_deferred<cles::detail::deferred_operation<Results, Initiation, A...>> : std::true_type {};

template <template <typename, typename> class Associator, typename Handler, typename Default>
struct associator<Associator, cles::detail::throwing_handler<Handler>, Default> : Associator<Handler, Default> {
    static auto get(const cles::detail::throwing_handler<Handler>& h) noexcept {
        return Associator<Handler, Default>::get(h.handler);
    }
    static auto get(const cles::detail::throwing_handler<Handler>& h, const Default& otherwise) noexcept {
        return Associator<Handler, Default>::get(h.handler, otherwise);
    }
};

// `co_await` of a deferred operation would throw the bare error code. The only way to change that is this template of
// Asio's, which is unchanged since 1.81. If a later version changes it, the code is thrown without the peer's message.
#if BOOST_VERSION < 108900
namespace detail {
template <typename Signature, typename... T, typename Initiation, typename... A, typename Executor>
class awaitable_async_op<Signature, cles::detail::deferred_operation<cles::detail::results<T...>, Initiation, A...>,
                         Executor> : public awaitable<typename cles::detail::only<T...>::type, Executor> {
  public:
    template <typename Operation, typename... More>
    awaitable_async_op(Operation&& op, awaitable_frame_base<Executor>*, const More&...)
        : awaitable<typename cles::detail::only<T...>::type, Executor>(
              std::forward<Operation>(op)(use_awaitable_t<Executor>{})) {}
};
} // namespace detail
#endif

} // namespace boost::asio
