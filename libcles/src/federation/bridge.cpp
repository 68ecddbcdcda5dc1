// SPDX-License-Identifier: BSL-1.0
#include "federation/bridge.hpp"

#include <cles/json_reader.hpp>

#include "federation/carried_line.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace cles::bridging {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds per_bridge{4};            // of the interval between heartbeats
constexpr milliseconds names_again_after{1'000}; // if nobody has answered
constexpr milliseconds between_names{200};
constexpr milliseconds soon{20};          // until a heartbeat that others ask for
constexpr milliseconds between_asked{50}; // of these, in a secured fleet
constexpr milliseconds acquaintance{200}; // in which the bridges of a secured fleet get to know a new one
constexpr std::chrono::seconds at_home_within{10};
constexpr std::chrono::seconds optimistic{1}; // after connecting, a pool that is not known may still appear
constexpr std::chrono::minutes between_drop_logs{1};
constexpr std::uint32_t upstream_keep = 1024;
constexpr std::chrono::seconds remembered_for{10}; // after a bridge is lost, or before it is known
constexpr std::size_t max_not_live = 1024;
constexpr std::size_t max_short = 1024; // of a failure for which room is reserved
// Of 2^32. Multiples of it are even, also if each second one is taken, as when requests of two kinds alternate.
constexpr std::uint32_t golden_ratio = 0x9e3779b9U;

constexpr std::array all_verbs{verb::pull, verb::push, verb::delegate, verb::bind, verb::update};
constexpr std::string_view cancel_path = "cles/cancel/";
constexpr std::string_view lost_line = "PUSH self:cles/lost";
constexpr std::string_view names_line = "PULL self:cles/names";

// "car1" of "north.car1".
std::string_view without_pool(std::string_view target, std::string_view pool) {
    const bool has_it = target.size() > pool.size() + 1 && target.starts_with(pool) && target[pool.size()] == '.';
    return has_it ? target.substr(pool.size() + 1) : target;
}

bool acknowledges_for_another(std::string_view message, std::string_view sender) {
    const auto taker = take_taker(message);
    return !taker.empty() && taker != sender;
}

protocol::failure not_known_yet(const std::string& node) {
    return {.code = errc::busy,
            .message = "the bridge '" + node + "' does not know the one that asks yet",
            .retry_ms = protocol::default_retry_ms};
}

std::string noun_of(const protocol::request_line& r) {
    return std::string{r.noun.target}.append(":").append(r.noun.path);
}

} // namespace

// -- the connection ------------------------------------------------------------------------------------------------

void bridge::on_connected(std::uint64_t drawn, std::size_t max_message, time_point now) {
    now_ = now;
    connected_ = true;
    connected_at_ = now;
    pools_may_appear_ = true;
    constexpr std::size_t around = 256; // the part of a line that is not in the message
    max_message_ = std::min(max_message, setup_.max_line - std::min(around, setup_.max_line));
    replaced_ = std::exchange(self_.instance, instance_text(drawn));
    if (trust_ != nullptr && !are_of_one_member(replaced_, self_.instance)) {
        replaced_.clear(); // nobody may replace a bridge of another member: that one is lost when it stays silent
    }
    self_.pool = setup_.pool;
    ++figures_.connections;
    out_.subscribe(inbox_filter(self_), false);
    out_.subscribe(std::string{heartbeat_filter}, false);
    out_.subscribe(std::string{names_filter}, false);
    starting_until_.reset();
    reachable_from_.reset();
    untrusted_.clear();
    if (trust_ != nullptr) {
        starting_until_ = now + acquaintance;
        reachable_from_ = now + acquaintance + soon; // the heartbeat arrives before the first request
    } else if (!leaving_) {
        for (const auto how : all_verbs) {
            out_.subscribe(request_filter(setup_.pool, how), true);
        }
    }
    home_ = names_of(out_.home_names());
    round_trip_.reset();
    pools_.note_connection(now);
    send_heartbeat(true);
    set_due();
}

void bridge::on_disconnected(std::string_view why) {
    if (!std::exchange(connected_, false)) {
        return;
    }
    due_ = time_point::max();
    const auto text = "the connection to NATS was lost: " + std::string{why};
    sent_.clear();
    taken_.clear();
    not_live_.clear();
    feeds_.clear();
    published_.clear();
    asked_names_.clear();
    binds_.clear();
    pools_.clear(now_);
    out_.lose_all(text);
    out_.on_pools_changed();
}

void bridge::leave(time_point now) {
    now_ = now;
    if (std::exchange(leaving_, true) || !connected_) {
        return;
    }
    if (trust_ != nullptr) {
        send_heartbeat(false);
        return;
    }
    for (const auto how : all_verbs) {
        out_.unsubscribe(request_filter(setup_.pool, how));
    }
}

void bridge::say_left() {
    if (!std::exchange(left_, true) && connected_) {
        send_heartbeat(false);
    }
}

void bridge::on_time(time_point now) {
    now_ = now;
    if (!connected_) {
        return;
    }
    if (due_ + interval() < now) { // this process did not run
        pools_.note_suspension(now);
    }
    if (auto names = names_of(out_.home_names()); names.digest != home_.digest) {
        home_ = std::move(names);
        next_heartbeat_ = std::min(next_heartbeat_, now + soon);
    }
    if (pools_may_appear_ && connected_at_ + optimistic <= now) { // names may mean another pool now
        pools_may_appear_ = false;
        out_.on_pools_changed();
    }
    if (names_wanted_ && next_names_ <= now) {
        send_names();
    }
    if (starting_until_ && *starting_until_ <= now) {
        starting_until_.reset();
        next_heartbeat_ = now;
    }
    if (reachable_from_ && *reachable_from_ <= now) {
        reachable_from_.reset();
        out_.on_pools_changed();
    }
    if (next_heartbeat_ <= now) {
        send_heartbeat(false);
    }
    for (const auto& gone : pools_.expire(now)) {
        on_lost(gone, "the bridge of the pool '" + gone.pool + "' was not received any more");
    }
    if (pools_.forget_pools(now)) {
        out_.on_pools_changed();
    }
    std::erase_if(not_live_, [&](const auto& each) {
        const bool is_over = each.second <= now;
        if (is_over && !pools_.is_live(each.first)) {
            taken_.forget(each.first);
        }
        return is_over;
    });
    sent_.on_time(now);
    check_own_pool(now);
    set_due();
}

void bridge::set_due() {
    due_ = names_wanted_ ? std::min(next_heartbeat_, next_names_) : next_heartbeat_;
    due_ = std::min({due_, starting_until_.value_or(time_point::max()), reachable_from_.value_or(time_point::max())});
}

milliseconds bridge::interval() const {
    return std::max(setup_.interval, per_bridge * static_cast<milliseconds::rep>(pools_.bridge_count()));
}

// -- messages ------------------------------------------------------------------------------------------------------

void bridge::on_message(std::string_view where, std::string_view reply, std::string_view message, time_point now,
                        const message_sender& by) {
    now_ = now;
    if (!connected_) {
        return;
    }
    auto about = parse_subject(where);
    if (trust_ != nullptr && about.kind != subject_kind::heartbeat && !has_effect(where, about, by)) {
        return;
    }
    if (trust_ == nullptr && about.kind == subject_kind::request && !about.instance.empty()) {
        about.kind = subject_kind::foreign; // permissions of NATS are about subjects that state verb, node and task
    }
    if (message.size() > max_message_) { // its line could not be read
        drop(where, "it is too long");
        if (about.kind == subject_kind::request) {
            refuse_foreign(std::string{reply},
                           {.code = errc::too_large,
                            .message = "a request has at most " + std::to_string(max_message_) + " bytes here"});
        } else if (about.kind == subject_kind::reply) {
            sent_.on_unusable(about.number, message, now,
                              {.code = errc::too_large,
                               .message = "the reply has " + std::to_string(message.size()) + " bytes; at most " +
                                          std::to_string(max_message_) + " are read here",
                               .ran = true});
        }
        return;
    }
    if (message.find('\n') != std::string_view::npos) { // would end a line of the node's links
        constexpr std::string_view why = "a message of NATS holds one line";
        drop(where, why);
        if (about.kind == subject_kind::request) {
            refuse_foreign(std::string{reply}, {.code = errc::bad_request, .message = std::string{why}});
        } else if (about.kind == subject_kind::reply) {
            sent_.on_unusable(about.number, message, now,
                              {.code = errc::failed, .message = "the reply that came through NATS is not one line"});
        }
        return;
    }
    switch (about.kind) {
    case subject_kind::request:
        if (about.instance.empty()) {
            take(where, text_of(about.verb, about.node, about.task, message), reply, by.member, false);
        } else {
            take(where, message, reply, by.member, false);
        }
        break;
    case subject_kind::feed:
        ++figures_.updates_received;
        deliver(feeds_.on_update(about, message));
        break;
    case subject_kind::heartbeat: on_heartbeat(about, message, now, by); break;
    case subject_kind::names: on_names(about, message); break;
    case subject_kind::control: on_control(reply, message, now, by); break;
    case subject_kind::reply:
        if (trust_ != nullptr && acknowledges_for_another(message, by.instance)) {
            drop(where, "it acknowledges a request for another bridge");
        } else {
            sent_.on_message(about.number, message, now);
        }
        break;
    case subject_kind::question: // of seals; without security, nobody asks
    case subject_kind::foreign: drop(where, "it is not a subject of CLES"); break;
    }
}

// Whether a message that was opened has an effect. A server could deliver a request to a second bridge, where it would
// run again. Requests and control lines are answered if their sender is not known.
bool bridge::has_effect(std::string_view where, const subject& about, const message_sender& by) {
    const bool is_for_all = about.kind == subject_kind::feed || about.kind == subject_kind::names;
    if (!is_for_all && about.bridge() != self_) {
        drop(where, "it is not for this bridge");
        return false;
    }
    if (about.kind == subject_kind::request || about.kind == subject_kind::control || by.instance == self_.instance) {
        return true;
    }
    if (!trust_->may_forward(by.member)) {
        drop_untrusted(by);
        return false;
    }
    if (about.kind == subject_kind::feed && !pools_.is_live({about.pool, std::string{by.instance}})) {
        drop(where, "its sender is no bridge that is known here");
        return false;
    }
    return true;
}

void bridge::drop_untrusted(const message_sender& by) {
    ++figures_.messages_refused;
    if (untrusted_.emplace(by.member).second) {
        out_.log(log_level::warning, "dropped what '" + std::string{by.member} +
                                         "' has sent through NATS: it may not forward for this node " +
                                         trust_->how_to_permit(by.member));
    }
}

void bridge::on_refused(std::string_view where, std::string_view why, time_point now) {
    now_ = now;
    drop(where, why);
}

void bridge::on_unproven(std::string_view where, std::string_view reply, time_point now) {
    now_ = now;
    const auto about = parse_subject(where);
    if (connected_ && about.kind == subject_kind::request && about.bridge() == self_) {
        refuse_foreign(std::string{reply}, not_known_yet(setup_.node));
    }
}

void bridge::announce_soon(time_point now) {
    if (!connected_) {
        return;
    }
    next_heartbeat_ = std::min(next_heartbeat_, std::max(now + soon, last_heartbeat_ + between_asked));
    due_ = std::min(due_, next_heartbeat_);
}

void bridge::on_security_changed(time_point now) {
    now_ = now;
    if (!connected_ || trust_ == nullptr) {
        return;
    }
    untrusted_.clear();
    std::vector<bridge_id> gone;
    for (const auto& [name, p] : pools_.pools()) {
        for (const auto& [instance, b] : p.bridges) {
            if (instance != self_.instance && !trust_->may_forward(b.node)) {
                gone.push_back({name, instance});
            }
        }
    }
    for (const auto& each : gone) {
        if (pools_.lose(each, now)) {
            on_lost(each, "the bridge of the pool '" + each.pool + "' may not forward for this node any more");
        }
    }
    announce_soon(now); // with the version of the roster
}

void bridge::drop(std::string_view where, std::string_view why) {
    ++figures_.messages_refused;
    if (next_drop_log_ <= now_) {
        next_drop_log_ = now_ + between_drop_logs;
        out_.log(log_level::warning, "dropped a message of NATS on " + std::string{where.substr(0, 256)} + ": " +
                                         std::string{why} + " (logged once a minute)");
    }
}

// -- other bridges -------------------------------------------------------------------------------------------------

void bridge::send_heartbeat(bool starting) {
    next_heartbeat_ = now_ + interval();
    const heartbeat said{.node = setup_.node,
                         .interval = interval(),
                         .names = home_.digest,
                         .replaces = replaced_,
                         .leaving = left_,
                         .starting = starting || starting_until_,
                         .closing = trust_ != nullptr && leaving_,
                         .roster = trust_ != nullptr ? trust_->roster_version() : 0};
    if (!left_ && !starting_until_) {
        pools_.on_heartbeat(self_, said, now_); // so that `publisher_of` considers it
    }
    heartbeat_sent_ = last_heartbeat_ = now_;
    publish_short(heartbeat_subject(self_), text_of(said));
}

void bridge::on_heartbeat(const subject& from, std::string_view message, time_point now, const message_sender& by) {
    const auto id = from.bridge();
    if (id == self_) {
        if (const auto sent = std::exchange(heartbeat_sent_, {})) {
            round_trip_ = now - *sent;
        }
        return;
    }
    const auto said = parse_heartbeat(message);
    if (!said) {
        drop(heartbeat_subject(id), "it is not a heartbeat");
        return;
    }
    if (trust_ != nullptr) {
        if (said->node != by.member || id.instance != by.instance ||
            (!said->replaces.empty() && !are_of_one_member(said->replaces, by.instance))) {
            drop(heartbeat_subject(id), "it is a heartbeat for another bridge");
            return;
        }
        trust_->on_stated_roster(id, said->roster); // which may permit this bridge
        if (!trust_->may_forward(by.member)) {
            drop_untrusted(by);
            return;
        }
    }
    if (!said->replaces.empty()) {
        const bridge_id before{id.pool, said->replaces};
        if (pools_.remove(before, now)) {
            on_lost(before, "the bridge of the pool '" + id.pool + "' has connected to NATS again");
        } else if (trust_ != nullptr) {
            trust_->on_lost(before);
        }
    }
    if (said->leaving) {
        if (pools_.remove(id, now)) {
            on_lost(id, "the bridge of the pool '" + id.pool + "' has left");
        } else if (trust_ != nullptr) {
            trust_->on_lost(id);
        }
        return;
    }
    if (trust_ != nullptr && said->starting) { // it takes no requests yet, but wants to know this bridge
        announce_soon(now);
        return;
    }
    switch (pools_.on_heartbeat(id, *said, now)) {
    case pool_table::arrival::ignored: return;
    case pool_table::arrival::returned: send_control(id, std::string{lost_line}); [[fallthrough]];
    case pool_table::arrival::fresh:
        out_.on_pools_changed();
        if (said->starting) {
            next_heartbeat_ = std::min(next_heartbeat_, now + soon);
            due_ = std::min(due_, next_heartbeat_);
        }
        break;
    case pool_table::arrival::known: break;
    }
    if (id.pool != setup_.pool && pools_.lacks_names(id.pool, said->names)) {
        auto& asked = asked_names_[id];
        if (asked + names_again_after <= now || asked == time_point{}) {
            asked = now;
            send_control(id, std::string{names_line});
        }
    }
}

void bridge::send_names() {
    names_wanted_ = false;
    next_names_ = now_ + between_names;
    auto text = text_of(home_);
    if (text.size() > max_message_) {
        out_.log(log_level::warning, "the names of the pool's nodes do not fit into a message of NATS");
        return;
    }
    publish(names_subject(self_), std::move(text));
}

void bridge::on_names(const subject& from, std::string_view message) {
    if (from.pool == setup_.pool) {
        return;
    }
    auto said = parse_names(message, pool_table::max_names);
    if (!said) {
        drop(names_subject(from.bridge()), "it is not a list of names");
    } else if (pools_.set_names(from.bridge(), std::move(*said))) {
        asked_names_.erase(from.bridge());
        out_.on_pools_changed();
    }
}

void bridge::send_control(const bridge_id& to, std::string line) {
    out_.publish(control_subject(to), control_subject(self_), std::move(line), bridge_output::room::reserved);
}

void bridge::on_control(std::string_view reply, std::string_view message, time_point now,
                        const message_sender& sender) {
    const auto from = parse_subject(reply);
    const auto by = from.bridge();
    protocol::request_line r;
    protocol::malformed_request wrong;
    if ((from.kind != subject_kind::control && from.kind != subject_kind::reply) ||
        !protocol::parse_request(message, r, wrong)) {
        drop(control_subject(self_), "it is not a message of a bridge");
        return;
    }
    // A bridge of the own pool passes on the BIND of another one.
    const bool is_passed_on = r.verb == verb::bind && !r.unbinds();
    if (trust_ != nullptr && by.instance != sender.instance &&
        !(is_passed_on && pools_.is_live(bridge_id{setup_.pool, std::string{sender.instance}}))) {
        drop(control_subject(self_), "it is for another bridge than its sender");
        return;
    }
    if (r.verb == verb::bind && r.unbinds()) {
        if (const auto noun = noun_of(r); published_.unbind(noun, by)) {
            end_published(noun);
        }
    } else if (r.verb == verb::bind) {
        take(control_subject(self_), message, reply, sender.member, true);
    } else if (message == names_line) {
        names_wanted_ = true;
        next_names_ = std::max(next_names_, now);
        due_ = std::min(due_, next_names_);
    } else if (message == lost_line) {
        if (pools_.is_live(by)) { // it continues, but has forgotten what it had to do with this bridge
            on_lost(by, "the bridge of the pool '" + by.pool + "' did not receive this one for a while");
        }
    } else if (r.noun.path.starts_with(cancel_path)) {
        const auto number = protocol::parse_number(r.noun.path.substr(cancel_path.size()));
        if (const auto id = number ? taken_.id_of(by, *number) : std::nullopt) {
            cancel_taken(*id);
        } else if (const auto noun = published_.cancel({by, std::string{reply}})) {
            end_published(*noun);
        }
    } else {
        drop(control_subject(self_), "it is not a message of a bridge");
    }
}

void bridge::on_lost(const bridge_id& gone, std::string_view why) {
    ++figures_.bridges_lost;
    if (trust_ != nullptr) {
        trust_->on_lost(gone);
    }
    asked_names_.erase(gone);
    for (const auto id : taken_.requests_of(gone)) {
        cancel_taken(id);
        taken_.remove(id);
    }
    not_live_.insert_or_assign(gone, now_ + remembered_for); // copies of its requests may still arrive
    for (const auto& noun : published_.remove(gone)) {
        end_published(noun);
    }
    if (!pools_.is_live(gone.pool)) {
        sent_.close_pool(gone.pool);
        for (const auto& each : feeds_.remove_pool(gone.pool)) {
            unsubscribe_if_last(each);
        }
        std::erase_if(binds_, [&gone](const auto& each) { return each.second.pool == gone.pool; });
        out_.lose_pool(gone.pool, why);
    } else {
        sent_.on_lost(gone, why);
        const auto lost = feeds_.remove_held(gone);
        end_bindings(lost);
        for (const auto& each : lost) { // the node binds these again
            out_.lose_binding(each.noun.on(), each.noun.text(), why);
        }
    }
    out_.on_pools_changed();
}

// Two sites that use one name for their pools would get each other's requests.
void bridge::check_own_pool(time_point now) {
    const auto own = pools_.pools().find(setup_.pool);
    if (own == pools_.pools().end()) {
        return;
    }
    for (const auto& [instance, b] : own->second.bridges) {
        if (instance != self_.instance && b.since + at_home_within <= now && b.node != setup_.node &&
            !std::ranges::binary_search(home_.nodes, b.node) && warned_of_.insert(b.node).second) {
            out_.log(log_level::warning, "the bridge of '" + b.node + "' is of the pool '" + setup_.pool +
                                             "' too, but that node is not known here: if it is at another site, give "
                                             "that another pool's name");
        }
    }
}

// -- requests of the node ------------------------------------------------------------------------------------------

std::string bridge::pool_of(std::string_view target, time_point now) const {
    const auto dot = target.find('.');
    const auto first = dot != std::string_view::npos && dot + 1 < target.size() ? target.substr(0, dot) : "";
    if (!first.empty() && (first == setup_.pool || pools_.is_known(first))) {
        return std::string{first};
    }
    if (const auto found = pools_.pool_of(target, setup_.pool); !found.empty()) {
        return std::string{found};
    }
    const bool may_appear = !connected_ || connected_at_ + optimistic > now;
    return may_appear && is_pool_name(first) ? std::string{first} : std::string{};
}

void bridge::on_line(const bridge_link& from, std::string_view line, time_point now) {
    now_ = now;
    if (!connected_) {
        return; // the link is being lost
    }
    switch (from.what) {
    case bridge_link::role::to_pool: send_request(from, line, now); break;
    case bridge_link::role::from_pool: send_reply(line); break;
    case bridge_link::role::publications:
        if (line.starts_with("UPDATE ")) {
            send_update(line);
        } else {
            send_bind_reply(line);
        }
        break;
    }
}

void bridge::on_closed(const bridge_link& which) {
    switch (which.what) {
    case bridge_link::role::to_pool:
        sent_.close(which);
        end_bindings(feeds_.remove_link(which));
        std::erase_if(binds_, [&which](const auto& each) {
            return each.second.pool == which.pool && each.second.link == which.number;
        });
        break;
    case bridge_link::role::from_pool:
        for (const auto id : taken_.requests_of(which.pool, which.member)) {
            const auto reply = taken_.find(id)->reply;
            taken_.remove(id);
            refuse_foreign(reply, {.code = errc::unavailable, .message = setup_.node + " has closed the link"});
        }
        break;
    case bridge_link::role::publications:
        for (const auto& each : published_.clear()) {
            send_control(each, std::string{lost_line});
        }
        break;
    }
}

void bridge::answer(const bridge_link& on, std::uint64_t id, std::string_view reply) {
    std::string line;
    protocol::append_reply_head(line, id);
    out_.deliver(on, std::move(line.append(reply)));
}

void bridge::refuse(const bridge_link& on, std::uint64_t id, const protocol::failure& why) {
    if (id != 0) {
        answer(on, id, protocol::failure_text(why));
    }
}

void bridge::deliver(std::vector<foreign_feeds::update> updates) {
    for (auto& each : updates) {
        out_.deliver(each.on, std::move(each.line));
    }
}

// The node asks whether replies to BIND have marks.
void bridge::answer_for_itself(const bridge_link& from, const protocol::request_line& r) {
    if (r.verb == verb::push && r.noun.path.starts_with(cancel_path)) {
        const auto id = protocol::parse_number(r.noun.path.substr(cancel_path.size()));
        if (id) {
            sent_.cancel(*id);
            if (auto gone = binds_.erase(*id) != 0 ? feeds_.remove(*id) : std::nullopt) {
                end_bindings({std::move(*gone)});
            }
        }
    } else if (r.verb == verb::pull && r.noun.path == "cles") {
        if (r.id != 0) {
            answer(from, r.id, R"({"pool":")" + from.pool + R"(","protocol":1,"features":["mark"]})");
        }
    } else if (r.noun.path != "cles/leaving") {
        refuse(from, r.id, {.code = errc::no_target, .message = "'self' is no node of the pool '" + from.pool + "'"});
    }
}

void bridge::send_request(const bridge_link& from, std::string_view line, time_point now) {
    protocol::request_line r;
    protocol::malformed_request wrong;
    if (protocol::is_reply(line) || !protocol::parse_request(line, r, wrong) || r.is_update()) {
        return; // the node itself writes these lines
    }
    if (r.noun.target == "self") {
        answer_for_itself(from, r);
    } else if (r.id != 0 && r.verb == verb::bind) { // without an id, nothing could be answered
        send_bind(from, r, now);
    } else if (r.id != 0) {
        publish_request(from, r, now);
    }
}

void bridge::publish_request(const bridge_link& from, const protocol::request_line& r, time_point now) {
    const auto& pool = from.pool;
    const std::string addressee{trust_ != nullptr ? pools_.taker_of(pool, turn_) : std::string_view{}};
    turn_ += golden_ratio;
    const auto number = sent_.add(from, r.id, now + milliseconds{r.deadline_ms}, now, addressee);
    if (has_crossed(r.via)) { // a node of that name in another pool is not the one that was meant
        sent_.refuse(number, {.code = errc::no_target,
                              .message = "a request from another pool is not sent on to '" + pool + "'"});
        return;
    }
    const auto node = without_pool(r.noun.target, pool);
    const auto deadline = node == "all" ? sent_.deadline_of_all(pool, r.deadline_ms) : 0;
    auto message = pool == setup_.pool ? message_within_pool(r, deadline) : message_of(r, setup_.pool, deadline);
    auto subject = request_subject(pool, r.verb, node, r.noun.task);
    if (trust_ != nullptr) { // for one bridge, so that the request runs there only, however often it arrives
        if (addressee.empty()) {
            sent_.refuse(number, {.code = errc::unavailable,
                                  .message = "no bridge of the pool '" + pool + "' takes requests now"});
            return;
        }
        subject = request_subject({pool, addressee});
        message = text_of(r.verb, node, r.noun.task, message);
    }
    if (message.size() > max_message_) {
        sent_.refuse(number,
                     {.code = errc::too_large,
                      .message = "a request through NATS has at most " + std::to_string(max_message_) + " bytes here"});
        return;
    }
    ++figures_.requests_sent;
    if (!out_.publish(std::move(subject), reply_subject(self_, number), std::move(message),
                      bridge_output::room::shared)) {
        sent_.refuse(number, {.code = errc::busy,
                              .message = "too much waits to be sent to NATS",
                              .retry_ms = protocol::default_retry_ms});
    }
}

void bridge::send_bind(const bridge_link& from, const protocol::request_line& r, time_point now) {
    const foreign_noun noun{.pool = from.pool,
                            .node = std::string{without_pool(r.noun.target, from.pool)},
                            .task = std::string{r.noun.task},
                            .parameters = std::string{r.noun.path.substr(r.noun.task.size())},
                            .target = std::string{r.noun.target},
                            .link = from.number};
    if (protocol::is_reserved_target(noun.node)) {
        refuse(from, r.id, {.code = errc::no_target, .message = "a binding in another pool needs the name of a node"});
        return;
    }
    if (r.unbinds()) {
        if (auto gone = feeds_.remove(noun)) {
            end_bindings({std::move(*gone)});
        }
        answer(from, r.id, "{}");
        return;
    }
    // First, so that no update is missed after the reply.
    if (feeds_.add(noun, r.id)) {
        out_.subscribe(noun.subject(), false);
    }
    binds_.insert_or_assign(r.id, noun);
    publish_request(from, r, now);
}

void bridge::unsubscribe_if_last(const foreign_feeds::removed& gone) {
    if (gone.is_last) {
        out_.unsubscribe(gone.noun.subject());
    }
}

// Ends them at the bridges that hold them.
void bridge::end_bindings(const std::vector<foreign_feeds::removed>& ended) {
    for (const auto& gone : ended) {
        unsubscribe_if_last(gone);
        if (!gone.taker.empty() && gone.is_only) {
            end_binding_at(gone.taker, gone.noun);
        }
    }
}

void bridge::end_binding_at(const std::string& taker, const foreign_noun& noun) {
    send_control({noun.pool, taker}, text_of(verb::bind, noun.node, noun.task, noun.parameters + " lease=0"));
}

void bridge::on_answer(const bridge_link& on, std::uint64_t id, std::string_view reply, std::string_view taker) {
    answer(on, id, reply);
    const auto bind = binds_.extract(id);
    if (bind.empty()) {
        return;
    }
    if (protocol::is_failure(reply)) {
        if (const auto gone = feeds_.remove(id)) {
            unsubscribe_if_last(*gone);
        }
        return;
    }
    if (!feeds_.has(bind.mapped()) && !taker.empty()) { // the node has ended it meanwhile
        end_binding_at(std::string{taker}, bind.mapped());
    }
    deliver(feeds_.on_bound(id, taker));
}

void bridge::on_forgotten(std::uint64_t id) {
    binds_.erase(id);
    if (auto gone = feeds_.remove(id)) {
        end_bindings({std::move(*gone)});
    }
}

void bridge::cancel_at(const bridge_id& taker, std::uint64_t number) {
    out_.publish(control_subject(taker), reply_subject(self_, number),
                 "PUSH self:" + std::string{cancel_path} + std::to_string(number), bridge_output::room::reserved);
}

// -- requests of other pools ---------------------------------------------------------------------------------------

bool bridge::publish(std::string subject, std::string message) {
    return out_.publish(std::move(subject), {}, std::move(message), bridge_output::room::shared);
}

void bridge::publish_short(std::string subject, std::string message) {
    out_.publish(std::move(subject), {}, std::move(message), bridge_output::room::reserved);
}

void bridge::refuse_foreign(const std::string& reply, const protocol::failure& why) {
    if (!reply.empty()) {
        publish_short(reply, protocol::failure_text(why));
    }
}

void bridge::take(std::string_view where, std::string_view line, std::string_view reply, std::string_view member,
                  bool is_passed_on) {
    const std::string answer_at{reply};
    protocol::request_line r;
    protocol::malformed_request wrong;
    if (protocol::parse_request(line, r, wrong) && r.is_update()) {
        wrong.why = "an update with 'seq' and 'epoch' is not a request";
    }
    if (!wrong.why.empty()) {
        drop(where, wrong.why);
        refuse_foreign(answer_at, {.code = errc::bad_request, .message = wrong.why});
        return;
    }
    if (r.noun.target == "self" || (r.noun.task == "cles" && r.verb != verb::pull)) {
        refuse_foreign(answer_at, {.code = errc::no_target,
                                   .message = "requests to the task 'cles' that concern a link do not cross NATS"});
        return;
    }
    const auto from = parse_subject(reply);
    taken_requests::request by{.by = {}, .number = 0, .reply = answer_at, .member = std::string{member}};
    if (from.kind == subject_kind::reply) {
        by.by = from.bridge();
        by.number = from.number;
    }
    if (trust_ != nullptr && by.by.pool.empty()) { // nobody would notice its loss, or that it arrives again
        drop(where, "only bridges send sealed requests");
        return;
    }
    if (const auto why = trust_ != nullptr ? why_not_served(by, is_passed_on) : std::nullopt) {
        refuse_foreign(answer_at, *why);
        return;
    }
    if (by.by.pool != setup_.pool && has_passed(r.via, setup_.pool)) {
        refuse_foreign(answer_at, {.code = errc::no_target,
                                   .message = "the request has passed through the pool '" + setup_.pool +
                                              "' before: the pools in 'via' form a loop"});
        return;
    }
    if (r.verb == verb::bind) {
        take_bind(r, by, is_passed_on);
        return;
    }
    if (!r.wants_reply || answer_at.empty()) {
        by.reply.clear();
    }
    const bridge_link on{.what = bridge_link::role::from_pool, .pool = by.by.pool, .member = by.member};
    if (!by.by.pool.empty() && !remember(by.by)) {
        refuse_foreign(answer_at, {.code = errc::busy,
                                   .message = "too many bridges that are not known here ask",
                                   .retry_ms = protocol::default_retry_ms});
        return;
    }
    const auto id = taken_.add(std::move(by));
    if (!id) {
        ++figures_.messages_refused; // it has arrived before
        return;
    }
    ++figures_.requests_taken;
    out_.deliver(on, line_of(r, *id, on.pool));
    if (!r.wants_reply) {
        taken_.remove(*id);
    }
}

// Why a request of that bridge of a secured fleet is refused. What a bridge asks that is not known, or lost, may have
// been held back for long.
std::optional<protocol::failure> bridge::why_not_served(const taken_requests::request& by, bool is_passed_on) const {
    if (leaving_) {
        return protocol::failure{
            .code = errc::busy, .message = setup_.node + " is shutting down", .retry_ms = protocol::default_retry_ms};
    }
    if (pools_.is_live(by.by)) {
        return {};
    }
    if (!is_passed_on && !trust_->may_forward(by.member)) {
        return protocol::failure{.code = errc::denied,
                                 .message = "'" + by.member + "' may not forward for '" + setup_.node + "' " +
                                            trust_->how_to_permit(by.member)};
    }
    return not_known_yet(setup_.node);
}

// Whether its requests can be recognised if they arrive again. It may not be known yet.
bool bridge::remember(const bridge_id& by) {
    if (pools_.is_live(by)) {
        return true;
    }
    if (not_live_.size() >= max_not_live && !not_live_.contains(by)) {
        return false;
    }
    not_live_.insert_or_assign(by, now_ + remembered_for);
    return true;
}

void bridge::on_batch() {
    for (const auto* open : taken_.take_unacknowledged()) {
        if (!open->reply.empty()) {
            publish_short(open->reply, taken_text(self_.instance));
        }
    }
}

void bridge::cancel_taken(std::uint64_t id) {
    if (const auto* r = taken_.find(id)) {
        out_.deliver({.what = bridge_link::role::from_pool, .pool = r->by.pool, .member = r->member},
                     "PUSH self:" + std::string{cancel_path} + std::to_string(id) + " reply=no");
    }
}

void bridge::send_reply(std::string_view line) {
    const auto parts = split_reply(line);
    const auto* r = parts.id == 0 ? nullptr : taken_.find(parts.id);
    if (r == nullptr) {
        return; // nobody waits
    }
    if (!r->reply.empty()) {
        if (parts.rest.size() <= max_message_) {
            if (protocol::is_failure(parts.rest) && parts.rest.size() <= max_short) {
                publish_short(r->reply, std::string{parts.rest});
            } else if (!publish(r->reply, std::string{parts.rest}) && !parts.is_interim) {
                refuse_foreign(r->reply, {.code = errc::busy,
                                          .message = "too much waits to be sent to NATS for the reply",
                                          .retry_ms = protocol::default_retry_ms,
                                          .ran = true});
            }
        } else if (!parts.is_interim) {
            refuse_foreign(r->reply, {.code = errc::too_large,
                                      .message = "the reply has " + std::to_string(parts.rest.size()) +
                                                 " bytes; NATS permits " + std::to_string(max_message_) + " here",
                                      .ran = true});
        }
    }
    if (!parts.is_interim) {
        taken_.remove(parts.id);
    }
}

// -- nouns for other pools -----------------------------------------------------------------------------------------

void bridge::take_bind(const protocol::request_line& r, const taken_requests::request& by, bool is_passed_on) {
    if (by.by.pool.empty()) {
        refuse_foreign(by.reply, {.code = errc::bad_request, .message = "only bridges bind through NATS"});
        return;
    }
    if (!pools_.is_live(by.by)) { // nobody would notice its loss
        refuse_foreign(by.reply, {.code = errc::busy,
                                  .message = "the bridge that binds is not known here yet",
                                  .retry_ms = static_cast<std::uint64_t>(setup_.interval.count())});
        return;
    }
    if (trust_ != nullptr) {
        if (const auto why = trust_->refusal(by.member, r)) {
            refuse_foreign(by.reply, *why);
            return;
        }
    }
    const auto noun = noun_of(r);
    const auto publisher = pools_.publisher_of(setup_.pool, noun);
    if (!is_passed_on && publisher != self_.instance && !publisher.empty()) {
        auto message = message_of(r, {});
        if (trust_ != nullptr && r.from.empty()) { // that one knows this bridge only
            message.insert(r.noun.path.size() - r.noun.task.size(), " from=" + by.member);
        }
        out_.publish(control_subject({setup_.pool, std::string{publisher}}), by.reply,
                     text_of(verb::bind, r.noun.target, r.noun.task, message), bridge_output::room::reserved);
        return;
    }
    ++figures_.requests_taken;
    publish_short(by.reply, taken_text(self_.instance));
    if (const auto id = published_.bind(noun, {by.by, by.reply}); id != 0) {
        std::string line = "BIND " + noun + " id=" + std::to_string(id) + " deadline=" + std::to_string(r.deadline_ms) +
                           " keep=" + std::to_string(upstream_keep) + " mark=yes hops=" + std::to_string(r.hops);
        line.append(" via=").append(via_of(r, by.by.pool));
        out_.deliver({bridge_link::role::publications, {}}, std::move(line));
    }
}

void bridge::send_bind_reply(std::string_view line) {
    const auto parts = split_reply(line);
    if (parts.id == 0) {
        return;
    }
    const auto answered = published_.on_reply(parts.id, protocol::is_failure(parts.rest));
    for (const auto& to : answered.to) {
        const auto taken = taken_text(self_.instance) + " ";
        if (protocol::is_failure(parts.rest) && parts.rest.size() <= max_short) {
            publish_short(to, taken + std::string{parts.rest});
        } else if (parts.rest.size() + max_pool_name > max_message_ || !publish(to, taken + std::string{parts.rest})) {
            publish_short(to, taken + "{}"); // it is bound nevertheless, without a value
        }
    }
    if (answered.ends) {
        end_published(answered.noun);
    }
}

void bridge::send_update(std::string_view line) {
    constexpr std::string_view verb_text = "UPDATE ";
    const auto text = line.substr(verb_text.size());
    const auto noun = text.substr(0, text.find(' '));
    const auto colon = noun.find(':');
    if (colon == std::string_view::npos) {
        return;
    }
    const auto task = noun.substr(colon + 1, noun.find('/') == std::string_view::npos ? std::string_view::npos
                                                                                      : noun.find('/') - colon - 1);
    auto message = std::string{text.substr(colon + 1 + task.size())};
    const bool is_sent = message.size() <= max_message_ &&
                         publish(feed_subject(setup_.pool, noun.substr(0, colon), task), std::move(message));
    ++(is_sent ? figures_.updates_sent : figures_.updates_dropped); // shows as a gap
}

void bridge::end_published(const std::string& noun) {
    out_.deliver({bridge_link::role::publications, {}},
                 "BIND " + noun + " id=" + std::to_string(published_.next_id()) + " lease=0");
}

} // namespace cles::bridging
