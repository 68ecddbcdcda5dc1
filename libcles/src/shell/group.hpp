// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include "core/group_intake.hpp"
#include "core/group_output.hpp"
#include "port/network_interface.hpp"
#include "shell/group_place.hpp"

#include <deque>
#include <string>
#include <string_view>

namespace cles::shell {

class local_node;

/// A service's part in its multicast group: a place by each of its interfaces, and what it takes in by all of them.
class group final : public core::group_sender {
  public:
    /// Joins. \throws cles::error: `invalid_url`, `insecure_listen`, or the system's code
    group(local_node& host, const multicast_options& where, bool insecure);

    /// Begins to listen; to be called once.
    void start();
    /// Says goodbye, leaves, and ends the feeds; repeating it does nothing.
    void stop();
    /// To all nodes of the group, by each interface. False where it was sent by none.
    bool send(std::string_view line) override;
    [[nodiscard]] core::group_intake& intake() noexcept { return intake_; }
    [[nodiscard]] std::deque<group_place>& places() noexcept { return places_; }
    /// The names of the interfaces: "lo, eth0".
    [[nodiscard]] const std::string& interfaces() const noexcept { return interfaces_; }

  private:
    void join(const core::network_interface& by, const multicast_options& where, bool insecure);
    void join_all(const multicast_options& where, bool insecure);
    void join_automatic(const multicast_options& where, bool insecure);

    local_node& host_;
    core::group_intake intake_;
    std::deque<group_place> places_; // which do not move
    std::string interfaces_;
};

} // namespace cles::shell
