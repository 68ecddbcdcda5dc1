// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include "json/json_scan.hpp"

#include <boost/container/static_vector.hpp>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

/// The parts of a line, common to requests and replies.

namespace cles::protocol {

inline constexpr std::uint64_t max_id = std::numeric_limits<std::int64_t>::max();

/// Reads the SP-separated parts before the body one by one.
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

    /// What has not been read: the body, once `next` has returned an empty part.
    [[nodiscard]] std::string_view rest() const noexcept { return rest_; }

  private:
    std::string_view rest_;
};

struct adverb {
    std::string_view key;
    std::string_view value;
};

/// Splits "key=value"; false for anything else.
bool split_adverb(std::string_view part, adverb& out) noexcept;

/// Parses a number within the bounds; nothing for anything else.
std::optional<std::uint64_t> number_between(std::string_view text, std::uint64_t low, std::uint64_t high) noexcept;

using json_detail::append_number;

// --- The elements of a line: names, numbers, parameters, nouns (paper, Fig. 2; docs/protocol.md, "The line") ---

inline constexpr std::size_t max_name = 64;
inline constexpr std::size_t max_parameters = 32;
inline constexpr std::size_t max_adverbs = 16;

/// 1 to 64 letters, digits, '_', '-', '.'.
bool is_name(std::string_view text) noexcept;

/// `self`, `any`, `all`: targets that are not allowed as names of nodes.
bool is_reserved_target(std::string_view name) noexcept;

/// "0", or digits without a leading zero, however many.
bool is_number(std::string_view text) noexcept;

/// "0", or digits without a leading zero; nothing if it does not fit into 64 bits.
std::optional<std::uint64_t> parse_number(std::string_view text) noexcept;

/// Whether `text` is a parameter in wire format (its escapes decode to UTF-8 without control characters).
bool is_parameter(std::string_view text) noexcept;

/// Appends a valid parameter, decoded.
void decode_parameter(std::string_view text, std::string& out);

/// Appends a parameter in wire format: allowed characters unchanged, all others as %HH.
void encode_parameter(std::string_view decoded, std::string& out);

/// A noun split into its parts, all of them views of the line and not decoded.
struct noun_view {
    std::string_view target;
    std::string_view task;
    std::string_view path; ///< the task and its parameters as written: "localization/fast"
    boost::container::static_vector<std::string_view, max_parameters> parameters;
};

/// Splits a noun. On failure returns false, and `why` says what is wrong with which part.
bool parse_noun(std::string_view text, noun_view& out, std::string& why);

/// The path in the form in which nouns are compared. Without a '%' it is `path` itself; otherwise it is built in
/// `scratch`.
std::string_view canonical_path(const noun_view& noun, std::string& scratch);

/// Text from a peer, quoted, shortened and printable, for a message.
[[gnu::cold]] std::string quoted(std::string_view text);

} // namespace cles::protocol
