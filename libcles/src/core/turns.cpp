// SPDX-License-Identifier: BSL-1.0
#include "core/turns.hpp"

#include <algorithm>
#include <iterator>

namespace cles::core {

class turns::round {
  public:
    explicit round(turns& of) noexcept : of_(of), these_(std::exchange(of.waiting_, std::exchange(of.spare_, {}))) {}
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

    /// `flush` is asked of each; true: it is done with. While it runs it may begin to wait again.
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
    turns& of_;
    std::vector<std::shared_ptr<turn_taker>> these_;
};

void turns::ask() {
    if (!asked_ && !host_.stopped()) {
        host_.post_turn();
        asked_ = true;
    }
}

void turns::flush_soon(turn_taker& which) {
    // Once stopped there are no more turns; `stop` itself flushes whatever is said on the way, like a farewell.
    if (!which.waits_ && !host_.stopped()) {
        waiting_.push_back(which.share());
        which.waits_ = true;
        ask();
    }
}

void turns::stop() {
    for (const auto& each : std::exchange(waiting_, {})) {
        each->flush();
    }
}

void turns::turn() {
    asked_ = false;
    if (host_.stopped()) {
        return;
    }
    try {
        carry_on();
    } catch (...) {
        ask_if_something_waits();
        host_.settle();
        throw;
    }
    ask_if_something_waits();
    host_.settle();
}

void turns::carry_on() {
    host_.route_on(time_.now());
    if (host_.stopped()) {
        return;
    }
    const auto gone = publish(false);
    round{*this}.each([](turn_taker& one) {
        one.flush();
        return true;
    });
    if (gone) {
        gathering_.gone(*gone, time_.now()); // not before: to write to many binders takes longer than updates may wait
    }
}

std::optional<std::uint64_t> turns::publish(bool alone) {
    auto& published = host_.published();
    if (!published.dirty()) {
        return std::nullopt;
    }
    const auto now = time_.now();
    if (alone ? !gathering_.alone(now) : gathering_.waits(published.published_to_binders(), now)) {
        return std::nullopt;
    }
    const posts_none during{*this}; // it is flushed right behind
    published.drain(now);
    return published.published_to_binders();
}

void turns::write_what_is_alone() {
    if (host_.stopped()) {
        return;
    }
    const auto gone = publish(true);
    round{*this}.each([&](turn_taker& one) { return (gone || one.asks_alone()) && one.write(); });
    if (gone) {
        gathering_.gone(*gone, time_.now());
    }
}

void turns::ask_if_something_waits() {
    if (host_.published().dirty() || !waiting_.empty()) {
        ask();
    }
}

} // namespace cles::core
