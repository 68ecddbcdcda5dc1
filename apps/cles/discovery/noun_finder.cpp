// SPDX-License-Identifier: BSL-1.0
#include "discovery/noun_finder.hpp"

#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/verb.hpp>

#include "client/client.hpp"
#include "client/offered_tasks.hpp"
#include "discovery/ask_all.hpp"
#include "discovery/find_nodes.hpp"
#include "options/addresses.hpp"
#include "options/arguments.hpp"
#include "output/errors.hpp"
#include "output/json_node.hpp"

#include <boost/system/error_code.hpp>

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>

namespace tool {

namespace asio = boost::asio;
using steady = std::chrono::steady_clock;

namespace {

constexpr std::size_t most_asked = 256; // nodes; more would be a load of their own

// Whether the node has no list of its nouns, at least not for this member.
bool does_not_tell(boost::system::error_code why) { return why == cles::errc::no_task || why == cles::errc::denied; }

// What a node has answered, whichever of the two it was; empty if neither.
std::vector<std::string> told_paths(const std::string& nouns, const std::string& description) {
    try {
        return !nouns.empty()         ? paths_in(nouns)
               : !description.empty() ? bindable_tasks_in(description)
                                      : std::vector<std::string>{};
    } catch (const cles::error&) { // it is not what it should be
        return {};
    }
}

} // namespace

std::vector<std::string> paths_in(std::string_view nouns) {
    std::vector<std::string> out;
    const auto document = parse_json(nouns);
    if (const auto* const listed = document.find("nouns"); listed != nullptr) {
        for (const auto& each : listed->elements) {
            out.push_back(each.text);
        }
    }
    return out;
}

std::vector<std::string> bindable_tasks_in(std::string_view description) {
    std::vector<std::string> out;
    const auto document = parse_json(description);
    for (const auto& each : offered_tasks(document.find("tasks"))) {
        if (each.verb == to_string(cles::verb::bind)) {
            out.push_back(each.task);
        }
    }
    return out;
}

asio::awaitable<std::vector<found_noun>> noun_finder::find() {
    std::vector<found_noun> found;
    failure_ = nullptr;
    for (const auto& pattern : patterns_) {
        if (!pattern.is_of_many_nodes()) {
            co_await ask_one(pattern, found);
        }
    }
    if (std::any_of(patterns_.begin(), patterns_.end(), [](const auto& each) { return each.is_of_many_nodes(); })) {
        co_await ask_many(found);
    }
    co_return found;
}

asio::awaitable<void> noun_finder::ask_one(const noun_pattern& pattern, std::vector<found_noun>& found) {
    std::string nouns;
    std::string description;
    const auto asked = pattern.target() + ":cles";
    try {
        const auto options = requester_.options_for(asked, patience);
        try {
            const cles::json_text told = co_await requester_.node().async_pull(asked + "/nouns", options);
            nouns = told.text;
        } catch (const cles::error& e) {
            if (!does_not_tell(e.code())) {
                throw;
            }
        }
        if (nouns.empty()) {
            const cles::json_text told = co_await requester_.node().async_pull(asked, options);
            description = told.text;
        }
    } catch (const cles::error& e) {
        if (e.code() == cles::errc::cancelled) {
            throw;
        }
        failure_ = std::current_exception();
    }
    for (const auto& path : told_paths(nouns, description)) {
        if (pattern.matches_path(path)) {
            found.push_back({.noun = pattern.target() + ":" + path});
        }
    }
}

asio::awaitable<void> noun_finder::ask_many(std::vector<found_noun>& found) {
    const auto until = steady::now() + patience;
    auto nodes = co_await find_nodes_quickly(requester_, addresses_, until);
    if (nodes.empty() && addresses_.has_url()) { // why does the node there not answer?
        std::vector<found_noun> ignored;
        const noun_pattern own{"self:**"};
        co_await ask_one(own, ignored);
    }
    std::erase_if(nodes, [this](const listed_node& node) {
        return node.state == "clash" || node.url().empty() || stands_for_others(node.node) ||
               std::none_of(patterns_.begin(), patterns_.end(), [&](const noun_pattern& each) {
                   return each.is_of_many_nodes() && each.matches_node(node.node);
               });
    });
    if (nodes.size() > most_asked) {
        if (!std::exchange(has_left_out_, true)) {
            note("more than " + std::to_string(most_asked) + " nodes match: " + nodes[most_asked].node +
                 " and others are not asked");
        }
        nodes.resize(most_asked);
    }
    auto urls = urls_of(nodes);
    const auto nouns = co_await ask_all(requester_, "self:cles/nouns", urls, patience);
    for (std::size_t i = 0; i < urls.size(); ++i) { // the others need not be asked again
        if (!does_not_tell(nouns[i].code)) {
            urls[i].clear();
        }
    }
    const auto descriptions = co_await ask_all(requester_, "self:cles", std::move(urls), patience);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        for (const auto& path : told_paths(nouns[i].json, descriptions[i].json)) {
            const bool is_wanted = std::any_of(patterns_.begin(), patterns_.end(), [&](const noun_pattern& each) {
                return each.is_of_many_nodes() && each.matches_node(nodes[i].node) && each.matches_path(path);
            });
            if (is_wanted) {
                found.push_back(
                    {.noun = nodes[i].node + ":" + path, .url = addresses_.has_url() ? nodes[i].url() : std::string{}});
            }
        }
    }
}

} // namespace tool
