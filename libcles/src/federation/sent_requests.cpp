// SPDX-License-Identifier: BSL-1.0
#include "federation/sent_requests.hpp"

#include <algorithm>
#include <utility>

namespace cles::bridging {
namespace {

constexpr std::string_view taken_key = "taken=";
constexpr std::chrono::seconds after_deadline{1}; // until a reply is not expected any more

} // namespace

std::string taken_text(std::string_view instance) { return std::string{taken_key}.append(instance); }

std::string_view take_taker(std::string_view& message) noexcept {
    if (!message.starts_with(taken_key)) {
        return {};
    }
    const auto end = std::min(message.find(' '), message.size());
    const auto instance = message.substr(taken_key.size(), end - taken_key.size());
    if (!is_instance(instance)) {
        return {};
    }
    message.remove_prefix(std::min(end + 1, message.size()));
    return instance;
}

std::uint64_t sent_requests::add(const bridge_link& from, std::uint64_t id, time_point due, time_point now,
                                 std::string addressee) {
    const auto number = ++last_;
    sent_.emplace(number, request{.from = from,
                                  .id = id,
                                  .addressee = std::move(addressee),
                                  .sent_at = now,
                                  .forgotten_at = due + after_deadline});
    numbers_.insert_or_assign(id, number);
    return number;
}

sent_requests::requests::iterator sent_requests::erase(requests::iterator which) {
    if (const auto found = numbers_.find(which->second.id);
        found != numbers_.end() && found->second == which->first) { // a cancelled one has none
        numbers_.erase(found);
    }
    return sent_.erase(which);
}

void sent_requests::refuse(std::uint64_t number, const protocol::failure& why) { fail(sent_.find(number), why); }

void sent_requests::on_message(std::uint64_t number, std::string_view message, time_point now) {
    const auto taker = take_taker(message);
    const auto found = sent_.find(number);
    if (found == sent_.end()) {
        return;
    }
    if (!taker.empty()) {
        on_taken(found, taker, now);
    }
    const auto again = sent_.find(number);
    if (message.empty() || again == sent_.end()) {
        return;
    }
    if (message.starts_with("progress=")) {
        if (!again->second.is_cancelled) {
            events_.on_answer(again->second.from, again->second.id, message, again->second.taker);
        }
        return;
    }
    const auto answered = std::move(again->second);
    const auto id = answered.id;
    erase(sent_.find(number));
    if (!answered.is_cancelled) {
        events_.on_answer(answered.from, id, message, answered.taker);
    }
}

void sent_requests::on_unusable(std::uint64_t number, std::string_view message, time_point now,
                                const protocol::failure& why) {
    if (const auto taker = take_taker(message); !taker.empty()) {
        on_message(number, taken_text(taker), now);
    }
    if (const auto found = sent_.find(number); found != sent_.end()) {
        if (const auto& r = found->second; !r.taker.empty()) { // it may continue there, or be bound
            events_.cancel_at({r.from.pool, r.taker}, number);
        }
        fail(found, why);
    }
}

void sent_requests::on_taken(requests::iterator which, std::string_view taker, time_point now) {
    auto& r = which->second;
    if (r.taker.empty()) {
        note_round_trip(r.from.pool, std::min<time_point::duration>(now - r.sent_at, acknowledged_within));
    }
    if (r.is_cancelled) {
        events_.cancel_at({r.from.pool, std::string{taker}}, which->first);
        erase(which);
    } else if (r.taker.empty()) {
        r.taker = taker;
    }
}

// Follows a longer one at once, and a shorter one slowly.
void sent_requests::note_round_trip(const std::string& pool, time_point::duration took) {
    auto& known = round_trips_[pool];
    known = std::max(took, known - (known - took) / 8);
}

std::uint32_t sent_requests::deadline_of_all(std::string_view pool, std::uint32_t left_ms) const {
    using std::chrono::milliseconds;
    constexpr milliseconds least{1'000};
    const milliseconds left{left_ms};
    const auto known = round_trips_.find(pool);
    const auto way = known == round_trips_.end() ? milliseconds{0} : std::chrono::ceil<milliseconds>(known->second);
    return static_cast<std::uint32_t>((left - std::clamp(way, std::min(left / 4, least), left * 3 / 4)).count());
}

void sent_requests::cancel(std::uint64_t id) {
    const auto number = numbers_.find(id);
    if (number == numbers_.end()) {
        return;
    }
    const auto which = sent_.find(number->second);
    auto& r = which->second;
    if (r.taker.empty()) {
        r.is_cancelled = true;
        numbers_.erase(number);
    } else {
        events_.cancel_at({r.from.pool, r.taker}, which->first);
        erase(which);
    }
}

void sent_requests::fail(requests::iterator which, const protocol::failure& why) {
    const auto failed = std::move(which->second);
    const auto number = which->first;
    erase(sent_.find(number));
    if (!failed.is_cancelled) {
        std::string text;
        protocol::append_failure(text, why);
        events_.on_answer(failed.from, failed.id, text, failed.taker);
    }
}

// It remains, so that a bridge that acknowledges it later is told.
void sent_requests::fail_unacknowledged(requests::iterator which, std::string why) {
    const auto number = which->first;
    auto waiting = which->second;
    waiting.is_cancelled = true;
    fail(which, {.code = errc::unavailable, .message = std::move(why)});
    sent_.emplace(number, std::move(waiting));
}

void sent_requests::on_lost(const bridge_id& taker, std::string_view why) {
    std::vector<std::uint64_t> lost;
    for (const auto& [number, r] : sent_) {
        const auto& at = r.taker.empty() ? r.addressee : r.taker;
        if (at == taker.instance && r.from.pool == taker.pool && !(r.taker.empty() && r.is_cancelled)) {
            lost.push_back(number);
        }
    }
    for (const auto number : lost) {
        const auto found = sent_.find(number);
        if (found == sent_.end()) {
            continue;
        }
        if (found->second.taker.empty()) { // it may have passed on a BIND
            fail_unacknowledged(found, std::string{why});
        } else {
            fail(found, {.code = errc::unavailable, .message = std::string{why}});
        }
    }
}

void sent_requests::on_time(time_point now) {
    std::vector<std::uint64_t> late;
    std::vector<std::uint64_t> over;
    for (const auto& [number, r] : sent_) {
        if (r.forgotten_at <= now) {
            over.push_back(number);
        } else if (r.taker.empty() && !r.is_cancelled && r.sent_at + acknowledged_within <= now) {
            late.push_back(number);
        }
    }
    for (const auto number : over) {
        const auto found = sent_.find(number);
        const auto gone = std::move(found->second);
        erase(found);
        if (!gone.is_cancelled) { // the node has given up by itself
            if (!gone.taker.empty()) {
                events_.cancel_at({gone.from.pool, gone.taker}, number);
            }
            events_.on_forgotten(gone.id);
        }
    }
    for (const auto number : late) {
        const auto found = sent_.find(number);
        if (found == sent_.end()) {
            continue;
        }
        fail_unacknowledged(found, "no bridge of the pool '" + found->second.from.pool + "' acknowledged the request");
    }
}

template <class Condition>
void sent_requests::cancel_if(Condition concerns) {
    std::vector<std::uint64_t> ids;
    for (const auto& [number, r] : sent_) {
        if (!r.is_cancelled && concerns(r)) {
            ids.push_back(r.id);
        }
    }
    for (const auto id : ids) {
        cancel(id);
    }
}

void sent_requests::close(const bridge_link& link) {
    cancel_if([&link](const request& r) { return r.from == link; });
}

void sent_requests::close_pool(std::string_view pool) {
    cancel_if([pool](const request& r) { return r.from.pool == pool; });
    if (const auto known = round_trips_.find(pool); known != round_trips_.end()) {
        round_trips_.erase(known);
    }
}

void sent_requests::clear() {
    sent_.clear();
    numbers_.clear();
    round_trips_.clear();
}

} // namespace cles::bridging
