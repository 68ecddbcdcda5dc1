// SPDX-License-Identifier: BSL-1.0
#include "simulation/network/tampering.hpp"

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

// A router's request for a node that it has chosen; the answer to the copy is nobody's.
void repeat_choice(std::vector<std::string>& lines) {
    for (std::size_t i = 0; i < lines.size(); ++i) {
        const auto at = lines[i].find(" id=");
        if (lines[i].starts_with("DELEGATE car") && at != std::string::npos) {
            lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(i), lines[i]);
            lines[i].insert(at + std::string_view{" id="}.size(), "9000000");
            return;
        }
    }
}

void swallow_rebinds(std::vector<std::string>& lines, std::set<std::string, std::less<>>& bound) {
    constexpr std::string_view verb{"BIND "};
    std::erase_if(lines, [&](const std::string& line) {
        return line.starts_with(verb) && line.find(" lease=0") == std::string::npos &&
               !bound.insert(line.substr(verb.size(), line.find(' ', verb.size()) - verb.size())).second;
    });
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

void tampering::apply(std::string& lines, const std::weak_ptr<place>& sender, dice& chance) {
    const bool always = fault_ == planted::rebind_forgotten || fault_ == planted::way_repeats;
    const bool sometimes =
        fault_ == planted::stream_repeats || fault_ == planted::replies_swapped || fault_ == planted::ids_exchanged;
    if (!always && (!sometimes || chance.chance(500))) {
        return;
    }
    auto each = split(lines);
    switch (fault_) {
    case planted::rebind_forgotten: swallow_rebinds(each, bound_[sender]); break;
    case planted::way_repeats: repeat_choice(each); break;
    case planted::stream_repeats: repeat_push(each); break;
    case planted::replies_swapped: swap_replies(each); break;
    default: exchange_ids(each);
    }
    lines.clear();
    for (const auto& line : each) {
        lines.append(line);
    }
}

} // namespace cles::simulation
