// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// The last updates of a noun, as the lines that go to its binders, in one piece of memory.
///
/// Each binder has a place in it instead of a queue of its own: publishing costs the same however many are bound, and
/// what a binder has missed goes out as one contiguous piece. Lines are numbered from 1, like `seq`.
class update_log {
  public:
    /// Begins a line: append it to the string, without its LF, then `commit` or `roll_back`.
    std::string& begin();
    void commit();
    void roll_back();
    /// What has been appended since `begin`.
    [[nodiscard]] std::string_view pending() const noexcept;

    /// The number of the newest line; 0 before the first.
    [[nodiscard]] std::uint64_t last() const noexcept { return first_ + sizes() - 1; }
    /// The number of the oldest line that is kept.
    [[nodiscard]] std::uint64_t first() const noexcept { return first_; }
    /// The lines from `from` to `to`, both included and kept, as one text.
    [[nodiscard]] std::string_view lines(std::uint64_t from, std::uint64_t to) const noexcept;
    [[nodiscard]] std::size_t bytes(std::uint64_t from, std::uint64_t to) const noexcept {
        return lines(from, to).size();
    }
    /// Forgets all lines before `from`, but never the newest.
    void forget_before(std::uint64_t from);

  private:
    [[nodiscard]] std::uint64_t sizes() const noexcept { return ends_.size() - head_; }
    [[nodiscard]] std::size_t start_of(std::uint64_t number) const noexcept;

    std::string text_;
    std::size_t text_head_ = 0;     // where the oldest kept line begins
    std::vector<std::size_t> ends_; // where each line ends in `text_`
    std::size_t head_ = 0;          // the oldest kept line's place in `ends_`
    std::uint64_t first_ = 1;
    std::size_t begun_ = 0;
};

} // namespace cles::core
