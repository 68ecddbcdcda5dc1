// SPDX-License-Identifier: BSL-1.0
#include "node/publish/update_log.hpp"

#include <algorithm>

namespace cles::core {

std::string& update_log::begin() {
    begun_ = text_.size();
    return text_;
}

void update_log::commit() {
    text_.push_back('\n');
    ends_.push_back(text_.size());
}

void update_log::roll_back() { text_.resize(begun_); }

std::string_view update_log::pending() const noexcept { return std::string_view{text_}.substr(begun_); }

std::size_t update_log::start_of(std::uint64_t number) const noexcept {
    const auto index = static_cast<std::size_t>(number - first_);
    return index == 0 ? text_head_ : ends_[head_ + index - 1];
}

std::string_view update_log::lines(std::uint64_t from, std::uint64_t to) const noexcept {
    if (from > to) {
        return {};
    }
    const auto start = start_of(from);
    return std::string_view{text_}.substr(start, start_of(to + 1) - start);
}

void update_log::forget_before(std::uint64_t from) {
    if (empty()) {
        return;
    }
    from = std::min(from, last());
    if (from <= first_) {
        return;
    }
    text_head_ = start_of(from);
    head_ += static_cast<std::size_t>(from - first_);
    first_ = from;
    // Forgotten text is removed once it is no shorter than the rest, which keeps the cost per line constant.
    if (text_head_ > 4096 && text_head_ >= text_.size() - text_head_) {
        compact();
        constexpr std::size_t roomy = 65536;
        if (text_.capacity() > roomy && text_.size() < text_.capacity() / 8) {
            text_.shrink_to_fit();
        }
    }
}

void update_log::compact() {
    text_.erase(0, text_head_);
    ends_.erase(ends_.begin(), ends_.begin() + static_cast<std::ptrdiff_t>(head_));
    for (auto& end : ends_) {
        end -= text_head_;
    }
    begun_ -= std::min(begun_, text_head_);
    text_head_ = 0;
    head_ = 0;
}

void update_log::clear() noexcept {
    first_ = last() + 1;
    std::string{}.swap(text_); // assigning {} would keep their memory
    std::vector<std::size_t>{}.swap(ends_);
    text_head_ = head_ = begun_ = 0;
}

void update_log::fit() {
    compact();
    text_.shrink_to_fit();
    ends_.shrink_to_fit();
}

} // namespace cles::core
