// SPDX-License-Identifier: BSL-1.0
#include "simulation/world/plan.hpp"

#include <boost/describe/enum_from_string.hpp>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace cles::simulation {
namespace {

using names = std::array<std::string_view, action::most_fields>;

// In the order of `deed`. Times and durations in milliseconds, sizes in bytes, probabilities per mille.
constexpr std::array<names, 21> fields_by_deed{{
    {"op", "from", "to", "by", "what", "deadline", "size", "work", "steps", "end"}, // ask
    {"op"},                                                                         // cancel
    {"feed", "from", "to", "by", "noun", "every", "keep", "slow"},                  // follow
    {"feed", "for"},                                                                // hold
    {"feed"},                                                                       // leave
    {"host", "noun", "count", "size"},                                              // publish
    {"host", "count", "size"},                                                      // offer
    {"op", "to", "lines", "gap", "style", "end", "slow"},                           // talk
    {"host", "down"},                                                               // crash
    {"host", "for"},                                                                // freeze
    {"a", "b", "for"},                                                              // part
    {"host", "which"},                                                              // cut
    {"lost", "doubled", "late", "least", "spread"},                                 // weather
    {"feed", "from", "to", "all", "noun", "slow"},                                  // gather
    {"host", "for", "silent"},                                                      // namesake
    {"host", "down"},                                                               // depart
    {"from", "to", "for"},                                                          // mute
    {"host", "ahead"},                                                              // jump
    {"host", "limit", "down"},                                                      // retire
    {"what", "host", "other"},                                                      // roster
    {"what", "host", "count"},                                                      // attack
}};

std::string_view word(std::string_view& rest) {
    const auto end = std::min(rest.find(' '), rest.size());
    const auto first = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    return first;
}

std::uint64_t number(std::string_view text) {
    std::uint64_t value = 0;
    const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (failed != std::errc{} || end != text.data() + text.size()) {
        throw std::runtime_error{"'" + std::string{text} + "' is no number"};
    }
    return value;
}

action action_from(std::string_view first, std::string_view rest) {
    action a{.at_ms = static_cast<std::uint32_t>(number(first))};
    const auto name = word(rest);
    if (!boost::describe::enum_from_string(std::string{name}.c_str(), a.what)) {
        throw std::runtime_error{"'" + std::string{name} + "' is nothing that happens"};
    }
    const auto known = fields_of(a.what);
    while (!rest.empty()) {
        const auto part = word(rest);
        const auto equals = part.find('=');
        const auto field = std::ranges::find(known, part.substr(0, equals));
        if (equals == std::string_view::npos || field == known.end()) {
            throw std::runtime_error{"'" + std::string{part} + "' says nothing about " + std::string{name}};
        }
        a.numbers[static_cast<std::size_t>(field - known.begin())] =
            static_cast<std::uint32_t>(number(part.substr(equals + 1)));
    }
    return a;
}

} // namespace

std::span<const std::string_view> fields_of(deed what) noexcept {
    const auto& all = fields_by_deed[static_cast<std::size_t>(what)];
    return {all.begin(), std::ranges::find(all, std::string_view{})};
}

std::uint32_t action::operator[](std::string_view field) const {
    const auto known = fields_of(what);
    const auto found = std::ranges::find(known, field);
    if (found == known.end()) {
        throw std::logic_error{"no field " + std::string{field}};
    }
    return numbers[static_cast<std::size_t>(found - known.begin())];
}

std::string to_text(const plan& p) {
    std::string text = "seed " + std::to_string(p.seed) + "\nhosts " + std::to_string(p.hosts) + "\nlimits " +
                       (p.small_limits ? "small" : "default") + "\nstrangers " + (p.strangers ? "yes" : "no") +
                       "\ngroup " + (p.group ? "yes" : "no") + "\nsecured " + (p.secured ? "yes" : "no") + "\n";
    for (const auto& a : p.actions) {
        text.append(std::to_string(a.at_ms)).append(" ").append(to_string(a.what));
        for (std::size_t i = 0; i < fields_of(a.what).size(); ++i) {
            text.append(" ").append(fields_of(a.what)[i]).append("=").append(std::to_string(a.numbers[i]));
        }
        text.push_back('\n');
    }
    return text;
}

plan plan_from(std::string_view text) {
    plan p;
    while (!text.empty()) {
        const auto end = std::min(text.find('\n'), text.size());
        const auto line = text.substr(0, end);
        text.remove_prefix(std::min(end + 1, text.size()));
        if (line.empty() || line.starts_with('#')) {
            continue;
        }
        auto rest = line;
        const auto first = word(rest);
        try {
            if (first == "seed") {
                p.seed = number(rest);
            } else if (first == "hosts") {
                p.hosts = static_cast<unsigned>(number(rest));
            } else if (first == "limits") {
                p.small_limits = rest == "small";
            } else if (first == "strangers") {
                p.strangers = rest == "yes";
            } else if (first == "group") {
                p.group = rest == "yes";
            } else if (first == "secured") {
                p.secured = rest == "yes";
            } else {
                p.actions.push_back(action_from(first, rest));
            }
        } catch (const std::runtime_error& e) {
            throw std::runtime_error{"'" + std::string{line} + "': " + e.what()};
        }
    }
    return p;
}

plan plan_in_file(const std::string& path) {
    std::ifstream file{path, std::ios::binary};
    if (!file) {
        throw std::runtime_error{path + " cannot be read"};
    }
    return plan_from(std::string{std::istreambuf_iterator<char>{file}, {}});
}

} // namespace cles::simulation
