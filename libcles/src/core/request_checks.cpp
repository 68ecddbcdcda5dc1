// SPDX-License-Identifier: BSL-1.0
#include "core/request_checks.hpp"

#include <cles/json_reader.hpp>

#include "protocol/parts.hpp"

#include <exception>
#include <string>
#include <utility>

namespace cles::core {

decoded_parameters decode(const protocol::noun_view& noun, std::string& storage) {
    decoded_parameters result;
    storage.clear();
    storage.reserve(noun.path.size());
    for (const auto raw : noun.parameters) {
        if (raw.find('%') == std::string_view::npos) {
            result.push_back(raw);
            continue;
        }
        const auto start = storage.size();
        protocol::decode_parameter(raw, storage);
        result.push_back(std::string_view{storage}.substr(start));
    }
    return result;
}

void release_if_large(std::string& decoded) {
    constexpr std::size_t kept = 4096;
    if (decoded.capacity() > kept) {
        std::string{}.swap(decoded);
    }
}

bool passes(std::string_view via, std::string_view name) {
    while (!via.empty()) {
        const auto comma = via.find(',');
        if (via.substr(0, comma) == name) {
            return true;
        }
        via.remove_prefix(comma == std::string_view::npos ? via.size() : comma + 1);
    }
    return false;
}

namespace {

// What the rules throw is their own fault, and no reason to let anybody in.
bool ask_rules(const node& n, const access& asked, std::uint64_t id) {
    try {
        return n.authorise(asked);
    } catch (const std::exception& thrown) {
        const auto why = std::string{"denied, since the access rules threw: "} + thrown.what();
        n.say(log_level::error, {why, asked.peer.address, id});
    } catch (...) {
        n.say(log_level::error, {"denied, since the access rules threw", asked.peer.address, id});
    }
    return false;
}

} // namespace

bool allows(const node& n, const identity& peer, const protocol::request_line& r) {
    if (!n.authorise) {
        return true;
    }
    std::string scratch;
    const auto path = protocol::canonical_path(r.noun, scratch);
    return ask_rules(n, {peer, r.verb, r.noun.task, path}, r.id);
}

bool is_for(const node& n, const protocol::request_line& r) {
    return r.noun.target == "self" || r.noun.target == n.name;
}

std::optional<protocol::failure> objection(const node& n, const identity& peer, const protocol::request_line& r) {
    const auto object = [](errc code, std::string message) {
        return protocol::failure{.code = code, .message = std::move(message)};
    };
    if (!allows(n, peer, r)) {
        return object(errc::denied, n.name + " does not allow " + std::string{to_string(r.verb)} + " '" +
                                        std::string{r.noun.task} + "'");
    }
    // What is told of the reserved task is for the link that it comes by: an id to withdraw, for one.
    const bool stays = n.way == nullptr || (r.noun.task == "cles" && r.verb != verb::pull);
    if (stays && !is_for(n, r)) {
        const auto target = protocol::quoted(r.noun.target);
        if (n.way != nullptr) {
            return object(errc::no_target, n.name + " forwards PULL of 'cles' only, and this is for " + target);
        }
        return object(errc::no_target,
                      n.name + " does not route, and so asks nobody for " + target +
                          (protocol::is_reserved_target(r.noun.target)
                               ? ": give it cles::routing() as service_options::routing, or ask a node that routes, "
                                 "as clesd does"
                               : ": ask that node itself, or a node that routes, as clesd does"));
    }
    if (passes(r.via, n.name)) {
        return object(errc::no_target, n.name + " has forwarded this request for " + protocol::quoted(r.noun.target) +
                                           " before: the nodes in 'via' pass it round");
    }
    std::string why;
    if (!r.body.empty() && !is_valid_json(r.body, n.bounds.depth, &why)) {
        return object(errc::bad_request, n.name + ": the body is not valid JSON: " + why);
    }
    if (r.verb == verb::update && protocol::begins_with_error(r.body)) {
        return object(errc::bad_request, n.name + ": an update's first key cannot be 'error'");
    }
    return std::nullopt;
}

bool says_that_it_leaves(const protocol::request_line& r) noexcept {
    return r.verb == verb::push && !r.wants_reply && r.noun.target == "self" && r.noun.path == "cles/leaving";
}

protocol::failure shutting_down(const node& n) {
    return {.code = errc::busy, .message = n.name + " is shutting down", .retry_ms = 1000};
}

protocol::failure no_room_for_links(const node& n) {
    return {.code = errc::busy, .message = n.name + " has as many links as it may", .retry_ms = 1000};
}

std::optional<std::uint64_t> cancelled_id(const protocol::noun_view& noun) {
    if (noun.task != "cles" || noun.parameters.size() != 2 || noun.parameters[0] != "cancel") {
        return std::nullopt;
    }
    return protocol::number_between(noun.parameters[1], 1, protocol::max_id);
}

} // namespace cles::core
