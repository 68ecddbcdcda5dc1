// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include "core/group_intake.hpp"
#include "core/group_output.hpp"
#include "core/group_session.hpp"
#include "port/group_port.hpp"
#include "port/group_source.hpp"
#include "port/network_interface.hpp"

#include <memory>
#include <string_view>

namespace cles::shell {

class local_node;

/// A service's place in its multicast group by one interface.
class group_place final : public core::group_output, private core::group_listener {
  public:
    /// Joins. \throws boost::system::system_error
    group_place(local_node& host, core::group_intake& intake, const core::network_interface& by,
                const multicast_options& where);
    ~group_place();

    /// Begins to listen; to be called once.
    void start();
    /// Leaves; repeating it does nothing.
    void stop();
    /// To all nodes of the group that hear it by this interface. What is not sent is counted.
    bool send(std::string_view line) override;
    void send_all(std::string_view lines) override;
    [[nodiscard]] bool has_room() const override { return port_->unsent() == 0; }
    /// Where what is sent here comes from.
    [[nodiscard]] const core::group_source& source() const noexcept { return port_->source(); }

  private:
    bool put(std::string_view lines);
    void on_datagram(const core::group_datagram& datagram) override;
    void on_batch() override;
    void on_room() override;

    local_node& host_;
    std::shared_ptr<core::group_port> port_;
    core::group_session session_;
};

} // namespace cles::shell
