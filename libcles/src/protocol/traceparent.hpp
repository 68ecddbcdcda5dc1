// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

/// The adverb `trace`, whose value is a `traceparent` (W3C Trace Context): "00-<trace>-<span>-<flags>".

namespace cles::protocol {

/// The identity of a trace: 32 lower-case hex digits, not all zero.
struct trace_id {
    std::uint64_t high = 0;
    std::uint64_t low = 0;

    bool operator==(const trace_id&) const = default;
};

/// A trace, and the span in it whose children are what a request causes.
struct trace_context {
    trace_id id{};
    std::uint64_t span = 0; ///< 0: the request belongs to no trace
    bool sampled = false;   ///< nodes record what it causes

    bool operator==(const trace_context&) const = default;
    [[nodiscard]] explicit operator bool() const noexcept { return span != 0; }
};

/// Nothing if the text has another form, or the version is `ff`. Of a later version, the part that this one defines
/// counts.
std::optional<trace_context> parse_traceparent(std::string_view text) noexcept;
std::string traceparent_text(const trace_context& trace);

std::optional<trace_id> parse_trace_id(std::string_view text) noexcept;
std::string trace_id_text(const trace_id& id);

} // namespace cles::protocol
