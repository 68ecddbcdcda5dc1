// SPDX-License-Identifier: BSL-1.0
#include "federation/bridge_presence.hpp"

#include "federation/carried_line.hpp"

#include <algorithm>

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

} // namespace

// -- this bridge ---------------------------------------------------------------------------------------------------

void bridge_presence::on_connected(std::string before, time_point now) {
    replaced_ = std::move(before);
    if (trust_ != nullptr && !are_of_one_member(replaced_, nats_.self().instance)) {
        replaced_.clear(); // nobody may replace a bridge of another member: that one is lost when it stays silent
    }
    connected_at_ = now;
    pools_may_appear_ = true;
    starting_until_.reset();
    reachable_from_.reset();
    if (trust_ != nullptr) {
        starting_until_ = now + acquaintance;
        reachable_from_ = now + acquaintance + soon; // the heartbeat arrives before the first request
    }
    untrusted_.clear();
    home_ = names_of(out_.home_names());
    round_trip_.reset();
    pools_.note_connection(now);
    send_heartbeat(true, now);
}

void bridge_presence::on_disconnected(time_point now) {
    asked_names_.clear();
    pools_.clear(now);
}

void bridge_presence::leave(time_point now) {
    if (trust_ != nullptr) {
        closing_ = true;
        if (nats_.is_open()) {
            send_heartbeat(false, now);
        }
    }
}

void bridge_presence::say_left(time_point now) {
    if (!std::exchange(left_, true) && nats_.is_open()) {
        send_heartbeat(false, now);
    }
}

void bridge_presence::on_time(time_point now) {
    if (due() + interval() < now) { // this process did not run
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
        send_names(now);
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
        send_heartbeat(false, now);
    }
    for (const auto& gone : pools_.expire(now)) {
        lose(gone, "was not received any more", now);
    }
    if (pools_.forget_pools(now)) {
        out_.on_pools_changed();
    }
    check_own_pool(now);
}

time_point bridge_presence::due() const noexcept {
    constexpr auto never = time_point::max();
    return std::min({next_heartbeat_, names_wanted_ ? next_names_ : never, starting_until_.value_or(never),
                     reachable_from_.value_or(never)});
}

milliseconds bridge_presence::interval() const {
    return std::max(shortest_, per_bridge * static_cast<milliseconds::rep>(pools_.bridge_count()));
}

void bridge_presence::announce_soon(time_point now) {
    next_heartbeat_ = std::min(next_heartbeat_, std::max(now + soon, last_heartbeat_ + between_asked));
}

void bridge_presence::send_heartbeat(bool starting, time_point now) {
    next_heartbeat_ = now + interval();
    const heartbeat said{.node = node_,
                         .interval = interval(),
                         .names = home_.digest,
                         .replaces = replaced_,
                         .leaving = left_,
                         .starting = starting || starting_until_,
                         .closing = closing_,
                         .roster = trust_ != nullptr ? trust_->roster_version() : 0,
                         .sessions = trust_ != nullptr};
    if (!left_ && !starting_until_) {
        pools_.on_heartbeat(nats_.self(), said, now); // so that `publisher_of` considers it
    }
    heartbeat_sent_ = last_heartbeat_ = now;
    nats_.publish_short(heartbeat_subject(nats_.self()), text_of(said));
}

void bridge_presence::on_asked_for_names(time_point now) {
    names_wanted_ = true;
    next_names_ = std::max(next_names_, now);
}

void bridge_presence::send_names(time_point now) {
    names_wanted_ = false;
    next_names_ = now + between_names;
    if (auto text = text_of(home_); nats_.fits(text)) {
        nats_.publish(names_subject(nats_.self()), std::move(text));
    } else {
        out_.log(log_level::warning, "the names of the pool's nodes do not fit into a message of NATS");
    }
}

// -- other bridges -------------------------------------------------------------------------------------------------

void bridge_presence::on_heartbeat(const received_message& m) {
    const auto id = m.about.bridge();
    const auto now = m.at;
    if (id == nats_.self()) {
        if (const auto sent = std::exchange(heartbeat_sent_, {})) {
            round_trip_ = now - *sent;
        }
        return;
    }
    const auto said = parse_heartbeat(m.text);
    if (!said) {
        nats_.drop(m, "it is not a heartbeat");
        return;
    }
    if (trust_ != nullptr) {
        if (!is_of_sender(*said, id, m.by)) {
            nats_.drop(m, "it is a heartbeat for another bridge");
            return;
        }
        trust_->on_stated_roster(id, said->roster); // which may permit this bridge
        if (!admit(m.by)) {
            return;
        }
    }
    if (!said->replaces.empty()) {
        remove({id.pool, said->replaces}, "has connected to NATS again", now);
    }
    if (said->leaving) {
        pools_.note_leaving(id);
        remove(id, "has left", now);
        return;
    }
    if (trust_ != nullptr && said->sessions) { // before anything is sent to it
        trust_->on_stated_sessions(id);
    }
    if (trust_ != nullptr && said->starting) { // it takes no requests yet, but wants to know this bridge
        announce_soon(now);
        return;
    }
    switch (pools_.on_heartbeat(id, *said, now)) {
    case pool_table::arrival::ignored: return;
    case pool_table::arrival::returned: nats_.send_control(id, std::string{lost_line}); [[fallthrough]];
    case pool_table::arrival::fresh:
        out_.on_pools_changed();
        if (said->starting) {
            next_heartbeat_ = std::min(next_heartbeat_, now + soon);
        }
        break;
    case pool_table::arrival::known: break;
    }
    if (id.pool != nats_.pool() && pools_.lacks_names(id.pool, said->names)) {
        ask_for_names(id, now);
    }
}

bool bridge_presence::is_of_sender(const heartbeat& said, const bridge_id& id, const message_sender& by) const {
    return said.node == by.member && id.instance == by.instance &&
           (said.replaces.empty() || are_of_one_member(said.replaces, by.instance));
}

void bridge_presence::ask_for_names(const bridge_id& of, time_point now) {
    auto& asked = asked_names_[of];
    if (asked + names_again_after <= now || asked == time_point{}) {
        asked = now;
        nats_.send_control(of, std::string{names_line});
    }
}

void bridge_presence::on_names(const received_message& m) {
    if (m.about.pool == nats_.pool()) {
        return;
    }
    auto said = parse_names(m.text, pool_table::max_names);
    if (!said) {
        nats_.drop(m, "it is not a list of names");
    } else if (const auto by = m.about.bridge(); pools_.set_names(by, std::move(*said))) {
        asked_names_.erase(by);
        out_.on_pools_changed();
    }
}

bool bridge_presence::admit(const message_sender& by) {
    if (trust_->may_forward(by.member)) {
        return true;
    }
    ++nats_.counts().messages_refused;
    if (untrusted_.emplace(by.member).second) {
        out_.log(log_level::warning, "dropped what '" + std::string{by.member} +
                                         "' has sent through NATS: it may not forward for this node " +
                                         trust_->how_to_permit(by.member));
    }
    return false;
}

void bridge_presence::on_security_changed(time_point now) {
    if (trust_ == nullptr || !nats_.is_open()) {
        return;
    }
    untrusted_.clear();
    const auto is_lost = [this](const std::string& instance, const pool_table::bridge& b) {
        return instance != nats_.self().instance && !trust_->may_forward(b.node);
    };
    for (const auto& gone : pools_.lose_if(is_lost, now)) {
        lose(gone, "may not forward for this node any more", now);
    }
    announce_soon(now); // with the version of the roster
}

void bridge_presence::on_forgotten_by(const bridge_id& by, time_point now) {
    if (pools_.is_live(by)) {
        lose(by, "did not receive this one for a while", now);
    }
}

// It says so itself.
void bridge_presence::remove(const bridge_id& gone, std::string_view why, time_point now) {
    if (pools_.remove(gone, now)) {
        lose(gone, why, now);
    } else if (trust_ != nullptr) {
        trust_->on_lost(gone);
    }
}

void bridge_presence::lose(const bridge_id& gone, std::string_view why, time_point now) {
    ++nats_.counts().bridges_lost;
    if (trust_ != nullptr) {
        trust_->on_lost(gone);
    }
    asked_names_.erase(gone);
    on_lost_(gone, ("the bridge of the pool '" + gone.pool + "' ").append(why), now);
    out_.on_pools_changed();
}

// Two sites that use one name for their pools would get each other's requests.
void bridge_presence::check_own_pool(time_point now) {
    const auto own = pools_.pools().find(nats_.pool());
    if (own == pools_.pools().end()) {
        return;
    }
    for (const auto& [instance, b] : own->second.bridges) {
        if (instance != nats_.self().instance && b.since + at_home_within <= now && b.node != node_ &&
            !std::ranges::binary_search(home_.nodes, b.node) && warned_of_.insert(b.node).second) {
            out_.log(log_level::warning, "the bridge of '" + b.node + "' is of the pool '" + nats_.pool() +
                                             "' too, but that node is not known here: if it is at another site, give "
                                             "that another pool's name");
        }
    }
}

std::string bridge_presence::pool_of(std::string_view target, time_point now) const {
    const auto dot = target.find('.');
    const auto first = dot != std::string_view::npos && dot + 1 < target.size() ? target.substr(0, dot) : "";
    if (!first.empty() && (first == nats_.pool() || pools_.is_known(first))) {
        return std::string{first};
    }
    if (const auto found = pools_.pool_of(target, nats_.pool()); !found.empty()) {
        return std::string{found};
    }
    const bool may_appear = !nats_.is_open() || connected_at_ + optimistic > now;
    return may_appear && is_pool_name(first) ? std::string{first} : std::string{};
}

} // namespace cles::bridging
