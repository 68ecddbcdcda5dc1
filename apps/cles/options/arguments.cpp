// SPDX-License-Identifier: BSL-1.0
#include "options/arguments.hpp"

#include <cles/json_reader.hpp>

#include "output/errors.hpp"
#include "system/whole_file.hpp"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <iostream>
#include <iterator>
#include <system_error>

namespace tool {
namespace {

constexpr std::size_t max_name = 64;
constexpr std::ptrdiff_t max_parameters = 32;

bool is_alphanumeric(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'); }

bool is_hex(char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F'); }

bool is_name_character(char c) { return is_alphanumeric(c) || c == '_' || c == '-' || c == '.'; }

/// Whether '*' stands for other characters, as in a pattern.
enum class stars { none, allowed };

bool is_name_or_pattern(std::string_view text, stars with) {
    return !text.empty() && text.size() <= max_name && std::all_of(text.begin(), text.end(), [with](char c) {
        return is_name_character(c) || (with == stars::allowed && c == '*');
    });
}

[[noreturn]] void refuse_noun(std::string_view noun, const std::string& reason) {
    throw usage_error("'" + std::string{noun} + "': " + reason);
}

// As nodes do: characters that are no control characters, in UTF-8.
bool is_text(std::string_view decoded) {
    std::string quoted = "[\"";
    for (std::size_t i = 0; i < decoded.size(); ++i) {
        const auto byte = static_cast<unsigned char>(decoded[i]);
        const bool is_c1 = byte == 0xC2 && i + 1 < decoded.size() && static_cast<unsigned char>(decoded[i + 1]) < 0xA0;
        if (byte < 0x20 || byte == 0x7F || is_c1) {
            return false;
        }
        quoted.push_back(byte == '"' || byte == '\\' ? '.' : decoded[i]);
    }
    return cles::is_valid_json(quoted + "\"]", 1);
}

void check_parameter(std::string_view noun, std::string_view parameter, stars with) {
    if (parameter.empty()) {
        refuse_noun(noun, "a parameter is empty; a noun must not end in '/'");
    }
    std::string decoded;
    for (std::size_t i = 0; i < parameter.size(); ++i) {
        const char c = parameter[i];
        if (c == '%' && i + 2 < parameter.size() && is_hex(parameter[i + 1]) && is_hex(parameter[i + 2])) {
            unsigned byte = 0;
            std::from_chars(&parameter[i + 1], &parameter[i + 1] + 2, byte, 16);
            decoded.push_back(static_cast<char>(byte));
            i += 2;
        } else if (is_name_character(c) || c == '~' || c == '+' || (with == stars::allowed && c == '*')) {
            decoded.push_back(c);
        } else {
            refuse_noun(noun, "the parameter '" + std::string{parameter} +
                                  "' may only contain letters, digits and _ - . ~ +; write others as %HH");
        }
    }
    if (!is_text(decoded)) {
        refuse_noun(noun, "the parameter '" + std::string{parameter} +
                              "' is not text: %HH may not be control characters, and have to be UTF-8 together");
    }
}

void check_parts(std::string_view noun, stars with) {
    const auto colon = noun.find(':');
    if (colon == std::string_view::npos) {
        refuse_noun(noun, "a noun is NODE:TASK or NODE:TASK/PARAMETER..., as in car1:localization");
    }
    if (!is_name_or_pattern(noun.substr(0, colon), with)) {
        refuse_noun(noun, "the node before ':' must be 1 to 64 letters, digits, '_', '-', '.'");
    }
    auto rest = noun.substr(colon + 1);
    const auto slash = rest.find('/');
    if (!is_name_or_pattern(rest.substr(0, slash), with)) {
        refuse_noun(noun, "the task after ':' must be 1 to 64 letters, digits, '_', '-', '.'");
    }
    if (std::ranges::count(rest, '/') > max_parameters) {
        refuse_noun(noun, "it has more than " + std::to_string(max_parameters) + " parameters");
    }
    while (rest.find('/') != std::string_view::npos) {
        rest.remove_prefix(rest.find('/') + 1);
        check_parameter(noun, rest.substr(0, rest.find('/')), with);
    }
}

std::string contents_of_file(const std::string& name) {
    std::string text;
    if (const auto why = read_file(name, text)) {
        throw usage_error("cannot read " + name + ": " + why.message());
    }
    return text;
}

} // namespace

bool is_name(std::string_view text) { return is_name_or_pattern(text, stars::none); }

std::string_view target_of(std::string_view noun) { return noun.substr(0, noun.find(':')); }

void check_noun(std::string_view noun) { check_parts(noun, stars::none); }

void check_noun_pattern(std::string_view pattern) { check_parts(pattern, stars::allowed); }

std::string read_body(const std::string& argument) {
    std::string text = argument;
    std::string origin = "the body";
    if (argument == "-") {
        origin = "the body from stdin";
        text = std::string{std::istreambuf_iterator<char>{std::cin}, {}};
    } else if (argument.starts_with('@')) {
        origin = argument.substr(1);
        text = contents_of_file(origin);
    }

    return checked_body(text, origin);
}

std::string checked_body(std::string_view text, const std::string& origin) {
    std::string reason;
    if (!cles::is_valid_json(text, 32, &reason)) {
        throw usage_error(origin + " is not valid JSON: " + reason);
    }
    const auto kind = cles::json_reader{text}.peek();
    if (kind != cles::json_reader::kind::object && kind != cles::json_reader::kind::array) {
        throw usage_error(origin + " must be an object or an array, as in {\"value\":1}");
    }
    std::string line;
    cles::append_compact_json(text, line);
    return line;
}

} // namespace tool
