// SPDX-License-Identifier: BSL-1.0
#include "node/routing/peer_channels.hpp"

#include "node/local_node.hpp"
#include "protocol/grammar.hpp"

#include <iterator>
#include <utility>

namespace cles::core {
namespace {

constexpr std::size_t max_channels_before_cleanup = 64;

// Key prefix, in place of a URL: the channel to a node that is not discovered yet.
constexpr std::string_view undiscovered = "undiscovered:";
// Key suffix after a URL, which contains no zero byte: the links for urgent requests.
constexpr std::string_view urgent_suffix{"\0urgent", 7};

} // namespace

void peer_channels::set_peer(std::string_view name, std::string_view where) {
    if (!protocol::is_name(name) || protocol::is_reserved_target(name)) {
        throw error(errc::invalid_name, protocol::quoted(name) + " is not a node's name");
    }
    if (!where.empty()) {
        const auto address = parse_url(where);
        if (!host_.environment().has_transport(address.scheme)) {
            throw error(errc::unknown_scheme, "'" + address.scheme + "' in '" + std::string{where} + "'");
        }
    }
    directory_.set(name, where);
    on_address_changed(name);
}

peer_channel* peer_channels::to(std::string_view target, std::string_view at, bool urgent,
                                boost::system::error_code& code, std::string& why) {
    if (!at.empty() || urgent) {
        return find(target, at, urgent, code, why);
    }
    if (recent_ == nullptr || recent_target_ != target) {
        recent_ = find(target, at, false, code, why);
        recent_target_ = target;
    }
    return recent_;
}

std::uint64_t peer_channels::send(std::string_view target, std::string_view at, protocol::outgoing_request r,
                                  time_point deadline, detail::pending_ptr operation,
                                  outbound::progress_function progress) {
    boost::system::error_code code;
    std::string why;
    auto* channel = to(target, at, r.carried.urgent, code, why);
    if (channel == nullptr) {
        host_.fail_later(std::move(operation), code, std::move(why), std::move(progress));
        return 0;
    }
    r.id = host_.draw_id();
    channel->send(r, deadline, host_.now(), std::move(operation), std::move(progress));
    return r.id;
}

std::string peer_channels::address_of(std::string_view target) const {
    const auto& own_name = host_.node().name;
    const auto& listeners = host_.listeners();
    const bool routed = host_.node().active_router != nullptr && protocol::is_reserved_target(target);
    if (target == "self" || target == own_name || routed) {
        return "inproc://" + listeners.self_endpoint();
    }
    if (const auto configured = directory_.find(target); !configured.empty()) {
        return std::string{configured};
    }
    if (const auto endpoint = listeners.shared_endpoint(target); host_.environment().is_open(endpoint)) {
        return "inproc://" + endpoint;
    }
    if (protocol::is_reserved_target(target)) {
        throw error(errc::no_target, "'" + std::string{target} +
                                         "' needs a node that routes: give this one cles::routing() as "
                                         "service_options::routing, or say with call_options::at where another is");
    }
    const auto unknown = own_name + " cannot find '" + std::string{target} + "': ";
    const auto& discovery = host_.discovery();
    if (const auto heard = discovery.address_of(target); heard && !discovery.expects_more_of(target)) {
        if (const auto second = discovery.conflicting_endpoint_of(target)) {
            throw error(errc::no_target, "there are two nodes that call themselves '" + std::string{target} + "', at " +
                                             std::string{*heard} + " and at " + std::string{*second} +
                                             ": give the URL of one");
        }
        if (heard->empty()) {
            throw error(errc::no_target, unknown + "it is there, but at no address that can be used from here");
        }
        return std::string{*heard};
    }
    if (discovery.expects_more()) {
        return std::string{undiscovered}.append(target);
    }
    throw error(errc::no_target, unknown + discovery.unknown_reason() + "give its URL");
}

peer_channel* peer_channels::find(std::string_view target, std::string_view at, bool urgent,
                                  boost::system::error_code& code, std::string& why) {
    try {
        const auto address = at.empty() ? address_of(target) : std::string{at};
        const bool waits = at.empty() && address.starts_with(undiscovered);
        const auto key = urgent && !waits ? address + std::string{urgent_suffix} : address;
        if (const auto found = channels_.find(key); found != channels_.end()) {
            return found->second.get();
        }
        std::shared_ptr<peer_channel> made;
        if (waits) {
            made = std::make_shared<peer_channel>(host_.shared_from_this(), target);
            host_.discovery().solicit(target);
        } else {
            const auto where = parse_url(address);
            if (!host_.environment().has_transport(where.scheme)) {
                throw error(errc::unknown_scheme, "'" + where.scheme + "' in '" + address + "'");
            }
            made = std::make_shared<peer_channel>(host_.shared_from_this(), where);
        }
        if (channels_.size() >= max_channels_before_cleanup) { // many may lead to nodes that no longer exist
            std::erase_if(channels_, [](const auto& entry) { return entry.second->idle(); });
            recent_ = nullptr;
        }
        return channels_.emplace(key, std::move(made)).first->second.get();
    } catch (const error& e) {
        code = e.code();
        why = e.message();
        return nullptr;
    }
}

void peer_channels::on_address_changed(std::string_view node) {
    recent_ = nullptr;
    const auto waiting = channels_.find(std::string{undiscovered}.append(node));
    if (waiting == channels_.end() || host_.discovery().expects_more_of(node)) {
        return;
    }
    const auto held = waiting->second;
    channels_.erase(waiting);
    boost::system::error_code code;
    std::string why;
    if (auto* channel = to(node, {}, false, code, why)) {
        held->hand_over(*channel);
    } else {
        held->fail(code, why);
    }
}

void peer_channels::on_discovery_grace_over() {
    const auto keep = host_.shared_from_this();
    for (;;) {
        const auto next = channels_.lower_bound(undiscovered);
        if (next == channels_.end() || !next->first.starts_with(undiscovered)) {
            return;
        }
        on_address_changed(next->first.substr(undiscovered.size()));
    }
}

bool peer_channels::cancel(std::uint64_t id) {
    for (const auto& [where, r] : channels_) {
        if (r->cancel(id)) {
            return true;
        }
    }
    return false;
}

void peer_channels::forget(const core::feed_machine& feed) {
    for (const auto& [where, r] : channels_) {
        r->forget(feed);
    }
}

void peer_channels::drop(const connection& c) {
    for (const auto& [where, r] : channels_) {
        r->drop(c);
    }
}

void peer_channels::release(std::string_view url) {
    if (const auto found = channels_.find(url); found != channels_.end()) {
        const auto held = found->second;
        held->release();
    }
}

void peer_channels::stop() {
    recent_ = nullptr;
    for (auto ended = std::exchange(channels_, {}); const auto& [where, r] : ended) {
        r->stop();
    }
}

} // namespace cles::core
