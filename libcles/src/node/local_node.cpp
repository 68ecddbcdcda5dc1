// SPDX-License-Identifier: BSL-1.0
#include "node/local_node.hpp"

#include <cles/limit_ranges.hpp>

#include "node/base/completion_drain.hpp"
#include "node/base/deadlines.hpp"
#include "node/membership/reachable_endpoints.hpp"
#include "node/session/call.hpp"
#include "node/session/command.hpp"
#include "node/session/graceful_shutdown.hpp"
#include "protocol/datagram.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>

namespace cles::core {
namespace {

core::node_options complete(core::node_options setup, const std::shared_ptr<core::environment>& by) {
    // Leaves room for the ids that one incarnation may draw, and is small enough for clients that read numbers as
    // doubles.
    constexpr std::uint64_t apart = 1U << 20U;
    setup.epoch = by->random();
    setup.first_datagram_id = std::uint64_t{by->random()} * apart;
    setup.complete = [drain = std::make_shared<core::completion_drain>(by)](core::completion due) {
        drain->put(std::move(due));
    };
    return setup;
}

void check_pool_name(const std::string& pool) {
    if (!pool.empty() && !protocol::is_name(pool)) {
        throw error(errc::invalid_name,
                    protocol::quoted(pool) + " is not a pool's name (1 to 64 letters, digits, '_', '-', '.')");
    }
}

void check_node_name(const std::string& name) {
    if (!protocol::is_name(name)) {
        throw error(errc::invalid_name,
                    protocol::quoted(name) + " is not a node's name (1 to 64 letters, digits, '_', '-', '.')");
    }
    if (protocol::is_reserved_target(name)) {
        throw error(errc::invalid_name, "a node cannot be named '" + name + "'");
    }
}

} // namespace

local_node::local_node(std::shared_ptr<core::environment> by, local_node_options options)
    : environment_(std::move(by)), insecure_(options.insecure), networks_(options.networks),
      multicast_(std::move(options.multicast)), gossip_(std::move(options.gossip)),
      on_name_taken_(std::move(options.on_name_taken)), routing_wanted_(options.routing) {
    check_node_name(options.node.name);
    check(options.node.bounds);
    check_pool_name(options.node.pool);
    for (const auto& [name, where] : options.peers) {
        peer_channels_.set_peer(name, where);
    }
    node_ = std::make_shared<core::node_state>(complete(std::move(options.node), environment_), *environment_,
                                               [this] { flush_scheduler_.schedule_turn(); });
    connections_.start();
    discovery_ = std::make_unique<core::discovery>(*this, environment_->random());
}

local_node::~local_node() { node_->deadlines.set_observer({}); } // others may share the state

void local_node::start(const std::vector<std::string>& listen_at) {
    environment_->start_timer([weak = weak_from_this()] {
        if (const auto self = weak.lock()) {
            self->on_timer();
        }
    });
    node_->deadlines.set_observer([this](time_point earliest) { schedule_.follow(earliest); });
    if (routing_wanted_ != nullptr) {
        routing_ = routing_wanted_->make(*this);
    }
    for (const auto& where : listen_at) {
        listen(where);
    }
    if (multicast_.is_on()) {
        join_group();
    }
    if (gossip_.part != nullptr || !gossip_.seeds.empty()) {
        discovery_->gossip(gossip_);
    } else {
        discovery_->start();
    }
    if (routing_ && discovery_->expects_more()) {
        routing_->hold();
    }
    listeners_.open_local_endpoints();
}

void local_node::on_timer() {
    const auto at = now();
    const core::deadline_schedule::expiry during{schedule_, node_->deadlines};
    if (schedule_.is_after_suspension(at)) {
        node_->peers.note_suspension(at);
    }
    node_->deadlines.expire(at);
}

void local_node::check_shutdown() {
    if (graceful_shutdown_ && !stopped_) {
        graceful_shutdown_->check();
    }
}

void local_node::join_group() {
    try {
        group_ = std::make_unique<core::multicast_group>(*this, multicast_, insecure_);
        group_->start();
        discovery_->join(*group_);
    } catch (const error& e) {
        if (multicast_.required) {
            throw;
        }
        write_log(log_level::warning, "no multicast: " + e.message());
    }
}

void local_node::on_discovery_grace_over() {
    const auto keep = shared_from_this();
    peer_channels_.on_discovery_grace_over();
    if (routing_) {
        routing_->release();
    }
}

void local_node::on_name_taken(const std::string& where) {
    if (on_name_taken_) {
        core::post(*environment_, [self = shared_from_this(), where] {
            if (!self->stopped_) {
                self->on_name_taken_(where);
            }
        });
    }
}

// -- links ---------------------------------------------------------------------------------------------------------

std::string local_node::listen(std::string_view where) {
    auto local = listeners_.listen(where, insecure_);
    node_->endpoints.push_back(local);
    write_log(log_level::debug, node_->name + " listens on " + local);
    return local;
}

void local_node::forget(core::connection& c, std::uint64_t received, std::uint64_t sent) {
    if (connections_.forget(c, received, sent)) {
        peer_channels_.drop(c);
    }
}

std::string local_node::unverified_address(const identity& peer) const {
    const auto host = core::host_of(peer);
    return peer.local || !peer.name.empty() || networks_.contain(host) ? std::string{} : host;
}

// -- turns ---------------------------------------------------------------------------------------------------------

void local_node::post_flush() { environment_->post(std::shared_ptr<core::task>{shared_from_this(), this}); }

void local_node::run() { flush_scheduler_.turn(); }

void local_node::drain_routing(time_point now) {
    if (routing_) {
        routing_->run_ready(now);
    }
}

// -- requests ------------------------------------------------------------------------------------------------------

void local_node::fail_later(detail::pending_ptr operation, boost::system::error_code code, std::string message,
                            core::completion::progress_function progress) {
    node_->completions.put(core::completion{
        core::completion::failure{std::move(operation), code, std::move(message), std::move(progress)}});
}

std::uint64_t local_node::send(verb how, std::string_view text, std::string_view body, const call_options& options,
                               detail::pending_ptr operation) {
    if (stopped_) {
        fail_later(std::move(operation), errc::stopped, "the service has been stopped");
        return 0;
    }
    if (auto wrong = core::invalid_option_reason(options); !wrong.empty()) {
        fail_later(std::move(operation), errc::invalid_option, std::move(wrong));
        return 0;
    }
    protocol::noun_view noun;
    std::string why;
    boost::system::error_code code = errc::bad_request;
    if (!protocol::parse_noun(text, noun, why)) {
        fail_later(std::move(operation), code, std::move(why));
        return 0;
    }
    auto* r = peer_channels_.to(noun.target, options.at_, options.urgent_, code, why);
    if (r == nullptr) {
        fail_later(std::move(operation), code, std::move(why));
        return 0;
    }
    const auto id = draw_id();
    const auto started = now();
    flush_scheduler_.run_user_call([&] {
        r->send({.verb = how, .noun = text, .id = id, .carried = {.urgent = options.urgent_}, .body = body},
                core::saturating_add(started, core::time_limit(options.deadline_, how)), started, std::move(operation),
                options.on_progress_);
    });
    return id;
}

void local_node::cancel(std::uint64_t ticket) {
    if (ticket == 0) { // already completed or failed
        return;
    }
    const auto keep = shared_from_this();
    if (graceful_shutdown_ && graceful_shutdown_->ticket() == ticket) {
        node_->completions.fail(graceful_shutdown_->give_up(), errc::cancelled,
                                "the wait for the service to close was cancelled");
    } else if (!peer_channels_.cancel(ticket) && !connections_.cancel(ticket)) {
        node_->published.cancel(ticket);
    }
}

// -- serving and publishing ----------------------------------------------------------------------------------------

void local_node::check_path(std::string_view noun) const {
    protocol::noun_view parts;
    std::string why;
    const auto whole = "self:" + std::string{noun};
    std::string scratch;
    if (!protocol::parse_noun(whole, parts, why)) {
        throw error(errc::invalid_name, why);
    }
    if (parts.task == "cles") {
        throw error(errc::invalid_name, "the task 'cles' is reserved");
    }
    if (protocol::canonical_path(parts, scratch) != noun) {
        throw error(errc::invalid_name, "write '" + scratch + "' instead of '" + std::string{noun} + "'");
    }
}

void local_node::publish(std::string_view noun, const std::function<void(json_writer&)>& write) {
    if (stopped_) {
        return;
    }
    if (node_->published.find(noun) == nullptr) {
        check_path(noun);
    }
    flush_scheduler_.run_user_call([&] { node_->published.publish(noun, write); });
}

std::uint64_t local_node::publish_when_room(std::string_view noun, std::string_view json,
                                            detail::pending_ptr operation) {
    if (stopped_) {
        fail_later(std::move(operation), errc::stopped, "the service has been stopped");
        return 0;
    }
    const auto ticket = draw_id();
    bool waits = false;
    try {
        if (node_->published.find(noun) == nullptr) {
            check_path(noun);
        }
        flush_scheduler_.run_user_call(
            [&] { waits = !node_->published.publish_when_room(noun, json, operation, ticket); });
    } catch (const error& e) {
        if (operation == nullptr) { // it was taken, and completes elsewhere
            throw;
        }
        fail_later(std::move(operation), e.code(), e.message());
    }
    return waits ? ticket : 0;
}

// -- shutdown ------------------------------------------------------------------------------------------------------

std::uint64_t local_node::close(std::chrono::milliseconds limit, detail::pending_ptr operation) {
    if (stopped_ || graceful_shutdown_) {
        fail_later(std::move(operation), errc::stopped, "the service is already closing");
        return 0;
    }
    const auto keep = shared_from_this();
    const auto ticket = draw_id();
    discovery_->leave();
    if (stopped_ || graceful_shutdown_) { // by the program's load function
        fail_later(std::move(operation), errc::stopped, "the service is already closing");
        return 0;
    }
    graceful_shutdown_ = std::make_unique<core::graceful_shutdown>(*this, ticket, limit, std::move(operation));
    listeners_.reject();
    connections_.refuse_new_requests();
    check_shutdown();
    return ticket;
}

void local_node::stop() {
    if (stopped_) {
        return;
    }
    const auto keep = shared_from_this();
    core::send_updates(node_->unsent, node_->published, now());
    stopped_ = true;
    listeners_.close();
    environment_->stop_timer();
    if (routing_) {
        routing_->stop();
    }
    flush_scheduler_.stop();
    // Waiting callers are notified on the executor, never from inside this call.
    constexpr auto why = "the service has been stopped";
    feeds_.stop();
    for (auto& operation : node_->published.take_waiters()) {
        fail_later(std::move(operation), errc::stopped, why);
    }
    discovery_->stop();
    if (group_) {
        group_->stop();
    }
    peer_channels_.stop();
    if (graceful_shutdown_) {
        if (auto operation = graceful_shutdown_->give_up()) {
            fail_later(std::move(operation), errc::stopped, why);
        }
    }
    for (const auto& c : connections_.all()) {
        c->session().asking().stop();
        c->flush();
        c->abandon(why);
    }
    connections_.stop();
}

} // namespace cles::core
