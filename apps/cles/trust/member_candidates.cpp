// SPDX-License-Identifier: BSL-1.0
#include "trust/member_candidates.hpp"

#include <cles/security/fleet_files.hpp>

#include "options/keys_option.hpp"

#include <CLI/App.hpp>

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace tool {

std::vector<candidate> member_candidates(std::vector<std::string> words, const std::string& suffix) {
    keys_option keys;
    CLI::App parser;
    parser.set_help_flag();
    parser.allow_extras();
    keys.add_to(parser, "");
    std::reverse(words.begin(), words.end()); // the order that CLI11 expects
    parser.parse(std::move(words));
    std::vector<candidate> out;
    try {
        for (const auto& member : cles::security::describe_fleet(keys.directory()).members) {
            out.push_back({member.name + suffix, "member " + std::to_string(member.number)});
        }
    } catch (const std::runtime_error&) {
        return {};
    }
    return out;
}

} // namespace tool
