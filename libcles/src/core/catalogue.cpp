// SPDX-License-Identifier: BSL-1.0
#include "core/catalogue.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {
namespace {

const std::vector<catalogue::offer> nobody;

} // namespace

class catalogue::asking final : public leg_events {
  public:
    asking(std::weak_ptr<catalogue*> by, const known_node& whom)
        : by_(std::move(by)), name_(whom.name), ticket_(whom.ticket) {}

    void on_result(std::size_t, std::string_view json) override {
        if (const auto alive = by_.lock()) {
            (*alive)->on_told(name_, ticket_, json);
        }
    }
    void on_failure(std::size_t, leg_failure why) override {
        if (const auto alive = by_.lock()) {
            (*alive)->on_silent(name_, ticket_, why.unreachable);
        }
    }
    void on_progress(std::size_t, double, std::string_view) override {}

  private:
    std::weak_ptr<catalogue*> by_;
    std::string name_;
    std::uint64_t ticket_;
};

catalogue::catalogue(node& host, onward& out, listener& owner)
    : node_(host), out_(out), owner_(owner), alive_(std::make_shared<catalogue*>(this)) {
    node_.others.observe(this);
}

catalogue::~catalogue() { stop(); }

void catalogue::stop() noexcept {
    if (std::exchange(alive_, nullptr)) {
        node_.others.observe(nullptr);
        node_.deadlines.disarm(*this);
    }
}

// -- who is there --------------------------------------------------------------------------------------------------

void catalogue::on_heard(std::string_view name) {
    const auto now = node_.time.now();
    const auto heard = node_.others.look(name);
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
        everyone_.push_back({at->second.get(), true});
    }
    auto& known = *at->second;
    known.hears(heard->load);
    const bool can_be_asked = !heard->suspect && !heard->where.empty();
    const bool could_be_asked = known.live && known.reachable;
    const bool another = fresh || known.run != heard->epoch;
    const bool moved = known.where != heard->where;
    known.live = !heard->suspect;
    known.reachable = !heard->where.empty();
    if (known.state == known_node::tasks_are::known && !another && known.digest == heard->tasks && !moved) {
        return;
    }
    if (another) {
        known.run = heard->epoch;
        known.avoid_until = {};
    }
    if (another || known.digest != heard->tasks) {
        begin_anew(known, heard->tasks, heard->where, now);
    } else if (moved) {
        const bool unknown = known.state != known_node::tasks_are::known;
        give_up(known);
        known.where = heard->where;
        if (unknown) {
            known.failures = 0;
            wait_for_turn(known);
        }
    } else if (can_be_asked && !could_be_asked) {
        wait_for_turn(known);
    } else if (!can_be_asked && could_be_asked && known.state == known_node::tasks_are::unknown) {
        give_up(known);
    } else {
        return;
    }
    ask(now);
}

known_node* catalogue::find(std::string_view name) noexcept {
    const auto at = nodes_.find(name);
    return at == nodes_.end() ? nullptr : at->second.get();
}

catalogue::kind* catalogue::kind_of(const known_node& n) noexcept {
    const auto found = n.digest.empty() ? kinds_.end() : kinds_.find(n.digest);
    return found == kinds_.end() ? nullptr : &found->second;
}

// What it offers is to be learnt: it is new, or says that it has changed.
void catalogue::begin_anew(known_node& of, std::string_view digest, std::string_view where, time_point now) {
    leave_kind(of);
    of.digest = digest;
    of.where = where;
    of.failures = 0;
    of.state = known_node::tasks_are::unknown;
    if (!digest.empty()) {
        auto& k = kinds_[of.digest];
        k.nodes.emplace(of.name, &of);
        if (k.tasks) {
            set_tasks(of, k.tasks);
            owner_.on_offers(now);
            return;
        }
    }
    if (!of.tasks && of.live && of.reachable) {
        expect(of, now + answer_within);
    }
    wait_for_turn(of);
}

void catalogue::leave_kind(known_node& n) {
    give_up(n);
    expect(n, {});
    if (auto* k = kind_of(n)) {
        k->nodes.erase(n.name);
        if (k->nodes.empty()) {
            kinds_.erase(n.digest);
        }
    }
}

void catalogue::forget(known_node& n, time_point now) {
    const bool last_expected = n.expected_until && expected_.size() == 1;
    leave_kind(n);
    forget_offers(n);
    if (n.tasks || last_expected) {
        owner_.on_offers(now);
    }
    ask(now);
}

void catalogue::expect(known_node& n, std::optional<time_point> until) {
    if (n.expected_until) {
        expected_.erase({*n.expected_until, n.name});
    }
    n.expected_until = until;
    if (until) {
        expected_.emplace(*until, n.name);
    }
}

// -- asking --------------------------------------------------------------------------------------------------------

void catalogue::wait_for_turn(known_node& n) {
    if (n.state == known_node::tasks_are::unknown && n.live && n.reachable) {
        asks_.enter(n);
    }
}

// It is not asked, nor does it wait to be.
void catalogue::give_up(known_node& n) {
    asks_.remove(n);
    if (n.state == known_node::tasks_are::asked) {
        n.state = known_node::tasks_are::unknown;
        n.ticket = 0;
    }
    if (auto* k = kind_of(n)) {
        k->waiting.erase(n.name);
        if (k->asked == &n) {
            wake_next(*k);
        }
    }
}

// Of many nodes of one kind one at a time is asked: what it says is most likely true of all.
void catalogue::ask(time_point now) {
    while (auto* next = asks_.next(now)) {
        auto& n = static_cast<known_node&>(*next);
        auto* k = kind_of(n);
        if (k != nullptr && k->asked != nullptr) {
            asks_.remove(n);
            k->waiting.emplace(n.name, &n);
            continue;
        }
        if (k != nullptr) {
            k->asked = &n;
        }
        n.state = known_node::tasks_are::asked;
        n.ticket = ++last_ticket_;
        out_.send({.verb = verb::pull, .node = n.name, .path = "cles", .deadline = now + answer_within},
                  detail::pending_ptr{new leg(std::make_shared<asking>(alive_, n), 0)}, {});
    }
    follow();
}

void catalogue::wake_next(kind& of) {
    of.asked = nullptr;
    if (!of.waiting.empty()) {
        auto& next = *of.waiting.begin()->second;
        of.waiting.erase(of.waiting.begin());
        wait_for_turn(next);
    }
}

known_node* catalogue::asked_by(const std::string& name, std::uint64_t ticket) noexcept {
    auto* known = find(name);
    return known != nullptr && known->state == known_node::tasks_are::asked && known->ticket == ticket ? known
                                                                                                       : nullptr;
}

void catalogue::on_told(const std::string& name, std::uint64_t ticket, std::string_view said) {
    auto* known = asked_by(name, ticket);
    if (known == nullptr) {
        return;
    }
    auto list = read_task_list(said, name);
    if (!list) {
        on_silent(name, ticket, false);
        return;
    }
    const auto now = node_.time.now();
    asks_.answered(*known);
    const auto tasks = std::make_shared<const task_list>(std::move(*list));
    if (auto* k = kind_of(*known)) {
        k->asked = nullptr;
        k->waiting.clear();
        k->tasks = tasks;
        for (const auto& [other, n] : k->nodes) {
            set_tasks(*n, tasks);
        }
    } else {
        set_tasks(*known, tasks);
    }
    ask(now);
    owner_.on_offers(now);
}

void catalogue::on_silent(const std::string& name, std::uint64_t ticket, bool unreachable) {
    auto* known = asked_by(name, ticket);
    if (known == nullptr) {
        return;
    }
    const auto now = node_.time.now();
    const bool last_expected = known->expected_until && expected_.size() == 1;
    known->state = known_node::tasks_are::unknown;
    asks_.failed(*known, unreachable, now);
    if (!known->live || !known->reachable) { // it is asked again when it is heard again
        asks_.remove(*known);
    }
    expect(*known, {});
    if (auto* k = kind_of(*known)) {
        wake_next(*k);
    }
    ask(now);
    if (last_expected) {
        owner_.on_offers(now);
    }
}

void catalogue::follow() {
    auto due = asks_.due();
    if (!expected_.empty()) {
        due = std::min(due.value_or(time_point::max()), expected_.begin()->first);
    }
    if (due) {
        node_.deadlines.arm(*this, *due);
    } else {
        node_.deadlines.disarm(*this);
    }
}

void catalogue::on_deadline(time_point now) {
    const bool expected = expects_more();
    while (!expected_.empty() && expected_.begin()->first <= now) {
        expect(*find(expected_.begin()->second), {});
    }
    ask(now);
    if (expected && !expects_more()) {
        owner_.on_offers(now);
    }
}

// -- the offers ----------------------------------------------------------------------------------------------------

const std::vector<catalogue::offer>& catalogue::offers(verb v, std::string_view task) const {
    if (task == "cles") {
        return v == verb::pull ? everyone_ : nobody;
    }
    const auto found = offers_.find(task);
    return found == offers_.end() ? nobody : found->second[static_cast<std::size_t>(v)];
}

void catalogue::set_tasks(known_node& of, std::shared_ptr<const task_list> tasks) {
    asks_.remove(of);
    expect(of, {});
    of.state = known_node::tasks_are::known;
    of.failures = 0;
    if (of.tasks == tasks) {
        return;
    }
    if (of.tasks) {
        forget_offers(of);
        everyone_.push_back({&of, true});
    }
    of.tasks = std::move(tasks);
    offer_all(of);
}

void catalogue::offer_all(const known_node& of) {
    auto* by = find(of.name);
    for (const auto& e : of.tasks->entries) {
        auto& list = offers_[e.task][static_cast<std::size_t>(e.verb)];
        if (std::none_of(list.begin(), list.end(), [by](const offer& o) { return o.by == by; })) {
            list.push_back({by, e.idempotent});
        }
    }
}

void catalogue::forget_offers(const known_node& of) {
    const auto from = [&of](const offer& o) { return o.by == &of; };
    std::erase_if(everyone_, from);
    if (!of.tasks) {
        return;
    }
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
