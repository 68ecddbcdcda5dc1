// SPDX-License-Identifier: BSL-1.0
#include "core/gossip.hpp"

#include "core/announcer.hpp"
#include "core/gossip_intake.hpp"
#include "protocol/message.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t most_guests = 4;

std::string list_of(const std::vector<std::uint32_t>& epochs) {
    std::string text;
    for (const auto epoch : epochs) {
        text.append(text.empty() ? "" : ",").append(protocol::epoch_text(epoch));
    }
    return text;
}

bool can_be_asked(const presence::known& k) noexcept { return !k.suspect && !k.where.empty(); }

} // namespace

gossip::gossip(self who, caller& out, presence& others, counters& counts, deadline_queue& deadlines, std::size_t most,
               std::uint32_t seed)
    : self_(std::move(who)), out_(out), others_(others), counts_(counts), deadlines_(deadlines), jitter_(seed),
      seeds_(seed * 3 + 1), lost_(most, seed * 5 + 2) {}

void gossip::start(time_point now) {
    started_ = true;
    last_asked_ = now;
    next_search_ = now + until_next_search();
    deadlines_.arm(*this, now);
}

void gossip::leave(time_point now) {
    if (!started_ || left_) {
        return;
    }
    left_ = true;
    others_.leave(now);
    for (auto& c : contacts_) {
        tell_own(c, now);
    }
}

void gossip::stop(time_point now) {
    if (!started_) {
        return;
    }
    leave(now);
    started_ = false;
    deadlines_.disarm(*this);
    contacts_.clear();
}

void gossip::set_seeds(const std::vector<std::string>& urls, time_point now) {
    seeds_.set(urls);
    if (started_) {
        deadlines_.arm(*this, now);
    }
}

std::vector<std::string> gossip::asked() const {
    std::vector<std::string> names;
    for (const auto& c : contacts_) {
        if (c.as != part::guest) {
            names.push_back(c.node);
        }
    }
    return names;
}

// -- what comes ----------------------------------------------------------------------------------------------------

void gossip::on_answer(std::uint64_t ticket, std::string_view json, time_point now) {
    auto* c = contacts_.find_ticket(ticket);
    if (c == nullptr) {
        return;
    }
    if (now - c->sent > limit) { // this node was stopped meanwhile: the ages in it say little
        on_failure(ticket, now);
        return;
    }
    gossip_intake in{others_, counts_, interval(), teller::at(c->url), c->sent, now};
    table_head head;
    if (!read_table(json, others_.most() * 2 + 2, in, head)) {
        on_failure(ticket, now);
        return;
    }
    c->failures = 0;
    c->ticket = 0;
    if (head.node == self_.name && head.epoch == self_.epoch) {
        seeds_.on_self(c->url);
        end(*c, true, now);
    } else if (head.pool != others_.pool() && !head.node.empty()) {
        end(*c, true, now);
    } else if (head.next.empty()) {
        c->since = "0";
        c->table_bytes = json.size();
        c->sent = now;
        c->ticket = ++last_ticket_;
        out_.ask_who(c->ticket, c->url);
    } else {
        c->since = head.next;
        seeds_.on_answer(c->url, head.node);
        const bool another = !c->node.empty() && c->node != head.node;
        c->describe = list_of(in.missing());
        if (another || (c->as == part::guest && !head.more)) {
            end(*c, another, now);
        } else if (head.more) {
            c->next = now;
        } else {
            put_off(*c, now);
        }
    }
    review(now); // before a guest's link is let go of: he may be asked on by it
    follow(now);
}

void gossip::on_description(std::uint64_t ticket, std::string_view json, time_point now) {
    auto* c = contacts_.find_ticket(ticket);
    if (c == nullptr) {
        return;
    }
    peer_report report;
    if (now - c->sent > limit || !read_description(json, report)) {
        on_failure(ticket, now);
        return;
    }
    c->ticket = 0;
    if (report.said.node == self_.name && protocol::epoch_text(report.epoch) == self_.epoch) {
        seeds_.on_self(c->url);
        end(*c, true, now);
    } else {
        gossip_intake in{others_, counts_, interval(), teller::at(c->url), c->sent, now};
        in.on_report(report);
        seeds_.on_answer(c->url, report.said.node);
        if (c->as == part::guest || (!c->node.empty() && c->node != report.said.node)) {
            end(*c, c->as != part::guest, now);
        } else if (plain_.add(others_, c->node, now + interval() * plain_nodes::intervals_apart, now)) {
            end(*c, false, now);
        } else {
            const auto pause = milliseconds{c->table_bytes * 1000 / bytes_a_second};
            c->next = now + std::max(interval() / 2, pause);
        }
    }
    review(now);
    follow(now);
}

void gossip::on_failure(std::uint64_t ticket, time_point now) {
    auto* c = contacts_.find_ticket(ticket);
    if (c == nullptr) {
        return;
    }
    ++counts_.tables_failed;
    c->ticket = 0;
    if (++c->failures >= most_failures || c->as == part::guest) {
        end(*c, true, now);
    } else {
        put_off(*c, now);
    }
    sweep();
    follow(now);
}

void gossip::write_news(json_writer& w, const table_question& asked, std::size_t longest, time_point now) {
    last_asked_ = now;
    ++counts_.tables_told;
    core::write_news(w, {self_.name, self_.epoch}, others_, asked, longest, now);
}

bool gossip::on_told(std::string_view json, const teller& by, time_point now) {
    gossip_intake in{others_, counts_, interval(), by, now, now};
    table_head head;
    const bool good = read_table(json, most_told, in, head);
    if (started_ && !in.newcomer().empty() && !stranger_) {
        stranger_ = in.newcomer();
        deadlines_.arm(*this, now);
    }
    return good;
}

void gossip::on_gone(std::string_view node, std::string_view where, time_point now) { lost_.add(node, where, now); }

// -- whom to ask ---------------------------------------------------------------------------------------------------

void gossip::on_deadline(time_point now) {
    review(now);
    for (auto& c : contacts_) {
        if (c.ticket == 0 && c.next <= now) {
            call(c, now);
        }
    }
    tell_if_nobody_asks(now);
    follow(now);
}

void gossip::review(time_point now) {
    contacts_.wake(now);
    drop_lost_causes(now);
    choose_successor(now);
    choose_at_random(now);
    invite_guests(now);
    sweep();
}

void gossip::drop_lost_causes(time_point now) {
    for (auto& c : contacts_) {
        if (c.ticket != 0 && now - c.sent > limit * 2) { // nobody has said what came of it
            c.ticket = 0;
            ++c.failures;
        }
        if (c.as == part::guest) {
            continue;
        }
        const auto known = others_.look(c.node);
        // Chosen among the few who were there first, they would be the same for all, and news would go from them only.
        const bool had_its_time = c.until <= now || (c.as == part::chosen && others_.size() >= 2 * c.among);
        if (!known || !can_be_asked(*known) || c.failures >= most_failures || (had_its_time && c.ticket == 0)) {
            end(c, c.failures != 0, now);
        } else {
            c.url = known->where;
        }
    }
}

void gossip::choose_successor(time_point now) {
    std::optional<presence::known> next;
    auto name = self_.name;
    for (std::size_t i = 0; i < others_.size(); ++i) {
        const auto k = others_.after(name);
        if (can_be_asked(*k) && !contacts_.rests(k->node, now) && !plain_.contain(*k, now)) {
            next = k;
            break;
        }
        name = k->node;
    }
    const auto* current = contacts_.find(part::successor);
    if (!next || (current != nullptr && current->node == next->node)) {
        return;
    }
    // While a table grows there is often a nearer one; each change costs that one's table.
    if (current != nullptr && now < next_successor_) {
        return;
    }
    next_successor_ = now + interval();
    for (auto& c : contacts_) {
        if (c.as == part::successor) {
            c.as = part::chosen;
            c.until = now + interval();
            c.among = others_.size();
        }
    }
    if (auto* already = contacts_.find_node(next->node); already != nullptr) {
        already->as = part::successor;
        already->until = time_point::max();
    } else {
        contacts_.add(part::successor, next->node, next->where, now);
    }
}

void gossip::choose_at_random(time_point now) {
    constexpr int tries = 8; // the next turn comes soon
    const auto size = others_.size();
    for (int i = 0; i < tries && size != 0 && contacts_.count(part::chosen) < at_random; ++i) {
        const auto k = others_.at(jitter_.below(size));
        if (can_be_asked(k) && contacts_.find_node(k.node) == nullptr && !plain_.contain(k, now) &&
            (size <= at_random + 1 || !contacts_.rests(k.node, now))) {
            const auto stay = interval() * intervals_of_stay;
            auto& c = contacts_.add(part::chosen, k.node, k.where, now);
            c.until = now + stay - jitter_.quarter_of(stay);
            c.among = size;
        }
    }
}

void gossip::invite_guests(time_point now) {
    while (contacts_.count(part::guest) < most_guests) {
        const auto url = seeds_.due(others_, now, search_pause());
        if (!url) {
            break;
        }
        contacts_.add(part::guest, {}, *url, now);
    }
    if (stranger_) {
        const auto known = others_.look(*stranger_);
        stranger_.reset();
        if (known && can_be_asked(*known) && contacts_.find_node(known->node) == nullptr) {
            contacts_.add(part::guest, known->node, known->where, now);
        }
    }
    if (now >= next_search_) {
        next_search_ = now + until_next_search();
        if (const auto lost = lost_.any(others_, now); lost && contacts_.find_node(lost->name) == nullptr) {
            contacts_.add(part::guest, lost->name, lost->url, now);
        }
    }
}

// -- asking --------------------------------------------------------------------------------------------------------

void gossip::call(contact& c, time_point now) {
    if (!c.told) {
        tell_own(c, now);
    }
    ++counts_.tables_asked;
    c.sent = now;
    c.ticket = ++last_ticket_;
    out_.ask(c.ticket, c.url, c.since, c.describe);
}

void gossip::tell_own(contact& c, time_point now) {
    const auto* own = others_.own();
    if (own == nullptr) {
        return;
    }
    c.told = true;
    std::string table;
    json_writer w{table};
    write_own_entry(w, own->said, self_.epoch, own->seq, std::chrono::ceil<milliseconds>(now - own->heard));
    out_.tell(c.url, table);
}

// In whose tables it is nobody's successor, nobody may hear of it.
void gossip::tell_if_nobody_asks(time_point now) {
    if (now - last_asked_ < interval()) {
        return;
    }
    last_asked_ = now;
    const auto who =
        std::find_if(contacts_.begin(), contacts_.end(), [](const contact& c) { return c.as != part::guest; });
    if (who != contacts_.end()) {
        tell_own(*who, now);
    }
}

void gossip::put_off(contact& c, time_point now) {
    const bool few = others_.size() <= at_random + 1;
    const auto pause = interval() / (few ? turns_among_few : turns_per_interval);
    c.next = now + pause - jitter_.quarter_of(pause);
}

void gossip::end(contact& c, bool rests, time_point now) {
    c.ended = true;
    if (rests && !c.node.empty()) {
        contacts_.rest(c.node, now + interval() * intervals_of_rest);
    }
}

void gossip::sweep() {
    for (const auto& url : contacts_.take_ended()) {
        out_.release(url);
    }
}

void gossip::follow(time_point now) {
    if (!started_) {
        return;
    }
    auto due = std::min(next_search_, last_asked_ + interval());
    if (const auto seed = seeds_.next(); seed && contacts_.count(part::guest) < most_guests) {
        due = std::min(due, *seed);
    }
    for (const auto& c : contacts_) {
        due = std::min(due, c.ticket == 0 ? c.next : c.sent + limit * 2);
    }
    const bool wanting = contacts_.count(part::chosen) + contacts_.count(part::successor) <
                         std::min<std::size_t>(at_random + 1, plain_.worth_asking(others_, now));
    if (wanting) {
        due = std::min(due, now + interval() / turns_per_interval);
    }
    deadlines_.arm(*this, std::max(due, now + milliseconds{1}));
}

milliseconds gossip::interval() const noexcept { return announcer::interval_among(others_.size()); }

// All nodes together try four times a second, however many they are: a dead one is not to be run down.
milliseconds gossip::search_pause() const noexcept {
    return std::max(seeds::shortest_rest, milliseconds{250} * static_cast<int>(others_.size() + 1));
}

// Anywhere in twice that time, or nodes that have started together would all try at once.
milliseconds gossip::until_next_search() noexcept {
    return milliseconds{jitter_.below(static_cast<std::size_t>(search_pause().count()) * 2)};
}

} // namespace cles::core
