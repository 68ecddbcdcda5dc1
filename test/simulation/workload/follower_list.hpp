// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/world/node_run.hpp"
#include "simulation/world/plan.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

namespace cles::simulation {

/// Those who follow, each by its label, and what a plan does to any of them.
template <class Follower>
class follower_list {
  public:
    using pointer = std::shared_ptr<Follower>;

    void add(pointer made) { all_.push_back(std::move(made)); }
    [[nodiscard]] pointer find(std::uint32_t label) const {
        const auto found = std::find_if(all_.begin(), all_.end(), [&](const auto& f) { return f->label() == label; });
        return found == all_.end() ? nullptr : *found;
    }
    void hold(const action& a) {
        if (const auto f = find(a["feed"])) {
            f->hold(std::chrono::milliseconds{a["for"]});
        }
    }
    void leave(const action& a) {
        if (const auto f = find(a["feed"]); f && !f->at().frozen()) {
            f->at().run([&] { f->close(); });
            std::erase(all_, f);
        }
    }
    void forget(const node_run& crashed) {
        std::erase_if(all_, [&](const auto& f) { return &f->at() == &crashed; });
    }
    void clear() { all_.clear(); }

    [[nodiscard]] auto begin() const { return all_.begin(); }
    [[nodiscard]] auto end() const { return all_.end(); }

  private:
    std::vector<pointer> all_;
};

} // namespace cles::simulation
