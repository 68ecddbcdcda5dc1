// SPDX-License-Identifier: BSL-1.0
#include "node/routing/service_registry.hpp"

#include "json/json_members.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {
namespace {

bool read_entry(json_reader& r, task_list& out) {
    task_list::entry found;
    std::string name;
    const bool good = read_members(r, [&](std::string_view key) {
        return key == "verb"         ? r.read(name)
               : key == "task"       ? r.read(found.task)
               : key == "idempotent" ? r.read(found.idempotent)
               : key == "local"      ? r.read(found.local)
               : key == "signed"     ? r.read(found.must_be_signed)
                                     : r.skip();
    });
    if (!good) {
        return false;
    }
    const auto verb = verb_from(name);
    if (verb && protocol::is_name(found.task) && out.entries.size() < max_tasks_of_a_node) {
        found.verb = *verb;
        out.entries.push_back(std::move(found));
    }
    return true;
}

bool read_entries(json_reader& r, task_list& out) {
    if (!r.begin_array()) {
        return false;
    }
    while (r.next_element()) {
        if (!read_entry(r, out)) {
            return false;
        }
    }
    return r.ok();
}

} // namespace

std::optional<task_list> read_task_list(std::string_view description, std::string_view node) {
    json_reader r{description};
    task_list list;
    std::string name;
    const bool good = read_members(r, [&](std::string_view key) {
        return key == "node" ? r.read(name) : key == "tasks" ? read_entries(r, list) : r.skip();
    });
    if (!good || !r.at_end() || name != node) {
        return std::nullopt;
    }
    return list;
}

service_registry::service_registry(node_state& host, next_hop& out, std::function<void()> on_offers)
    : node_(host), out_(out), on_offers_(std::move(on_offers)),
      queries_([this](query_target& n) { on_postponed(static_cast<known_node&>(n)); }),
      alive_(std::make_shared<service_registry*>(this)) {
    node_.peers.observe([this](std::string_view name) { on_member_seen(name); });
}

service_registry::~service_registry() { stop(); }

void service_registry::stop() noexcept {
    if (std::exchange(alive_, nullptr)) {
        node_.peers.observe(nullptr);
        node_.deadlines.disarm(*this);
    }
}

// -- known nodes ---------------------------------------------------------------------------------------------------

void service_registry::on_member_seen(std::string_view name) {
    const auto now = node_.time.now();
    const auto heard = node_.peers.find_member(name);
    auto at = nodes_.find(name);
    if (!heard) {
        if (at != nodes_.end()) {
            const auto gone = std::move(at->second);
            nodes_.erase(at);
            forget(*gone, now);
        }
        return;
    }
    const bool fresh = at == nodes_.end();
    if (fresh) {
        at = nodes_.emplace(std::string{name}, std::make_unique<known_node>()).first;
        at->second->name = name;
        all_nodes_.push_back({at->second.get(), true});
    }
    auto& known = *at->second;
    known.update_load(heard->load);
    const bool can_be_asked = !heard->suspect && !heard->where.empty();
    const bool could_be_asked = known.live && known.reachable();
    const bool another = fresh || known.epoch != heard->epoch;
    const bool moved = known.where != heard->where;
    known.live = !heard->suspect;
    if (known.state == known_node::task_knowledge::known && !another && known.digest == heard->tasks && !moved) {
        return;
    }
    if (another) {
        known.epoch = heard->epoch;
        known.avoid_until = {};
    }
    if (another || known.digest != heard->tasks) {
        restart_discovery(known, heard->tasks, heard->where, now);
    } else if (moved) {
        const bool unknown = known.state != known_node::task_knowledge::known;
        give_up(known);
        known.where = heard->where;
        if (unknown) {
            known.failures = 0;
            wait_for_turn(known);
        }
    } else if (can_be_asked && !could_be_asked) {
        wait_for_turn(known);
    } else if (!can_be_asked && could_be_asked && known.state == known_node::task_knowledge::unknown) {
        give_up(known);
    } else {
        return;
    }
    ask(now);
}

const known_node* service_registry::find(std::string_view name) const noexcept {
    const auto at = nodes_.find(name);
    return at == nodes_.end() ? nullptr : at->second.get();
}

known_node* service_registry::find(std::string_view name) noexcept {
    return const_cast<known_node*>(std::as_const(*this).find(name)); // NOLINT(cppcoreguidelines-pro-type-const-cast)
}

service_registry::digest_group* service_registry::digest_group_of(const known_node& n) noexcept {
    const auto found = n.digest.empty() ? digest_groups_.end() : digest_groups_.find(n.digest);
    return found == digest_groups_.end() ? nullptr : &found->second;
}

// Its tasks are to be queried: it is new, or its digest has changed.
void service_registry::restart_discovery(known_node& of, std::string_view digest, std::string_view where,
                                         time_point now) {
    leave_digest_group(of);
    of.digest = digest;
    of.where = where;
    of.failures = 0;
    of.state = known_node::task_knowledge::unknown;
    if (!digest.empty()) {
        auto& k = digest_groups_[of.digest];
        k.nodes.emplace(of.name, &of);
        if (k.tasks) {
            set_tasks(of, k.tasks);
            offers_changed_ = true; // if it was suspect, it may be used again
            return;
        }
    }
    if (!of.tasks && of.live && of.reachable()) {
        expect(of, now + answer_within);
    }
    wait_for_turn(of);
}

void service_registry::leave_digest_group(known_node& n) {
    give_up(n);
    expect(n, {});
    if (auto* k = digest_group_of(n)) {
        k->nodes.erase(n.name);
        if (k->nodes.empty()) {
            digest_groups_.erase(n.digest);
        }
    }
}

void service_registry::forget(known_node& n, time_point now) {
    leave_digest_group(n);
    forget_offers(n);
    ask(now);
}

void service_registry::expect(known_node& n, std::optional<time_point> until) {
    if (n.expected_until) {
        expected_.erase({*n.expected_until, n.name});
    }
    n.expected_until = until;
    if (until) {
        expected_.emplace(*until, n.name);
    }
}

// -- queries -------------------------------------------------------------------------------------------------------

void service_registry::wait_for_turn(known_node& n) {
    if (n.state == known_node::task_knowledge::unknown && n.live && n.reachable()) {
        queries_.enter(n);
    }
}

// It is neither queried nor waits to be.
void service_registry::give_up(known_node& n) {
    const bool queued = queries_.remove(n);
    if (n.state == known_node::task_knowledge::asked) {
        n.state = known_node::task_knowledge::unknown;
        n.ticket = 0;
    }
    if (auto* k = digest_group_of(n)) {
        k->waiting.erase({n.failures, n.name});
        if (k->asked == &n || (k->asked == nullptr && queued)) { // the others wait for its reply or its turn
            wake_next(*k);
        }
    }
}

// Of the nodes with one digest, one at a time is queried: its reply most likely holds for all.
void service_registry::ask(time_point now) {
    while (auto* next = queries_.next(now)) {
        auto& n = static_cast<known_node&>(*next);
        auto* k = digest_group_of(n);
        if (k != nullptr && k->asked != nullptr) {
            queries_.remove(n);
            k->waiting.emplace(std::pair{n.failures, std::string_view{n.name}}, &n);
            continue;
        }
        if (k != nullptr) {
            k->asked = &n;
        }
        n.state = known_node::task_knowledge::asked;
        n.ticket = ++last_ticket_;
        auto then = [weak = std::weak_ptr{alive_}, name = n.name, ticket = n.ticket](std::string_view json,
                                                                                     const subrequest_failure* why) {
            if (const auto alive = weak.lock()) {
                (*alive)->on_reply(name, ticket, json, why);
            }
        };
        out_.send_own({.verb = verb::pull, .noun = n.name + ":cles"}, now + answer_within,
                      detail::pending_ptr{new subrequest(std::move(then))});
    }
    follow();
}

// Its turn may be a minute away: neither requests nor the others of its digest wait for it.
void service_registry::on_postponed(known_node& n) {
    expect(n, {});
    if (auto* k = digest_group_of(n); k != nullptr && k->asked == nullptr) {
        wake_next(*k);
    }
}

void service_registry::wake_next(digest_group& of) {
    of.asked = nullptr;
    if (of.waiting.empty()) {
        return;
    }
    expect_next(of);
    auto& next = *of.waiting.begin()->second;
    of.waiting.erase(of.waiting.begin());
    wait_for_turn(next);
}

// The next one to be asked has waited for the replies of others, and is waited for from now on.
void service_registry::expect_next(const digest_group& of) {
    if (of.waiting.empty()) {
        return;
    }
    if (auto& next = *of.waiting.begin()->second; !next.tasks && next.failures == 0) {
        expect(next, node_.time.now() + answer_within);
    }
}

void service_registry::on_reply(const std::string& name, std::uint64_t ticket, std::string_view said,
                                const subrequest_failure* why) {
    auto* known = find(name);
    if (known == nullptr || known->state != known_node::task_knowledge::asked || known->ticket != ticket) {
        return;
    }
    const auto now = node_.time.now();
    auto list = why == nullptr ? read_task_list(said, name) : std::nullopt;
    if (list) {
        on_tasks(*known, std::move(*list));
    } else {
        on_no_reply(*known, why != nullptr && why->unreachable, now);
    }
    ask(now);
}

void service_registry::on_tasks(known_node& of, task_list list) {
    queries_.answered(of);
    const auto tasks = std::make_shared<const task_list>(std::move(list));
    if (auto* k = digest_group_of(of)) {
        k->asked = nullptr;
        k->waiting.clear();
        k->tasks = tasks;
        for (const auto& [other, n] : k->nodes) {
            set_tasks(*n, tasks);
        }
    } else {
        set_tasks(of, tasks);
    }
}

void service_registry::on_no_reply(known_node& of, bool unreachable, time_point now) {
    of.state = known_node::task_knowledge::unknown;
    queries_.failed(of, unreachable, now);
    if (!of.live || !of.reachable()) { // queried again when it is received again
        queries_.remove(of);
    }
    expect(of, {});
    if (auto* k = digest_group_of(of)) {
        wake_next(*k);
    }
}

void service_registry::follow() {
    auto due = queries_.due();
    if (!expected_.empty()) {
        due = std::min(due.value_or(time_point::max()), expected_.begin()->first);
    }
    if (due) {
        node_.deadlines.arm(*this, *due);
    } else {
        node_.deadlines.disarm(*this);
    }
    const bool expected = std::exchange(expected_more_, expects_more());
    if (std::exchange(offers_changed_, false) || (expected && !expected_more_)) {
        on_offers_();
    }
}

void service_registry::on_deadline(time_point now) {
    while (!expected_.empty() && expected_.begin()->first <= now) {
        auto& late = *find(expected_.begin()->second);
        expect(late, {});
        if (const auto* k = digest_group_of(late); k != nullptr && k->asked != nullptr) {
            expect_next(*k); // the query that it waits for ends within a second, perhaps at this moment
        }
    }
    ask(now);
}

// -- offers --------------------------------------------------------------------------------------------------------

const std::vector<service_registry::offer>& service_registry::offers(verb v, std::string_view task) const {
    static const auto& nobody = *new std::vector<offer>;
    if (task == "cles") {
        return v == verb::pull ? all_nodes_ : nobody;
    }
    const auto found = offers_.find(task);
    return found == offers_.end() ? nobody : found->second[static_cast<std::size_t>(v)];
}

void service_registry::set_tasks(known_node& of, std::shared_ptr<const task_list> tasks) {
    queries_.remove(of);
    expect(of, {});
    of.state = known_node::task_knowledge::known;
    of.failures = 0;
    if (of.tasks == tasks) {
        return;
    }
    if (of.tasks) {
        forget_offers(of);
        all_nodes_.push_back({&of, true});
    }
    of.tasks = std::move(tasks);
    offer_all(of);
    offers_changed_ = true;
}

void service_registry::offer_all(const known_node& of) {
    auto* by = find(of.name);
    for (const auto& e : of.tasks->entries) {
        auto& list = offers_[e.task][static_cast<std::size_t>(e.verb)];
        if (std::none_of(list.begin(), list.end(), [by](const offer& o) { return o.by == by; })) {
            list.push_back({by, e.idempotent});
        }
    }
}

void service_registry::forget_offers(const known_node& of) {
    const auto from = [&of](const offer& o) { return o.by == &of; };
    std::erase_if(all_nodes_, from);
    if (!of.tasks) {
        return;
    }
    offers_changed_ = true;
    for (const auto& e : of.tasks->entries) {
        const auto found = offers_.find(e.task);
        if (found == offers_.end()) {
            continue;
        }
        std::erase_if(found->second[static_cast<std::size_t>(e.verb)], from);
        if (std::all_of(found->second.begin(), found->second.end(), [](const auto& list) { return list.empty(); })) {
            offers_.erase(found);
        }
    }
}

} // namespace cles::core
