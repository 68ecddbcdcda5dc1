// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string_view>

namespace cles::core {

class topic;

/// Where the peer of a link finds what it is bound to: what the node publishes, or what it passes on.
class topic_source {
  public:
    topic_source() = default;
    topic_source(const topic_source&) = delete;
    topic_source& operator=(const topic_source&) = delete;

    /// The topic, or null.
    [[nodiscard]] virtual topic* find(std::string_view path) noexcept = 0;
    /// A binder has gone; the topic may go too.
    virtual void release(topic& t) = 0;
    /// A binder has taken what waited for it.
    virtual void admit(topic& t) = 0;

  protected:
    ~topic_source() = default;
};

} // namespace cles::core
