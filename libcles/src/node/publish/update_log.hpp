// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// The last updates of a noun, as the lines sent to its subscribers, in one contiguous buffer.
///
/// Each subscriber has a position in it instead of its own queue: publishing costs the same for any number of them, and
/// what a subscriber has missed is sent as one piece. Lines are numbered from 1, like `seq`.
class update_log {
  public:
    /// The first line has the number `last` + 1.
    explicit update_log(std::uint64_t last = 0) noexcept : first_(last + 1) {}

    /// Starts a line: append it to the string, without its LF, then call `commit` or `roll_back`.
    std::string& begin();
    void commit();
    void roll_back();
    /// What has been appended since `begin`.
    [[nodiscard]] std::string_view pending() const noexcept;

    /// The number of the newest line; at first, the constructor's `last`.
    [[nodiscard]] std::uint64_t last() const noexcept { return first_ + sizes() - 1; }
    /// The number of the oldest line kept.
    [[nodiscard]] std::uint64_t first() const noexcept { return first_; }
    /// The lines from `from` to `to`, both included and kept, as one text.
    [[nodiscard]] std::string_view lines(std::uint64_t from, std::uint64_t to) const noexcept;
    [[nodiscard]] std::size_t bytes(std::uint64_t from, std::uint64_t to) const noexcept {
        return lines(from, to).size();
    }
    /// Forgets all lines before `from`, but never the newest.
    void forget_before(std::uint64_t from);
    /// Forgets all lines. The numbers continue.
    void clear() noexcept;
    /// Releases spare memory.
    void fit();
    [[nodiscard]] bool empty() const noexcept { return sizes() == 0; }
    /// Memory in bytes, the line being written and spare capacity included.
    [[nodiscard]] std::size_t memory() const noexcept {
        return text_.capacity() + ends_.capacity() * sizeof(std::size_t);
    }

  private:
    [[nodiscard]] std::uint64_t sizes() const noexcept { return ends_.size() - head_; }
    void compact();
    [[nodiscard]] std::size_t start_of(std::uint64_t number) const noexcept;

    std::string text_;
    std::size_t text_head_ = 0;     // where the oldest line kept starts
    std::vector<std::size_t> ends_; // where each line ends in `text_`
    std::size_t head_ = 0;          // the index of its end in `ends_`
    std::uint64_t first_ = 1;
    std::size_t begun_ = 0;
};

} // namespace cles::core
