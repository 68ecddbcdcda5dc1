// SPDX-License-Identifier: BSL-1.0
#include "node/membership/name_conflict.hpp"

#include <cles/error.hpp>

#include "json/json_members.hpp"
#include "node/local_node.hpp"
#include "protocol/datagram.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <boost/system/errc.hpp>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>

namespace cles::core {

probe_outcome read_probe_answer(std::string_view json) {
    constexpr auto longest = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max() / 1'000'000);
    probe_outcome found;
    bool has_epoch = false;
    json_reader r{json};
    const bool good = read_members(r, [&](std::string_view key) {
        if (key == "node") {
            return r.read(found.node);
        }
        if (key == "epoch") {
            std::string text;
            if (!r.read(text)) {
                return false;
            }
            const auto epoch = protocol::parse_epoch(text);
            has_epoch = epoch.has_value();
            found.epoch = epoch.value_or(0);
            return true;
        }
        if (key == "uptime_ms") {
            std::uint64_t ms = 0;
            if (!r.read(ms)) {
                return false;
            }
            found.uptime = std::chrono::milliseconds{std::min(ms, longest)};
            return true;
        }
        return r.skip();
    });
    if (good && has_epoch && !found.node.empty()) {
        found.what = probe_outcome::kind::answered;
    }
    return found;
}

namespace {

using outcome = core::probe_outcome::kind;

constexpr std::size_t max_probes = 64; // in progress

// Absent means that no node is there, not that this node lacks something or that the other is busy.
outcome outcome_of(boost::system::error_code code) {
    namespace system_errc = boost::system::errc;
    const bool absent = code == errc::deadline || code == errc::unavailable ||
                        code == system_errc::connection_refused || code == system_errc::connection_reset ||
                        code == system_errc::timed_out || code == system_errc::no_such_file_or_directory;
    return absent ? outcome::absent : outcome::unclear;
}

} // namespace

// -- probes --------------------------------------------------------------------------------------------------------

bool name_conflicts::may_probe(time_point now) noexcept {
    if (prober_ == nullptr || probes_.size() >= max_probes || probe_debt_ > now + probe_burst) {
        return false;
    }
    probe_debt_ = std::max(probe_debt_, now) + probe_interval;
    return true;
}

void name_conflicts::probe(name_check& check, name_check::stage stage, const std::string& name, std::string_view where,
                           time_point now) {
    check.at = stage;
    check.asked = now;
    check.ticket = ++last_probe_;
    probes_.emplace(check.ticket, name);
    const std::string url{where};
    prober_->probe(check.ticket, url);
}

void name_conflicts::check_owner(const std::string& name, const incarnation& owner, name_conflict& conflict,
                                 time_point now) {
    if (conflict.check.at == name_check::stage::none && !owner.endpoints.empty() && may_probe(now)) {
        probe(conflict.check, name_check::stage::owner, name, owner.where(), now);
    }
}

void name_conflicts::check_own_name(name_conflict& conflict, time_point now) {
    if (conflict.check.at == name_check::stage::none && !conflict.contender.endpoints.empty() && may_probe(now)) {
        probe(conflict.check, name_check::stage::contender, own_name_, conflict.contender.where(), now);
    }
}

std::optional<std::string> name_conflicts::take_probe(std::uint64_t ticket) {
    auto asked = probes_.extract(ticket);
    return asked ? std::optional{std::move(asked.mapped())} : std::nullopt;
}

// -- outcomes ------------------------------------------------------------------------------------------------------

name_conflicts::action name_conflicts::on_probed(const std::string& name, const incarnation& owner, time_point since,
                                                 name_conflict& conflict, const probe_outcome& found,
                                                 time_point resumed_at, time_point now) {
    auto& check = conflict.check;
    if (found.what == outcome::absent && resumed_at > check.asked) { // suspended meanwhile: the reply may be lost
        check.at = name_check::stage::none;                          // retried on the contender's next sighting
        return action::none;
    }
    if (check.at == name_check::stage::owner) {
        return on_owner_probed(name, owner, conflict, found, now);
    }
    if (check.at != name_check::stage::contender) {
        return action::none;
    }
    // The owner has answered; `found` is the outcome for the contender.
    check.at = name_check::stage::over;
    if (found.what != outcome::answered || found.node != name || found.epoch != conflict.contender.epoch) {
        return action::none;
    }
    // An owner that was known here before the contender started keeps the name. Otherwise the start times decide.
    const auto began = now - found.uptime;
    const auto apart = began - check.owner_began;
    const bool first = began <= since && (apart < -same_start_tolerance ||
                                          (apart <= same_start_tolerance && conflict.contender.epoch < owner.epoch));
    return first ? action::swap : action::conflict_confirmed;
}

name_conflicts::action name_conflicts::on_owner_probed(const std::string& name, const incarnation& owner,
                                                       name_conflict& conflict, const probe_outcome& found,
                                                       time_point now) {
    auto& check = conflict.check;
    check.at = name_check::stage::over;
    const bool another = found.what == outcome::answered && (found.node != name || found.epoch != owner.epoch);
    if (found.what == outcome::absent || another) {
        return action::owner_gone;
    }
    if (found.what == outcome::answered && !conflict.contender.endpoints.empty() && may_probe(now)) {
        check.owner_began = now - found.uptime;
        probe(check, name_check::stage::contender, name, conflict.contender.where(), now);
    }
    return action::none;
}

name_conflicts::action name_conflicts::on_own_name_probed(name_conflict& conflict, const probe_outcome& found,
                                                          time_point now) const {
    conflict.check.at = name_check::stage::over;
    if (found.what != outcome::answered || found.node != own_name_ || found.epoch != conflict.contender.epoch) {
        return action::none;
    }
    const auto later = started_at_ - (now - found.uptime); // how much later this node started
    const bool gives_way =
        later > same_start_tolerance || (later >= -same_start_tolerance && conflict.contender.epoch < own_epoch_);
    return gives_way ? action::own_name_taken : action::conflict_confirmed;
}

// -- replies -------------------------------------------------------------------------------------------------------

probe_reply::verdict probe_reply::offer(std::string_view json) {
    if (!is_valid_json(json)) {
        return verdict::malformed;
    }
    const std::unique_ptr<probe_reply> self{this};
    report(core::read_probe_answer(json));
    return verdict::completed;
}

void probe_reply::fail(boost::system::error_code code, std::string_view) {
    const std::unique_ptr<probe_reply> self{this};
    report({.what = outcome_of(code)});
}

void probe_reply::refuse(boost::system::error_code, std::string_view, std::string_view) {
    const std::unique_ptr<probe_reply> self{this};
    report({});
}

void probe_reply::report(core::probe_outcome found) const {
    const auto host = host_.lock();
    if (!host || host->stopped()) {
        return;
    }
    // Posted, because the link that delivered the reply must be done with it before it is released and others are
    // notified.
    core::post(host->environment(), [weak = host_, ticket = ticket_, url = url_, found = std::move(found)] {
        if (const auto alive = weak.lock(); alive && !alive->stopped()) {
            alive->node().peers.on_probed(ticket, found, alive->now());
            alive->peer_channels().release(url);
        }
    });
}

} // namespace cles::core
