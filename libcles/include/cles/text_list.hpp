// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>
#include <cles/standard.hpp>

#include <concepts>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace cles {

/// Texts of an option. A std::vector that the library copies, assigns and destroys, so that a user's file compiles
/// less, and that says what is wrong if an option gets a text instead of a list.
struct text_list : std::vector<std::string> {
    using vector::vector;
    text_list() = default;
    text_list(std::initializer_list<std::string> texts);
    text_list(const vector& texts);
    text_list(vector&& texts) noexcept;
    text_list(const text_list& other);
    text_list(text_list&& other) noexcept;
    text_list& operator=(const text_list& other);
    text_list& operator=(text_list&& other) noexcept;
    ~text_list();

    template <std::convertible_to<std::string_view> Text>
    text_list(const Text&) {
        constexpr bool is_list = !std::convertible_to<Text, std::string_view>;
        static_assert(is_list, "the option is a list: put braces around the text, as in {\"tcp://127.0.0.1:0\"}");
    }
};
template <std::same_as<text_list> List>
struct converter<List> : converter<typename List::vector> {}; // a template: convert_containers.hpp may be missing

} // namespace cles
