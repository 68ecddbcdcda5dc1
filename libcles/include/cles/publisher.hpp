// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles {

namespace detail {

/// Where a publisher's updates go; implemented by the service, and by the host of a plugin.
class update_sink {
  public:
    virtual ~update_sink() = default;
    virtual void publish(std::string_view noun, std::string_view json) = 0;
};

} // namespace detail

/// Publishes updates from any thread, for as long as you like: copies may be kept by handlers, threads and jobs. Made
/// by `registrar::make_publisher`, so that the same code publishes in an application and in a plugin.
///
/// An update is handed to the service and sent soon, on its executor. Nothing blocks, and nothing is reported: what is
/// published after the service has gone is dropped, and so are the oldest where updates come faster than they can be
/// sent, or a noun that the service refuses; both are told in its log. On the service's own executor,
/// `service::update` says more.
class publisher {
  public:
    explicit publisher(std::shared_ptr<detail::update_sink> to) noexcept : to_(std::move(to)) {}

    /// Publishes a value to all that are bound to the task (or to "task/parameter/...").
    /// \throws cles::error with `conversion` where it cannot be written as JSON, as text that is not UTF-8
    template <class T>
    void update(std::string_view noun, const T& value) const {
        to_->publish(noun, to_json(value));
    }

  private:
    std::shared_ptr<detail::update_sink> to_;
};

} // namespace cles
