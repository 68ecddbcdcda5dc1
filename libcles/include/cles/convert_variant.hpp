// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <compare>
#include <concepts>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>

/// Conversion of `std::variant`; included by `<cles/convert.hpp>`.
///
/// A variant is written as the value that it holds, and read as the first alternative that fits. So order alternatives
/// from the most to the least specific. `std::monostate` is null.

namespace cles {
namespace detail {

// Both types are recognised by what they can do: with `<variant>`, `<cles/service.hpp>` would take some 2 % longer to
// compile, also for programs that have no variant.

template <class T>
concept variant = requires(const T& value) {
    { value.index() } -> std::same_as<std::size_t>;
    { value.valueless_by_exception() } -> std::same_as<bool>;
};

/// `std::monostate`: an empty class that is ordered, and of the namespace `std`, since argument-dependent lookup finds
/// its `swap`; not `std::tuple<>` or `std::true_type`.
template <class T>
concept monostate =
    std::is_empty_v<T> && !std::is_same_v<T, std::tuple<>> && !std::is_convertible_v<T, bool> && requires(T & value) {
    { value <=> value } -> std::same_as<std::strong_ordering>;
    swap(value, value);
};

} // namespace detail

template <detail::monostate T>
struct converter<T> {
    static constexpr bool is_scalar = true;
    static void write(json_writer& w, const T&) { w.null(); }
    static bool read(json_reader& r, T&) { return r.read_null(); }
};

template <template <class...> class Variant, class... T>
    requires detail::variant<Variant<T...>>
struct converter<Variant<T...>> {
    using variant = Variant<T...>;

    static void write(json_writer& w, const variant& value) {
        visit([&w](const auto& held) { write_json(w, held); }, value);
    }
    static bool read(json_reader& r, variant& value) {
        std::string_view raw;
        if (!r.read_raw(raw)) {
            return false;
        }
        std::string why;
        return try_each(raw, value, why, std::index_sequence_for<T...>{}) || r.fail("matches no alternative: " + why);
    }

  private:
    template <std::size_t... I>
    static bool try_each(std::string_view raw, variant& value, std::string& why, std::index_sequence<I...>) {
        return (try_one<I>(raw, value, why) || ...);
    }
    template <std::size_t I>
    static bool try_one(std::string_view raw, variant& value, std::string& why) {
        json_reader part{raw, std::string_view::npos}; // its depth has been checked
        if (read_json(part, value.template emplace<I>())) {
            return true;
        }
        const auto wrong = part.error();
        why.append(why.empty() ? "" : "; ").append(wrong, 0, wrong.rfind(" (at byte"));
        return false;
    }
};

} // namespace cles
