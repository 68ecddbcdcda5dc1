// SPDX-License-Identifier: BSL-1.0
#include "node/routing/peer_channels.hpp"

#include "node/local_node.hpp"
#include "node/membership/gossip.hpp"
#include "node/publish/feed_machine.hpp"
#include "node/routing/other_pools.hpp"
#include "node/tracing/span_recorder.hpp"
#include "protocol/grammar.hpp"

#include <boost/system/errc.hpp>

#include <algorithm>
#include <optional>
#include <utility>

namespace cles::core {
namespace {

constexpr std::size_t max_channels_before_cleanup = 64;

// Key prefix, in place of a URL: the channel to a node that is not discovered yet.
constexpr std::string_view undiscovered = "undiscovered:";
// Key suffix after a URL, which contains no zero byte: the links for urgent requests.
constexpr std::string_view urgent_suffix{"\0urgent", 7};

// Key suffix after a URL: the links that lead to the node of this name, and to no other that answers there.
std::string name_suffix(std::string_view name) { return name.empty() ? std::string{} : '\0' + std::string{name}; }

} // namespace

// -- one channel ---------------------------------------------------------------------------------------------------

std::shared_ptr<connection> peer_channel::usable_link(const feed_machine* feed) const {
    for (const auto& c : links_) {
        if (c->usable() && (feed == nullptr || c->session().bound().admits(*feed))) {
            return c;
        }
    }
    return nullptr;
}

void peer_channel::send(const protocol::outgoing_request& r, time_point deadline, time_point now,
                        detail::pending_ptr operation, outbound::progress_function progress, const manner& how) {
    if (const auto c = usable_link()) {
        if (how.forwarded) {
            c->prepare_to_forward();
        }
        c->session().asking().send(r, deadline, now, std::move(operation), std::move(progress));
        return;
    }
    constexpr std::size_t around = 512; // overhead besides the text, roughly
    memory_reservation held{host_->node().kept_requests};
    const auto bytes = r.size() + around;
    if (r.is_reserved()) {
        held.resize(bytes);
    } else if (!held.try_resize(bytes)) {
        host_->fail_later(std::move(operation), errc::busy,
                          "no memory is left to queue a request to " + address_ + " (limits.memory)",
                          std::move(progress));
        return;
    }
    auto w = std::make_unique<waiting_request>(*this, r);
    w->memory = std::move(held);
    w->operation = std::move(operation);
    w->progress = std::move(progress);
    w->how = how;
    host_->deadlines().arm(*w, deadline);
    requests_.push_back(std::move(w));
    dial();
}

bool peer_channel::cancel(std::uint64_t id) {
    const auto found =
        std::find_if(requests_.begin(), requests_.end(), [id](const auto& w) { return w->request.id == id; });
    if (found == requests_.end()) {
        return false;
    }
    fail(found, errc::cancelled, "the request was cancelled");
    return true;
}

void peer_channel::waiting_request::on_deadline(time_point) {
    auto& all = owner->requests_;
    const auto found = std::find_if(all.begin(), all.end(), [this](const auto& w) { return w.get() == this; });
    owner->fail(found, errc::deadline, "no link to " + owner->address_ + " was established in time"); // destroys this
}

void peer_channel::fail(waiting_requests::iterator which, errc code, std::string_view message) {
    auto operation = std::move((*which)->operation);
    auto report = std::move((*which)->progress);
    requests_.erase(which);
    host_->completions().fail(std::move(operation), code, message, std::move(report));
}

void peer_channel::connect(feed_machine& feed, ready_function ready) {
    if (const auto c = usable_link(&feed)) {
        ready(c, {}, {});
        return;
    }
    feeds_.push_back({&feed, std::move(ready)});
    dial();
}

void peer_channel::forget(const feed_machine& feed) {
    feeds_.remove_if([&](const waiting_feed& f) { return f.feed == &feed; });
}

void peer_channel::drop(const connection& c) {
    std::erase_if(links_, [&](const auto& held) { return held.get() == &c; });
}

bool peer_channel::leads_to_known_node() const {
    const auto* const known = node_.empty() ? nullptr : host_->node().peers.owner(node_);
    return known != nullptr && std::ranges::find(known->endpoints, address_) != known->endpoints.end();
}

void peer_channel::release() {
    for (const auto& c : std::vector{links_}) {
        if (c->usable() && c->is_idle()) {
            c->finish();
        }
    }
    std::erase_if(links_, [](const auto& c) { return !c->usable(); });
}

void peer_channel::dial() {
    if (give_up_ || !where_) {
        return;
    }
    give_up_ = host_->environment().dial(*where_, name_, host_->bounds(),
                                         [weak = weak_from_this()](boost::system::error_code code, link_ptr made) {
                                             if (const auto self = weak.lock()) {
                                                 self->on_dialled(code, std::move(made));
                                             } else if (made) {
                                                 made->close();
                                             }
                                         });
}

void peer_channel::on_dialled(boost::system::error_code code, link_ptr made) {
    const auto keep = shared_from_this();
    give_up_ = nullptr;
    host_->peer_channels().on_dialled(*this, code);
    if (code) {
        fail(code, "cannot connect to " + address_ + ": " + code.message());
    } else {
        const auto c = host_->connections().adopt(std::move(made), connection::origin::dialled);
        c->set_channel(weak_from_this());
        links_.push_back(c);
        serve_waiting(c);
    }
}

void peer_channel::serve_waiting(const std::shared_ptr<connection>& c) {
    const auto now = host_->now();
    for (auto requests = std::exchange(requests_, {}); !requests.empty(); requests.pop_front()) {
        auto& w = *requests.front();
        w.memory.resize(0); // the link accounts for it now
        if (w.how.forwarded) {
            c->prepare_to_forward();
        }
        c->session().asking().send(w.request, w.due(), now, std::move(w.operation), std::move(w.progress));
    }
    for (auto feeds = std::exchange(feeds_, {}); !feeds.empty(); feeds.pop_front()) {
        auto& next = feeds.front();
        if (const auto free = usable_link(next.feed)) {
            next.ready(free, {}, {});
        } else {
            feeds_.push_back(std::move(next));
        }
    }
    if (!feeds_.empty()) {
        dial();
    }
}

void peer_channel::hand_over(peer_channel& channel) {
    if (idle()) {
        return;
    }
    for (const auto& w : requests_) {
        w->owner = &channel;
    }
    channel.requests_.splice(channel.requests_.end(), requests_);
    channel.feeds_.splice(channel.feeds_.end(), feeds_);
    channel.serve_or_dial();
}

void peer_channel::reroute(
    const std::function<peer_channel*(std::string_view target, const forwarding& by)>& channel_to) {
    for (auto next = requests_.begin(); next != requests_.end();) {
        const auto here = next++;
        auto* const channel = (*here)->how.anywhere ? channel_to((*here)->request.target(), {}) : nullptr;
        if (channel != nullptr && channel != this) {
            (*here)->owner = channel;
            channel->requests_.splice(channel->requests_.end(), requests_, here);
            channel->serve_or_dial();
        }
    }
    for (auto next = feeds_.begin(); next != feeds_.end();) {
        const auto here = next++;
        const auto& feed = *here->feed;
        const auto& terms = feed.entry().terms;
        auto* const channel =
            terms.at.empty() ? channel_to(feed.target(), {.via = terms.via, .requester = terms.requester}) : nullptr;
        if (channel != nullptr && channel != this) {
            here->feed->entry().at = channel->address();
            channel->feeds_.splice(channel->feeds_.end(), feeds_, here);
            channel->serve_or_dial();
        }
    }
}

void peer_channel::serve_or_dial() {
    if (const auto c = usable_link()) {
        serve_waiting(c);
    } else {
        dial();
    }
}

void peer_channel::fail(boost::system::error_code code, std::string_view message) {
    const auto feeds = std::exchange(feeds_, {});
    for (const auto& w : std::exchange(requests_, {})) {
        host_->completions().fail(std::move(w->operation), code, message, std::move(w->progress));
    }
    for (const auto& f : feeds) {
        f.ready(nullptr, code, message);
    }
}

void peer_channel::stop() {
    if (const auto give_up = std::exchange(give_up_, nullptr)) {
        give_up();
    }
    feeds_.clear();
    links_.clear();
    for (const auto& w : std::exchange(requests_, {})) {
        host_->fail_later(std::move(w->operation), errc::stopped, "the service has been stopped",
                          std::move(w->progress));
    }
}

// -- all channels --------------------------------------------------------------------------------------------------

void peer_channels::set_peer(std::string_view name, std::string_view where) {
    if (!protocol::is_name(name) || protocol::is_reserved_target(name)) {
        throw error(errc::invalid_name, protocol::quoted(name) + " is not a node's name");
    }
    if (where.empty()) {
        directory_.erase(std::string{name});
    } else {
        checked_url(where);
        directory_.insert_or_assign(std::string{name}, std::string{where});
    }
    on_address_changed(name);
}

url peer_channels::checked_url(std::string_view where) const {
    auto address = parse_url(where);
    if (!host_.environment().has_transport(address.scheme)) {
        throw error(errc::unknown_scheme, "'" + address.scheme + "' in '" + std::string{where} + "'");
    }
    if (host_.node().security && !host_.environment().is_trusted(address)) {
        throw error(errc::denied, "'" + address.scheme + "' is refused with security: use 'tls' instead of '" +
                                      std::string{where} + "'");
    }
    return address;
}

// The name that the transport has to check. An address that was given without one may be anybody's.
std::string_view peer_channels::name_to_check(std::string_view target, std::string_view at,
                                              std::string_view address) const {
    const bool authenticates =
        address.starts_with("tls://") ||
        (host_.node().security && (address.starts_with("udp://") || address.starts_with("unix://")));
    return at.empty() && authenticates ? target : std::string_view{};
}

bool peer_channels::is_by_datagram(std::string_view node) const {
    try {
        return place_of(node).address.starts_with("udp://");
    } catch (const error&) { // it is not known
        return false;
    }
}

std::string peer_channels::tls_address_of(std::string_view node) const {
    const auto configured = directory_.find(node);
    if (configured != directory_.end() && configured->second.starts_with("tls://")) {
        return configured->second;
    }
    if (const auto* const known = host_.node().peers.owner(node)) {
        for (const auto& endpoint : known->endpoints) {
            if (endpoint.starts_with("tls://")) {
                return endpoint;
            }
        }
    }
    if (configured != directory_.end() && configured->second.starts_with("udp://")) {
        return "tls" + configured->second.substr(3);
    }
    return {};
}

peer_channel* peer_channels::to(const destination& where, boost::system::error_code& code, std::string& why) {
    if (!where.at.empty() || where.urgent || !where.by.empty()) {
        return find(where, code, why);
    }
    if (recent_ == nullptr || recent_target_ != where.target) {
        recent_ = find(where, code, why);
        recent_target_ = where.target;
    }
    return recent_;
}

std::uint64_t peer_channels::send(destination where, protocol::outgoing_request r, time_point deadline,
                                  detail::pending_ptr operation, outbound::progress_function progress) {
    where.urgent = r.carried.urgent;
    if (r.carried.trace.sampled) {
        operation = record(r, where.at, where.by, std::move(operation));
    }
    boost::system::error_code code;
    std::string why;
    auto* channel = to(where, code, why);
    if (channel == nullptr) {
        host_.fail_later(std::move(operation), code, std::move(why), std::move(progress));
        return 0;
    }
    r.id = host_.draw_id();
    channel->send(r, deadline, host_.now(), std::move(operation), std::move(progress),
                  {.anywhere = where.at.empty() && where.by.empty() && !where.urgent, .forwarded = where.forwarded});
    return r.id;
}

detail::pending_ptr peer_channels::record(protocol::outgoing_request& r, std::string_view at, const forwarding& by,
                                          detail::pending_ptr operation) {
    const auto& spans = host_.node().spans;
    if (!spans) {
        return operation;
    }
    const auto next = at.empty() ? neighbour_towards(r.target(), by) : std::string{};
    return spans->send(r, next, std::move(operation), host_.now());
}

std::string peer_channels::neighbour_towards(std::string_view target, const forwarding& by) const {
    try {
        auto next = place_of(target, by).node;
        return next == target ? std::string{} : next;
    } catch (const error&) { // it is not known
        return {};
    }
}

peer_channels::place peer_channels::place_of(std::string_view target, const forwarding& by) const {
    const auto& own_name = host_.node().name;
    const bool routed = host_.node().active_router != nullptr && protocol::is_reserved_target(target);
    if (target == "self" || target == own_name || routed) {
        return {host_.own_url(), own_name};
    }
    if (const auto configured = directory_.find(target); configured != directory_.end()) {
        return {configured->second, std::string{target}};
    }
    // With security, the other end would take this node for itself.
    if (const auto endpoint = host_.listeners().shared_endpoint(target);
        !host_.node().security && host_.environment().is_open(endpoint)) {
        return {"inproc://" + endpoint, std::string{target}};
    }
    if (protocol::is_reserved_target(target)) {
        throw error(errc::no_target, "'" + std::string{target} +
                                         "' needs a node that routes: give this one cles::routing() as "
                                         "service_options::routing, or set call_options::at to the URL of another");
    }
    if (auto found = discovered_place_of(target, by)) {
        return std::move(*found);
    }
    const auto& discovery = host_.discovery();
    if (discovery.expects_more()) {
        return {std::string{undiscovered}.append(target), std::string{target}};
    }
    if (const auto* const pools = host_.node().pools) {
        if (auto address = pools->address_of(target); !address.empty()) {
            return {std::move(address), {}};
        }
    }
    // Who asks a node that routes has given a URL: that of the node that routes.
    const auto advice = host_.node().active_router == nullptr
                            ? std::string{"give its URL"}
                            : "PULL " + own_name + ":cles/peers lists the nodes that it knows";
    throw error(errc::no_target,
                own_name + " cannot find '" + std::string{target} + "': " + discovery.unknown_reason() + advice);
}

std::optional<peer_channels::place> peer_channels::discovered_place_of(std::string_view target,
                                                                       const forwarding& by) const {
    const auto& peers = host_.node().peers;
    const auto known = peers.address_of(target);
    if (!known || host_.discovery().expects_more_of(target)) {
        return {};
    }
    auto* const routes = host_.node().gossip_responder;
    auto hop = routes != nullptr ? routes->reach().next_hop_to(target, by.via, by.requester) : std::string{target};
    const auto where = hop == target ? known : peers.address_of(hop);
    if (!where || where->empty()) {
        const auto reason = known->empty() || routes == nullptr
                                ? " cannot find '" + std::string{target} +
                                      "': it has announced no address that is reachable from here; state its URL in "
                                      "'peers', or in 'links' a node that "
                                      "reaches it"
                                : " has no link to '" + std::string{target} + "', and knows no route to it";
        throw error(errc::no_target, host_.node().name + reason);
    }
    return place{std::string{*where}, std::move(hop)};
}

void peer_channels::tell_of_second(std::string_view target, std::string* diagnostics) const {
    if (diagnostics == nullptr || directory_.contains(target)) {
        return;
    }
    if (const auto where = host_.node().peers.second_of(target); !where.empty()) {
        *diagnostics =
            "a second node has the name '" + std::string{target} + "', at " + where + ", and gets no requests";
    }
}

void peer_channels::on_dialled(peer_channel& channel, boost::system::error_code code) {
    auto* const routes = host_.node().gossip_responder;
    // Gossip knows what it has asked, and a configured address says nothing about the one that a node announces.
    if (routes == nullptr || host_.node().peers.address_of(channel.node()) != channel.address()) {
        return;
    }
    if (!code) {
        routes->reach().on_opened(channel.node());
    } else if (code != errc::denied && code != boost::system::errc::too_many_files_open) { // the link is not to blame
        routes->reach().lose(channel.node(), host_.now());
        reroute(channel);
    }
}

void peer_channels::on_route_changed(std::string_view node) {
    on_address_changed(node);
    const auto where = host_.node().peers.address_of(node);
    std::vector<std::shared_ptr<peer_channel>> waiting; // those may create others
    for (const auto& [key, channel] : channels_) {
        if (where && channel->address() == *where && channel->is_opening()) {
            waiting.push_back(channel);
        }
    }
    for (const auto& channel : waiting) {
        reroute(*channel);
    }
}

void peer_channels::reroute(peer_channel& channel) {
    recent_ = nullptr;
    channel.reroute([this](std::string_view target, const forwarding& by) {
        boost::system::error_code code;
        std::string why;
        return find({.target = target, .by = by}, code, why);
    });
}

peer_channel* peer_channels::find(const destination& to, boost::system::error_code& code, std::string& why) {
    const auto& [target, at, urgent, expected, by, forwarded] = to;
    try {
        auto [address, node] = at.empty() ? place_of(target, by) : place{std::string{at}, std::string{target}};
        const bool waits = at.empty() && address.starts_with(undiscovered);
        const auto name = expected.empty() ? name_to_check(node, at, address) : expected;
        const auto key = address + name_suffix(name) + (urgent && !waits ? std::string{urgent_suffix} : std::string{});
        const auto reached = at.empty() ? std::string_view{node} : expected;
        if (const auto found = channels_.find(key); found != channels_.end()) {
            if (!reached.empty()) {
                found->second->set_node(reached);
            }
            return found->second.get();
        }
        const auto where = waits ? std::nullopt : std::optional{checked_url(address)};
        if (where && where->scheme == "udp" && name.empty() && host_.node().security) {
            throw error(errc::denied, "'" + address +
                                          "' is an address without a name, and datagrams are sealed for a "
                                          "node that is named: configure it as a peer, or use 'tls'");
        }
        auto made = std::make_shared<peer_channel>(
            host_.shared_from_this(), where ? to_string(*where) : std::string{target}, where, std::string{name});
        made->set_node(reached);
        if (waits) {
            host_.discovery().solicit(target);
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
    if (auto* channel = to({.target = node}, code, why)) {
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

void peer_channels::forget(const feed_machine& feed) {
    for (const auto& [where, r] : channels_) {
        r->forget(feed);
    }
}

void peer_channels::drop(const connection& c) {
    for (const auto& [where, r] : channels_) {
        r->drop(c);
    }
}

void peer_channels::release(std::string_view url, std::string_view name) {
    if (const auto found = channels_.find(std::string{url} + name_suffix(name)); found != channels_.end()) {
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
