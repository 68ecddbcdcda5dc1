// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/update_mark.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

/// Replies, in both directions: parsing and writing (docs/protocol.md).

namespace cles::protocol {

/// Whether a line is a reply (anything else is a request).
constexpr bool is_reply(std::string_view line) noexcept {
    return line.starts_with('{') || line.starts_with('[') || line.starts_with("id=");
}

struct reply_line {
    std::uint64_t id = 0; ///< 0: none
    std::optional<double> progress;
    std::optional<update_mark> mark; ///< of a value in reply to BIND
    std::uint64_t grant = 0;         ///< of a slot, in reply to a job that was forwarded on a grant; 0: none
    std::string_view body;
};

/// Parses the parts of a reply; the body is located but not validated.
bool parse_reply(std::string_view line, reply_line& out) noexcept;

/// Whether a body is a failure.
constexpr bool is_failure(std::string_view body) noexcept { return body.starts_with(R"({"error":")"); }

/// Whether the first key of a JSON text is `error`, however it is written: such a body might be taken for a failure.
bool begins_with_error(std::string_view body);

/// For a `busy` whose writer has no better estimate.
inline constexpr std::uint64_t default_retry_ms = 100;

struct failure {
    errc code = errc::failed;
    std::string message; ///< of a parsed one: printable
    std::optional<std::uint64_t> retry_ms{};
    bool ran = false;
    std::string node{};      ///< which executes the request if it is signed; empty: it need not be
    std::string challenge{}; ///< to sign, if `node` is set
    std::string answer{};    ///< if it is forwarded: the complete body, as another node wrote it
};

/// Parses a failure's members; an unknown code counts as `failed`. False: it is not valid JSON.
[[gnu::cold]] bool parse_failure(std::string_view body, failure& out);

/// Appends a failure's body; a forwarded one unchanged. `ran` is written if it is true, `retry_ms` if it is set, and
/// always with `busy`.
void append_failure(std::string& out, const failure& f);
[[gnu::cold]] std::string failure_text(const failure& f);

/// Appends "id=7 ", or nothing for 0.
void append_reply_head(std::string& out, std::uint64_t id);

/// "seq=17 epoch=5f3a09c1", which precedes the value in a reply to BIND; empty for none.
[[gnu::cold]] std::string mark_text(const std::optional<update_mark>& mark);

/// Appends "id=7 progress=0.4 ".
void append_progress_head(std::string& out, std::uint64_t id, double fraction);

} // namespace cles::protocol
