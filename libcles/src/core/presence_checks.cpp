// SPDX-License-Identifier: BSL-1.0
// Which of two runs of one name is still there.
#include "core/presence.hpp"

#include <algorithm>
#include <string>
#include <utility>

namespace cles::core {
namespace {

using outcome = probe_outcome::kind;

// Any host that may send to the group can have nodes asked: no more often than this.
constexpr std::size_t most_probes = 64;

} // namespace

bool presence::may_probe(time_point now) noexcept {
    if (prober_ == nullptr || probes_.size() >= most_probes || probe_debt_ > now + probe_burst) {
        return false;
    }
    probe_debt_ = std::max(probe_debt_, now) + per_probe;
    return true;
}

void presence::probe(name_check& check, name_check::stage of, std::string name, std::string_view where,
                     time_point now) {
    check.at = of;
    check.asked = now;
    check.ticket = ++last_probe_;
    probes_.emplace(check.ticket, std::move(name));
    const std::string url{where};
    prober_->probe(check.ticket, url);
}

// Another run has been heard of under a name that is live.
void presence::check_owner(const std::string& name, time_point now) {
    auto& e = peers_.find(name)->second;
    if (e.second && e.second->check.at == name_check::stage::none && !e.owner.endpoints.empty() && may_probe(now)) {
        probe(e.second->check, name_check::stage::owner, name, e.owner.where(), now);
    }
}

void presence::check_namesake(time_point now) {
    if (namesake_ && namesake_->check.at == name_check::stage::none && !namesake_->of.endpoints.empty() &&
        may_probe(now)) {
        probe(namesake_->check, name_check::stage::rival, own_name_, namesake_->of.where(), now);
    }
}

void presence::on_probed(std::uint64_t ticket, const probe_outcome& found, time_point now) {
    const auto asked = probes_.extract(ticket);
    if (!asked) {
        return;
    }
    const auto& name = asked.mapped();
    if (name == own_name_) {
        if (namesake_ && namesake_->check.ticket == ticket) {
            on_namesake_probed(found, now);
        }
        return;
    }
    const auto at = peers_.find(name);
    if (at == peers_.end() || !at->second.second || at->second.second->check.ticket != ticket) {
        return;
    }
    auto& check = at->second.second->check;
    if (found.what == outcome::absent && excused_ > check.asked) { // this node was stopped, and may have missed it
        check.at = name_check::stage::none;                        // the other's next word has it asked again
    } else if (check.at == name_check::stage::owner) {
        on_owner_probed(at, found, now);
    } else if (check.at == name_check::stage::rival) {
        on_rival_probed(at, found, now);
    }
}

void presence::on_owner_probed(entries::iterator at, const probe_outcome& found, time_point now) {
    auto& e = at->second;
    auto& second = *e.second;
    second.check.at = name_check::stage::over;
    const bool another = found.what == outcome::answered && (found.node != at->first || found.epoch != e.owner.epoch);
    if (found.what == outcome::absent || another) {
        if (silent_at(second.of) > now) {
            end(at, change::gone, now);
        }
        return;
    }
    if (found.what == outcome::answered && !second.of.endpoints.empty() && may_probe(now)) {
        second.check.owner_began = now - found.uptime;
        probe(second.check, name_check::stage::rival, at->first, second.of.where(), now);
    }
}

// The owner has answered. The other one too?
void presence::on_rival_probed(entries::iterator at, const probe_outcome& found, time_point now) {
    auto& e = at->second;
    auto& second = *e.second;
    second.check.at = name_check::stage::over;
    if (found.what != outcome::answered || found.node != at->first || found.epoch != second.of.epoch) {
        return;
    }
    // Who has heard the one before the other began knows. All others judge by when they began.
    const auto began = now - found.uptime;
    const auto apart = began - second.check.owner_began;
    const bool first =
        began <= e.since && (apart < -together || (apart <= together && second.of.epoch < e.owner.epoch));
    if (first) {
        std::swap(e.owner, second.of);
        e.since = second.first;
        e.owner.described = e.owner.news = ++news_;
        freshen(*at);
        const auto name = at->first;
        follow(silent_at(e.owner));
        tell(name, change::moved, e.owner.where());
        const auto still = peers_.find(name);
        if (still == peers_.end() || !still->second.second) {
            return;
        }
        confirm_clash(*still->second.second);
        return;
    }
    confirm_clash(second);
}

void presence::on_namesake_probed(const probe_outcome& found, time_point now) {
    auto& second = *namesake_;
    second.check.at = name_check::stage::over;
    if (found.what != outcome::answered || found.node != own_name_ || found.epoch != second.of.epoch) {
        return;
    }
    const auto later = begun_ - (now - found.uptime); // this one
    const bool gives_way = later > together || (later >= -together && second.of.epoch < own_epoch_);
    const std::string where{second.of.where()};
    confirm_clash(second);
    if (gives_way) {
        tell(own_name_, change::taken, where);
    }
}

void presence::confirm_clash(rival& second) {
    second.check.confirmed = true;
    if (!std::exchange(second.clashes, true)) {
        const auto& r = second.of;
        const auto name = r.said.node;
        tell(name, change::clash, r.from == group_source{} ? std::string{r.where()} : host_text(r.from));
    }
}

std::optional<std::string_view> presence::second_of(std::string_view node) const noexcept {
    const auto found = peers_.find(node);
    if (found == peers_.end() || !found->second.second || !found->second.second->check.confirmed) {
        return {};
    }
    return found->second.second->of.where();
}

} // namespace cles::core
