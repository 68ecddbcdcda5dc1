// SPDX-License-Identifier: BSL-1.0
#include "serve/command_outcome.hpp"

#include <cles/json_reader.hpp>
#include <cles/printable.hpp>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include <sys/wait.h>

namespace tool {
namespace {

constexpr std::size_t longest_message = 256;

constexpr std::array<std::pair<int, cles::errc>, 10> exit_codes{{{2, cles::errc::bad_request}, // usage
                                                                 {3, cles::errc::no_task},
                                                                 {4, cles::errc::deadline},
                                                                 {5, cles::errc::failed},
                                                                 {6, cles::errc::busy},
                                                                 {64, cles::errc::bad_request}, // EX_USAGE
                                                                 {65, cles::errc::bad_request}, // EX_DATAERR
                                                                 {69, cles::errc::unavailable}, // EX_UNAVAILABLE
                                                                 {75, cles::errc::busy},        // EX_TEMPFAIL
                                                                 {77, cles::errc::denied}}};    // EX_NOPERM

std::string_view without_blanks(std::string_view text) {
    constexpr std::string_view blanks = " \t\r\n";
    const auto from = std::min(text.find_first_not_of(blanks), text.size());
    const auto to = text.find_last_not_of(blanks);
    return text.substr(from, to == std::string_view::npos ? 0 : to + 1 - from);
}

// What the program says about its failure; otherwise this.
std::string first_line_or(std::string_view printed, const std::string& otherwise) {
    const auto text = without_blanks(printed);
    auto line = cles::printable(without_blanks(text.substr(0, text.find('\n'))));
    if (line.size() > longest_message) {
        auto end = longest_message;
        while ((static_cast<unsigned char>(line[end]) & 0xC0U) == 0x80U) { // within a character
            --end;
        }
        line.resize(end);
    }
    return line.empty() ? otherwise : line;
}

command_outcome result_of(std::string_view printed) {
    const auto text = without_blanks(printed);
    if (text.empty()) {
        return {.text = "{}"};
    }
    std::string why;
    if (!cles::is_valid_json(text, 32, &why)) {
        return {.failure = cles::errc::failed, .text = "the command has printed something that is no JSON: " + why};
    }
    command_outcome out;
    cles::append_compact_json(text, out.text);
    return out;
}

} // namespace

std::optional<cles::errc> failure_of_exit(int exit_code) {
    if (exit_code == 0) {
        return std::nullopt;
    }
    const auto* const found =
        std::find_if(exit_codes.begin(), exit_codes.end(), [&](const auto& each) { return each.first == exit_code; });
    return found == exit_codes.end() ? cles::errc::failed : found->second;
}

command_outcome outcome_of(const finished_command& command) {
    if (command.is_cut) {
        return {.failure = cles::errc::too_large,
                .text = "the command has printed more than " + std::to_string(most_printed) + " bytes"};
    }
    if (WIFSIGNALED(command.status)) {
        return {.failure = cles::errc::failed,
                .text = "the command was ended by signal " + std::to_string(WTERMSIG(command.status))};
    }
    const int code = WEXITSTATUS(command.status);
    const auto failure = failure_of_exit(code);
    if (!failure) {
        return result_of(command.printed);
    }
    return {.failure = failure,
            .text = first_line_or(command.printed, "the command has ended with exit code " + std::to_string(code))};
}

} // namespace tool
