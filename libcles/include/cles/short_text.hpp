// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>

namespace cles::detail {

/// Text that an operation keeps until it starts; not allocated if it is as short as most nouns.
class short_text {
  public:
    explicit short_text(std::string_view text) {
        if (text.size() <= inside_.size()) {
            size_ = text.size();
            text.copy(inside_.data(), size_);
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
