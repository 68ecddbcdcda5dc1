// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/printable.hpp>
#include <cles/service.hpp>

#include <boost/describe/class.hpp>

#include <chrono>
#include <cstdio>
#include <map>
#include <string>

namespace dsgd {

/// How often a manager looks whether nodes are late, and how many times as seldom for nodes that have come.
inline constexpr std::chrono::milliseconds watch_interval{20};
inline constexpr int peers_every = 10;

struct refusal {
    std::string error{}, message{};
};
BOOST_DESCRIBE_STRUCT(refusal, (), (error, message))

/// The reply to a PULL of all nodes: of each its result, or why there is none.
template <class Offer>
struct offers {
    std::map<std::string, Offer> results;
    std::map<std::string, refusal> errors;
    BOOST_DESCRIBE_CLASS(offers, (), (results, errors), (), ())
};

/// What is known of a node; empty if it is not known.
inline cles::peer peer_of(const cles::service& member, const std::string& node) {
    for (auto& each : member.peers()) {
        if (each.node == node) {
            return each;
        }
    }
    return {};
}

// For a node that is busy as well; one that has stopped takes all of it.
inline constexpr std::chrono::seconds find_deadline{5};

/// What each node replies that offers the task; stderr names those that do not reply.
/// \param task   by PULL
/// \param plugin that offers it
/// \throws cles::error that says what is missing
template <class Offer>
std::map<std::string, Offer> find_offers(cles::service& node, const std::string& task, const char* plugin) {
    offers<Offer> found;
    try {
        found = cles::from_json<offers<Offer>>(
            node.request("PULL all:" + task, cles::call_options{}.deadline(find_deadline)));
    } catch (const cles::error& e) {
        if (node.peers().empty()) {
            throw cles::error(cles::errc::no_target,
                              "no node answers at the given address (--at): is clesd running there?");
        }
        throw cles::error(e.code(), e.message() + ": is " + plugin + " among the plugins of a node?");
    }
    std::string silent;
    for (const auto& [name, why] : found.errors) {
        const auto shown = cles::printable(name);
        std::fprintf(stderr, "cles-dsgd: %s does not take part: %s\n", shown.c_str(),
                     cles::printable(why.message).c_str());
        silent += (silent.empty() ? "" : ", ") + shown;
    }
    if (found.results.empty()) {
        throw cles::error(cles::errc::deadline, "no node that offers '" + task + "' answers: " + silent);
    }
    return found.results;
}

} // namespace dsgd
