// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/base/deadlines.hpp"

#include <chrono>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

namespace cles::core {

class topic;

/// The end of a link that receives updates.
class subscriber {
  public:
    subscriber() = default;
    subscriber(const subscriber&) = delete;
    subscriber& operator=(const subscriber&) = delete;
    /// Whether it takes more updates now; if not, it requests the rest when it does.
    [[nodiscard]] virtual bool takes_updates() const = 0;
    virtual void put_updates(std::string_view lines) = 0;

  protected:
    ~subscriber() = default;
};

/// One subscriber's position in a topic.
class binding final : public deadline {
  public:
    struct terms {
        std::chrono::milliseconds every{0};
        std::uint32_t keep = 64;

        bool operator==(const terms&) const = default;
    };

    binding(topic& source, subscriber& target, terms wanted) : source_(source), target_(target), terms_(wanted) {}

    /// Sends the subscriber its pending updates, as far as it takes them.
    void drain(time_point now);
    void set_terms(terms wanted) noexcept { terms_ = wanted; }
    [[nodiscard]] subscriber& target() const noexcept { return target_; }
    /// Whether updates are pending for it.
    [[nodiscard]] bool is_behind() const noexcept;

  private:
    friend class topic_bindings;
    void on_deadline(time_point now) override;
    void drain_newest(time_point now);
    void drain_all();

    topic& source_;
    subscriber& target_;
    terms terms_;
    std::uint64_t seen_ = 0; // the last update that it was sent, or that was dropped for it
    time_point next_due_{};  // with `every`: no update earlier
};

/// The subscribers of a topic and their positions.
class topic_bindings {
  public:
    explicit topic_bindings(topic& of) noexcept : of_(of) {}
    topic_bindings(const topic_bindings&) = delete;
    topic_bindings& operator=(const topic_bindings&) = delete;

    binding& bind(subscriber& target, binding::terms wanted);
    /// Returns false if it was not bound.
    bool unbind(subscriber& target);
    [[nodiscard]] binding* find(const subscriber& target) noexcept;
    [[nodiscard]] bool empty() const noexcept { return bindings_.empty(); }
    /// Whether updates are pending for one of them.
    [[nodiscard]] bool is_behind() const noexcept;

    /// Sends all subscribers their pending updates, as far as they take them.
    void drain(time_point now);
    /// Records the positions after one was drained on its own.
    void refresh() noexcept;
    /// Whether one more update fits into the queue of every subscriber.
    [[nodiscard]] bool has_room() const noexcept;
    /// Whether one of them takes every update.
    [[nodiscard]] bool is_unthinned() const noexcept { return unthinned_; }
    /// The first update that one of them still needs.
    [[nodiscard]] std::uint64_t first_needed() const noexcept;

  private:
    topic& of_;
    std::vector<std::unique_ptr<binding>> bindings_;
    std::uint64_t slowest_ = 0;    // the lowest `seen_` of the bindings that take every update
    std::uint64_t room_until_ = 0; // the last number that fits into each one's `keep`
    std::uint32_t max_keep_ = 0;
    bool unthinned_ = false; // there are such bindings
};

} // namespace cles::core
