// SPDX-License-Identifier: BSL-1.0
#include "node/local_node.hpp"

#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/limit_ranges.hpp>

#include "node/base/failure_copy.hpp"
#include "node/membership/reachable_endpoints.hpp"
#include "node/routing/other_pools.hpp"
#include "node/session/request_checks.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>

namespace cles {
namespace {

[[noreturn]] void refuse(std::string_view name, const std::string& value, const std::string& least,
                         const std::string& most, const char* unit) {
    throw error(errc::invalid_option,
                "limits." + std::string{name} + " is " + value + unit + ": must be " + least + " to " + most + unit);
}

template <class T>
void refuse_outside(std::string_view name, T value, T least, T most, const char* unit) {
    if (value < least || value > most) {
        refuse(name, std::to_string(value), std::to_string(least), std::to_string(most), unit);
    }
}

} // namespace

void check(const limits& bounds) {
    for (const auto& range : count_ranges) {
        refuse_outside(range.name, bounds.*range.member, range.least, range.most, "");
    }
    for (const auto& range : time_ranges) {
        refuse_outside(range.name, (bounds.*range.member).count(), range.least.count(), range.most.count(), " ms");
    }
}

} // namespace cles

namespace cles::core {
namespace {

// Other adverbs would have to be ignored: the library writes them itself.
std::string foreign_adverb(std::string_view command) {
    protocol::part_reader parts{command};
    parts.next(); // verb
    parts.next(); // noun
    for (auto part = parts.next(); !part.empty(); part = parts.next()) {
        if (!part.starts_with("deadline=") && !part.starts_with("hops=") && part != "urgent=yes") {
            return "only the adverbs 'deadline', 'hops' and 'urgent' are allowed here, not " + protocol::quoted(part);
        }
    }
    return {};
}

protocol::carried_adverbs carried_by(const call_options& options) {
    protocol::carried_adverbs carried{.urgent = options.urgent_};
    if (!options.trace_.empty()) {
        carried.trace = protocol::parse_traceparent(options.trace_).value_or(protocol::trace_context{});
    }
    return carried;
}

std::string negative(const char* option, std::chrono::milliseconds value) {
    return std::string{option} + " is " + std::to_string(value.count()) + " ms: must be 0 or more";
}

std::string invalid_hops_reason(const char* option, std::uint32_t value) {
    return value <= protocol::max_hops ? std::string{}
                                       : std::string{option} + " is " + std::to_string(value) + ": must be 0 to " +
                                             std::to_string(protocol::max_hops);
}

/// Checks the settings, and adds what a node draws for each incarnation, and who calls its completions.
node_options complete(node_options setup, const std::shared_ptr<environment>& by) {
    check_name(setup.name, "node");
    if (protocol::is_reserved_target(setup.name)) {
        throw error(errc::invalid_name, "a node cannot be named '" + setup.name + "'");
    }
    check(setup.bounds);
    if (!setup.pool.empty()) {
        check_name(setup.pool, "pool");
    }
    // Leaves space for the ids that one incarnation may draw, and is small enough for clients that read numbers as
    // doubles.
    constexpr std::uint64_t apart = 1U << 20U;
    setup.epoch = setup.epoch != 0 ? setup.epoch : by->random();
    setup.first_datagram_id = std::uint64_t{by->random()} * apart;
    setup.complete = [drain = std::make_shared<completion_drain>(by)](completion due) { drain->put(std::move(due)); };
    return setup;
}

} // namespace

std::string invalid_option_reason(const call_options& options) {
    if (!options.trace_.empty() && !protocol::parse_traceparent(options.trace_)) {
        return "call_options::trace is " + protocol::quoted(options.trace_) +
               ": must be 00-<32 hex digits>-<16 hex digits>-<2 hex digits>, the first two not all 0";
    }
    return options.deadline_.count() < 0 ? negative("call_options::deadline", options.deadline_)
                                         : invalid_hops_reason("call_options::hops", options.hops_);
}

std::string invalid_option_reason(const bind_options& options) {
    if (options.deadline_.count() < 0) {
        return negative("bind_options::deadline", options.deadline_);
    }
    if (options.every_.count() < 0) {
        return negative("bind_options::every", options.every_);
    }
    if (options.keep_ > protocol::max_keep) {
        return "bind_options::keep is " + std::to_string(options.keep_) + ": must be 1 to " +
               std::to_string(protocol::max_keep) + ", or 0 for the default";
    }
    return invalid_hops_reason("bind_options::hops", options.hops_);
}

std::optional<protocol::failure> objection_to_member(const node_state& n, const call_options& options, verb how,
                                                     const protocol::noun_view& noun) {
    const auto& member = options.on_behalf_of_;
    const auto objection = [](errc code, std::string message) {
        return protocol::failure{.code = code, .message = std::move(message)};
    };
    if (!protocol::is_name(member)) { // it becomes a part of a line
        return objection(errc::invalid_option, "call_options::on_behalf_of is " + protocol::quoted(member) +
                                                   ": must be the name of a member");
    }
    if (!options.at_.empty() || !options.at_node_.empty()) {
        return objection(errc::invalid_option, "call_options::on_behalf_of does not go together with call_options::at");
    }
    if (!n.security) {
        return objection(errc::denied, n.name + " has no security, so it can ask nothing on behalf of " + member);
    }
    if (noun.task == "cles" && how != verb::pull) {
        return objection(errc::denied, n.name + " sends only PULL of the task 'cles' on behalf of " + member);
    }
    return std::nullopt;
}

std::chrono::milliseconds time_limit(std::chrono::milliseconds deadline, verb of) {
    if (deadline.count() <= 0) {
        return std::chrono::milliseconds{protocol::default_deadline(of)};
    }
    return std::min(deadline, std::chrono::milliseconds{protocol::max_deadline_ms});
}

local_node::local_node(std::shared_ptr<core::environment> by, local_node_options options)
    : environment_(std::move(by)), networks_(options.networks),
      node_(std::make_shared<node_state>(complete(std::move(options.node), environment_), *environment_,
                                         [this] { flush_scheduler_.schedule_turn(); })),
      options_(std::move(options)) {
    for (const auto& [name, where] : options_.peers) {
        peer_channels_.set_peer(name, where);
    }
    discovery_ = std::make_unique<core::discovery>(*this, environment_->random());
}

// Others may share the state.
local_node::~local_node() {
    node_->deadlines.set_observer({});
    if (node_->secured) {
        node_->secured->stop();
    }
}

void local_node::start(const std::vector<std::string>& listen_at) {
    environment_->start_timer([weak = weak_from_this()] {
        if (const auto self = weak.lock()) {
            self->on_timer();
        }
    });
    node_->deadlines.set_observer([this](time_point earliest) { schedule_.follow(earliest); });
    if (options_.routing != nullptr) {
        routing_ = options_.routing->make(*this);
    }
    if (node_->secured) {
        node_->secured->start(*this);
    }
    for (const auto& where : listen_at) {
        listen(where);
    }
    if (node_->pools) {
        node_->pools->start(*this);
    }
    if (options_.multicast.is_on()) {
        join_group();
    }
    if (options_.gossip.part != nullptr || !options_.gossip.seeds.empty()) {
        discovery_->gossip(options_.gossip);
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
    const deadline_schedule::expiry during{schedule_, node_->deadlines};
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
        auto group = std::make_unique<multicast_group>(node_, environment_->random(), weak_from_this());
        group->join(*environment_, options_.multicast, options_.insecure);
        group_ = std::move(group);
        group_->start();
        discovery_->join(*group_);
    } catch (const error& e) {
        if (options_.multicast.required) {
            throw;
        }
        write_log(log_level::warning, "no multicast: " + e.message());
    }
}

void local_node::on_discovery_grace_changed() {
    const auto keep = shared_from_this();
    const bool expects_more = discovery_->expects_more();
    if (!expects_more) {
        peer_channels_.on_discovery_grace_over();
    }
    if (routing_) {
        routing_->release(expects_more);
    }
}

void local_node::on_name_taken(const std::string& where) {
    if (options_.on_name_taken) {
        post(*environment_, [self = shared_from_this(), where] {
            if (!self->stopped_) {
                self->options_.on_name_taken(where);
            }
        });
    }
}

// -- links ---------------------------------------------------------------------------------------------------------

std::string local_node::listen(std::string_view where) {
    auto local = listeners_.listen(where, options_.insecure);
    node_->endpoints.push_back(local);
    write_log(log_level::debug, node_->name + " listens on " + local);
    return local;
}

std::string local_node::unverified_address(const identity& peer) const {
    const auto host = host_of(peer);
    return peer.local || !peer.name.empty() || networks_.contain(host) ? std::string{} : host;
}

// -- turns ---------------------------------------------------------------------------------------------------------

void local_node::post_flush() { environment_->post(std::shared_ptr<task>{shared_from_this(), this}); }

void local_node::run() { flush_scheduler_.turn(); }

void local_node::drain_routing(time_point now) {
    if (routing_) {
        routing_->begin_ready(now);
    }
}

// -- requests ------------------------------------------------------------------------------------------------------

detail::pending_ptr
local_node::reply_while_running(std::function<void(local_node& host, const peer_answer& found)> then,
                                bool checks_json) {
    auto if_running = [weak = weak_from_this(), then = std::move(then)](const peer_answer& found) {
        if (const auto self = weak.lock(); self && !self->stopped_) {
            then(*self, found);
        }
    };
    return detail::pending_ptr{new peer_reply{std::move(if_running), checks_json}};
}

std::uint64_t local_node::fail_later(detail::pending_ptr operation, boost::system::error_code code, std::string message,
                                     completion::progress_function progress) {
    node_->completions.put(
        completion{completion::failure{std::move(operation), code, std::move(message), std::move(progress)}});
    return 0;
}

std::uint64_t local_node::send(verb how, std::string_view text, std::string_view body, const call_options& options,
                               detail::pending_ptr operation) {
    if (stopped_) {
        return fail_later(std::move(operation), errc::stopped, "the service has been stopped");
    }
    if (auto wrong = invalid_option_reason(options); !wrong.empty()) {
        return fail_later(std::move(operation), errc::invalid_option, std::move(wrong));
    }
    protocol::noun_view noun;
    std::string why;
    boost::system::error_code code = errc::bad_request;
    if (!protocol::parse_noun(text, noun, why)) {
        return fail_later(std::move(operation), code, std::move(why));
    }
    const bool is_own = !options.is_on_behalf_;
    if (!is_own) {
        if (auto wrong = objection_to_member(*node_, options, how, noun)) {
            return fail_later(std::move(operation), wrong->code, std::move(wrong->message));
        }
    } else if (!protocol::is_reserved_target(noun.target) &&
               !permits(*node_, {.requester = node_->name}, noun.target, how, noun)) {
        return fail_later(std::move(operation), errc::denied,
                          node_->name + " may not send " + request_text(how, noun.path) + " to " +
                              std::string{noun.target});
    }
    const auto own = is_own ? std::string{} : own_url();
    const auto at = is_own ? std::string_view{options.at_} : std::string_view{own};
    auto* r = peer_channels_.to(
        {.target = noun.target, .at = at, .urgent = options.urgent_, .expected = options.at_node_}, code, why);
    if (r == nullptr) {
        return fail_later(std::move(operation), code, std::move(why));
    }
    if (options.at_.empty()) {
        peer_channels_.tell_of_second(noun.target, options.diagnostics_);
    }
    const auto id = draw_id();
    const auto started = now();
    const auto deadline = saturating_add(started, time_limit(options.deadline_, how));
    const auto adverbs = is_own ? std::string{} : protocol::adverb_from(options.on_behalf_of_);
    protocol::outgoing_request request{.verb = how,
                                       .noun = text,
                                       .id = id,
                                       .carried = carried_by(options),
                                       .hops = options.hops_,
                                       .adverbs = adverbs,
                                       .body = body};
    if (options.failure_ != nullptr) {
        operation = detail::pending_ptr{new failure_copy{std::move(operation), *options.failure_}};
    }
    if (node_->secured && is_own) { // a node signs no requests of others
        operation = node_->secured->watch({.how = how,
                                           .noun = noun,
                                           .body = body,
                                           .options = options,
                                           .carried = request.carried,
                                           .deadline = deadline,
                                           .ticket = id},
                                          std::move(operation));
    }
    if (request.carried.trace.sampled) {
        operation = peer_channels_.record(request, at, {}, std::move(operation));
    }
    flush_scheduler_.run_user_call(
        [&] { r->send(request, deadline, started, std::move(operation), options.on_progress_, {}); });
    return id;
}

std::uint64_t local_node::send_command(std::string_view command, const call_options& options,
                                       detail::pending_ptr operation, std::optional<std::chrono::milliseconds> left) {
    protocol::request_line parsed;
    protocol::malformed_request wrong;
    std::string why;
    if (!protocol::parse_request(command, parsed, wrong)) {
        why = wrong.why;
    } else if (parsed.is_update()) {
        why = "an update with 'seq' and 'epoch' is not a request";
    } else if (parsed.verb == verb::bind) {
        why = "a binding is made by async_bind";
    } else if (!parsed.body.empty()) {
        is_valid_json(parsed.body, bounds().depth, &why);
    }
    if (why.empty()) {
        why = foreign_adverb(command);
    }
    if (!why.empty()) {
        return fail_later(std::move(operation), errc::bad_request, std::move(why));
    }
    auto chosen = options;
    if (chosen.deadline_.count() == 0 && parsed.deadline_ms != protocol::default_deadline(parsed.verb)) {
        chosen.deadline(std::chrono::milliseconds{parsed.deadline_ms});
    }
    if (left && chosen.deadline_.count() >= 0) {
        chosen.deadline(chosen.deadline_.count() > 0 ? std::min(chosen.deadline_, *left) : *left);
    }
    chosen.urgent(chosen.urgent_ || parsed.urgent);
    chosen.hops(parsed.hops == protocol::default_hops ? chosen.hops_ : parsed.hops);
    const auto noun = std::string{parsed.noun.target} + ":" + std::string{parsed.noun.path};
    std::string body; // a line feed in it would end the request's line
    append_compact_json(parsed.body, body);
    return send(parsed.verb, noun, body, chosen, std::move(operation));
}

void local_node::cancel(std::uint64_t ticket) {
    if (ticket == 0) { // already completed or failed
        return;
    }
    const auto keep = shared_from_this();
    if (graceful_shutdown_ && graceful_shutdown_->ticket() == ticket) {
        node_->completions.fail(graceful_shutdown_->give_up(), errc::cancelled,
                                "the wait for the service to close was cancelled");
    } else if (!cancel_sent(ticket) && !(node_->secured && node_->secured->cancel(ticket))) {
        node_->published.cancel(ticket);
    }
}

// -- serving and publishing ----------------------------------------------------------------------------------------

void local_node::check_noun(std::string_view noun) const {
    if (node_->published.find(noun) != nullptr) {
        return;
    }
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
    check_noun(noun);
    flush_scheduler_.run_user_call([&] { node_->published.publish(noun, write); });
}

std::uint64_t local_node::publish_or_wait(std::string_view noun, std::string_view json, detail::pending_ptr operation) {
    if (stopped_) {
        return fail_later(std::move(operation), errc::stopped, "the service has been stopped");
    }
    const auto ticket = draw_id();
    bool waits = false;
    try {
        check_noun(noun);
        flush_scheduler_.run_user_call(
            [&] { waits = !node_->published.publish_or_wait(noun, json, operation, ticket); });
    } catch (const error& e) {
        if (operation == nullptr) { // it was taken, and completes elsewhere
            throw;
        }
        return fail_later(std::move(operation), e.code(), e.message());
    }
    return waits ? ticket : 0;
}

// -- shutdown ------------------------------------------------------------------------------------------------------

std::uint64_t local_node::close(std::chrono::milliseconds limit, detail::pending_ptr operation) {
    if (stopped_ || graceful_shutdown_) {
        return fail_later(std::move(operation), errc::stopped, "the service is already closing");
    }
    const auto keep = shared_from_this();
    const auto ticket = draw_id();
    discovery_->leave();
    if (stopped_ || graceful_shutdown_) { // by the program's load function
        return fail_later(std::move(operation), errc::stopped, "the service is already closing");
    }
    graceful_shutdown_.emplace(*this, ticket, limit, std::move(operation));
    listeners_.reject();
    connections_.refuse_new_requests();
    for (const auto& c : connections_.all()) {
        c->session().serving().drain_last(now());
    }
    check_shutdown();
    return ticket;
}

void local_node::stop() {
    if (stopped_) {
        return;
    }
    const auto keep = shared_from_this();
    send_updates(node_->unsent, node_->published, now());
    stopped_ = true;
    if (node_->secured) {
        node_->secured->stop();
    }
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
