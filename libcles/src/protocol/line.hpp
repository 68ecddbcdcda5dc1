// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string_view>

namespace cles::protocol {

/// Collects the bytes of a stream and hands them back as lines.
///
/// Bytes are searched once, however few arrive at a time. The buffer starts small, grows while lines or reads need it,
/// up to the limit on a line, and gives back what a long line took.
class line_buffer {
  public:
    enum class status { line, need_more, overlong };

    explicit line_buffer(std::size_t limit) noexcept : limit_(limit) {}

    /// Where the next bytes go; never empty. Views of earlier lines end here.
    std::span<char> prepare();
    /// Says how many bytes of the prepared space were filled.
    void commit(std::size_t count) noexcept;
    /// Bytes of memory that it holds.
    [[nodiscard]] std::size_t capacity() const noexcept { return capacity_; }
    /// Gives back what the lines that are still here do not need. Prepared space ends here.
    void shrink();
    /// The next line, without its LF. `overlong`: the line exceeds the limit, `line` is what is there of it, and no
    /// more lines follow.
    status next(std::string_view& line) noexcept;
    /// What has come of a line whose end has not.
    [[nodiscard]] std::string_view unfinished() const noexcept { return {data_.get() + begin_, end_ - begin_}; }

  private:
    void resize(std::size_t capacity);

    std::size_t limit_;
    std::unique_ptr<char[]> data_;
    std::size_t capacity_ = 0;
    std::size_t begin_ = 0; // of the first line not yet handed out
    std::size_t scanned_ = 0;
    std::size_t end_ = 0;
    bool filled_ = false; // the last read used all the space there was
};

/// The line as the grammar sees it: without CR and without SP at either end. Empty: to be ignored.
std::string_view trim(std::string_view line) noexcept;

/// Whether the line is a web client's (a page may reach a node on loopback by a POST).
bool is_http(std::string_view line) noexcept;

} // namespace cles::protocol
