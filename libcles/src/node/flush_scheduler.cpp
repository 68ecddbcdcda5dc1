// SPDX-License-Identifier: BSL-1.0
#include "node/flush_scheduler.hpp"

#include "node/publish/binding.hpp"
#include "node/publish/publications.hpp"
#include "node/publish/unsent_topics.hpp"

#include <algorithm>
#include <iterator>

namespace cles::core {

void send_updates(unsent_topics& unsent, publications& published, time_point now) {
    auto topics = unsent.take();
    for (auto* t : topics) {
        t->bindings().drain(now);
    }
    // The publications below may retire nouns that have neither subscribers nor waiters.
    std::erase_if(topics, [](topic* t) { return t->waiters().empty(); });
    for (auto* t : topics) {
        published.admit(*t);
    }
    unsent.reuse(std::move(topics));
}

class flush_scheduler::round {
  public:
    explicit round(flush_scheduler& of) noexcept
        : of_(of), these_(std::exchange(of.waiting_, std::exchange(of.spare_, {}))) {}
    round(const round&) = delete;
    round& operator=(const round&) = delete;
    ~round() {
        std::erase(these_, nullptr);
        if (!these_.empty()) {
            std::ranges::move(of_.waiting_, std::back_inserter(these_));
            of_.waiting_.swap(these_);
            these_.clear();
        }
        of_.spare_ = std::move(these_);
    }

    /// Calls `flush` for each; true: it is done. During the call it may start to wait again.
    template <class F>
    void each(F&& flush) {
        for (auto& place : these_) {
            auto one = std::exchange(place, nullptr);
            one->waits_ = false;
            if (!flush(*one) && !one->waits_) {
                one->waits_ = true;
                place = std::move(one);
            }
        }
    }

  private:
    flush_scheduler& of_;
    std::vector<std::shared_ptr<flushable>> these_;
};

void flush_scheduler::schedule_turn() {
    if (!scheduled_ && !host_.stopped()) {
        host_.post_flush();
        scheduled_ = true;
    }
}

void flush_scheduler::flush_soon(flushable& which) {
    // After `stop` there are no turns; `stop` itself flushes the output made on the way, such as a leave.
    if (!which.waits_ && !host_.stopped()) {
        waiting_.push_back(which.share());
        which.waits_ = true;
        schedule_turn();
    }
}

void flush_scheduler::stop() {
    for (const auto& each : std::exchange(waiting_, {})) {
        each->flush();
    }
}

void flush_scheduler::turn() {
    scheduled_ = false;
    if (host_.stopped()) {
        return;
    }
    try {
        run_turn();
    } catch (...) {
        request_flush_if_pending();
        host_.check_shutdown();
        throw;
    }
    request_flush_if_pending();
    host_.check_shutdown();
}

void flush_scheduler::run_turn() {
    const auto now = time_.now();
    host_.drain_routing(now);
    if (host_.stopped()) {
        return;
    }
    send_updates(host_.node().unsent_relayed, host_.node().published, now);
    const auto gone = publish(false);
    round{*this}.each([](flushable& one) {
        one.flush();
        return true;
    });
    if (gone) {
        coalescer_.gone(*gone, time_.now()); // afterwards: writing to many subscribers takes longer than updates wait
    }
}

std::optional<std::uint64_t> flush_scheduler::publish(bool alone) {
    auto& node = host_.node();
    if (node.unsent.empty()) {
        return std::nullopt;
    }
    const auto now = time_.now();
    if (alone ? !coalescer_.alone(now) : coalescer_.waits(node.unsent.updates(), now)) {
        return std::nullopt;
    }
    const post_suppressor during{*this}; // it is flushed right after
    send_updates(node.unsent, node.published, now);
    return node.unsent.updates();
}

void flush_scheduler::write_single_messages() {
    if (host_.stopped()) {
        return;
    }
    const auto gone = publish(true);
    round{*this}.each([&](flushable& one) { return (gone || one.has_single_request()) && one.write(); });
    if (gone) {
        coalescer_.gone(*gone, time_.now());
    }
}

void flush_scheduler::request_flush_if_pending() {
    const auto& node = host_.node();
    if (!node.unsent.empty() || !node.unsent_relayed.empty() || !waiting_.empty()) {
        schedule_turn();
    }
}

} // namespace cles::core
