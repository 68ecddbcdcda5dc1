// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/standard.hpp>

#include <array>
#include <cstddef>
#include <string_view>

namespace cles {

/// A JSON key as it is written after another member: a comma, the name in quotation marks, and a colon. Made at compile
/// time from a name that needs no escapes.
template <std::size_t Length>
class prepared_key_text {
  public:
    /// \pre the name has length `Length`
    consteval explicit prepared_key_text(std::string_view name) {
        text_[0] = ',';
        text_[1] = '"';
        for (std::size_t i = 0; i < name.size(); ++i) { // <algorithm> would slow down every user's compilation
            text_[i + 2] = name[i];
        }
        text_[Length + 2] = '"';
        text_[Length + 3] = ':';
    }
    [[nodiscard]] constexpr std::string_view view() const noexcept { return {text_.data(), text_.size()}; }

  private:
    std::array<char, Length + 4> text_{};
};

/// A reference to a `prepared_key_text` of any length, which must outlive it.
class prepared_key {
  public:
    template <std::size_t Length>
    constexpr explicit(false) prepared_key(const prepared_key_text<Length>& made) noexcept : text_(made.view()) {}
    [[nodiscard]] constexpr std::string_view text() const noexcept { return text_; }
    [[nodiscard]] constexpr std::string_view name() const noexcept { return text_.substr(2, text_.size() - 4); }

  private:
    std::string_view text_;
};

} // namespace cles
