// SPDX-License-Identifier: BSL-1.0
#include "simulation/world/plan.hpp"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace cles::simulation {
namespace {

using names = std::array<std::string_view, action::most_fields>;

struct kind {
    std::string_view name;
    std::size_t count;
    names fields;
};

// In the order of `deed`. Times and durations in milliseconds, sizes in bytes, probabilities per mille.
constexpr std::array<kind, 21> kinds{{
    {"ask", 10, {"op", "from", "to", "by", "what", "deadline", "size", "work", "steps", "end"}},
    {"cancel", 1, {"op"}},
    {"follow", 8, {"feed", "from", "to", "by", "noun", "every", "keep", "slow"}},
    {"hold", 2, {"feed", "for"}},
    {"leave", 1, {"feed"}},
    {"publish", 4, {"host", "noun", "count", "size"}},
    {"offer", 3, {"host", "count", "size"}},
    {"talk", 7, {"op", "to", "lines", "gap", "style", "end", "slow"}},
    {"crash", 2, {"host", "down"}},
    {"freeze", 2, {"host", "for"}},
    {"part", 3, {"a", "b", "for"}},
    {"cut", 2, {"host", "which"}},
    {"weather", 5, {"lost", "doubled", "late", "least", "spread"}},
    {"gather", 6, {"feed", "from", "to", "all", "noun", "slow"}},
    {"namesake", 3, {"host", "for", "silent"}},
    {"depart", 2, {"host", "down"}},
    {"mute", 3, {"from", "to", "for"}},
    {"jump", 2, {"host", "ahead"}},
    {"retire", 3, {"host", "limit", "down"}},
    {"roster", 3, {"what", "host", "other"}},
    {"attack", 3, {"what", "host", "count"}},
}};

const kind& kind_of(deed what) noexcept { return kinds[static_cast<std::size_t>(what)]; }

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
    const auto found = std::find_if(kinds.begin(), kinds.end(), [&](const kind& k) { return k.name == name; });
    if (found == kinds.end()) {
        throw std::runtime_error{"'" + std::string{name} + "' is nothing that happens"};
    }
    a.what = static_cast<deed>(found - kinds.begin());
    while (!rest.empty()) {
        const auto part = word(rest);
        const auto equals = part.find('=');
        const auto field = std::find(found->fields.begin(), found->fields.end(), part.substr(0, equals));
        if (equals == std::string_view::npos || field == found->fields.end()) {
            throw std::runtime_error{"'" + std::string{part} + "' says nothing about " + std::string{name}};
        }
        a.numbers[static_cast<std::size_t>(field - found->fields.begin())] =
            static_cast<std::uint32_t>(number(part.substr(equals + 1)));
    }
    return a;
}

} // namespace

std::span<const std::string_view> fields_of(deed what) noexcept {
    return {kind_of(what).fields.data(), kind_of(what).count};
}

std::string_view to_string(deed what) noexcept { return kind_of(what).name; }

std::uint32_t action::operator[](std::string_view field) const {
    const auto fields = fields_of(what);
    const auto found = std::find(fields.begin(), fields.end(), field);
    if (found == fields.end()) {
        throw std::logic_error{"no field " + std::string{field}};
    }
    return numbers[static_cast<std::size_t>(found - fields.begin())];
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
