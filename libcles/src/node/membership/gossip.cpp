// SPDX-License-Identifier: BSL-1.0
#include "node/membership/gossip.hpp"

#include "port/node_security.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t max_bootstraps = 4;

} // namespace

gossip::gossip(self who, client& out, membership& others, counters& counts, deadline_queue& deadlines, std::size_t most,
               std::uint32_t seed, const node_security* security)
    : self_(std::move(who)), out_(out), others_(others), counts_(counts), deadlines_(deadlines), security_(security),
      jitter_(seed), seeds_(seed * 3 + 1), lost_(most, seed * 5 + 2), reach_(self_.name, out, others, most) {}

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
        send_own_entry(c, now);
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
    if (seeds_.all_heard()) { // those that were silent are gone
        out_.on_seeds_heard();
    }
    if (started_) {
        deadlines_.arm(*this, now);
    }
}

std::vector<std::string> gossip::asked() const {
    std::vector<std::string> names;
    for (const auto& c : contacts_) {
        if (c.as != part::bootstrap) {
            names.push_back(c.node);
        }
    }
    return names;
}

// -- replies -------------------------------------------------------------------------------------------------------

void gossip::on_answer(std::uint64_t ticket, std::string_view json, time_point now) {
    auto* c = contacts_.find_ticket(ticket);
    if (c == nullptr) {
        return;
    }
    if (now - c->sent > limit) { // suspended meanwhile: its ages are unreliable
        on_failure(ticket, now);
        return;
    }
    peer_table table;
    const bool good = read(json, others_.max_peers() * 2 + 2, table);
    const bool allowed = table.node.empty() || reach_.allows(table.node);
    c->reply_time = now - c->sent;
    auto found = allowed ? apply(table, observed_source::at(c->url), c->sent, now) : learned{};
    if (!good) {
        on_failure(ticket, now);
        return;
    }
    c->failures = 0;
    c->ticket = 0;
    if (table.node.empty()) {
        reach_.on_reached(c->node);
    } else if (allowed && is_of_owner(table) && (c->node.empty() || c->node == table.node)) {
        // With security, its announcement states its addresses, of which this one works.
        others_.prefer_address(table.node, table.epoch, c->url, security_ != nullptr);
        if (security_ == nullptr || !c->node.empty()) { // otherwise anybody may have sent it
            reach_.on_reply(table);
            push_routes(now);
        }
    }
    if (table.node == self_.name && table.epoch == self_.epoch) {
        seeds_.on_self(c->url);
        end(*c, true, now);
    } else if (!allowed || (table.pool != others_.pool() && !table.node.empty())) {
        end(*c, true, now);
    } else if (table.next.empty()) {
        c->since = "0";
        c->table_bytes = json.size();
        c->sent = now;
        c->ticket = ++last_ticket_;
        out_.ask_description(c->ticket, destination_of(*c));
    } else {
        c->since = table.next;
        seeds_.on_answer(c->url, table.node);
        const bool another = !c->node.empty() && c->node != table.node;
        c->describe = std::move(found.missing);
        if (another || (c->as == part::bootstrap && !table.more)) {
            // One that has just started may not have announced itself: then it is asked again.
            end(*c, another, now, another || others_.find_member(table.node).has_value());
        } else if (table.more) {
            c->next = now;
        } else {
            postpone(*c, now);
        }
    }
    review(now); // before the link of a bootstrap is released: it may be asked again over it
    follow(now);
}

void gossip::on_description(std::uint64_t ticket, std::string_view json, time_point now) {
    auto* c = contacts_.find_ticket(ticket);
    if (c == nullptr) {
        return;
    }
    peer_report report;
    if (now - c->sent > limit || !read_description(json, interval(), report)) {
        on_failure(ticket, now);
        return;
    }
    c->ticket = 0;
    if (report.announced.node == self_.name && protocol::epoch_text(report.epoch) == self_.epoch) {
        seeds_.on_self(c->url);
        end(*c, true, now);
    } else {
        apply(report, observed_source::at(c->url), c->sent, now);
        seeds_.on_answer(c->url, report.announced.node);
        if (c->as == part::bootstrap || (!c->node.empty() && c->node != report.announced.node)) {
            end(*c, c->as != part::bootstrap, now);
        } else if (announce_only_.add(others_, c->node, now + interval() * announce_only_nodes::recheck_intervals,
                                      now)) {
            end(*c, false, now);
        } else {
            const auto pause = milliseconds{c->table_bytes * 1000 / bytes_a_second};
            c->next = now + std::max(interval() / 2, pause);
        }
    }
    review(now);
    follow(now);
}

void gossip::on_failure(std::uint64_t ticket, time_point now, bool silent) {
    auto* c = contacts_.find_ticket(ticket);
    if (c == nullptr) {
        return;
    }
    ++counts_.tables_failed;
    c->ticket = 0;
    if (!c->node.empty() && silent) {
        reach_.lose(std::string{c->node}, now);
        push_routes(now);
    }
    if (++c->failures >= max_failures || c->as == part::bootstrap) {
        end(*c, true, now, now - c->sent < limit); // one that is silent may only be slow
    } else {
        postpone(*c, now);
    }
    sweep();
    follow(now);
}

void gossip::write_delta(json_writer& w, const table_question& asked, std::size_t longest, time_point now) {
    last_asked_ = now;
    ++counts_.tables_told;
    if (asked.routes.distance == 0) {
        core::write_delta(w, {self_.name, self_.epoch}, others_, asked, longest, now);
        return;
    }
    reach_.on_question(asked.routes, now);
    core::write_delta(w, {self_.name, self_.epoch}, others_, asked, longest, now, reach_.adverts_to(asked.routes.by));
}

bool gossip::on_pushed_table(std::string_view json, const observed_source& by, time_point now) {
    peer_table table;
    const bool good = read(json, max_pushed_entries, table);
    auto found = apply(table, by, now, now);
    const bool is_from_node = security_ == nullptr || by.name == table.node;
    if (is_from_node && contacts_.find_node(table.node) != nullptr && is_of_owner(table)) {
        reach_.on_pushed(table);
        push_routes(now);
    }
    if (started_ && !found.newcomer.empty() && !unknown_peer_) {
        unknown_peer_ = std::move(found.newcomer);
        deadlines_.arm(*this, now);
    }
    return good;
}

gossip::learned gossip::apply(const peer_table& table, const observed_source& by, time_point asked, time_point now) {
    learned found;
    counts_.entries_dropped += table.bad_entries;
    for (const auto& report : table.reports) {
        const bool was_known = others_.find_member(report.announced.node).has_value();
        const auto verdict = apply(report, by, asked, now);
        if (verdict == membership::verdict::taken && !was_known && !report.announced.leaving) {
            found.newcomer = report.announced.node;
        }
    }
    std::size_t missing = 0;
    for (const auto& beat : table.beats) {
        if (others_.apply_gossip(beat, asked, now) == membership::verdict::unknown &&
            missing++ < protocol::max_described) {
            found.missing.append(found.missing.empty() ? "" : ",").append(protocol::epoch_text(beat.epoch));
        }
    }
    return found;
}

// Whether it is from the node that has the name here, and of this pool.
bool gossip::is_of_owner(const peer_table& table) const {
    const auto known = others_.find_member(table.node);
    return known && protocol::epoch_text(known->epoch) == table.epoch && table.pool == others_.pool();
}

gossip::client::destination gossip::destination_of(const contact& c) const noexcept {
    return {c.url, security_ != nullptr ? std::string_view{c.node} : std::string_view{}};
}

bool gossip::read(std::string_view json, std::size_t max_entries, peer_table& table) const {
    const auto form = security_ != nullptr ? entry_form::signed_by_node : entry_form::plain;
    return read_table(json, max_entries, interval(), table, form);
}

membership::verdict gossip::apply(const peer_report& report, const observed_source& by, time_point asked,
                                  time_point now) {
    if (security_ != nullptr) {
        return apply_signed(report, by, asked, now);
    }
    const auto verdict = others_.apply_gossip(report, by, asked, now);
    counts_.peers_refused += verdict == membership::verdict::refused ? 1 : 0;
    return verdict;
}

// The path that the entry took says nothing about the node's address; only that a loopback address may be of this host.
membership::verdict gossip::apply_signed(const peer_report& report, const observed_source& by, time_point asked,
                                         time_point now) {
    const auto& said = report.announced;
    if (!said.original || (!others_.holds(report) &&
                           !security_->is_signed(said.node, "cles", report.seq, protocol::epoch_text(report.epoch),
                                                 said.original->body, said.original->sig))) {
        ++counts_.entries_dropped;
        return membership::verdict::old;
    }
    const auto verdict = others_.apply_gossip(report, {.host = {}, .local = by.local}, asked, now);
    counts_.peers_refused += verdict == membership::verdict::refused ? 1 : 0;
    if (verdict == membership::verdict::taken && said.roster != 0) {
        out_.on_stated_roster(said.node, said.roster);
    }
    return verdict;
}

void gossip::on_gone(std::string_view node, std::string_view where, time_point now) { lost_.add(node, where, now); }

// -- routes --------------------------------------------------------------------------------------------------------

// At once, so that a lost link is known as soon as the messages arrive, instead of after a turn for each node on the
// way.
void gossip::push_routes(time_point now) {
    const auto news = reach_.take_unsent(now);
    if (news.empty() || reach_.need(now) == 0) {
        return;
    }
    for (auto& c : contacts_) {
        const auto advert_of = reach_.adverts_to(c.node);
        for (auto next = news.begin(); !c.node.empty() && reach_.is_usable(c.node) && next != news.end();) {
            std::vector<peer_table::route> routes;
            std::vector<peer_table::route> wanted;
            for (; next != news.end() && std::max(routes.size(), wanted.size()) < max_pushed_routes; ++next) {
                const auto item = others_.entry_of(next->first);
                if (const auto advert = item ? advert_of(*item) : std::nullopt) {
                    routes.push_back({item->epoch, *advert});
                }
                if (item && next->second) {
                    wanted.push_back({item->epoch, *next->second});
                }
            }
            std::string table;
            json_writer w{table};
            write_routes(w, {self_.name, self_.epoch}, others_.pool(), routes, wanted);
            out_.push(destination_of(c), table);
        }
    }
}

// A neighbour that does not reply for that long is not used until it does: another may have a route.
void gossip::notice_silence(time_point now) {
    if (reach_.need(now) == 0) {
        return;
    }
    for (const auto& c : contacts_) {
        if (c.ticket != 0 && !c.node.empty() && now - c.sent >= silence_of(c)) {
            reach_.lose(std::string{c.node}, now);
        }
    }
}

// Longer than it usually takes: until it has replied once, a link may have to be opened. By datagrams, the request may
// have to be repeated.
std::chrono::nanoseconds gossip::silence_of(const contact& c) const {
    if (!c.reply_time) {
        return limit;
    }
    const auto usual = c.url.starts_with("udp:") ? 2 * reach_.silence() : reach_.silence();
    return std::max<std::chrono::nanoseconds>(usual, 3 * *c.reply_time);
}

bool gossip::can_be_asked(const membership::member& k, time_point now) const {
    return !k.suspect && reach_.may_ask(k.node, now);
}

// -- selection -----------------------------------------------------------------------------------------------------

void gossip::on_deadline(time_point now) {
    reach_.review(now);
    notice_silence(now);
    review(now);
    for (auto& c : contacts_) {
        if (c.ticket == 0 && c.next <= now) {
            call(c, now);
        }
    }
    send_own_entry_if_not_asked(now);
    push_routes(now);
    follow(now);
}

void gossip::review(time_point now) {
    if (security_ != nullptr) { // otherwise a reply itself tells the address, see `on_answer`
        seeds_.prefer_in(others_);
    }
    contacts_.expire_resting(now);
    drop_unresponsive(now);
    choose_successor(now);
    choose_at_random(now);
    contact_bootstraps(now);
    sweep();
}

void gossip::drop_unresponsive(time_point now) {
    const bool takes_turns = reach_.need(now) <= 1 || contacts_.count(part::chosen) >= max_neighbours;
    for (auto& c : contacts_) {
        if (c.ticket != 0 && now - c.sent > limit * 2) { // no outcome was reported
            c.ticket = 0;
            ++c.failures;
        }
        if (c.as == part::bootstrap) {
            continue;
        }
        const auto known = others_.find_member(c.node);
        // Nodes chosen while few were known would be the same for all, and changes would come only from them.
        const bool had_its_time =
            takes_turns && (c.until <= now || (c.as == part::chosen && others_.size() >= 2 * c.among));
        if (!known || (!can_be_asked(*known, now) && c.ticket == 0) || c.failures >= max_failures ||
            (had_its_time && c.ticket == 0)) {
            end(c, c.failures != 0, now);
        } else {
            c.url = known->where;
        }
    }
}

void gossip::choose_successor(time_point now) {
    std::optional<membership::member> next;
    auto name = self_.name;
    for (std::size_t i = 0; i < others_.size() && reach_.allowed().empty(); ++i) { // otherwise all are asked
        const auto k = others_.next_member(name);
        if (can_be_asked(*k, now) && !contacts_.rests(k->node, now) && !announce_only_.contain(*k, now)) {
            next = k;
            break;
        }
        name = k->node;
    }
    const auto* current = contacts_.find(part::successor);
    if (!next || (current != nullptr && current->node == next->node)) {
        return;
    }
    // While the table grows, there is often a closer successor, and each change costs a whole table.
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

void gossip::choose(const membership::member& k, time_point now) {
    const auto stay = interval() * intervals_of_stay;
    auto& c = contacts_.add(part::chosen, k.node, k.where, now);
    c.until = now + stay - jitter_.quarter_of(stay);
    c.among = others_.size();
}

void gossip::choose_at_random(time_point now) {
    constexpr int tries = 8; // the next turn comes soon
    const auto size = others_.size();
    if (reach_.need(now) > 1) {
        choose_neighbours(now);
    }
    for (int i = 0;
         i < tries && size != 0 && reach_.allowed().empty() && contacts_.count(part::chosen) < random_contacts; ++i) {
        const auto k = others_.at(jitter_.below(size));
        if (can_be_asked(k, now) && contacts_.find_node(k.node) == nullptr && !announce_only_.contain(k, now) &&
            (size <= random_contacts + 1 || !contacts_.rests(k.node, now))) {
            choose(k, now);
        }
    }
}

// All that can be asked, because the shortest route may lead through any of them.
void gossip::choose_neighbours(time_point now) {
    const auto add = [&](const membership::member& k) {
        if (can_be_asked(k, now) && contacts_.find_node(k.node) == nullptr && !contacts_.rests(k.node, now) &&
            !announce_only_.contain(k, now)) {
            choose(k, now);
        }
    };
    if (!reach_.allowed().empty()) {
        for (const auto& name : reach_.allowed()) {
            if (const auto known = others_.find_member(name)) {
                add(*known);
            }
        }
    } else if (others_.size() != 0) {
        auto next = others_.at(jitter_.below(others_.size())); // others in turn, where there are more
        for (std::size_t i = 0; i < others_.size() && contacts_.count(part::chosen) < max_neighbours; ++i) {
            add(next);
            next = *others_.next_member(next.node);
        }
    }
}

void gossip::contact_bootstraps(time_point now) {
    while (contacts_.count(part::bootstrap) < max_bootstraps) {
        const auto url = seeds_.due(others_, now, search_pause());
        if (!url) {
            break;
        }
        contacts_.add(part::bootstrap, {}, *url, now);
    }
    if (unknown_peer_) {
        const auto known = others_.find_member(*unknown_peer_);
        unknown_peer_.reset();
        if (known && can_be_asked(*known, now) && contacts_.find_node(known->node) == nullptr) {
            contacts_.add(part::bootstrap, known->node, known->where, now);
        }
    }
    if (now >= next_search_) {
        next_search_ = now + until_next_search();
        if (const auto lost = lost_.any(others_, now);
            lost && contacts_.find_node(lost->name) == nullptr && reach_.allows(lost->name)) {
            contacts_.add(part::bootstrap, lost->name, lost->url, now);
        }
    }
}

// -- requests ------------------------------------------------------------------------------------------------------

void gossip::call(contact& c, time_point now) {
    if (!c.own_entry_sent) {
        send_own_entry(c, now);
    }
    ++counts_.tables_asked;
    c.sent = now;
    c.ticket = ++last_ticket_;
    out_.ask(c.ticket, destination_of(c),
             {.since = c.since, .describe = c.describe, .routes = {.distance = reach_.need(now), .by = self_.name}});
}

void gossip::send_own_entry(contact& c, time_point now) {
    const auto* own = others_.own();
    if (own == nullptr) {
        return;
    }
    c.own_entry_sent = true;
    std::string table;
    json_writer w{table};
    write_own_entry(w, *own, now);
    out_.push(destination_of(c), table);
}

// A node that is no other node's successor would otherwise remain unknown.
void gossip::send_own_entry_if_not_asked(time_point now) {
    if (now - last_asked_ < interval()) {
        return;
    }
    last_asked_ = now;
    const auto who =
        std::find_if(contacts_.begin(), contacts_.end(), [](const contact& c) { return c.as != part::bootstrap; });
    if (who != contacts_.end()) {
        send_own_entry(*who, now);
    }
}

void gossip::postpone(contact& c, time_point now) {
    const bool few = others_.size() <= random_contacts + 1 && reach_.need(now) == 0;
    const auto pause = interval() / (few ? turns_among_few : turns_per_interval);
    c.next = now + pause - jitter_.quarter_of(pause);
}

void gossip::end(contact& c, bool rests, time_point now, bool heard) {
    c.ended = true;
    if (heard && c.as == part::bootstrap && seeds_.on_heard(c.url)) {
        out_.on_seeds_heard();
    }
    if (rests && !c.node.empty()) {
        contacts_.rest(c.node, now + interval() * intervals_of_rest);
    }
}

void gossip::sweep() {
    for (const auto& c : contacts_.take_ended(security_ != nullptr)) {
        out_.release(destination_of(c));
    }
}

void gossip::follow(time_point now) {
    if (!started_) {
        return;
    }
    auto due = std::min(next_search_, last_asked_ + interval());
    if (const auto seed = seeds_.next(); seed && contacts_.count(part::bootstrap) < max_bootstraps) {
        due = std::min(due, *seed);
    }
    for (const auto& c : contacts_) {
        due = std::min(due, due_of(c, now));
    }
    const bool wanting = contacts_.count(part::chosen) + contacts_.count(part::successor) <
                         std::min<std::size_t>(random_contacts + 1, announce_only_.count_gossiping(others_, now));
    if (reach_.has_unsent()) {
        due = std::min(due, reach_.next_push());
    }
    if (wanting) {
        due = std::min(due, now + interval() / turns_per_interval);
    }
    deadlines_.arm(*this, std::max(due, now + milliseconds{1}));
}

time_point gossip::due_of(const contact& c, time_point now) const {
    if (c.ticket == 0) {
        return c.next;
    }
    if (reach_.need(now) != 0 && reach_.is_usable(c.node)) {
        return c.sent + std::chrono::ceil<milliseconds>(silence_of(c));
    }
    return c.sent + limit * 2;
}

milliseconds gossip::interval() const noexcept { return interval_among(others_.size()); }

// All nodes together try at most four times a second, however many they are, so as not to flood a node that is down.
milliseconds gossip::search_pause() const noexcept {
    return std::max(seeds::min_rest, milliseconds{250} * static_cast<int>(others_.size() + 1));
}

// At random within twice that pause: nodes that started together would otherwise all try at once.
milliseconds gossip::until_next_search() noexcept {
    return milliseconds{jitter_.below(static_cast<std::size_t>(search_pause().count()) * 2)};
}

} // namespace cles::core
