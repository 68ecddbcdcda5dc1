// SPDX-License-Identifier: BSL-1.0
#include "shell/local_node.hpp"

#include <cles/limit_ranges.hpp>

#include "core/call.hpp"
#include "core/completion_drain.hpp"
#include "core/later.hpp"
#include "core/teller.hpp"
#include "protocol/message.hpp"
#include "shell/departure.hpp"
#include "shell/option_checks.hpp"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>

namespace cles::shell {
namespace {

core::node_setup complete(core::node_setup setup, const std::shared_ptr<core::environment>& by) {
    // Room for as many ids as a run may draw, and short enough for clients that read numbers as doubles.
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
        throw error(errc::invalid_name, "no node may be called '" + name + "'");
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
        routes_.set_peer(name, where);
    }
    node_ = std::make_shared<core::node>(complete(std::move(options.node), environment_), *environment_,
                                         [this] { turns_.ask(); });
    connections_.start();
    neighbours_ = std::make_unique<shell::neighbours>(*this, environment_->random());
}

local_node::~local_node() = default;

void local_node::start(const std::vector<std::string>& listen_at) {
    environment_->start_timer([weak = weak_from_this()] {
        if (const auto self = weak.lock()) {
            self->on_timer();
        }
    });
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
        neighbours_->gossip(gossip_);
    } else {
        neighbours_->start();
    }
    if (routing_ && neighbours_->expects_more()) {
        routing_->hold();
    }
    listeners_.open_local_doors();
}

void local_node::on_timer() {
    struct settling {
        local_node& by;
        ~settling() { by.settle(); }
    };
    const settling afterwards{*this}; // whatever happens: without the timer no deadline would come any more
    const auto at = now();
    if (schedule_.on_timer(at)) {
        node_->others.excuse(at);
    }
    node_->deadlines.expire(at);
}

void local_node::settle() {
    if (departure_ && !stopped_) {
        departure_->look();
    }
    schedule_.follow(node_->deadlines, *environment_);
}

void local_node::join_group() {
    try {
        group_ = std::make_unique<shell::group>(*this, multicast_, insecure_);
        group_->start();
        neighbours_->join(*group_);
    } catch (const error& e) {
        if (multicast_.required) {
            throw;
        }
        say(log_level::warning, "no multicast: " + e.message());
    }
}

void local_node::on_round_over() {
    const auto keep = shared_from_this();
    routes_.on_round_over();
    if (routing_) {
        routing_->release(now());
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
    say(log_level::debug, node_->name + " listens on " + local);
    return local;
}

void local_node::forget(shell::connection& c, std::uint64_t received, std::uint64_t sent) {
    if (connections_.forget(c, received, sent)) {
        routes_.drop(c);
    }
}

std::string local_node::stranger(const identity& peer) const {
    const auto host = core::host_of(peer);
    return peer.local || !peer.name.empty() || networks_.contain(host) ? std::string{} : host;
}

// -- turns ---------------------------------------------------------------------------------------------------------

void local_node::post_turn() { environment_->post(std::shared_ptr<core::task>{shared_from_this(), this}); }

void local_node::run() { turns_.turn(); }

void local_node::route_on(time_point now) {
    if (routing_) {
        routing_->go_on(now);
    }
}

// -- asking --------------------------------------------------------------------------------------------------------

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
    if (auto wrong = shell::objection_to(options); !wrong.empty()) {
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
    auto* r = routes_.to(noun.target, options.at_, options.urgent_, code, why);
    if (r == nullptr) {
        fail_later(std::move(operation), code, std::move(why));
        return 0;
    }
    const auto id = draw_id();
    const auto begun = now();
    turns_.let([&] {
        r->send({.verb = how,
                 .noun = text,
                 .body = body,
                 .id = id,
                 .urgent = options.urgent_,
                 .begun = begun,
                 .deadline = core::later(begun, shell::time_limit(options.deadline_, how))},
                std::move(operation), options.on_progress_);
    });
    settle();
    return id;
}

void local_node::cancel(std::uint64_t ticket) {
    if (ticket == 0) { // what has ended or failed already
        return;
    }
    const auto keep = shared_from_this();
    if (departure_ && departure_->ticket() == ticket) {
        node_->completions.fail(departure_->give_up(), errc::cancelled, "the service is not waited for");
    } else if (!routes_.cancel(ticket) && !connections_.cancel(ticket)) {
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
    turns_.let([&] { node_->published.publish(noun, write); });
    settle();
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
        turns_.let([&] { waits = !node_->published.publish_when_room(noun, json, operation, ticket); });
        settle();
    } catch (const error& e) {
        if (operation == nullptr) { // it has been taken, and is told of its end elsewhere
            throw;
        }
        fail_later(std::move(operation), e.code(), e.message());
    }
    return waits ? ticket : 0;
}

// -- the end -------------------------------------------------------------------------------------------------------

std::uint64_t local_node::close(std::chrono::milliseconds limit, detail::pending_ptr operation) {
    if (stopped_ || departure_) {
        fail_later(std::move(operation), errc::stopped, "the service ends already");
        return 0;
    }
    const auto keep = shared_from_this();
    const auto ticket = draw_id();
    neighbours_->leave();
    if (stopped_ || departure_) { // by a function of the program's that is asked for its load
        fail_later(std::move(operation), errc::stopped, "the service ends already");
        return 0;
    }
    departure_ = std::make_unique<shell::departure>(*this, ticket, limit, std::move(operation));
    listeners_.turn_away();
    connections_.begin_nothing();
    settle();
    return ticket;
}

void local_node::stop() {
    if (stopped_) {
        return;
    }
    const auto keep = shared_from_this();
    node_->published.drain(now()); // what has been published goes out
    stopped_ = true;
    listeners_.close();
    environment_->stop_timer();
    if (routing_) {
        routing_->stop();
    }
    turns_.stop();
    // Callers that wait are told on the executor, never from inside this call.
    constexpr auto why = "the service has been stopped";
    feeds_.stop();
    for (auto& operation : node_->published.take_waiters()) {
        fail_later(std::move(operation), errc::stopped, why);
    }
    neighbours_->stop();
    if (group_) {
        group_->stop();
    }
    routes_.stop();
    if (departure_) {
        if (auto operation = departure_->give_up()) {
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

} // namespace cles::shell
