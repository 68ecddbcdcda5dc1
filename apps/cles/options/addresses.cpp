// SPDX-License-Identifier: BSL-1.0
#include "options/addresses.hpp"

#include <cles/error.hpp>
#include <cles/link.hpp>
#include <cles/url.hpp>

#include "options/arguments.hpp"
#include "output/failure.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <cstdlib>

namespace tool {
namespace {

void check_url(const std::string& text) {
    const auto scheme = cles::parse_url(text).scheme;
    if (cles::find_transport(scheme) == nullptr) {
        throw usage_error("'" + text + "': there is no transport called " + scheme);
    }
}

} // namespace

void address_book::add_options(CLI::App& command, const std::string& multicast_help) {
    auto* at = command.add_option("-a,--at", at_,
                                  "Where the node is (default CLES_AT; else it is found by its name, and self is " +
                                      std::string{default_url} + ")");
    at->type_name("URL");
    auto* peer = command.add_option("-p,--peer", peers_, "Where a node of that name is; may be repeated");
    peer->type_name("NAME=URL")->expected(1)->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    multicast_.add_to(command, multicast_help);
}

std::string address_book::at() const {
    const char* otherwise = std::getenv("CLES_AT");
    return at_.empty() && otherwise != nullptr ? otherwise : at_;
}

void address_book::check() const {
    if (const auto where = at(); !where.empty()) {
        check_url(where);
    }
    for (const auto& peer : peers_) {
        const auto equals = peer.find('=');
        const std::string_view name = std::string_view{peer}.substr(0, equals);
        if (equals == std::string::npos || !is_name(name)) {
            throw usage_error("--peer '" + peer + "': write NAME=URL, as in car1=tcp://127.0.0.1:25370");
        }
        if (name == "self" || name == "any" || name == "all") {
            throw usage_error("--peer '" + peer + "': no node is called " + std::string{name});
        }
        check_url(peer.substr(equals + 1));
    }
}

std::map<std::string, std::string> address_book::peers() const {
    std::map<std::string, std::string> out;
    for (const auto& peer : peers_) {
        const auto equals = peer.find('=');
        out[peer.substr(0, equals)] = peer.substr(equals + 1);
    }
    return out;
}

std::string address_book::url_for(std::string_view node) const {
    if (peers().contains(std::string{node})) {
        return {};
    }
    const auto where = at();
    if (where.empty() && !peers_.empty()) {
        throw cles::error(cles::errc::no_target,
                          "no --peer is called '" + std::string{node} + "', and there is no --at");
    }
    if (finds_by_name() && node != "self" && node != "any" && node != "all") {
        return {};
    }
    return where.empty() ? std::string{default_url} : where;
}

std::string address_book::where_is(std::string_view node) const {
    const auto known = peers();
    const auto at = known.find(std::string{node});
    return at != known.end() ? at->second : url_for(node);
}

} // namespace tool
