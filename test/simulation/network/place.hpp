// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/agenda.hpp"

#include <deque>
#include <memory>
#include <string>
#include <utility>

namespace cles::simulation {

/// Where something runs: one run of a node, or a client. When it is gone, nothing of it happens any more; while it is
/// frozen, as a stopped process is, all that comes waits. It has a clock of its own, which may be ahead.
class place : public std::enable_shared_from_this<place> {
  public:
    place(agenda& time, unsigned host, std::string name) : time_(time), host_(host), name_(std::move(name)) {}
    place(const place&) = delete;
    place& operator=(const place&) = delete;
    virtual ~place() = default;

    [[nodiscard]] unsigned host() const noexcept { return host_; }
    [[nodiscard]] const std::string& name() const noexcept { return name_; }
    [[nodiscard]] agenda& time() const noexcept { return time_; }
    [[nodiscard]] time_point now() const { return time_.now() + ahead_; }

    /// Does something here: now, or when it goes on.
    void run(agenda::action what) {
        if (frozen_) {
            waiting_.push_back(std::move(what));
        } else {
            what();
        }
    }
    /// Something has arrived at a socket here.
    void receive(agenda::action what) {
        constexpr std::size_t max_unread = 256; // what the system keeps for a process that does not fetch it
        if (waiting_.size() < max_unread) {
            run(std::move(what));
        }
    }
    /// By its own clock.
    void at(time_point when, agenda::action what) { at_true(when - ahead_, std::move(what)); }
    /// By that of the network.
    void at_true(time_point when, agenda::action what) {
        time_.at(when, [weak = weak_from_this(), what = std::move(what)]() mutable {
            if (const auto self = weak.lock()) {
                self->run(std::move(what));
            }
        });
    }
    void later(std::chrono::nanoseconds by, agenda::action what) { at(now() + by, std::move(what)); }

    void freeze() {
        if (!std::exchange(frozen_, true)) {
            frozen_at_ = now();
        }
    }
    void thaw() {
        if (!frozen_) {
            return;
        }
        const auto keep = shared_from_this();
        frozen_ = false;
        thawed_ = now();
        back_ = thawed_ - frozen_at_ > long_absence ? thawed_ : back_;
        while (!waiting_.empty() && !frozen_) {
            const auto next = std::move(waiting_.front());
            waiting_.pop_front();
            run(next);
        }
    }
    /// Its clock goes ahead at once.
    void jump(std::chrono::nanoseconds by) {
        ahead_ += by;
        thawed_ = now();
        back_ = by > long_absence ? thawed_ : back_;
        run([this] { after_jump(); });
    }
    [[nodiscard]] bool frozen() const noexcept { return frozen_; }
    /// Whether what happens now could not have happened before.
    [[nodiscard]] bool was_frozen_until_now() const { return thawed_ == now(); }
    /// When it last went on, and when after so long that it must have noticed.
    [[nodiscard]] time_point thawed_at() const noexcept { return thawed_; }
    [[nodiscard]] time_point back_since() const noexcept { return back_; }

    static constexpr std::chrono::milliseconds long_absence{1'500};

  private:
    virtual void after_jump() {}

    agenda& time_;
    unsigned host_;
    std::string name_;
    std::deque<agenda::action> waiting_;
    std::chrono::nanoseconds ahead_{0};
    time_point frozen_at_{};
    time_point thawed_{};
    time_point back_{};
    bool frozen_ = false;
};

} // namespace cles::simulation
