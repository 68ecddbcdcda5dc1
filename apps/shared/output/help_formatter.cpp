// SPDX-License-Identifier: BSL-1.0
#include "output/help_formatter.hpp"

#include <algorithm>
#include <sstream>
#include <utility>
#include <vector>

#include <sys/ioctl.h>
#include <unistd.h>

namespace tool {
namespace {

// 0: stdout is no terminal, or has no width.
std::size_t terminal_width() {
    winsize size{};
    return ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 ? size.ws_col : 0;
}

bool is_of_paragraph(const std::string& line) {
    return !line.empty() && line.front() != ' ' && line.back() != ':' && !line.starts_with("Usage:");
}

// Lines of one paragraph become one line.
std::vector<std::string> joined_lines(const std::string& text) {
    std::vector<std::string> out;
    std::istringstream lines{text};
    bool follows = false;
    for (std::string line; std::getline(lines, line);) {
        const bool belongs = is_of_paragraph(line);
        if (belongs && follows) {
            out.back().append(" ").append(line);
        } else {
            out.push_back(line);
        }
        follows = belongs;
    }
    return out;
}

void append_wrapped(std::string& out, std::string line, std::size_t width, std::size_t indent) {
    while (line.size() > width) {
        const auto begin = std::max(indent, line.find_first_not_of(' '));
        auto space = line.rfind(' ', width);
        if (space == std::string::npos || space <= begin) {
            space = line.find(' ', begin + 1); // a word that is longer than the line
        }
        if (space == std::string::npos) {
            break;
        }
        out.append(line, 0, line.find_last_not_of(' ', space) + 1).append("\n");
        const auto rest = line.find_first_not_of(' ', space);
        line = rest == std::string::npos ? std::string{} : std::string(indent, ' ').append(line, rest);
    }
    out.append(line).append("\n");
}

} // namespace

std::string wrapped_help(const std::string& text, std::size_t width, std::size_t column) {
    std::string out;
    bool in_examples = false;
    for (const auto& line : joined_lines(text)) {
        in_examples = in_examples || line == "Examples:";
        if (in_examples) {
            out.append(line).append("\n");
        } else {
            append_wrapped(out, line, width, line.starts_with(' ') ? std::min(column, width / 2) : 0);
        }
    }
    return out;
}

std::string help_formatter::make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const {
    auto text = CLI::Formatter::make_help(app, std::move(name), mode);
    constexpr std::size_t narrowest = 40;
    const auto width = terminal_width();
    return width == 0 ? text : wrapped_help(text, std::max(width, narrowest), get_column_width());
}

} // namespace tool
