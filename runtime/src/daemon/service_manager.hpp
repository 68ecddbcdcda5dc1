// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <string>
#include <string_view>
#include <utility>

namespace cles::runtime {

/// Tells the service manager how the daemon is, as sd_notify(3) does: one datagram to the Unix socket that
/// NOTIFY_SOCKET names, an abstract one where the name begins with '@'.
class notifier {
  public:
    /// \param socket what NOTIFY_SOCKET says; empty: nobody is told
    explicit notifier(std::string socket) : socket_(std::move(socket)) {}

    /// Lines of KEY=VALUE, such as "READY=1". False where it could not be told; nobody to tell is no failure.
    [[nodiscard]] bool tell(std::string_view state) const;

    [[nodiscard]] bool ready() const { return tell("READY=1"); }
    /// \param now by the monotonic clock, which tells systemd this reload from earlier ones
    [[nodiscard]] bool reloading(std::chrono::steady_clock::time_point now) const;
    [[nodiscard]] bool stopping() const { return tell("STOPPING=1"); }

  private:
    std::string socket_;
};

} // namespace cles::runtime
