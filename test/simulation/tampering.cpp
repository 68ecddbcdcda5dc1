// SPDX-License-Identifier: BSL-1.0
#include "simulation/tampering.hpp"

#include "protocol/reply_line.hpp"

#include <string_view>
#include <utility>
#include <vector>

namespace cles::simulation {
namespace {

std::vector<std::string> split(std::string_view text) {
    std::vector<std::string> lines;
    while (!text.empty()) {
        const auto end = text.find('\n') + 1;
        lines.emplace_back(text.substr(0, end));
        text.remove_prefix(end);
    }
    return lines;
}

bool is_plain_reply(std::string_view line) { return line.starts_with('{'); }
bool is_result(std::string_view line) {
    return line.starts_with("id=") && line.find(" {\"op\":") != std::string_view::npos &&
           line.find(" progress=") == std::string_view::npos;
}

void repeat_push(std::vector<std::string>& lines) {
    for (std::size_t i = 0; i < lines.size(); ++i) {
        if (lines[i].starts_with("PUSH ") && lines[i].find(":store/") != std::string::npos &&
            lines[i].find(" id=") != std::string::npos) {
            lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(i), lines[i]);
            return;
        }
    }
}

void swap_replies(std::vector<std::string>& lines) {
    for (std::size_t i = 0; i + 1 < lines.size(); ++i) {
        if (is_plain_reply(lines[i]) && is_plain_reply(lines[i + 1])) {
            std::swap(lines[i], lines[i + 1]);
            return;
        }
    }
}

void exchange_ids(std::vector<std::string>& lines) {
    std::string* before = nullptr;
    for (auto& line : lines) {
        if (!is_result(line)) {
            continue;
        }
        if (before != nullptr) {
            const auto a = before->substr(0, before->find(' '));
            const auto b = line.substr(0, line.find(' '));
            before->replace(0, a.size(), b);
            line.replace(0, b.size(), a);
            return;
        }
        before = &line;
    }
}

} // namespace

void tamper_with(std::string& lines, planted fault, dice& chance) {
    const bool concerned =
        fault == planted::stream_repeats || fault == planted::replies_swapped || fault == planted::ids_exchanged;
    if (!concerned || chance.chance(500)) {
        return;
    }
    auto each = split(lines);
    if (fault == planted::stream_repeats) {
        repeat_push(each);
    } else if (fault == planted::replies_swapped) {
        swap_replies(each);
    } else {
        exchange_ids(each);
    }
    lines.clear();
    for (const auto& line : each) {
        lines.append(line);
    }
}

} // namespace cles::simulation
