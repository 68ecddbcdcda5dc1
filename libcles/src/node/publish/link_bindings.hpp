// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/publish/topic.hpp"

#include <cstddef>
#include <string_view>
#include <vector>

namespace cles::core {

/// The bindings of one link's peer.
class link_bindings {
  public:
    link_bindings(topic_source& source, subscriber& target) noexcept : source_(source), target_(target) {}
    link_bindings(const link_bindings&) = delete;
    link_bindings& operator=(const link_bindings&) = delete;

    [[nodiscard]] bool has(std::string_view path) noexcept;
    /// Binds, or changes the terms of a binding.
    void bind(topic& t, binding::terms wanted);
    /// Does nothing if it is not bound.
    void unbind(std::string_view path);
    void clear();
    /// Sends pending updates: the link has room again.
    void drain(time_point now);

    [[nodiscard]] std::size_t size() const noexcept { return topics_.size(); }
    [[nodiscard]] bool empty() const noexcept { return topics_.empty(); }

  private:
    void release(topic& t);

    topic_source& source_;
    subscriber& target_;
    std::vector<topic*> topics_;
};

} // namespace cles::core
