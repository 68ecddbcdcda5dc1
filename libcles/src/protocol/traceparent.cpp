// SPDX-License-Identifier: BSL-1.0
#include "protocol/traceparent.hpp"

#include "protocol/hex_number.hpp"

#include <cstddef>

namespace cles::protocol {
namespace {

// The positions of the parts: a version of 2 digits, a trace of 32, a span of 16, flags of 2, with '-' between them.
constexpr std::size_t trace_at = 3;
constexpr std::size_t span_at = 36;
constexpr std::size_t flags_at = 53;
constexpr std::size_t length = 55;
constexpr std::uint8_t no_version = 0xff;
constexpr unsigned sampled_flag = 1;

} // namespace

std::optional<trace_context> parse_traceparent(std::string_view text) noexcept {
    if (text.size() < length || text[trace_at - 1] != '-' || text[span_at - 1] != '-' || text[flags_at - 1] != '-') {
        return std::nullopt;
    }
    const auto version = parse_hex<std::uint8_t>(text.substr(0, 2));
    const auto id = parse_trace_id(text.substr(trace_at, span_at - 1 - trace_at));
    const auto span = parse_hex<std::uint64_t>(text.substr(span_at, flags_at - 1 - span_at));
    const auto flags = parse_hex<std::uint8_t>(text.substr(flags_at, 2));
    if (!version || *version == no_version || !id || !span || *span == 0 || !flags) {
        return std::nullopt;
    }
    if (text.size() != length && (*version == 0 || text[length] != '-')) {
        return std::nullopt;
    }
    return trace_context{.id = *id, .span = *span, .sampled = (*flags & sampled_flag) != 0};
}

std::string traceparent_text(const trace_context& trace) {
    return "00-" + trace_id_text(trace.id) + "-" + hex_text(trace.span) + (trace.sampled ? "-01" : "-00");
}

std::optional<trace_id> parse_trace_id(std::string_view text) noexcept {
    const auto half = 2 * sizeof(std::uint64_t);
    if (text.size() != 2 * half) {
        return std::nullopt;
    }
    const auto high = parse_hex<std::uint64_t>(text.substr(0, half));
    const auto low = parse_hex<std::uint64_t>(text.substr(half));
    if (!high || !low || (*high | *low) == 0) {
        return std::nullopt;
    }
    return trace_id{.high = *high, .low = *low};
}

std::string trace_id_text(const trace_id& id) { return hex_text(id.high) + hex_text(id.low); }

} // namespace cles::protocol
