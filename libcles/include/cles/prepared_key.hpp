// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/standard.hpp>

#include <array>
#include <cstddef>
#include <string_view>

namespace cles {

/// The name of a JSON object's member as it is written behind another: a comma, the name in quotation marks, and a
/// colon. Made when a program is compiled, of a name that needs no escapes.
template <std::size_t Length>
class prepared_key_text {
  public:
    /// \pre the name has this length
    consteval explicit prepared_key_text(std::string_view name) {
        text_[0] = ',';
        text_[1] = '"';
        for (std::size_t i = 0; i < name.size(); ++i) { // without <algorithm>, which every user would pay for
            text_[i + 2] = name[i];
        }
        text_[Length + 2] = '"';
        text_[Length + 3] = ':';
    }
    [[nodiscard]] constexpr std::string_view view() const noexcept { return {text_.data(), text_.size()}; }

  private:
    std::array<char, Length + 4> text_{};
};

/// Any such text, which has to outlive it.
class prepared_key {
  public:
    template <std::size_t Length>
    constexpr explicit(false) prepared_key(const prepared_key_text<Length>& made) noexcept : text_(made.view()) {}
    [[nodiscard]] constexpr std::string_view text() const noexcept { return text_; }

  private:
    std::string_view text_;
};

} // namespace cles
