// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/deadlines.hpp"

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// How long each binding of a source lives that came by datagram: until its lease runs out, unless it is renewed.
class leases {
  public:
    /// `over` is told the path of a binding whose lease has run out.
    leases(deadline_queue& deadlines, std::function<void(const std::string&)> over)
        : deadlines_(deadlines), over_(std::move(over)) {}

    /// Begins a lease, or renews it.
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
            all.drop(ended); // ends this
            all.over_(ended);
        }

        leases& owner;
        std::string path;
    };

    deadline_queue& deadlines_;
    std::function<void(const std::string&)> over_;
    std::map<std::string, std::unique_ptr<lease>, std::less<>> open_;
};

} // namespace cles::core
