// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "simulation/network/agenda.hpp"

#include <deque>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::simulation {

class link_security;

/// Calls `what` with the object, unless that has been destroyed.
template <class Object, class Action>
auto if_alive(std::weak_ptr<Object> weak, Action what) {
    return [weak = std::move(weak), what = std::move(what)](auto... arguments) {
        if (const auto self = weak.lock()) {
            what(*self, arguments...);
        }
    };
}

/// A simulated process: one incarnation of a node, or a client. After it has ended, nothing of it runs any more; while
/// it is frozen, like a stopped process, everything that arrives waits. It has its own clock, which may be ahead.
class place : public std::enable_shared_from_this<place> {
  public:
    place(agenda& time, unsigned host, std::string name) : time_(time), host_(host), name_(std::move(name)) {}
    place(const place&) = delete;
    place& operator=(const place&) = delete;
    virtual ~place() = default;

    [[nodiscard]] unsigned host() const noexcept { return host_; }
    [[nodiscard]] const std::string& name() const noexcept { return name_; }
    [[nodiscard]] agenda& time() const noexcept { return time_; }
    /// Null without security.
    [[nodiscard]] virtual link_security* security() noexcept { return nullptr; }
    /// A line is about to leave by a link, or has arrived by a datagram.
    virtual void on_link_sends(const identity& /*to*/, std::string_view) {}
    virtual void on_link_receives(const identity& /*from*/, std::string_view) {}
    [[nodiscard]] time_point now() const { return time_.now() + ahead_; }

    /// Runs an action here: now, or when the process continues.
    void run(agenda::action what) {
        if (frozen_) {
            waiting_.push_back(std::move(what));
        } else {
            what();
        }
    }
    /// Something has arrived at a socket here.
    void receive(agenda::action what) {
        constexpr std::size_t max_unread = 256; // what the system buffers for a process that does not read it
        if (waiting_.size() < max_unread) {
            run(std::move(what));
        }
    }
    /// By the process's own clock.
    void at(time_point when, agenda::action what) { at_true(when - ahead_, std::move(what)); }
    /// By the clock of the network.
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
    void freeze_for(std::chrono::nanoseconds span) {
        freeze();
        time_.later(span, if_alive(weak_from_this(), [](place& self) { self.thaw(); }));
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
    /// Its clock jumps ahead.
    void jump(std::chrono::nanoseconds by) {
        ahead_ += by;
        thawed_ = now();
        back_ = by > long_absence ? thawed_ : back_;
        run([this] { after_jump(); });
    }
    [[nodiscard]] bool frozen() const noexcept { return frozen_; }
    /// Whether what happens now could not have happened earlier.
    [[nodiscard]] bool was_frozen_until_now() const { return thawed_ == now(); }
    /// When it last continued, and when it last did after a time so long that it must have noticed.
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
