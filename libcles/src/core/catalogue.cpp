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
        : by_(std::move(by)), name_(whom.name), run_(whom.run), digest_(whom.digest) {}

    void on_result(std::size_t, std::string_view json) override {
        if (const auto alive = by_.lock()) {
            (*alive)->on_told(name_, run_, digest_, json);
        }
    }
    void on_failure(std::size_t, leg_failure) override {
        if (const auto alive = by_.lock()) {
            (*alive)->on_silent(name_);
        }
    }
    void on_progress(std::size_t, double, std::string_view) override {}

  private:
    std::weak_ptr<catalogue*> by_;
    std::string name_;
    std::uint32_t run_;
    std::string digest_;
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
            forget_offers(*at->second);
            asked_ -= at->second->state == known_node::tasks_are::asked ? 1 : 0;
            nodes_.erase(at);
            owner_.on_offers(now);
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
    known.live = !heard->suspect;
    known.reachable = !heard->where.empty();
    const bool another = known.run != heard->epoch;
    if (!fresh && !another && known.digest == heard->tasks) {
        return;
    }
    if (another) {
        known.run = heard->epoch;
        known.avoid_until = {};
    }
    known.digest = heard->tasks;
    known.tried = false;
    asked_ -= known.state == known_node::tasks_are::asked ? 1 : 0;
    known.state = known_node::tasks_are::unknown;
    ask(now);
}

known_node* catalogue::find(std::string_view name) noexcept {
    const auto at = nodes_.find(name);
    return at == nodes_.end() ? nullptr : at->second.get();
}

// -- what they offer -----------------------------------------------------------------------------------------------

std::shared_ptr<const task_list> catalogue::tasks_of_another(const known_node& like) const {
    if (like.digest.empty()) {
        return nullptr;
    }
    for (const auto& [name, n] : nodes_) {
        if (n->state == known_node::tasks_are::known && n->digest == like.digest) {
            return n->tasks;
        }
    }
    return nullptr;
}

void catalogue::ask(time_point now) {
    bool learnt = false;
    for (const auto& [name, n] : nodes_) {
        if (n->state != known_node::tasks_are::unknown) {
            continue;
        }
        if (auto same = tasks_of_another(*n)) {
            set_tasks(*n, std::move(same));
            learnt = true;
        } else if (n->reachable && !n->tried && asked_ < asked_at_once) {
            // Of many nodes of one kind, one at a time: what it says is most likely true of all.
            const bool another_says =
                !n->digest.empty() && std::any_of(nodes_.begin(), nodes_.end(), [&of = *n](const auto& o) {
                    return o.second->state == known_node::tasks_are::asked && o.second->digest == of.digest;
                });
            if (!another_says) {
                n->state = known_node::tasks_are::asked;
                ++asked_;
                out_.send({.verb = verb::pull, .node = name, .path = "cles", .deadline = now + answer_within},
                          detail::pending_ptr{new leg(std::make_shared<asking>(alive_, *n), 0)}, {});
            }
        }
    }
    if (learnt) {
        owner_.on_offers(now);
    }
}

void catalogue::on_told(const std::string& name, std::uint32_t run, const std::string& digest, std::string_view said) {
    auto* known = find(name);
    if (known == nullptr || known->state != known_node::tasks_are::asked || known->run != run ||
        known->digest != digest) {
        return;
    }
    auto list = read_task_list(said, name);
    if (!list) {
        on_silent(name);
        return;
    }
    --asked_;
    set_tasks(*known, std::make_shared<const task_list>(std::move(*list)));
    const auto now = node_.time.now();
    ask(now);
    owner_.on_offers(now);
}

void catalogue::on_silent(const std::string& name) {
    const auto now = node_.time.now();
    auto* known = find(name);
    if (known != nullptr && known->state == known_node::tasks_are::asked) {
        --asked_;
        known->state = known_node::tasks_are::unknown;
        known->tried = true;
        if (!armed()) {
            node_.deadlines.arm(*this, now + ask_again_after);
        }
    }
    ask(now);
    owner_.on_offers(now);
}

void catalogue::on_deadline(time_point now) {
    for (const auto& [name, n] : nodes_) {
        n->tried = false;
    }
    ask(now);
}

bool catalogue::expects_more() const noexcept {
    return std::any_of(nodes_.begin(), nodes_.end(), [](const auto& entry) {
        const auto& n = *entry.second;
        return n.state != known_node::tasks_are::known && !n.tasks && !n.tried && n.reachable && n.live;
    });
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
    of.state = known_node::tasks_are::known;
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
