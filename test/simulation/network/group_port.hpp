// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/group_port.hpp"
#include "simulation/network/network.hpp"

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <set>
#include <string>
#include <string_view>

namespace cles::simulation {

class node_run;

/// A node's port in the simulated multicast group. The system accepts a limited number of datagrams at once; the rest
/// waits.
class group_port final : public core::group_port, public std::enable_shared_from_this<group_port> {
  public:
    group_port(network& net, node_run& process);

    void start(core::group_listener& owner) override;
    core::datagrams_done send(core::datagram_list all) override;
    void send_to(const core::group_source& to, std::string_view datagram) override;
    void receive_own() override {}
    [[nodiscard]] std::size_t unsent() const noexcept override { return unsent_; }
    void close() override;
    [[nodiscard]] const core::group_source& source() const noexcept override { return source_; }

    [[nodiscard]] const endpoint& local() const noexcept { return local_; }
    /// A datagram has arrived at the host.
    void receive(const endpoint& from, const std::string& datagram, bool to_group);
    /// With security, the port that seals for this one reports what the node sends and receives; otherwise, this one.
    void report_sent(std::string_view line);
    void report_received(const core::group_source& from, std::string_view line);
    void report_accepted(std::string_view member, std::string_view line);
    /// Loses everything that is sent from now on.
    void fall_silent() noexcept { silent_ = true; }

    static constexpr std::size_t max_waiting = 1U << 16U;

  private:
    [[nodiscard]] bool is_swallowed(std::string_view line);
    [[nodiscard]] bool put(std::string_view line);
    void pass_on(std::string_view line);
    void drain();
    void hand_over(const endpoint& from, const std::string& datagram, bool to_group);

    network& net_;
    std::weak_ptr<node_run> process_;
    endpoint local_;
    std::string name_; // in the trace
    core::group_source source_;
    core::group_listener* owner_ = nullptr; // null: not started, or closed
    std::deque<std::string> waiting_;
    std::size_t unsent_ = 0;
    unsigned in_system_ = 0;
    bool silent_ = false;
    std::uint64_t announcements_ = 0;          // for planted faults
    std::set<std::string, std::less<>> bound_; // for planted faults
};

} // namespace cles::simulation
