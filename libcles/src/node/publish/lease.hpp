// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/backoff.hpp"
#include "node/base/deadlines.hpp"

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// The leases of the bindings that one source has made by datagram: a binding ends when its lease expires, unless it is
/// renewed.
class leases {
  public:
    /// `over` is called with the path of a binding whose lease has expired.
    leases(deadline_queue& deadlines, std::function<void(const std::string&)> over)
        : deadlines_(deadlines), over_(std::move(over)) {}

    /// Starts or renews a lease.
    void set(std::string_view path, time_point until) {
        auto found = open_.find(path);
        if (found == open_.end()) {
            found = open_.emplace(std::string{path}, std::make_unique<lease>(*this, std::string{path})).first;
        }
        deadlines_.arm(*found->second, until);
    }
    void drop(std::string_view path) {
        if (const auto found = open_.find(path); found != open_.end()) {
            open_.erase(found);
        }
    }
    void clear() { open_.clear(); }

  private:
    struct lease final : deadline {
        lease(leases& all, std::string what) : owner(all), path(std::move(what)) {}
        void on_deadline(time_point) override {
            const auto ended = path;
            auto& all = owner;
            all.drop(ended); // destroys this
            all.over_(ended);
        }

        leases& owner;
        std::string path;
    };

    deadline_queue& deadlines_;
    std::function<void(const std::string&)> over_;
    std::map<std::string, std::unique_ptr<lease>, std::less<>> open_;
};

/// Decides when to renew a leased binding: after a third of the lease, or a little earlier at random, so that many
/// renewals do not coincide.
class renewal final : private deadline {
  public:
    class keeper {
      public:
        keeper() = default;
        keeper(const keeper&) = delete;
        keeper& operator=(const keeper&) = delete;
        /// Sends the BIND again; `renewed`, `retry_later` or `stop` follows by `until`.
        virtual void renew(time_point until) = 0;

      protected:
        ~keeper() = default;
    };

    renewal(keeper& owner, deadline_queue& deadlines, std::uint32_t seed) noexcept
        : owner_(owner), deadlines_(deadlines), jitter_(seed) {}

    /// The binding that was requested at `asked` has been made, with this lease.
    void begin(time_point asked, std::chrono::milliseconds lease);
    /// The publisher has renewed the binding. The lease counts from the request, not from the reply, so that it never
    /// ends at the publisher before it does here.
    void renewed(time_point asked);
    /// The publisher was busy: tries again in the remaining time. False if none is left.
    bool retry_later(time_point now);
    void stop() noexcept { deadlines_.disarm(*this); }

    [[nodiscard]] time_point until() const noexcept { return until_; }

  private:
    void on_deadline(time_point now) override;

    keeper& owner_;
    deadline_queue& deadlines_;
    jitter jitter_;
    std::chrono::milliseconds lease_{0};
    time_point until_{};
};

} // namespace cles::core
