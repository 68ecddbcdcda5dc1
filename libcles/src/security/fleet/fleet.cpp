// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/fleet.hpp"

#include <algorithm>
#include <exception>
#include <utility>

namespace cles::security {

struct fleet::observation {
    observer changed;
};

fleet::fleet(std::string name, signing_key own, std::shared_ptr<const roster> initial)
    : name_(std::move(name)), own_(std::move(own)) {
    const auto* const listed = initial->find(own_.public_part());
    if (listed != nullptr && listed->name != name_) {
        throw security_error{"the roster lists the key of " + name_ + " under the name " + listed->name};
    }
    if (const auto wrong = adopt(std::move(initial)); !wrong.empty()) {
        throw security_error{wrong};
    }
}

// Returns why the group keys cannot be used. The roster is in force nevertheless: it may remove a member.
std::string fleet::adopt(std::shared_ptr<const roster> next) {
    roster_ = std::move(next);
    reported_fork_ = false;
    self_ = roster_->find(own_.public_part());
    if (self_ != nullptr && self_->name != name_) {
        self_ = nullptr;
    }
    if (self_ == nullptr) {
        ring_.clear();
        return {};
    }
    try {
        ring_.adopt(*roster_, open_group_keys(self_->group_keys, own_));
        return {};
    } catch (const security_error& e) {
        ring_.clear();
        return "version " + std::to_string(roster_->version()) + " of the roster: " + e.what();
    }
}

fleet::verdict fleet::offer(std::string_view line, std::string* why) {
    std::string reported;
    const auto result = judge(line, reported);
    if (why != nullptr) {
        *why = std::move(reported);
    }
    return result;
}

fleet::verdict fleet::judge(std::string_view line, std::string& why) {
    if (line == roster_->line()) {
        return verdict::known;
    }
    std::shared_ptr<const roster> next;
    try {
        next = roster::read(line, roster_->fleet(), roster_.get());
    } catch (const security_error& e) {
        why = e.what();
        return verdict::refused;
    }
    if (next->version() < roster_->version()) {
        return verdict::older;
    }
    if (next->version() == roster_->version()) {
        if (next->content() == roster_->content()) {
            return verdict::known;
        }
        if (!std::exchange(reported_fork_, true)) {
            why = "there are two rosters of version " + std::to_string(next->version()) +
                  "; the next version ends the fork";
        }
        return verdict::forked;
    }
    const auto before = roster_;
    why = adopt(std::move(next));
    note_removed(*before);
    notify(*before);
    return verdict::adopted;
}

void fleet::note_removed(const roster& before) {
    for (const auto& each : before.members()) {
        if (roster_->find(each.key) == nullptr && find_former(each.key) == nullptr) {
            former_.push_back({.key = each.key, .name = each.name});
        }
    }
    while (former_.size() > max_members) {
        former_.pop_front();
    }
}

const std::string* fleet::find_former(const public_key& key) const {
    const auto found = std::ranges::find(former_, key, &former_member::key);
    return found != former_.end() && roster_->find(key) == nullptr ? &found->name : nullptr;
}

// An observer may end observations: each is kept alive during its call, and looked up only when it is its turn.
void fleet::notify(const roster& before) {
    std::exception_ptr thrown;
    const auto called = observers_;
    for (const auto& entry : called) {
        if (const auto observed = entry.lock()) {
            try {
                observed->changed(before);
            } catch (...) {
                thrown = thrown ? thrown : std::current_exception();
            }
        }
    }
    if (thrown) {
        std::rethrow_exception(thrown);
    }
}

std::shared_ptr<void> fleet::observe(observer changed) {
    std::erase_if(observers_, [](const auto& entry) { return entry.expired(); });
    auto made = std::make_shared<observation>(observation{std::move(changed)});
    observers_.emplace_back(made);
    return made;
}

} // namespace cles::security
