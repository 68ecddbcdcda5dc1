// SPDX-License-Identifier: BSL-1.0
#include "options/arguments.hpp"

#include "output/failure.hpp"

#include <algorithm>
#include <string>

namespace tool {
namespace {

constexpr std::size_t max_name = 64;

bool is_alphanumeric(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'); }

bool is_hex(char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F'); }

bool is_name_character(char c) { return is_alphanumeric(c) || c == '_' || c == '-' || c == '.'; }

[[noreturn]] void refuse(std::string_view noun, const std::string& why) {
    throw usage_error("'" + std::string{noun} + "': " + why);
}

void check_parameter(std::string_view noun, std::string_view parameter) {
    if (parameter.empty()) {
        refuse(noun, "a parameter is empty; a noun does not end in '/'");
    }
    for (std::size_t i = 0; i < parameter.size(); ++i) {
        const char c = parameter[i];
        if (c == '%' && i + 2 < parameter.size() && is_hex(parameter[i + 1]) && is_hex(parameter[i + 2])) {
            i += 2;
        } else if (!is_name_character(c) && c != '~' && c != '+') {
            refuse(noun, "the parameter '" + std::string{parameter} +
                             "' may hold letters, digits and _ - . ~ + alone; write others as %HH");
        }
    }
}

} // namespace

bool is_name(std::string_view text) {
    return !text.empty() && text.size() <= max_name && std::all_of(text.begin(), text.end(), is_name_character);
}

std::string_view target_of(std::string_view noun) { return noun.substr(0, noun.find(':')); }

void check_noun(std::string_view noun) {
    const auto colon = noun.find(':');
    if (colon == std::string_view::npos) {
        refuse(noun, "a noun is NODE:TASK or NODE:TASK/PARAMETER..., as in car1:localization");
    }
    if (!is_name(noun.substr(0, colon))) {
        refuse(noun, "the node before ':' is 1 to 64 letters, digits, '_', '-', '.'");
    }
    auto rest = noun.substr(colon + 1);
    const auto slash = rest.find('/');
    if (!is_name(rest.substr(0, slash))) {
        refuse(noun, "the task after ':' is 1 to 64 letters, digits, '_', '-', '.'");
    }
    while (rest.find('/') != std::string_view::npos) {
        rest.remove_prefix(rest.find('/') + 1);
        check_parameter(noun, rest.substr(0, rest.find('/')));
    }
}

} // namespace tool
