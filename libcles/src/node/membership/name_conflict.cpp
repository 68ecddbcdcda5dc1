// SPDX-License-Identifier: BSL-1.0
#include "node/membership/name_conflict.hpp"

#include <cles/error.hpp>

#include "json/json_members.hpp"

#include <boost/system/errc.hpp>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>

namespace cles::core {
namespace {

using outcome = probe_outcome::kind;

constexpr std::size_t max_probes = 64; // in progress

} // namespace

probe_outcome read_probe_answer(std::string_view json) {
    constexpr std::chrono::milliseconds longest{std::numeric_limits<std::int64_t>::max() / 1'000'000};
    probe_outcome found;
    std::optional<std::uint32_t> epoch;
    json_reader r{json};
    const bool good = read_members(r, [&](std::string_view key) {
        return key == "node"        ? r.read(found.node)
               : key == "epoch"     ? read_epoch(r, epoch)
               : key == "uptime_ms" ? read_milliseconds(r, found.uptime, longest)
                                    : r.skip();
    });
    found.epoch = epoch.value_or(0);
    if (good && epoch && !found.node.empty()) {
        found.what = outcome::answered;
    }
    return found;
}

// Absent means that no node is there, not that this node lacks something or that the other is busy.
probe_outcome failed_probe(boost::system::error_code code) {
    namespace system_errc = boost::system::errc;
    const bool absent = code == errc::deadline || code == errc::unavailable ||
                        code == system_errc::connection_refused || code == system_errc::connection_reset ||
                        code == system_errc::timed_out || code == system_errc::no_such_file_or_directory;
    return {.what = absent ? outcome::absent : outcome::unclear};
}

// -- probes --------------------------------------------------------------------------------------------------------

void name_conflicts::probe(name_check& check, name_check::stage stage, const std::string& name, std::string_view where,
                           time_point now) {
    if (where.empty() || !prober_ || probes_.size() >= max_probes || probe_debt_ > now + probe_burst) {
        return;
    }
    probe_debt_ = std::max(probe_debt_, now) + probe_interval;
    check.at = stage;
    check.asked = now;
    check.ticket = ++last_probe_;
    probes_.emplace(check.ticket, name);
    const std::string url{where}; // which may change meanwhile
    prober_(check.ticket, url);
}

void name_conflicts::check_owner(const std::string& name, const incarnation& owner, name_conflict& conflict,
                                 time_point now) {
    if (conflict.check.at == name_check::stage::none) {
        probe(conflict.check, name_check::stage::owner, name, owner.where(), now);
    }
}

// Again by each newer one: the last answer may have been lost, and the node may have begun to listen.
void name_conflicts::check_new_source(const std::string& name, name_conflict& conflict, std::string_view where,
                                      time_point now) {
    if (conflict.check.at == name_check::stage::none || conflict.check.at == name_check::stage::over) {
        probe(conflict.check, name_check::stage::contender, name, where, now);
    }
}

void name_conflicts::check_own_name(const std::string& name, name_conflict& conflict, time_point now) {
    if (conflict.check.at == name_check::stage::none) {
        conflict.check.owner_began = started_at_;
        probe(conflict.check, name_check::stage::contender, name, conflict.contender.where(), now);
    }
}

std::string_view name_conflicts::probed_name(std::uint64_t ticket) const noexcept {
    const auto found = probes_.find(ticket);
    return found == probes_.end() ? std::string_view{} : found->second;
}

std::optional<std::string> name_conflicts::take_probe(std::uint64_t ticket) {
    auto asked = probes_.extract(ticket);
    return asked ? std::optional{std::move(asked.mapped())} : std::nullopt;
}

// -- outcomes ------------------------------------------------------------------------------------------------------

name_conflicts::action name_conflicts::on_probed(const known_owner& owner, name_conflict& conflict,
                                                 const probe_outcome& found, time_point now) {
    auto& check = conflict.check;
    const auto is_by = [&](std::uint32_t epoch) { return found.node == owner.name && found.epoch == epoch; };
    if (found.what == outcome::absent && owner.resumed_at > check.asked) { // suspended meanwhile: the reply may be lost
        check.at = name_check::stage::none;                                // retried on the contender's next sighting
        return action::none;
    }
    const auto stage = std::exchange(check.at, name_check::stage::over);
    const bool is_owner = conflict.contender.epoch == owner.epoch; // at another address
    if (stage == name_check::stage::owner) {
        const bool is_gone = found.what == outcome::absent || (found.what == outcome::answered && !is_by(owner.epoch));
        if (is_gone && !is_owner) {
            return action::owner_gone;
        }
        if (found.what == outcome::answered) {
            check.owner_began = now - found.uptime;
        }
        if (is_owner ? is_gone : found.what == outcome::answered) {
            probe(check, name_check::stage::contender, owner.name, conflict.contender.where(), now);
        }
        return action::none;
    }
    // The owner is live; `found` is the outcome for the contender.
    if (found.what != outcome::answered || !is_by(conflict.contender.epoch)) {
        return action::none;
    }
    if (is_owner) {
        return action::owner_moved;
    }
    // An owner that was known here before the contender started keeps the name. Otherwise the start times decide.
    const auto began = now - found.uptime;
    const auto apart = began - check.owner_began;
    const bool first =
        began <= owner.since &&
        (apart < -same_start_tolerance || (apart <= same_start_tolerance && conflict.contender.epoch < owner.epoch));
    return first ? action::contender_first : action::owner_stays;
}

} // namespace cles::core
