// SPDX-License-Identifier: BSL-1.0
#include "protocol/grammar.hpp"

#include <cles/error.hpp>
#include <cles/parameter.hpp>
#include <cles/printable.hpp>

#include "json/json_scan.hpp"

#include <algorithm>
#include <array>
#include <charconv>

namespace cles {

std::optional<verb> verb_from(std::string_view text) noexcept {
    constexpr auto lower_case = 0x20; // the bit by which lower-case letters differ; the names are letters only
    const auto upper = [](char c) { return static_cast<char>(c & ~lower_case); };
    for (std::size_t i = 0; i < verb_count; ++i) {
        if (std::ranges::equal(text, verb_names[i], {}, upper)) {
            return static_cast<verb>(i);
        }
    }
    return std::nullopt;
}

} // namespace cles

namespace cles::protocol {
namespace {

enum : std::uint8_t { name_char = 1, parameter_char = 2 };

constexpr auto classes = [] {
    std::array<std::uint8_t, 256> table{};
    for (const auto c : std::string_view{"abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-."}) {
        table[static_cast<unsigned char>(c)] = name_char | parameter_char;
    }
    table['~'] = table['+'] = parameter_char;
    return table;
}();

constexpr bool in_class(char c, std::uint8_t wanted) noexcept {
    return (classes[static_cast<unsigned char>(c)] & wanted) != 0;
}

// Reads the two hex digits of an escape whose '%' is at `at`.
bool read_escape(std::string_view text, std::size_t at, std::uint8_t& byte) noexcept {
    if (text.size() - at < 3) {
        return false;
    }
    const auto* const end = text.data() + at + 3;
    return std::from_chars(text.data() + at + 1, end, byte, 16).ptr == end;
}

bool has_control(std::string_view text) noexcept {
    for (std::size_t i = 0; i < text.size(); ++i) {
        const auto b = static_cast<unsigned char>(text[i]);
        const bool c1 = b == 0xC2 && i + 1 < text.size() && static_cast<unsigned char>(text[i + 1]) < 0xA0;
        if (b < 0x20 || b == 0x7F || c1) {
            return true;
        }
    }
    return false;
}

} // namespace

bool is_name(std::string_view text) noexcept {
    return !text.empty() && text.size() <= max_name &&
           std::all_of(text.begin(), text.end(), [](char c) { return in_class(c, name_char); });
}

bool is_reserved_target(std::string_view name) noexcept { return name == "self" || name == "any" || name == "all"; }

bool is_number(std::string_view text) noexcept {
    return !text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos &&
           (text.size() == 1 || text.front() != '0');
}

std::optional<std::uint64_t> parse_number(std::string_view text) noexcept {
    std::uint64_t value = 0;
    if (!json_detail::read_number(text, value) || (text.size() > 1 && text.front() == '0')) {
        return std::nullopt;
    }
    return value;
}

bool is_parameter(std::string_view text) noexcept {
    bool escapes = false;
    std::uint8_t ignored = 0;
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] == '%') {
            if (!read_escape(text, i, ignored)) {
                return false;
            }
            escapes = true;
            i += 2;
        } else if (!in_class(text[i], parameter_char)) {
            return false;
        }
    }
    if (escapes) {
        std::string decoded;
        decode_parameter(text, decoded);
        return json_detail::is_utf8(decoded) && !has_control(decoded);
    }
    return !text.empty();
}

void decode_parameter(std::string_view text, std::string& out) {
    std::uint8_t byte = 0;
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] == '%' && read_escape(text, i, byte)) {
            out.push_back(static_cast<char>(byte));
            i += 2;
        } else {
            out.push_back(text[i]);
        }
    }
}

void encode_parameter(std::string_view decoded, std::string& out) {
    constexpr std::string_view digits = "0123456789ABCDEF";
    for (const auto c : decoded) {
        if (in_class(c, parameter_char)) {
            out.push_back(c);
        } else {
            const auto b = static_cast<unsigned char>(c);
            out.push_back('%');
            out.push_back(digits[b >> 4U]);
            out.push_back(digits[b & 0xFU]);
        }
    }
}

bool parse_noun(std::string_view text, noun_view& out, std::string& why) {
    const auto colon = text.find(':');
    if (colon == std::string_view::npos) {
        why = "the noun " + quoted(text) + " has no ':' between target and task";
        return false;
    }
    out.target = text.substr(0, colon);
    out.path = text.substr(colon + 1);
    if (!is_name(out.target)) {
        why = "the target " + quoted(out.target) + " is not a name (1 to 64 letters, digits, '_', '-', '.')";
        return false;
    }
    auto slash = out.path.find('/');
    out.task = out.path.substr(0, slash);
    if (!is_name(out.task)) {
        why = "the task " + quoted(out.task) + " is not a name (1 to 64 letters, digits, '_', '-', '.')";
        return false;
    }
    out.parameters.clear();
    while (slash != std::string_view::npos) {
        const auto from = slash + 1;
        slash = out.path.find('/', from);
        const auto parameter =
            out.path.substr(from, slash == std::string_view::npos ? std::string_view::npos : slash - from);
        if (out.parameters.size() == max_parameters) {
            why = "more than 32 parameters";
            return false;
        }
        if (!is_parameter(parameter)) {
            const auto which = "parameter " + std::to_string(out.parameters.size() + 1);
            why = parameter.empty()
                      ? which + " is empty"
                      : which + " " + quoted(parameter) + " contains a character or an escape that is not allowed";
            return false;
        }
        out.parameters.push_back(parameter);
    }
    return true;
}

std::string_view canonical_path(const noun_view& noun, std::string& scratch) {
    if (noun.path.find('%') == std::string_view::npos) {
        return noun.path;
    }
    scratch.assign(noun.task);
    std::string decoded;
    for (const auto parameter : noun.parameters) {
        decoded.clear();
        decode_parameter(parameter, decoded);
        scratch.push_back('/');
        encode_parameter(decoded, scratch);
    }
    return scratch;
}

std::string quoted(std::string_view text) {
    constexpr std::size_t longest = 48;
    auto end = std::min(text.size(), longest);
    while (end < text.size() && end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) {
        --end; // whole characters
    }
    return "'" + printable(text.substr(0, end)) + (text.size() > longest ? "...'" : "'");
}

bool split_adverb(std::string_view part, adverb& out) noexcept {
    const auto equals = part.find('=');
    if (equals == 0 || equals == std::string_view::npos || equals + 1 == part.size()) {
        return false;
    }
    out = {part.substr(0, equals), part.substr(equals + 1)};
    return std::all_of(out.key.begin(), out.key.end(), [](char c) { return (c >= 'a' && c <= 'z') || c == '_'; }) &&
           std::all_of(out.value.begin(), out.value.end(), [](char c) { return c > 0x20 && c < 0x7F; });
}

std::optional<std::uint64_t> number_between(std::string_view text, std::uint64_t low, std::uint64_t high) noexcept {
    const auto value = parse_number(text);
    return value && *value >= low && *value <= high ? value : std::nullopt;
}

} // namespace cles::protocol

namespace cles {

std::string encode_parameter(std::string_view text) {
    std::string encoded;
    protocol::encode_parameter(text, encoded);
    if (!protocol::is_parameter(encoded)) {
        throw error(errc::invalid_name, "a parameter is UTF-8 text without control characters, and not empty");
    }
    return encoded;
}

} // namespace cles
