// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/topic.hpp"
#include "core/topic_source.hpp"

#include <cstddef>
#include <string_view>
#include <vector>

namespace cles::core {

/// What the peer of one link is bound to.
class link_bindings {
  public:
    link_bindings(topic_source& source, binder& target) noexcept : source_(source), target_(target) {}
    link_bindings(const link_bindings&) = delete;
    link_bindings& operator=(const link_bindings&) = delete;

    [[nodiscard]] bool has(std::string_view path) noexcept;
    /// Binds, or changes the terms of what is bound.
    void bind(topic& t, binding::terms wanted);
    /// Does nothing where it is not bound.
    void unbind(std::string_view path);
    void clear();
    /// Puts updates that wait to the link, which has room again.
    void drain(time_point now);

    [[nodiscard]] std::size_t size() const noexcept { return topics_.size(); }
    [[nodiscard]] bool empty() const noexcept { return topics_.empty(); }

  private:
    void release(topic& t);

    topic_source& source_;
    binder& target_;
    std::vector<topic*> topics_;
};

} // namespace cles::core
