// SPDX-License-Identifier: BSL-1.0
#include "node/flush_scheduler.hpp"

#include "node/publish/binding.hpp"

namespace cles::core {

void send_updates(unsent_topics& unsent, publications& published, time_point now) {
    auto topics = unsent.take();
    for (auto* t : topics) {
        t->drain(now);
    }
    // The publications below may retire nouns that have neither subscribers nor waiters.
    std::erase_if(topics, [](topic* t) { return t->waiters().empty(); });
    for (auto* t : topics) {
        published.admit(*t);
    }
    unsent.reuse(std::move(topics));
}

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
        if (!collecting_) {
            schedule_turn();
        }
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
    const auto now = node_.time.now();
    host_.drain_routing(now);
    if (host_.stopped()) {
        return;
    }
    send_updates(node_.unsent_relayed, node_.published, now);
    const auto gone = publish(false);
    flush_waiting([](flushable& one) {
        one.flush();
        return true;
    });
    if (gone) { // as of now: writing to many subscribers takes longer than updates wait
        coalescer_.gone(*gone, node_.time.now());
    }
}

std::optional<std::uint64_t> flush_scheduler::publish(bool alone) {
    if (node_.unsent.empty()) {
        return std::nullopt;
    }
    const auto now = node_.time.now();
    if (alone ? !coalescer_.alone(now) : coalescer_.waits(node_.unsent.updates(), now)) {
        return std::nullopt;
    }
    const scoped_flag during{scheduled_}; // it is flushed right after
    send_updates(node_.unsent, node_.published, now);
    return node_.unsent.updates();
}

void flush_scheduler::write_single_messages() {
    if (host_.stopped()) {
        return;
    }
    const auto gone = publish(true);
    flush_waiting([&](flushable& one) { return (gone || one.has_single_request()) && one.write(); });
    if (gone) {
        coalescer_.gone(*gone, node_.time.now());
    }
}

void flush_scheduler::request_flush_if_pending() {
    if (!node_.unsent.empty() || !node_.unsent_relayed.empty() || !waiting_.empty()) {
        schedule_turn();
    }
}

} // namespace cles::core
