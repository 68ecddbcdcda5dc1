// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <string>
#include <string_view>
#include <utility>

namespace cles::runtime {

/// Notifies the service manager of the daemon's state, as sd_notify(3) does: with one datagram to the Unix socket that
/// NOTIFY_SOCKET names, an abstract one if the name begins with '@'.
class service_manager {
  public:
    /// \param socket the value of NOTIFY_SOCKET; empty: there is no service manager
    explicit service_manager(std::string socket) : socket_(std::move(socket)) {}

    /// Sends lines of KEY=VALUE, such as "READY=1". False if that fails; without a service manager it does not.
    [[nodiscard]] bool notify(std::string_view state) const;

    [[nodiscard]] bool ready() const { return notify("READY=1"); }
    /// \param now of the monotonic clock, by which systemd distinguishes reloads
    [[nodiscard]] bool reloading(std::chrono::steady_clock::time_point now) const;
    [[nodiscard]] bool stopping() const { return notify("STOPPING=1"); }

  private:
    std::string socket_;
};

} // namespace cles::runtime
