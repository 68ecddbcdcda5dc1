// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include <boost/container/static_vector.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

/// The words of a line: names, numbers, parameters, nouns (paper, Fig. 2; docs/protocol.md, "The line").

namespace cles::protocol {

inline constexpr std::size_t max_name = 64;
inline constexpr std::size_t max_parameters = 32;
inline constexpr std::size_t max_adverbs = 16;

/// 1 to 64 letters, digits, '_', '-', '.'.
bool is_name(std::string_view text) noexcept;

/// `self`, `any`, `all`: targets that no node may be called.
bool is_reserved_target(std::string_view name) noexcept;

/// "0", or digits without a leading zero, however many.
bool is_number(std::string_view text) noexcept;

/// "0", or digits without a leading zero; nothing where it does not fit 64 bits.
std::optional<std::uint64_t> parse_number(std::string_view text) noexcept;

/// Whether `text` is a parameter as it may stand on the wire (its escapes decode to UTF-8 without control characters).
bool is_parameter(std::string_view text) noexcept;

/// Appends what a valid parameter stands for.
void decode_parameter(std::string_view text, std::string& out);

/// Appends a parameter as nodes write it: allowed characters plain, all others as %HH.
void encode_parameter(std::string_view decoded, std::string& out);

/// A noun split into its parts, all of them views of the line and not decoded.
struct noun_view {
    std::string_view target;
    std::string_view task;
    std::string_view path; ///< the task and its parameters as they stand: "localization/fast"
    boost::container::static_vector<std::string_view, max_parameters> parameters;
};

/// Splits a noun. On failure false, and `why` says what is wrong with which part.
bool parse_noun(std::string_view text, noun_view& out, std::string& why);

/// The path in the one form under which nouns are compared. Without a '%' it is `path` itself; otherwise it is rebuilt
/// in `scratch`.
std::string_view canonical_path(const noun_view& noun, std::string& scratch);

/// Text from a peer, quoted and cut to a length that is fit for a message.
std::string quoted(std::string_view text);

} // namespace cles::protocol
