// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string_view>

namespace cles::core {

/// Sends a node's messages to its multicast group.
class group_sender {
  public:
    group_sender() = default;
    group_sender(const group_sender&) = delete;
    group_sender& operator=(const group_sender&) = delete;
    /// Sends a line, its LF included, as one datagram. False if it was not sent: it is too large, or too much is
    /// pending.
    virtual bool send(std::string_view line) = 0;

  protected:
    ~group_sender() = default;
};

/// The same on one interface, where it is known how much is pending.
class group_output : public group_sender {
  public:
    /// Sends lines, none of them too large, each as one datagram, as far as there is room.
    virtual void send_all(std::string_view lines) {
        while (!lines.empty()) {
            const auto size = lines.find('\n') + 1;
            send(lines.substr(0, size));
            lines.remove_prefix(size);
        }
    }
    /// Whether nothing is pending. Otherwise `group_bindings::drain` is called once it has been sent.
    [[nodiscard]] virtual bool has_room() const = 0;

  protected:
    ~group_output() = default;
};

} // namespace cles::core
