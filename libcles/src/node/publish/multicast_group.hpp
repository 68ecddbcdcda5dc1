// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include "node/publish/group_dispatcher.hpp"
#include "node/publish/group_output.hpp"
#include "node/publish/group_session.hpp"
#include "port/group_port.hpp"
#include "port/group_source.hpp"
#include "port/network_interface.hpp"

#include <deque>
#include <memory>
#include <string>
#include <string_view>

namespace cles::core {

class local_node;

/// A service's endpoint in its multicast group on one interface.
class group_endpoint final : public core::group_output, private core::group_listener {
  public:
    /// Joins the group. \throws boost::system::system_error
    group_endpoint(local_node& host, core::group_dispatcher& dispatcher, const core::network_interface& by,
                   const multicast_options& where);
    ~group_endpoint();

    /// Starts to receive. Call once.
    void start();
    /// Leaves the group. Idempotent.
    void stop();
    /// Sends to all nodes of the group that this interface reaches. What is not sent is counted.
    bool send(std::string_view line) override;
    void send_all(std::string_view lines) override;
    [[nodiscard]] bool has_room() const override { return port_->unsent() == 0; }
    /// The source of what is sent here.
    [[nodiscard]] const core::group_source& source() const noexcept { return port_->source(); }

  private:
    bool put(std::string_view lines);
    void on_datagram(const core::group_datagram& datagram) override;
    void on_room() override;

    local_node& host_;
    std::shared_ptr<core::group_port> port_;
    core::group_session session_;
};

class local_node;

/// A service's membership in its multicast group: an endpoint on each interface, and one dispatcher for all.
class multicast_group final : public core::group_sender {
  public:
    /// Joins the group. \throws cles::error: `invalid_url`, `insecure_listen`, or the system's code
    multicast_group(local_node& host, const multicast_options& where, bool insecure);

    /// Starts to receive. Call once.
    void start();
    /// Leaves the group and ends the feeds. Idempotent.
    void stop();
    /// Sends to all nodes of the group, on each interface. False if it was sent on none.
    bool send(std::string_view line) override;
    [[nodiscard]] core::group_dispatcher& dispatcher() noexcept { return dispatcher_; }
    [[nodiscard]] std::deque<group_endpoint>& endpoints() noexcept { return endpoints_; }
    /// The names of the interfaces: "lo, eth0".
    [[nodiscard]] const std::string& interfaces() const noexcept { return interfaces_; }

  private:
    void join(const core::network_interface& by, const multicast_options& where, bool insecure);
    void join_all(const multicast_options& where, bool insecure);
    void join_automatic(const multicast_options& where, bool insecure);

    local_node& host_;
    core::group_dispatcher dispatcher_;
    std::deque<group_endpoint> endpoints_; // its elements do not move
    std::string interfaces_;
};

} // namespace cles::core
