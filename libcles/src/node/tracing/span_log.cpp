// SPDX-License-Identifier: BSL-1.0
#include "node/tracing/span_log.hpp"

#include <cles/error.hpp>
#include <cles/tracing.hpp>

#include "json/json_members.hpp"
#include "node/base/wrapped_operation.hpp"
#include "node/node_state.hpp"
#include "protocol/hex_number.hpp"

#include <algorithm>
#include <functional>
#include <utility>
#include <vector>

namespace cles::core {
namespace {

// The next of a sequence without visible order (SplitMix64); not 0.
std::uint64_t mixed(std::uint64_t& state) noexcept {
    state += 0x9e3779b97f4a7c15U;
    auto z = state;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
    return (z ^ (z >> 31U)) | 1U;
}

double in_us(std::chrono::nanoseconds span) noexcept { return static_cast<double>(span.count()) / 1000.0; }

std::string_view task_in(std::string_view noun) noexcept {
    const auto path = noun.substr(std::min(noun.find(':'), noun.size() - 1) + 1);
    return path.substr(0, path.find('/'));
}

} // namespace

/// A request that was sent: ends its span, and passes the outcome on.
class span_log::sent_request final : public wrapped_operation {
  public:
    sent_request(std::shared_ptr<span_log> log, std::uint64_t span, time_point begun, detail::pending_ptr operation)
        : wrapped_operation(std::move(operation)), log_(std::move(log)), span_(span), over_(begun) {}
    sent_request(const sent_request&) = delete;
    sent_request& operator=(const sent_request&) = delete;
    ~sent_request() override { log_->end(span_, outcome_, over_); }

    verdict offer(std::string_view json) override {
        return complete([&](detail::pending& p) { return p.offer(json); });
    }
    verdict offer_marked(std::string_view json, const update_mark& mark) override {
        return complete([&](detail::pending& p) { return p.offer_marked(json, mark); });
    }
    verdict offer_granted(std::string_view json, std::uint64_t grant) override {
        return complete([&](detail::pending& p) { return p.offer_granted(json, grant); });
    }
    void fail(boost::system::error_code code, std::string_view message) override {
        note(code);
        wrapped_operation::fail(code, message);
    }
    void refuse(boost::system::error_code code, std::string_view message, std::string_view answer) override {
        const std::unique_ptr<sent_request> self{this};
        note(code);
        take_operation().release()->refuse(code, message, answer);
    }

  private:
    // The user's code may end the node: the time is read before.
    template <class Offer>
    verdict complete(Offer offer) {
        const auto before = std::exchange(over_, log_->time_.now());
        outcome_ = "ok";
        const auto found = pass_on(std::move(offer));
        if (found == verdict::malformed) { // else this is destroyed
            over_ = before;
            outcome_ = nobody_waits;
        }
        return found;
    }
    void note(boost::system::error_code code) {
        over_ = log_->time_.now();
        const bool known = code.category() == error_category();
        outcome_ = wire_name(known ? static_cast<errc>(code.value()) : errc::unavailable);
    }

    static constexpr std::string_view nobody_waits = "cancelled";

    std::shared_ptr<span_log> log_;
    std::uint64_t span_;
    time_point over_;
    std::string_view outcome_ = nobody_waits;
};

protocol::trace_context span_log::receive(const protocol::request_line& r, time_point arrived, time_point now) {
    return begin({.verb = r.verb,
                  .target = std::string{r.noun.target},
                  .task = std::string{r.noun.task},
                  .begun = arrived,
                  .queued = now - arrived},
                 r.trace, now);
}

detail::pending_ptr span_log::send(protocol::outgoing_request& r, std::string_view next, detail::pending_ptr operation,
                                   time_point now) {
    const auto own = begin({.sent = true,
                            .verb = r.verb,
                            .target = std::string{r.target()},
                            .task = std::string{task_in(r.noun)},
                            .next = std::string{next},
                            .begun = now},
                           r.carried.trace, now);
    if (own.span == r.carried.trace.span) {
        return operation;
    }
    r.carried.trace = own;
    return detail::pending_ptr{new sent_request{shared_from_this(), own.span, now, std::move(operation)}};
}

// Beyond the limit, what it causes belongs to the parent.
protocol::trace_context span_log::begin(span what, const protocol::trace_context& parent, time_point now) {
    forget_old(now);
    auto trace = parent;
    if (open_.size() >= max_open) {
        return trace;
    }
    trace.span = what.id = mixed(next_id_);
    what.trace = parent.id;
    what.parent = parent.span;
    open_.emplace(what.id, std::move(what));
    return trace;
}

void span_log::add_times(std::uint64_t id, std::chrono::nanoseconds queued, std::chrono::nanoseconds ran) {
    if (auto* const s = find(id)) {
        s->queued += queued;
        s->ran += ran;
    }
}

void span_log::end(std::uint64_t id, std::string_view outcome, time_point now) {
    const auto found = open_.find(id);
    if (found == open_.end()) {
        return;
    }
    auto& s = found->second;
    s.over = std::max(now, s.begun);
    s.outcome = outcome;
    if (ended_.size() >= max_ended) {
        ended_.pop_front();
    }
    ended_.push_back(std::move(s));
    open_.erase(found);
}

// Most are about spans that are open, or have just ended.
span_log::span* span_log::find(std::uint64_t id) noexcept {
    if (const auto found = open_.find(id); found != open_.end()) {
        return &found->second;
    }
    const auto found = std::find_if(ended_.rbegin(), ended_.rend(), [id](const span& s) { return s.id == id; });
    return found == ended_.rend() ? nullptr : &*found;
}

void span_log::forget_old(time_point now) {
    while (!ended_.empty() && now - ended_.front().over > kept_for) {
        ended_.pop_front();
    }
}

void span_log::write(json_writer& w, const protocol::trace_id& id, time_point now) {
    forget_old(now);
    std::vector<const span*> found;
    const auto add = [&](const span& s) {
        if (s.trace == id) {
            found.push_back(&s);
        }
    };
    std::for_each(ended_.begin(), ended_.end(), add);
    for (const auto& [key, s] : open_) {
        add(s);
    }
    std::sort(found.begin(), found.end(), [](const span* a, const span* b) { return a->begun < b->begun; });
    w.begin_object();
    write_member(w, "node", std::string_view{node_});
    w.key("spans");
    w.begin_array();
    for (const auto* s : found) {
        write(w, *s, found.front()->begun);
    }
    w.end_array();
    w.end_object();
}

void span_log::write(json_writer& w, const span& s, time_point from) {
    w.begin_object();
    write_member(w, "span", protocol::hex_text(s.id));
    write_member(w, "parent", protocol::hex_text(s.parent));
    write_member(w, "kind", std::string_view{s.sent ? "sent" : "received"});
    write_member(w, "verb", to_string(s.verb));
    write_member(w, "target", std::string_view{s.target});
    write_member(w, "task", std::string_view{s.task});
    if (!s.next.empty()) {
        write_member(w, "next", std::string_view{s.next});
    }
    write_member(w, "start_us", in_us(s.begun - from));
    if (!s.sent) {
        write_member(w, "queue_us", in_us(s.queued));
        write_member(w, "run_us", in_us(s.ran));
    }
    if (!s.outcome.empty()) {
        write_member(w, "total_us", in_us(s.over - s.begun));
        write_member(w, "outcome", s.outcome);
    }
    w.end_object();
}

} // namespace cles::core

namespace cles {

const detail::tracing_part* tracing() noexcept {
    static constexpr detail::tracing_part part{
        [](const core::node_state& host, const core::clock& time) -> std::shared_ptr<core::span_recorder> {
            const auto seed = std::hash<std::string>{}(host.name + host.epoch) ^ host.first_datagram_id;
            return std::make_shared<core::span_log>(host.name, time, seed);
        }};
    return &part;
}

} // namespace cles
