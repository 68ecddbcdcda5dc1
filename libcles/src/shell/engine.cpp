// SPDX-License-Identifier: BSL-1.0
#include "shell/engine.hpp"

#include <cles/limit_ranges.hpp>

#include "core/call.hpp"
#include "core/later.hpp"
#include "core/teller.hpp"
#include "protocol/message.hpp"
#include "shell/completion_drain.hpp"
#include "shell/departure.hpp"
#include "shell/option_checks.hpp"
#include "shell/service_call.hpp"

#include <boost/asio/post.hpp>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <random>
#include <utility>

namespace cles::detail {
namespace asio = boost::asio;

namespace {

core::node_setup setup_of(service_options& options, const asio::any_io_executor& executor) {
    std::random_device source;
    // Room for as many ids as a run may draw, and short enough for clients that read numbers as doubles.
    constexpr std::uint64_t apart = 1U << 20U;
    const auto epoch = source();
    return {.name = std::move(options.name),
            .pool = std::move(options.pool),
            .epoch = epoch,
            .first_datagram_id = (source() & 0xFFFFFFFFU) * apart,
            .bounds = options.limits,
            .authorise = std::move(options.authorise),
            .log = std::move(options.log),
            .metrics = std::move(options.metrics),
            .load = std::move(options.load),
            .complete = [drain = std::make_shared<shell::completion_drain>(executor)](core::completion due) {
                drain->put(std::move(due));
            }};
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

engine::engine(asio::any_io_executor executor, service_options options)
    : executor_(std::move(executor)), insecure_(options.insecure), networks_(options.networks),
      multicast_(options.multicast), gossip_(options.gossip), on_name_taken_(std::move(options.on_name_taken)),
      routing_wanted_(options.routing) {
    check_node_name(options.name);
    check(options.limits);
    check_pool_name(options.pool);
    for (const auto& [name, where] : options.peers) {
        routes_.set_peer(name, where);
    }
    node_ = std::make_shared<core::node>(setup_of(options, executor_), clock_, [this] { turns_.ask(); });
    connections_.start();
    neighbours_ = std::make_unique<shell::neighbours>(*this, std::random_device{}());
}

engine::~engine() = default;

void engine::start(const std::vector<std::string>& listen_at) {
    timer_ = std::make_shared<shell::deadline_timer>(executor_, clock_, [weak = weak_from_this()](bool was_away) {
        if (const auto self = weak.lock()) {
            self->expire(was_away);
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

void engine::expire(bool was_away) {
    struct settling {
        engine& by;
        ~settling() { by.settle(); }
    };
    const settling afterwards{*this}; // whatever happens: without the timer no deadline would come any more
    const auto at = now();
    if (was_away) {
        node_->others.excuse(at);
    }
    node_->deadlines.expire(at);
}

void engine::settle() {
    if (departure_ && !stopped_) {
        departure_->look();
    }
    timer_->follow(node_->deadlines);
}

void engine::join_group() {
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

void engine::on_round_over() {
    const auto keep = shared_from_this();
    routes_.on_round_over();
    if (routing_) {
        routing_->release(now());
    }
}

void engine::on_name_taken(const std::string& where) {
    if (on_name_taken_) {
        asio::post(executor_, [self = shared_from_this(), where] {
            if (!self->stopped_) {
                self->on_name_taken_(where);
            }
        });
    }
}

// -- links ---------------------------------------------------------------------------------------------------------

std::string engine::listen(std::string_view where) {
    auto local = listeners_.listen(where, insecure_);
    node_->endpoints.push_back(local);
    say(log_level::debug, node_->name + " listens on " + local);
    return local;
}

void engine::forget(shell::connection& c, std::uint64_t received, std::uint64_t sent) {
    if (connections_.forget(c, received, sent)) {
        routes_.drop(c);
    }
}

std::string engine::stranger(const identity& peer) const {
    const auto host = core::host_of(peer);
    return peer.local || !peer.name.empty() || networks_.contain(host) ? std::string{} : host;
}

// -- turns ---------------------------------------------------------------------------------------------------------

void engine::post_turn() {
    asio::post(executor_, [self = shared_from_this()] { self->turns_.turn(); });
}

void engine::route_on(time_point now) {
    if (routing_) {
        routing_->go_on(now);
    }
}

// -- asking --------------------------------------------------------------------------------------------------------

void engine::fail_later(pending_ptr operation, boost::system::error_code code, std::string message,
                        core::completion::progress_function progress) {
    node_->completions.put(core::completion{
        core::completion::failure{std::move(operation), code, std::move(message), std::move(progress)}});
}

std::uint64_t engine::send(const outgoing& request, const call_options& options, pending_ptr operation) {
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
    if (!protocol::parse_noun(request.noun, noun, why)) {
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
        r->send({.verb = request.verb,
                 .noun = request.noun,
                 .body = request.body,
                 .id = id,
                 .urgent = options.urgent_,
                 .begun = begun,
                 .deadline = core::later(begun, shell::time_limit(options.deadline_, request.verb))},
                std::move(operation), options.on_progress_);
    });
    settle();
    return id;
}

void engine::cancel(std::uint64_t ticket) {
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

void engine::add(registration task) {
    core::handler entry{.info = std::move(task.info)};
    if (task.plain) {
        entry.plain = [this, handler = std::move(task.plain)](const request& r, json_writer& w) {
            const core::turns::serving during{turns_};
            handler(r, w);
        };
    }
    if (task.async) {
        entry.start = [this, handler = std::move(task.async), executor = executor_,
                       self = weak_from_this()](const request& r, const std::shared_ptr<core::call>& call) {
            // Held here too, so that what a handler throws is the answer, and not that its responder went without one.
            const auto control = std::make_shared<shell::service_call>(call, executor, self);
            const core::turns::serving during{turns_};
            try {
                handler(r, responder{control});
            } catch (...) {
                fail_with(*control, std::current_exception());
            }
        };
    }
    node_->tasks.add(task.verb, task.task, std::move(entry));
}

void engine::check_path(std::string_view noun) const {
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

void engine::publish(std::string_view noun, const std::function<void(json_writer&)>& write) {
    if (stopped_) {
        return;
    }
    if (node_->published.find(noun) == nullptr) {
        check_path(noun);
    }
    turns_.let([&] { node_->published.publish(noun, write); });
    settle();
}

std::shared_ptr<update_sink> engine::outside_updates() {
    if (!outside_updates_) {
        // The service outlives what is taken: it closes this when it stops.
        outside_updates_ = std::make_shared<shell::outside_updates>(
            executor_,
            [weak = weak_from_this()](std::string_view noun, std::string_view json) {
                const auto self = weak.lock();
                if (!self) { // what was refused before has been logged, by a program that then let go of the service
                    return;
                }
                try {
                    self->publish(noun, [json](json_writer& w) { write_text(w, json); });
                } catch (const error& e) {
                    self->say(log_level::warning,
                              "an update of '" + std::string{noun} + "' was refused: " + e.message());
                }
            },
            [weak = weak_from_this()](std::size_t count) {
                if (const auto self = weak.lock()) {
                    self->say(log_level::warning,
                              std::to_string(count) + " updates were dropped: they come faster than they go");
                }
            });
        if (stopped_) {
            outside_updates_->close();
        }
    }
    return outside_updates_;
}

std::uint64_t engine::publish_when_room(std::string_view noun, std::string_view json, pending_ptr operation) {
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

std::uint64_t engine::close(std::chrono::milliseconds limit, pending_ptr operation) {
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

void engine::stop() {
    if (stopped_) {
        return;
    }
    const auto keep = shared_from_this();
    node_->published.drain(now()); // what has been published goes out
    stopped_ = true;
    listeners_.close();
    if (timer_) { // not where making it has failed
        timer_->stop();
    }
    if (routing_) {
        routing_->stop();
    }
    turns_.stop();
    // Callers that wait are told on the executor, never from inside this call.
    constexpr auto why = "the service has been stopped";
    feeds_.stop();
    if (outside_updates_) {
        outside_updates_->close();
    }
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

} // namespace cles::detail
