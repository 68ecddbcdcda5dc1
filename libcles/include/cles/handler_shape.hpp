// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>
#include <cles/request.hpp>
#include <cles/responder.hpp>
#include <cles/verb.hpp>

#include <cstddef>
#include <string>
#include <tuple>
#include <type_traits>
#include <vector>

/// Arguments and results of handlers, with readable compiler errors for unsuitable ones. Not for applications.

// Coroutine handlers are recognised here; `<cles/coroutine_handler.hpp>` runs them.
namespace boost::asio {
template <typename T, typename Executor>
class awaitable;
} // namespace boost::asio

namespace cles::detail {

/// The argument and result types of a function, or of an object with one call operator.
template <class F>
struct call_signature : call_signature<decltype(&F::operator())> {};
template <class R, class... A, bool NoThrow>
struct call_signature<R (*)(A...) noexcept(NoThrow)> {
    using arguments = std::tuple<A...>;
    using result = R;
};
template <class C, class R, class... A, bool NoThrow>
struct call_signature<R (C::*)(A...) noexcept(NoThrow)> : call_signature<R (*)(A...)> {};
template <class C, class R, class... A, bool NoThrow>
struct call_signature<R (C::*)(A...) const noexcept(NoThrow)> : call_signature<R (*)(A...)> {};
template <class C, class R, class... A, bool NoThrow>
struct call_signature<R (C::*)(A...)& noexcept(NoThrow)> : call_signature<R (*)(A...)> {};
template <class C, class R, class... A, bool NoThrow>
struct call_signature<R (C::*)(A...) const& noexcept(NoThrow)> : call_signature<R (*)(A...)> {};

template <class T>
struct awaited {
    static constexpr bool is_awaitable = false;
    static constexpr bool is_ours = true;
    using type = T;
};
template <class T, class E>
struct awaited<boost::asio::awaitable<T, E>> {
    static constexpr bool is_awaitable = true;
    static constexpr bool is_ours = std::is_same_v<E, boost::asio::any_io_executor>;
    using type = T;
};

/// Requests of these verbs have no body.
constexpr bool has_body(verb v) noexcept { return v != verb::pull && v != verb::bind; }

/// The form of a handler: (), (request), (body), (request, body) or (request, responder).
template <class F>
struct handler_shape {
    using arguments = typename call_signature<F>::arguments;
    using result = typename call_signature<F>::result;
    static constexpr std::size_t arity = std::tuple_size_v<arguments>;

    template <std::size_t I>
    using argument = std::remove_cvref_t<std::tuple_element_t<I, arguments>>;

    template <std::size_t I, class T>
    static constexpr bool takes() {
        if constexpr (I < arity) {
            return std::is_same_v<argument<I>, T>;
        } else {
            return false;
        }
    }
    static constexpr bool takes_request = takes<0, request>();
    static constexpr bool takes_responder = arity == 2 && takes<1, responder>();
    static constexpr bool takes_body = arity > (takes_request ? 1 : 0) && !takes_responder;
    /// Whether what it takes as its body can be the parameters of a request without one.
    static constexpr bool takes_texts = takes_body && takes<arity - 1, std::vector<std::string>>();
    static constexpr bool is_coroutine = awaited<result>::is_awaitable;
};

template <class F>
concept one_signature = (std::is_pointer_v<F> && std::is_function_v<std::remove_pointer_t<F>>) || requires {
    &F::operator();
};

// In a class that inherits two call operators, naming `operator()` is ambiguous.
struct a_call_operator {
    void operator()();
};
template <class F>
struct one_more_call_operator : F, a_call_operator {};
template <class F>
concept callable_somehow = std::is_class_v<F> && !std::is_final_v<F> && !requires {
    &one_more_call_operator<F>::operator();
};

template <class T>
inline constexpr bool lends_mutable = std::is_lvalue_reference_v<T> && !std::is_const_v<std::remove_reference_t<T>>;

/// False, with a compiler error, if a handler cannot have this result type.
template <class Result>
constexpr bool fits_result() {
    using value = std::remove_cvref_t<typename awaited<Result>::type>;
    static_assert(awaited<Result>::is_ours,
                  "a handler's coroutine is a boost::asio::awaitable of the default executor, any_io_executor");
    if constexpr (!awaited<Result>::is_ours || std::is_void_v<value>) {
        return awaited<Result>::is_ours;
    } else {
        static_assert(writable<value>, "the handler's result cannot be written as JSON: describe a struct with "
                                       "BOOST_DESCRIBE_STRUCT, an enum with BOOST_DESCRIBE_ENUM, or specialise "
                                       "cles::converter (see <cles/convert.hpp>)");
        return writable<value>;
    }
}

template <class F>
constexpr bool fits_body() {
    using shape = handler_shape<F>;
    using argument = std::tuple_element_t<shape::arity - 1, typename shape::arguments>;
    using body = std::remove_cvref_t<argument>;
    constexpr bool dangles = shape::is_coroutine && std::is_reference_v<argument>;
    constexpr bool readable_body = readable<body>;
    constexpr bool made_first = std::is_default_constructible_v<body>;
    static_assert(!dangles, "a coroutine takes its body by value, or its parameters: a reference would dangle once it "
                            "waits");
    static_assert(readable_body, "the handler's argument cannot be read from JSON: describe a struct with "
                                 "BOOST_DESCRIBE_STRUCT, an enum with BOOST_DESCRIBE_ENUM, or specialise "
                                 "cles::converter (see <cles/convert.hpp>)");
    static_assert(made_first || !readable_body,
                  "the type of a handler's body needs a default constructor: it is made first, and then read");
    return !dangles && readable_body && made_first;
}

/// False, with a compiler error, if a request of this verb never has what a handler takes, or never gets its result.
template <verb Verb, class F>
constexpr bool fits_verb() {
    using shape = handler_shape<F>;
    constexpr bool has_its_body = !shape::takes_body || shape::takes_texts || has_body(Verb);
    constexpr bool decides_at_once = Verb != verb::bind || (!shape::takes_responder && !shape::is_coroutine);
    static_assert(has_its_body, "PULL and BIND have no body: their handler takes their parameters, as "
                                "std::vector<std::string> or from a const cles::request&");
    static_assert(decides_at_once, "a BIND handler must be a plain function, because it decides at once");
    return has_its_body && decides_at_once;
}

/// False, with a compiler error, if a function object cannot be a handler of this verb.
template <verb Verb, class F>
constexpr bool fits_handler() {
    if constexpr (one_signature<F>) {
        using shape = handler_shape<F>;
        constexpr bool known =
            shape::arity <= 2 && (shape::arity < 2 || shape::takes_request) && !shape::template takes<0, responder>();
        static_assert(known, "a handler takes (), (const cles::request&), (body), (const cles::request&, body) or "
                             "(const cles::request&, cles::responder)");
        if constexpr (known) {
            constexpr bool lends = []<class... A>(std::tuple<A...>*) {
                return (lends_mutable<A> || ...);
            }(static_cast<typename shape::arguments*>(nullptr));
            static_assert(!lends, "a handler takes its arguments by value or by reference to const");
            if constexpr (lends || !fits_verb<Verb, F>()) {
                return false;
            } else if constexpr (shape::takes_responder && shape::is_coroutine) {
                using result = typename awaited<typename shape::result>::type;
                using answer = std::tuple_element_t<1, typename shape::arguments>;
                constexpr bool fits = std::is_void_v<result> && !std::is_reference_v<answer>;
                static_assert(fits, "a coroutine with a responder answers through it: it is an awaitable<void>, and "
                                    "takes the responder by value");
                return fits && fits_result<typename shape::result>();
            } else if constexpr (shape::takes_responder) {
                return true;
            } else if constexpr (shape::takes_body) {
                return fits_body<F>() && fits_result<typename shape::result>();
            } else {
                return fits_result<typename shape::result>();
            }
        } else {
            return false;
        }
    } else {
        constexpr bool overloaded = callable_somehow<F>;
        constexpr bool member = std::is_member_pointer_v<F>;
        static_assert(!overloaded,
                      "the handler's arguments are not known, since its call operator is a template (an 'auto' "
                      "parameter) or overloaded: write the types, as [](const cles::request&, position)");
        static_assert(!member, "a member function cannot be a handler without its object: use a lambda, as "
                               "[this](position to) { return steer(to); }");
        static_assert(overloaded || member,
                      "the handler is not callable: it is a function, a lambda or an object with a "
                      "call operator");
        return false;
    }
}

} // namespace cles::detail
