// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "federation/bridge_output.hpp"
#include "federation/received_message.hpp"
#include "federation/subject.hpp"
#include "port/log_budget.hpp"
#include "protocol/reply_line.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace cles::bridging {

/// What has crossed NATS, and what has not.
struct bridge_figures {
    std::uint64_t requests_sent = 0;
    std::uint64_t requests_taken = 0;
    std::uint64_t updates_sent = 0;
    std::uint64_t updates_received = 0;
    std::uint64_t updates_dropped = 0;  ///< not sent: too long, or too much waits already
    std::uint64_t messages_refused = 0; ///< not of this protocol, or repeated
    std::uint64_t bridges_lost = 0;
    std::uint64_t connections = 0;
};

/// The connection of a bridge to NATS: the identity that it has there, and the messages that it publishes.
class bridge_connection {
  public:
    bridge_connection(std::string pool, bridge_output& out) : self_{std::move(pool), {}}, out_(out) {}

    void open(std::string instance, std::size_t max_message);
    void close() noexcept { is_open_ = false; }
    [[nodiscard]] bool is_open() const noexcept { return is_open_; }
    [[nodiscard]] const bridge_id& self() const noexcept { return self_; }
    [[nodiscard]] const std::string& pool() const noexcept { return self_.pool; }
    /// The longest message, in bytes.
    [[nodiscard]] std::size_t max_message() const noexcept { return max_message_; }
    [[nodiscard]] bool fits(std::string_view message) const noexcept { return message.size() <= max_message_; }

    /// Returns false if too much waits already.
    bool publish(std::string subject, std::string message, std::string reply = {});
    /// A short message without which others would wait in vain.
    void publish_short(std::string subject, std::string message, std::string reply = {});
    /// A reply after `head`; a short failure has room in any case. Returns false if it is too long, or too much waits.
    bool answer(const std::string& to, std::string_view reply, std::string_view head = {});
    void acknowledge(const std::string& to);
    /// Nothing if nobody waits for a reply.
    void refuse(std::string_view to, const protocol::failure& why);
    /// A line for another bridge.
    void send_control(const bridge_id& to, std::string line);
    /// The request of this bridge with that number is cancelled, or what it has bound is over.
    void send_cancel(const bridge_id& to, std::uint64_t number);

    /// The message has no effect.
    void drop(const received_message& m, std::string_view why);
    [[nodiscard]] bridge_figures& counts() noexcept { return counts_; }
    [[nodiscard]] const bridge_figures& counts() const noexcept { return counts_; }

  private:
    bridge_id self_;
    bridge_output& out_;
    std::size_t max_message_ = 0;
    bool is_open_ = false;
    core::log_budget dropped_; // by the member that has sealed the message, if one has
    bridge_figures counts_;
};

} // namespace cles::bridging
