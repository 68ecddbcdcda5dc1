// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

/// The parts that a line consists of, common to requests and replies.

namespace cles::protocol {

inline constexpr std::uint64_t max_id = std::numeric_limits<std::int64_t>::max();

/// Takes the SP-separated parts before the body one by one.
class part_reader {
  public:
    explicit part_reader(std::string_view line) noexcept : rest_(line) {}

    /// The next part; empty at the body and at the end.
    std::string_view next() noexcept {
        const auto from = rest_.find_first_not_of(' ');
        rest_.remove_prefix(from == std::string_view::npos ? rest_.size() : from);
        if (rest_.starts_with('{') || rest_.starts_with('[')) {
            return {};
        }
        const auto part = rest_.substr(0, rest_.find(' '));
        rest_.remove_prefix(part.size());
        return part;
    }

    /// What has not been taken: after `next` gave an empty part, the body.
    [[nodiscard]] std::string_view rest() const noexcept { return rest_; }

  private:
    std::string_view rest_;
};

struct adverb {
    std::string_view key;
    std::string_view value;
};

/// Splits "key=value"; false where it is none.
bool split_adverb(std::string_view part, adverb& out) noexcept;

/// The number, where it is one and lies within the bounds.
std::optional<std::uint64_t> number_between(std::string_view text, std::uint64_t low, std::uint64_t high) noexcept;

void append_number(std::string& out, std::uint64_t n);

} // namespace cles::protocol
