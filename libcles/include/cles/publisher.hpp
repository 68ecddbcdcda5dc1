// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert_wrapped.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles {

namespace detail {

/// Receives a publisher's updates; implemented by the service, and by the host of a plugin.
class update_sink {
  public:
    virtual ~update_sink() = default;
    virtual void publish(std::string_view noun, std::string_view json) = 0;
};

} // namespace detail

/// Publishes updates from any thread. Copies may be kept by handlers, threads and jobs. Made by
/// `registrar::make_publisher`, so the same code works in an application and in a plugin.
///
/// `update` passes the value to the service, which sends it soon on its executor. It does not block and reports no
/// errors. Updates are dropped if the service has ended, if it refuses the noun, and, oldest first, if they are
/// published faster than they can be sent; the last two cases are logged. On the service's own executor,
/// `service::update` reports errors.
class publisher {
  public:
    explicit publisher(std::shared_ptr<detail::update_sink> to) noexcept : to_(std::move(to)) {}

    /// Publishes a value to all subscribers of the task (or of "task/parameter/...").
    /// \throws cles::error with `conversion` if it cannot be written as JSON, for example text that is not UTF-8
    template <class T>
    void update(std::string_view noun, const T& value) const {
        to_->publish(noun, detail::to_content(value));
    }

  private:
    std::shared_ptr<detail::update_sink> to_;
};

} // namespace cles
