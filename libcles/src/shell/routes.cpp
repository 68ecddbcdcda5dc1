// SPDX-License-Identifier: BSL-1.0
#include "shell/routes.hpp"

#include "protocol/grammar.hpp"
#include "shell/local_node.hpp"

#include <iterator>
#include <utility>

namespace cles::shell {
namespace {

constexpr std::size_t routes_before_tidying = 64;

// Among the routes, in the place of a URL: what waits for a node of which nobody has heard yet.
constexpr std::string_view unheard = "unheard:";
// Behind a URL, in which no zero stands: the links for what is urgent.
constexpr std::string_view apart{"\0urgent", 7};

} // namespace

void routes::set_peer(std::string_view name, std::string_view where) {
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
    on_whereabouts(name);
}

route* routes::to(std::string_view target, std::string_view at, bool urgent, boost::system::error_code& code,
                  std::string& why) {
    if (!at.empty() || urgent) {
        return find(target, at, urgent, code, why);
    }
    if (recent_ == nullptr || recent_target_ != target) {
        recent_ = find(target, at, false, code, why);
        recent_target_ = target;
    }
    return recent_;
}

std::string routes::address_of(std::string_view target) const {
    const auto& own_name = host_.node().name;
    const auto& listeners = host_.listeners();
    const bool routed = host_.node().way != nullptr && protocol::is_reserved_target(target);
    if (target == "self" || target == own_name || routed) {
        return "inproc://" + listeners.self_door();
    }
    if (const auto configured = directory_.find(target); !configured.empty()) {
        return std::string{configured};
    }
    if (const auto door = listeners.shared_door(target); host_.environment().is_open(door)) {
        return "inproc://" + door;
    }
    if (protocol::is_reserved_target(target)) {
        throw error(errc::no_target, "'" + std::string{target} +
                                         "' needs a node that routes: give this one cles::routing() as "
                                         "service_options::routing, or say with call_options::at where another is");
    }
    const auto unknown = own_name + " cannot find '" + std::string{target} + "': ";
    const auto& neighbours = host_.neighbours();
    if (const auto heard = neighbours.find(target); heard && !neighbours.expects_more_of(target)) {
        if (const auto second = neighbours.second_of(target)) {
            throw error(errc::no_target, "there are two nodes that call themselves '" + std::string{target} + "', at " +
                                             std::string{*heard} + " and at " + std::string{*second} +
                                             ": give the URL of one");
        }
        if (heard->empty()) {
            throw error(errc::no_target, unknown + "it is there, but at no address that can be used from here");
        }
        return std::string{*heard};
    }
    if (neighbours.expects_more()) {
        return std::string{unheard}.append(target);
    }
    throw error(errc::no_target, unknown + neighbours.why_unknown() + "give its URL");
}

route* routes::find(std::string_view target, std::string_view at, bool urgent, boost::system::error_code& code,
                    std::string& why) {
    try {
        const auto address = at.empty() ? address_of(target) : std::string{at};
        const bool waits = at.empty() && address.starts_with(unheard);
        const auto key = urgent && !waits ? address + std::string{apart} : address;
        if (const auto found = routes_.find(key); found != routes_.end()) {
            return found->second.get();
        }
        std::shared_ptr<route> made;
        if (waits) {
            made = std::make_shared<route>(host_.shared_from_this(), target);
            host_.neighbours().ask_for(target);
        } else {
            const auto where = parse_url(address);
            if (!host_.environment().has_transport(where.scheme)) {
                throw error(errc::unknown_scheme, "'" + where.scheme + "' in '" + address + "'");
            }
            made = std::make_shared<route>(host_.shared_from_this(), where);
        }
        if (routes_.size() >= routes_before_tidying) { // to many a node of the past
            std::erase_if(routes_, [](const auto& entry) { return entry.second->idle(); });
            recent_ = nullptr;
        }
        return routes_.emplace(key, std::move(made)).first->second.get();
    } catch (const error& e) {
        code = e.code();
        why = e.message();
        return nullptr;
    }
}

void routes::on_whereabouts(std::string_view node) {
    recent_ = nullptr;
    const auto waiting = routes_.find(std::string{unheard}.append(node));
    if (waiting == routes_.end() || host_.neighbours().expects_more_of(node)) {
        return;
    }
    const auto held = waiting->second;
    routes_.erase(waiting);
    boost::system::error_code code;
    std::string why;
    if (auto* way = to(node, {}, false, code, why)) {
        held->hand_over(*way);
    } else {
        held->fail(code, why);
    }
    host_.settle();
}

void routes::on_round_over() {
    const auto keep = host_.shared_from_this();
    for (;;) {
        const auto next = routes_.lower_bound(unheard);
        if (next == routes_.end() || !next->first.starts_with(unheard)) {
            return;
        }
        on_whereabouts(next->first.substr(unheard.size()));
    }
}

bool routes::cancel(std::uint64_t id) {
    for (const auto& [where, r] : routes_) {
        if (r->cancel(id)) {
            return true;
        }
    }
    return false;
}

void routes::forget(const core::feed_machine& feed) {
    for (const auto& [where, r] : routes_) {
        r->forget(feed);
    }
}

void routes::drop(const connection& c) {
    for (const auto& [where, r] : routes_) {
        r->drop(c);
    }
}

void routes::release(std::string_view url) {
    if (const auto found = routes_.find(url); found != routes_.end()) {
        const auto held = found->second;
        held->release();
    }
}

void routes::stop() {
    recent_ = nullptr;
    for (auto ended = std::exchange(routes_, {}); const auto& [where, r] : ended) {
        r->stop();
    }
}

} // namespace cles::shell
