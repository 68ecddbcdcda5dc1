// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>

namespace cles::core {

/// Events that nobody has fetched yet. Past its bounds the oldest values go, and are made up for by a gap; of losses
/// and returns of the publisher only the latest are kept.
class feed_queue {
  public:
    feed_queue(std::size_t most_values, std::size_t most_bytes) noexcept
        : most_values_(most_values), most_bytes_(most_bytes) {}

    void push(const detail::raw_event& event);
    [[nodiscard]] bool empty() const noexcept { return entries_.empty() && shed_ == 0; }
    /// Hands the oldest event to `deliver`, which may push and pop.
    template <class F>
    void pop(F&& deliver) {
        if (shed_ != 0) {
            const detail::raw_event gap{.kind = feed_event::gap, .missed = shed_};
            shed_ = 0;
            deliver(gap);
            return;
        }
        const auto e = std::move(entries_.front());
        entries_.pop_front();
        forget(e);
        deliver(detail::raw_event{.kind = e.kind,
                                  .body = e.body,
                                  .checked = true,
                                  .publisher = e.publisher,
                                  .seq = e.seq,
                                  .missed = e.missed,
                                  .text = e.text});
    }

  private:
    struct entry {
        feed_event kind;
        std::string body;
        std::string publisher;
        std::uint64_t seq;
        std::uint64_t missed;
        std::string text;
    };
    static bool is_value(const entry& e) noexcept {
        return e.kind == feed_event::update || e.kind == feed_event::current;
    }
    static bool is_news(const entry& e) noexcept { return e.kind == feed_event::lost || e.kind == feed_event::rebound; }
    void forget(const entry& e) noexcept;
    void shed_oldest_value();
    void shed_oldest_news();

    std::size_t most_values_;
    std::size_t most_bytes_;
    std::deque<entry> entries_;
    std::size_t values_ = 0;
    std::size_t news_ = 0; // losses and returns
    std::size_t bytes_ = 0;
    std::uint64_t shed_ = 0;
};

} // namespace cles::core
