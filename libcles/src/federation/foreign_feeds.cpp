// SPDX-License-Identifier: BSL-1.0
#include "federation/foreign_feeds.hpp"

#include "federation/carried_line.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

namespace cles::bridging {
namespace {

auto subject_key(const foreign_noun& n) { return std::tie(n.pool, n.node, n.task); }
auto noun_key(const foreign_noun& n) { return std::tie(n.pool, n.node, n.task, n.parameters); }
auto requester_key(const foreign_noun& n) { return std::tie(n.pool, n.node, n.task, n.parameters, n.requester); }

// Whether one is bound that has this key. \param first of those that may have it
template <class Bindings, class Key>
bool has_key(const Bindings& bound, const foreign_noun& first, Key key_of) {
    const auto next = bound.lower_bound(first);
    return next != bound.end() && key_of(next->first) == key_of(first);
}

} // namespace

void foreign_feeds::bind(const foreign_noun& noun, std::uint64_t id) {
    if (!has_key(bound_, {noun.pool, noun.node, noun.task}, subject_key)) {
        out_.subscribe(noun.subject(), false);
    }
    bound_[noun].id = id;
    asked_.insert_or_assign(id, noun);
}

void foreign_feeds::unbind(const foreign_noun& noun) {
    if (const auto found = bound_.find(noun); found != bound_.end()) {
        erase(found, true);
    }
}

void foreign_feeds::erase(bindings::iterator which, bool tells) {
    const auto gone = bound_.extract(which);
    const auto& noun = gone.key();
    if (!has_key(bound_, {noun.pool, noun.node, noun.task}, subject_key)) {
        out_.unsubscribe(noun.subject());
    }
    if (tells) {
        end_at(gone.mapped().taker, noun, gone.mapped().numbers);
    }
}

template <class Condition>
void foreign_feeds::erase_if(Condition concerns, bool tells) {
    for (auto at = bound_.begin(); at != bound_.end();) {
        const auto here = at++;
        if (concerns(here->first)) {
            erase(here, tells);
        }
    }
    std::erase_if(asked_, [&concerns](const auto& each) { return concerns(each.second); });
}

// All that is bound of the noun, or if it is still bound for other requesters, what these requests have bound.
void foreign_feeds::end_at(std::string_view taker, const foreign_noun& noun, const std::deque<std::uint64_t>& numbers) {
    foreign_noun first{noun.pool, noun.node, noun.task, noun.parameters};
    const bridge_id at{noun.pool, std::string{taker}};
    if (taker.empty()) {
        return;
    }
    if (!has_key(bound_, first, noun_key)) {
        nats_.send_control(at, text_of(verb::bind, noun.node, noun.task, noun.parameters + " lease=0"));
        return;
    }
    first.requester = noun.requester;
    if (!has_key(bound_, first, requester_key)) {
        for (const auto number : numbers) {
            nats_.send_cancel(at, number);
        }
    }
}

void foreign_feeds::on_unbound(const bridge_id& by, std::uint64_t number) {
    const auto found = std::ranges::find_if(bound_, [&](const auto& each) {
        const auto& [noun, b] = each;
        return noun.pool == by.pool && b.taker == by.instance && b.id == 0 && !b.numbers.empty() &&
               b.numbers.back() == number;
    });
    if (found != bound_.end()) {
        out_.lose_binding(found->first.on(), found->first.text(), "the publisher has ended the binding");
        erase(found, false);
    }
}

void foreign_feeds::on_answer(std::uint64_t id, std::uint64_t number, bool is_failure, std::string_view taker) {
    const auto asked = asked_.extract(id);
    if (asked.empty()) {
        return;
    }
    const auto found = bound_.find(asked.mapped());
    if (found == bound_.end()) {
        if (!is_failure) { // the node has ended it meanwhile
            end_at(taker, asked.mapped(), {number});
        }
        return;
    }
    auto& b = found->second;
    const bool is_last = b.id == id;
    if (is_failure) {
        if (is_last) {
            erase(found, false);
        }
        return;
    }
    if (b.taker != taker && !is_last && b.id == 0) { // another bridge has answered the last one
        nats_.send_cancel({found->first.pool, std::string{taker}}, number);
        return;
    }
    if (b.taker != taker) {
        for (const auto each : std::exchange(b.numbers, {})) {
            nats_.send_cancel({found->first.pool, b.taker}, each);
        }
        b.taker = taker;
    }
    b.numbers.push_back(number); // also if it is not the last: what it has bound is to be ended, too
    if (b.numbers.size() > max_numbers) {
        b.numbers.pop_front();
    }
    if (is_last) {
        b.id = 0;
        for (auto& line : std::exchange(b.held, {})) {
            out_.deliver(found->first.on(), std::move(line));
        }
    }
}

void foreign_feeds::cancel(std::uint64_t id) {
    const auto asked = asked_.extract(id);
    const auto found = asked.empty() ? bound_.end() : bound_.find(asked.mapped());
    if (found != bound_.end() && found->second.id == id) {
        erase(found, true);
    }
}

void foreign_feeds::close(const bridge_link& link) {
    erase_if([&link](const foreign_noun& n) { return n.on() == link; }, true);
}

void foreign_feeds::lose_pool(std::string_view pool) {
    erase_if([pool](const foreign_noun& n) { return n.pool == pool; }, false);
}

void foreign_feeds::on_lost(const bridge_id& taker, std::string_view why) {
    for (auto at = bound_.begin(); at != bound_.end();) {
        const auto here = at++;
        const auto& [noun, b] = *here;
        if (noun.pool == taker.pool && b.taker == taker.instance && b.id == 0) {
            out_.lose_binding(noun.on(), noun.text(), why); // the node binds it again
            erase(here, true);
        }
    }
}

void foreign_feeds::clear() {
    bound_.clear();
    asked_.clear();
}

void foreign_feeds::on_update(const subject& about, std::string_view message) {
    ++nats_.counts().updates_received;
    const foreign_noun first{about.pool, about.node, about.task};
    for (auto at = bound_.lower_bound(first); at != bound_.end() && subject_key(at->first) == subject_key(first);
         ++at) {
        auto& [noun, b] = *at;
        const auto& parameters = noun.parameters;
        if (!message.starts_with(parameters) || message.substr(parameters.size(), 1) != " ") {
            continue;
        }
        auto line = text_of(verb::update, noun.target, noun.task, message);
        if (b.id == 0) {
            out_.deliver(noun.on(), std::move(line));
            continue;
        }
        b.held.push_back(std::move(line));
        if (b.held.size() > max_held) { // shows as a gap
            b.held.pop_front();
        }
    }
}

} // namespace cles::bridging
