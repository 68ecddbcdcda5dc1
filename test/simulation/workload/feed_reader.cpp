// SPDX-License-Identifier: BSL-1.0
#include "simulation/workload/feed_reader.hpp"

#include <charconv>
#include <utility>

namespace cles::simulation {
namespace {

std::uint64_t big_number_after(std::string_view json, std::string_view name) {
    const auto at = json.find(name);
    std::uint64_t value = 0;
    if (at != std::string_view::npos) {
        std::from_chars(json.data() + at + name.size(), json.data() + json.size(), value);
    }
    return value;
}

} // namespace

published_mark mark_of(std::string_view json) {
    return {.number = big_number_after(json, "{\"n\":"),
            .run = static_cast<unsigned>(big_number_after(json, "\"run\":"))};
}

/// One wait for an event.
class feed_reader::next_event final : public detail::pending_event {
  public:
    explicit next_event(std::weak_ptr<feed_reader> owner) : owner_(std::move(owner)) {}
    bool deliver(const detail::raw_event& event) override {
        if (!event.has_json()) {
            return false;
        }
        const std::unique_ptr<next_event> self{this};
        if (const auto owner = owner_.lock()) {
            owner->take(event);
        }
        return true;
    }
    void fail(boost::system::error_code, std::string_view) override { delete this; }
    void discard() noexcept override { delete this; }

  private:
    std::weak_ptr<feed_reader> owner_;
};

void feed_reader::begin() {
    begun_ = true;
    node_.later({}, [self = shared_from_this()] { self->fetch(); });
}

void feed_reader::hold(std::chrono::milliseconds time) {
    held_ = true;
    node_.later(time, [weak = weak_from_this()] {
        if (const auto self = weak.lock()) {
            self->held_ = false;
            self->fetch();
        }
    });
}

void feed_reader::fetch() {
    if (held_ || waits_ || !begun_ || mail().closed()) {
        return;
    }
    waits_ = true;
    if (mail().next(core::feed_mailbox::event_ptr{new next_event{weak_from_this()}})) {
        node_.later({}, [self = shared_from_this()] { self->mail().pump(); });
    }
}

void feed_reader::take(const detail::raw_event& event) {
    waits_ = false;
    if (!std::exchange(fetch_planned_, true)) {
        node_.later(slow_, [weak = weak_from_this()] {
            if (const auto self = weak.lock()) {
                self->fetch_planned_ = false;
                self->fetch();
            }
        });
    }
    on_event(event);
}

} // namespace cles::simulation
