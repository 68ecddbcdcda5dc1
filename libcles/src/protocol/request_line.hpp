// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/shared_reading.hpp>
#include <cles/verb.hpp>

#include "protocol/grammar.hpp"
#include "protocol/parts.hpp"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

/// Requests, both directions: how one is read from a line and how it is written (docs/protocol.md).

namespace cles::protocol {

inline constexpr std::uint64_t max_deadline_ms = 86'400'000;
inline constexpr std::uint32_t default_deadline_ms = 5'000;
inline constexpr std::uint32_t default_delegate_deadline_ms = 30'000;
inline constexpr std::uint32_t default_keep = 64;
inline constexpr std::uint64_t max_keep = 65'536;
inline constexpr std::uint64_t max_hops = 16;
inline constexpr std::uint32_t default_lease_ms = 10'000;
inline constexpr std::uint32_t max_lease_ms = 60'000;
inline constexpr std::size_t longest_since = 64;
inline constexpr std::size_t most_described = 64;

constexpr std::uint32_t default_deadline(verb v) noexcept {
    return v == verb::delegate ? default_delegate_deadline_ms : default_deadline_ms;
}

/// What a line says; absent adverbs hold their defaults.
struct request_line {
    cles::verb verb = verb::pull;
    noun_view noun;
    std::uint64_t id = 0; ///< 0: none
    std::uint32_t deadline_ms = default_deadline_ms;
    bool wants_reply = true;
    bool wants_progress = false;
    bool urgent = false;
    std::uint8_t hops = 8;
    std::optional<std::uint32_t> lease_ms;
    std::uint32_t every_ms = 0; ///< 0: every update
    std::uint32_t keep = default_keep;
    bool wants_mark = false; ///< which update the answer to BIND bears
    std::optional<std::uint64_t> seq;
    std::optional<std::uint32_t> epoch;
    std::string_view via;
    std::string_view since;                    ///< what has been told already
    std::string_view describe;                 ///< epochs of runs that are to be told of in full, separated by commas
    std::string_view body;                     ///< empty: none was given
    std::string_view text;                     ///< the line that all this was read from
    detail::shared_reading* reading = nullptr; ///< of the body, where others are handed the same line

    /// An update, as opposed to a request to publish.
    [[nodiscard]] bool is_update() const noexcept { return seq && epoch; }
    [[nodiscard]] bool unbinds() const noexcept { return lease_ms == 0U; }
};

/// A line that is no request, and what is known of the request that it was meant to be.
struct malformed_request {
    std::string why;
    std::uint64_t id = 0;
    bool wants_reply = true;
};

/// Reads the parts of a request. The body is found but not validated, so that a caller which drops it need not pay.
bool parse_request(std::string_view line, request_line& out, malformed_request& error);

/// Whether an adverb of that key has a meaning of this version on that verb.
bool is_known_adverb(std::string_view key, verb on) noexcept;

/// What the parts before the body say for an answer to a line that cannot be read as a whole.
malformed_request salvage(std::string_view line);

/// What a request carries when it is written. Zero or empty means: not written.
struct request_text {
    cles::verb verb = verb::pull;
    std::string_view noun{};
    std::uint64_t id = 0;
    std::uint32_t deadline_ms = 0;
    bool wants_reply = true;
    bool wants_progress = false;
    bool urgent = false;
    std::optional<std::uint32_t> lease_ms{};
    std::uint32_t every_ms = 0;
    std::uint32_t keep = 0;
    std::string_view adverbs{}; ///< further ones, as they stand on the wire
    std::string_view body{};
};

/// Appends the request and its LF.
void append_request(std::string& out, const request_text& request);

/// Appends an update's head, up to and without its body.
void append_update_head(std::string& out, std::string_view publisher, std::string_view path, std::uint64_t seq,
                        std::string_view epoch);

/// Eight lower-case hex digits, both ways.
std::optional<std::uint32_t> parse_epoch(std::string_view text) noexcept;
std::string epoch_text(std::uint32_t epoch);

} // namespace cles::protocol
