// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/agenda.hpp"

#include <deque>
#include <memory>
#include <string>
#include <utility>

namespace cles::simulation {

/// Where something runs: one run of a node, or a client. When it is gone, nothing of it happens any more; while it is
/// frozen, as a stopped process is, all that comes waits.
class place : public std::enable_shared_from_this<place> {
  public:
    place(agenda& time, unsigned host, std::string name) : time_(time), host_(host), name_(std::move(name)) {}
    place(const place&) = delete;
    place& operator=(const place&) = delete;
    virtual ~place() = default;

    [[nodiscard]] unsigned host() const noexcept { return host_; }
    [[nodiscard]] const std::string& name() const noexcept { return name_; }
    [[nodiscard]] agenda& time() const noexcept { return time_; }
    [[nodiscard]] time_point now() const { return time_.now(); }

    /// Does something here: now, or when it goes on.
    void run(agenda::action what) {
        if (frozen_) {
            waiting_.push_back(std::move(what));
        } else {
            what();
            after();
        }
    }
    void at(time_point when, agenda::action what) {
        time_.at(when, [weak = weak_from_this(), what = std::move(what)]() mutable {
            if (const auto self = weak.lock()) {
                self->run(std::move(what));
            }
        });
    }
    void later(std::chrono::nanoseconds by, agenda::action what) { at(now() + by, std::move(what)); }

    void freeze() noexcept { frozen_ = true; }
    void thaw() {
        if (!frozen_) {
            return;
        }
        const auto keep = shared_from_this();
        frozen_ = false;
        thawed_ = now();
        while (!waiting_.empty() && !frozen_) {
            const auto next = std::move(waiting_.front());
            waiting_.pop_front();
            run(next);
        }
    }
    [[nodiscard]] bool frozen() const noexcept { return frozen_; }
    /// How much waits.
    [[nodiscard]] std::size_t waiting() const noexcept { return waiting_.size(); }
    /// Whether what happens now could not have happened before.
    [[nodiscard]] bool was_frozen_until_now() const { return thawed_ == now(); }

  private:
    /// Something has happened here.
    virtual void after() {}

    agenda& time_;
    unsigned host_;
    std::string name_;
    std::deque<agenda::action> waiting_;
    time_point thawed_{};
    bool frozen_ = false;
};

} // namespace cles::simulation
