// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <string>
#include <string_view>
#include <utility>
#include <variant>

/// Conversion of `std::variant`; included by `<cles/convert.hpp>`.
///
/// A variant is written as the value that it holds, and read as the first alternative that fits. So order alternatives
/// from the most to the least specific. `std::monostate` is null.

namespace cles {

template <>
struct converter<std::monostate> {
    static constexpr bool is_scalar = true;
    static void write(json_writer& w, const std::monostate&) { w.null(); }
    static bool read(json_reader& r, std::monostate&) { return r.read_null(); }
};

template <class... T>
struct converter<std::variant<T...>> {
    using variant = std::variant<T...>;
    using parts = detail::types<T...>;

    static void write(json_writer& w, const variant& value) {
        std::visit([&w](const auto& held) { cles::write_json(w, held); }, value);
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
        if (cles::read_json(part, value.template emplace<I>())) {
            return true;
        }
        const auto wrong = part.error();
        why.append(why.empty() ? "" : "; ").append(wrong, 0, wrong.rfind(" (at byte"));
        return false;
    }
};

} // namespace cles
