// SPDX-License-Identifier: BSL-1.0
#include "simulation/network/planted.hpp"

#include <boost/algorithm/string/classification.hpp>
#include <boost/algorithm/string/join.hpp>
#include <boost/algorithm/string/split.hpp>

#include <algorithm>
#include <utility>
#include <vector>

namespace cles::simulation {
namespace {

using text_lines = std::vector<std::string>;

bool is_push(std::string_view line) {
    return line.starts_with("PUSH ") && line.find(":store/") != std::string_view::npos;
}
// A router's request for a node that it has chosen.
bool is_choice(std::string_view line) { return line.starts_with("DELEGATE car"); }
bool is_moved_job(std::string_view line) {
    return line.starts_with("DELEGATE ") && line.find(" grant=") != std::string_view::npos;
}
bool is_result(std::string_view line) {
    return line.starts_with("id=") && line.find(" {\"op\":") != std::string_view::npos &&
           line.find(" progress=") == std::string_view::npos;
}

// The first such request with an id: the copy precedes it, with these digits before its own id.
void repeat(text_lines& lines, bool (*is_wanted)(std::string_view), std::string_view digits) {
    constexpr std::string_view id{" id="};
    const auto found = std::find_if(lines.begin(), lines.end(), [&](const std::string& line) {
        return is_wanted(line) && line.find(id) != std::string::npos;
    });
    if (found != lines.end()) {
        auto copy = *found;
        copy.insert(copy.find(id) + id.size(), digits);
        lines.insert(found, std::move(copy));
    }
}

void swap_replies(text_lines& lines) {
    const auto found = std::adjacent_find(lines.begin(), lines.end(), [](const std::string& a, const std::string& b) {
        return a.starts_with('{') && b.starts_with('{');
    });
    if (found != lines.end()) {
        std::iter_swap(found, found + 1);
    }
}

void swallow_rebinds(text_lines& lines, std::set<std::string, std::less<>>& bound) {
    constexpr std::string_view verb{"BIND "};
    std::erase_if(lines, [&](const std::string& line) {
        return line.starts_with(verb) && line.find(" lease=0") == std::string::npos &&
               !bound.insert(line.substr(verb.size(), line.find(' ', verb.size()) - verb.size())).second;
    });
}

void exchange_ids(text_lines& lines) {
    const auto first = std::find_if(lines.begin(), lines.end(), is_result);
    const auto second = first == lines.end() ? first : std::find_if(first + 1, lines.end(), is_result);
    if (second != lines.end()) {
        const auto a = first->substr(0, first->find(' '));
        const auto b = second->substr(0, second->find(' '));
        first->replace(0, a.size(), b);
        second->replace(0, b.size(), a);
    }
}

} // namespace

void tampering::apply(std::string& lines, const std::weak_ptr<place>& sender, dice& chance) {
    const bool always =
        fault_ == planted::rebind_forgotten || fault_ == planted::way_repeats || fault_ == planted::moved_twice;
    const bool sometimes =
        fault_ == planted::stream_repeats || fault_ == planted::replies_swapped || fault_ == planted::ids_exchanged;
    if (!always && (!sometimes || chance.chance(500))) {
        return;
    }
    text_lines each;
    boost::algorithm::split(each, lines, boost::algorithm::is_any_of("\n"));
    switch (fault_) {
    case planted::rebind_forgotten: swallow_rebinds(each, bound_[sender]); break;
    case planted::way_repeats: repeat(each, is_choice, "9000000"); break; // the reply to the copy matches no request
    case planted::moved_twice: repeat(each, is_moved_job, "9000000"); break;
    case planted::stream_repeats: repeat(each, is_push, ""); break;
    case planted::replies_swapped: swap_replies(each); break;
    default: exchange_ids(each);
    }
    lines = boost::algorithm::join(each, "\n");
}

} // namespace cles::simulation
