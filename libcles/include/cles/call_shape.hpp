// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/chrono.hpp>
#include <cles/completion_token.hpp>
#include <cles/handler_shape.hpp>

#include <type_traits>

/// Types of answers and completion tokens, with readable compiler errors for unsuitable ones. Not for applications.

namespace cles::detail {

template <class T>
inline constexpr bool is_duration = false;
template <class Rep, class Period>
inline constexpr bool is_duration<std::chrono::duration<Rep, Period>> = true;

/// What is called in the end: a function that may be bound to an executor and the like.
template <class Token>
struct callback_of {
    using type = Token;
};
template <class T, class E>
struct callback_of<boost::asio::executor_binder<T, E>> : callback_of<T> {};
template <class T, class A>
struct callback_of<boost::asio::allocator_binder<T, A>> : callback_of<T> {};
template <class T, class S>
struct callback_of<boost::asio::cancellation_slot_binder<T, S>> : callback_of<T> {};

/// False, with a compiler error, if an answer cannot be of this type.
template <class T>
constexpr bool fits_answer() {
    constexpr bool is_value = !std::is_void_v<T>;
    static_assert(is_value,
                  "an answer is a value: leave out <void>, and ignore the JSON text that it is without a type");
    if constexpr (is_value) {
        constexpr bool made_first = std::is_default_constructible_v<T>;
        static_assert(
            made_first,
            "the type of an answer or an update needs a default constructor: it is made first, and then read");
        return made_first;
    } else {
        return false;
    }
}

/// False, with a compiler error, if an operation that completes with these results cannot have this token.
template <class Token, class... Results>
constexpr bool fits_token() {
    using token = std::remove_cvref_t<Token>;
    using callback = typename callback_of<token>::type;
    constexpr bool is_limit = is_duration<token>;
    static_assert(!is_limit, "a duration is not a completion token: a deadline is an option, as in "
                             "cles::call_options{}.deadline(200ms)");
    if constexpr (one_signature<callback>) {
        constexpr bool takes_results = std::is_invocable_v<callback, boost::system::error_code, Results...>;
        static_assert(takes_results || sizeof...(Results) == 0,
                      "a callback takes a boost::system::error_code and then the result, as in "
                      "[](boost::system::error_code code, double speed) {}");
        static_assert(takes_results || sizeof...(Results) != 0,
                      "a callback takes a boost::system::error_code alone here");
        return takes_results;
    } else {
        return !is_limit;
    }
}

/// False, with one compiler error, if a request cannot have this answer or this token.
template <class Token, class T>
constexpr bool fits_call() {
    if constexpr (detail::fits_answer<T>()) {
        return detail::fits_token<Token, T>();
    } else {
        return false;
    }
}

/// The type of a call that does not compile, so that the compiler reports nothing else about it.
template <class Token, class T>
using refused_call = std::conditional_t<outcome_of<std::remove_cvref_t<Token>> == outcome::exception ||
                                            is_duration<std::remove_cvref_t<Token>>,
                                        boost::asio::awaitable<T>, void>;
template <class Token, class T>
refused_call<Token, T> refuse_call();

} // namespace cles::detail
