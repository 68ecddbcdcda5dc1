// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>

namespace cles::detail {

/// Text that an operation keeps until it begins: without allocation where it is as short as most nouns are.
class short_text {
  public:
    explicit short_text(std::string_view text) {
        if (text.size() <= inside_.size()) {
            size_ = text.size();
            std::copy_n(text.data(), size_, inside_.data());
        } else {
            outside_ = text;
        }
    }

    [[nodiscard]] std::string_view view() const noexcept {
        return outside_.empty() ? std::string_view{inside_.data(), size_} : std::string_view{outside_};
    }

  private:
    std::array<char, 48> inside_{};
    std::size_t size_ = 0;
    std::string outside_;
};

} // namespace cles::detail
