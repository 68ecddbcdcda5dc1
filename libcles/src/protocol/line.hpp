// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string_view>

namespace cles::protocol {

/// Collects the bytes of a stream and returns them as lines.
///
/// Each byte is searched once, however few arrive at a time. The buffer starts small, grows when lines or reads need
/// it, up to the limit on a line, and releases what a long line took.
class line_buffer {
  public:
    enum class status { line, need_more, overlong };

    explicit line_buffer(std::size_t limit) noexcept : limit_(limit) {}
    /// For the lines that have not been returned yet.
    void set_limit(std::size_t limit) noexcept { limit_ = limit; }

    /// Space for the next bytes; never empty. Invalidates views of earlier lines.
    std::span<char> prepare();
    /// Sets how many bytes of the prepared space were filled.
    void commit(std::size_t count) noexcept;
    /// The memory held, in bytes.
    [[nodiscard]] std::size_t capacity() const noexcept { return capacity_; }
    /// Releases memory that the remaining lines do not need. Invalidates prepared space.
    void shrink();
    /// The next line, without its LF. `overlong`: the line exceeds the limit, `line` is what has arrived of it, and no
    /// more lines follow.
    status next(std::string_view& line) noexcept;
    /// What has arrived of a line whose end has not; before `need_more`, everything that has not been returned.
    [[nodiscard]] std::string_view unfinished() const noexcept { return {data_.get() + begin_, end_ - begin_}; }

  private:
    void resize(std::size_t capacity);

    std::size_t limit_;
    std::unique_ptr<char[]> data_;
    std::size_t capacity_ = 0;
    std::size_t begin_ = 0; // of the first line not yet returned
    std::size_t scanned_ = 0;
    std::size_t end_ = 0;
    bool filled_ = false; // the last read used all the space
};

/// The line without CR and without SP at either end. Empty lines are ignored.
std::string_view trim(std::string_view line) noexcept;

/// Whether the line is HTTP (a web page can reach a node on loopback by a POST).
bool is_http(std::string_view line) noexcept;

} // namespace cles::protocol
