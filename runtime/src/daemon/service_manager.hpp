// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace cles::runtime {

/// Notifies the service manager of the daemon's state, as sd_notify(3) does: with one datagram to the Unix socket that
/// NOTIFY_SOCKET names, an abstract one if the name begins with '@'.
class service_manager {
  public:
    /// \param socket the value of NOTIFY_SOCKET; empty: there is no service manager
    /// \param watchdog how long it waits for `alive` before it starts the daemon again; zero: it does not
    explicit service_manager(std::string socket, std::chrono::microseconds watchdog = {})
        : socket_(std::move(socket)), watchdog_(watchdog) {}

    /// Sends lines of KEY=VALUE, such as "READY=1". False if that fails; without a service manager it does not.
    [[nodiscard]] bool notify(std::string_view state) const;

    [[nodiscard]] bool ready() const { return notify("READY=1"); }
    /// \param now of the monotonic clock, by which systemd distinguishes reloads
    [[nodiscard]] bool reloading(std::chrono::steady_clock::time_point now) const;
    [[nodiscard]] bool alive() const { return notify("WATCHDOG=1"); }
    /// How often `alive` has to be called, with time to spare; zero: never.
    [[nodiscard]] std::chrono::microseconds heartbeat() const noexcept {
        return socket_.empty() ? std::chrono::microseconds{} : watchdog_ / 2;
    }
    [[nodiscard]] bool stopping() const { return notify("STOPPING=1"); }

  private:
    std::string socket_;
    std::chrono::microseconds watchdog_;
};

/// How long the service manager waits for a heartbeat of the process `self`, by the values of WATCHDOG_USEC and
/// WATCHDOG_PID, as sd_watchdog_enabled(3) reads them; null: not set. Zero: it does not wait. At most a day.
[[nodiscard]] std::chrono::microseconds watchdog_of(const char* microseconds, const char* process, std::int64_t self);

} // namespace cles::runtime
