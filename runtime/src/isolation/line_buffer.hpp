// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace cles::runtime {

/// Text from a stream, to be taken line by line.
class line_buffer {
  public:
    void append(std::string_view text) {
        searched_ -= taken_;
        text_.erase(0, std::exchange(taken_, 0));
        text_.append(text);
    }
    /// The next line without its LF, valid until the next `append`. Nothing if there is no whole line.
    std::optional<std::string_view> next() {
        const auto end = text_.find('\n', searched_);
        if (end == std::string::npos) {
            searched_ = text_.size(); // nothing is searched twice
            return std::nullopt;
        }
        const auto line = std::string_view{text_}.substr(taken_, end - taken_);
        taken_ = searched_ = end + 1;
        return line;
    }
    /// What has arrived of the line after the last one that was taken.
    [[nodiscard]] std::string_view rest() const noexcept { return std::string_view{text_}.substr(taken_); }
    void clear() noexcept {
        text_.clear();
        taken_ = searched_ = 0;
    }

  private:
    std::string text_;
    std::size_t taken_ = 0;
    std::size_t searched_ = 0;
};

} // namespace cles::runtime
