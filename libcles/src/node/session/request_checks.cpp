// SPDX-License-Identifier: BSL-1.0
#include "node/session/request_checks.hpp"

#include <cles/json_reader.hpp>
#include <cles/pending.hpp>

#include "node/membership/reachable_endpoints.hpp"
#include "port/node_security.hpp"
#include "protocol/exempt_nouns.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <cstddef>
#include <exception>
#include <utility>

namespace cles::core {

std::string request_text(verb how, std::string_view path) {
    return std::string{to_string(how)} + " " + protocol::quoted(path);
}

bool is_in_via(std::string_view via, std::string_view name) {
    return protocol::any_in_via(via, [name](std::string_view node) { return node == name; });
}

namespace {

constexpr std::string_view all_nodes = "all";

// Who it is at the other end of a link of a secured node.
std::string_view member_at(const node_state& n, const identity& peer) {
    return peer.transport == "inproc" ? std::string_view{n.name} : peer.name;
}

std::string not_allowed(const node_state& n, verb how, std::string_view path) {
    return n.name + " does not allow " + request_text(how, path);
}

} // namespace

std::string via_of_part(std::string_view via) {
    return std::string{all_nodes}.append(via.empty() ? "" : ",").append(via);
}

bool is_part_of_all(const protocol::request_line& r) {
    return r.noun.target == all_nodes || is_in_via(r.via, all_nodes);
}

request_origin origin_of(const node_state& n, const identity& peer, const protocol::request_line& r) {
    if (!n.security) {
        return {};
    }
    const auto by = member_at(n, peer);
    if (r.from.empty()) {
        return {.requester = by};
    }
    return n.security->may_forward(by, r.from) ? request_origin{.requester = r.from, .forwarder = by}
                                               : request_origin{};
}

std::string_view member_of(const node_state& n, std::string_view target) {
    if (!n.security || n.security->is_member(target)) {
        return target;
    }
    const auto rest = target.substr(std::min(target.find('.'), target.size() - 1) + 1);
    return n.security->is_member(rest) || protocol::is_reserved_target(rest) ? rest : target;
}

bool permits(const node_state& n, const request_origin& by, std::string_view provider, verb how,
             const protocol::noun_view& noun) {
    if (!n.security) {
        return true;
    }
    const auto member = member_of(n, provider);
    const bool is_group_elsewhere = member.size() != provider.size() && protocol::is_reserved_target(member);
    return is_group_elsewhere || n.security->allows(by, member, how, noun);
}

bool permits(const node_state& n, const request_origin& by, std::string_view provider, verb how,
             std::string_view path) {
    if (!n.security) {
        return true;
    }
    protocol::noun_view noun;
    std::string why;
    const auto whole = std::string{provider}.append(":").append(path);
    return protocol::parse_noun(whole, noun, why) && permits(n, by, provider, how, noun);
}

bool may_forward_for(const node_state& n, std::string_view requester) {
    return !n.security || requester == n.name || n.security->may_forward(n.name, requester);
}

namespace {

passage passage_of(const node_state& n, const request_origin& by, bool is_permitted_there) {
    return !is_permitted_there                 ? passage::not_permitted
           : !may_forward_for(n, by.requester) ? passage::not_forwarded
                                               : passage::permitted;
}

} // namespace

passage may_pass_on(const node_state& n, const request_origin& by, std::string_view node, verb how,
                    const protocol::noun_view& noun) {
    return passage_of(n, by, permits(n, by, node, how, noun));
}

passage may_pass_on(const node_state& n, const request_origin& by, std::string_view node, verb how,
                    std::string_view path) {
    return passage_of(n, by, permits(n, by, node, how, path));
}

std::string how_to_permit_forwarding(std::string_view forwarder, std::string_view requester) {
    return "(cles fleet rights " + std::string{forwarder} + " --forwards " + std::string{requester} + ")";
}

namespace {

protocol::failure reason_of(const node_state& n, passage why, std::string_view requester, std::string_view node,
                            verb how, std::string_view path) {
    return {.code = errc::denied,
            .message = why == passage::not_forwarded
                           ? n.name + " may not forward requests of " + std::string{requester} + " to " +
                                 std::string{node} + " " + how_to_permit_forwarding(n.name, requester)
                           : not_allowed(n, how, path)};
}

bool is_exempt(const protocol::noun_view& noun) noexcept {
    return !noun.parameters.empty() && protocol::is_exempt_from_rights(noun.task, noun.parameters.front());
}

// For `any` and `all`, the rights are checked for each node that is asked.
bool is_permitted(const node_state& n, const identity& peer, const protocol::request_line& r) {
    const auto by = origin_of(n, peer, r);
    if (by.requester.empty() || !n.security->is_member(by.requester)) {
        return false;
    }
    if (protocol::is_reserved_target(r.noun.target) && r.noun.target != "self") {
        return true;
    }
    return is_local_target(n, r) ? is_exempt(r.noun) || permits(n, by, n.name, r.verb, r.noun)
                                 : may_pass_on(n, by, r.noun.target, r.verb, r.noun) == passage::permitted;
}

// Why it is denied. A lack of the right to forward is not the requester's fault, so it is named.
protocol::failure denial(const node_state& n, const identity& peer, const protocol::request_line& r) {
    if (n.security) {
        const auto by = origin_of(n, peer, r);
        if (by.requester.empty() && !r.from.empty()) {
            const std::string stated{r.from};
            const std::string forwarder{member_at(n, peer)};
            return {.code = errc::denied,
                    .message = n.security->is_member(stated)
                                   ? n.name + ": " + (forwarder.empty() ? "the peer" : forwarder) +
                                         " may not forward requests of " + stated +
                                         (forwarder.empty() ? "" : " " + how_to_permit_forwarding(forwarder, stated))
                                   : n.name + ": '" + stated + "', the requester that is stated, is not a member"};
        }
        if (n.security->is_member(by.requester) && !protocol::is_reserved_target(r.noun.target) &&
            !is_local_target(n, r)) {
            return reason_of(n, may_pass_on(n, by, r.noun.target, r.verb, r.noun), by.requester, r.noun.target, r.verb,
                             r.noun.path);
        }
    }
    return {.code = errc::denied, .message = not_allowed(n, r.verb, r.noun.path)};
}

// "op, which states from='car3', was denied PULL car1:speed: ..."
std::string denial_text(std::string who, std::string_view from, verb how, std::string_view node, std::string_view path,
                        std::string_view why) {
    constexpr std::size_t longest = 128;
    std::string noun{node};
    noun.append(":").append(path);
    if (noun.size() > longest) {
        noun.replace(longest, std::string::npos, "...");
    }
    who.append(from.empty() ? "" : ", which states from=" + protocol::quoted(from) + ",");
    return who.append(" was denied ").append(to_string(how)).append(" ").append(noun).append(": ").append(why);
}

} // namespace

void log_denial(node_state& n, const identity& peer, const protocol::request_line& r, std::string_view why) {
    const std::string source{peer.name.empty() ? holder_of(peer) : peer.name};
    n.log_denial(source, peer.address, [&] {
        const auto node = is_local_target(n, r) ? std::string_view{n.name} : r.noun.target;
        return denial_text(source, r.from, r.verb, node, r.noun.path, why);
    });
}

protocol::failure no_passage(node_state& n, passage why, const request_origin& by, std::string_view node, verb how,
                             std::string_view path) {
    auto failure = reason_of(n, why, by.requester, node, how, path);
    const bool is_forwarded = !by.forwarder.empty();
    const std::string source{is_forwarded ? by.forwarder : by.requester};
    n.log_denial(source, {}, [&] {
        return denial_text(source, is_forwarded ? by.requester : std::string_view{}, how, node, path, failure.message);
    });
    return failure;
}

bool allows(node_state& n, const identity& peer, const protocol::request_line& r) {
    if (n.security && !is_permitted(n, peer, r)) {
        return false;
    }
    if (!n.authorise) {
        return true;
    }
    const auto log_error = [&](const std::string& why) {
        constexpr std::uint32_t most = 8;
        const auto source = peer.name.empty() ? holder_of(peer) : peer.name;
        const auto left_out =
            n.log ? n.logged.take({.kind = "rules", .source = source, .most = most}, n.time.now()) : std::nullopt;
        if (!left_out) {
            return;
        }
        const auto text = why + left_out_text(*left_out);
        const auto trace = r.trace ? protocol::trace_id_text(r.trace.id) : std::string{};
        n.write_log(log_level::error, {text, peer.address, r.id, trace});
    };
    std::string scratch;
    const auto path = protocol::canonical_path(r.noun, scratch);
    const auto by = origin_of(n, peer, r);
    try {
        return n.authorise({peer, r.verb, r.noun.task, path, by.requester, by.forwarder});
    } catch (const std::exception& thrown) {
        const auto why = std::string{"denied, because the access rules threw an exception: "} + thrown.what();
        log_error(why);
    } catch (...) {
        log_error("denied, because the access rules threw an exception");
    }
    return false; // rules that throw deny access
}

bool is_local_target(const node_state& n, const protocol::request_line& r) {
    return r.noun.target == "self" || r.noun.target == n.name;
}

std::optional<protocol::failure> refusal_reason(node_state& n, const identity& peer, const protocol::request_line& r) {
    const auto object = [](errc code, std::string message) {
        return protocol::failure{.code = code, .message = std::move(message)};
    };
    if (!allows(n, peer, r)) {
        auto why = denial(n, peer, r);
        log_denial(n, peer, r, why.message);
        return why;
    }
    // A request for the reserved task other than PULL concerns the link it arrives on, such as an id to cancel.
    const bool stays = n.active_router == nullptr || (r.noun.task == "cles" && r.verb != verb::pull);
    if (stays && !is_local_target(n, r)) {
        const auto target = protocol::quoted(r.noun.target);
        if (n.active_router != nullptr) {
            return object(errc::no_target, n.name + " forwards only PULL of 'cles', not this request for " + target);
        }
        return object(errc::no_target,
                      n.name + " does not route, and cannot forward a request to " + target +
                          (protocol::is_reserved_target(r.noun.target)
                               ? ": give it cles::routing() as service_options::routing, or ask a node that routes, "
                                 "as clesd does"
                               : ": ask that node itself, or a node that routes, as clesd does"));
    }
    if (is_in_via(r.via, n.name)) {
        return object(errc::no_target, n.name + " has forwarded this request for " + protocol::quoted(r.noun.target) +
                                           " before: the nodes in 'via' form a loop");
    }
    std::string why;
    // What is published has to be readable for all subscribers, whatever this node accepts.
    const auto depth = r.verb == verb::update ? std::min(n.bounds.depth, detail::answer_depth) : n.bounds.depth;
    if (!r.body.empty() && !is_valid_json(r.body, depth, &why)) {
        return object(errc::bad_request, n.name + ": the body is not valid JSON: " + why);
    }
    if (r.verb == verb::update && protocol::begins_with_error(r.body)) {
        return object(errc::bad_request, n.name + ": an update's first key cannot be 'error'");
    }
    return std::nullopt;
}

std::string why_unreadable(std::string_view body) {
    std::string why;
    return body.empty() || is_valid_json(body, detail::answer_depth, &why) ? std::string{}
                                                                           : "its body is no JSON: " + why;
}

protocol::failure shutting_down(const node_state& n) {
    return {.code = errc::busy, .message = n.name + " is shutting down", .retry_ms = 1000};
}

void append_link_refusal(std::string& out, const node_state& n, std::uint64_t id) {
    protocol::append_reply_head(out, id);
    protocol::append_failure(
        out, {.code = errc::busy, .message = n.name + " has reached its limit of links", .retry_ms = 1000});
    out.push_back('\n');
}

std::optional<std::uint64_t> cancelled_id(const protocol::noun_view& noun) {
    if (noun.task != "cles" || noun.parameters.size() != 2 || noun.parameters[0] != "cancel") {
        return std::nullopt;
    }
    return protocol::number_between(noun.parameters[1], 1, protocol::max_id);
}

protocol::failure busy(std::string message) { return {.code = errc::busy, .message = std::move(message)}; }

protocol::failure no_memory(const node_state& n) {
    return busy(n.name + ": no memory is left for this link or for all links (limits.memory)");
}

protocol::failure no_such_task(const node_state& n, const protocol::request_line& r) {
    return {.code = errc::no_task,
            .message = n.name + " has no " + std::string{to_string(r.verb)} + " '" + std::string{r.noun.task} + "'"};
}

protocol::failure overlong(const node_state& n, std::size_t datagram) {
    if (datagram != 0) {
        return {.code = errc::too_large,
                .message = n.name + ": a datagram has at most " + std::to_string(datagram) + " bytes: use TCP"};
    }
    return {.code = errc::too_large,
            .message = n.name + ": a line has at most " + std::to_string(n.bounds.line) + " bytes (limits.line)"};
}

std::optional<protocol::failure> no_capacity_to_run(const node_state& n) {
    if (n.counts.handlers_running < n.bounds.running) {
        return std::nullopt;
    }
    return busy(n.name + " has reached its limit of running handlers");
}

protocol::failure after_run(protocol::failure why) {
    why.ran = why.code == errc::too_large || why.code == errc::no_target || why.code == errc::no_task;
    return why;
}

} // namespace cles::core
