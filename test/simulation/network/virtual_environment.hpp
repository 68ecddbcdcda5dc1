// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/environment.hpp"
#include "simulation/network/dice.hpp"
#include "simulation/network/network.hpp"

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::simulation {

class datagram_port;
class group_port;
class node_run;

/// The environment of one simulated node: virtual time, the simulated network, and random numbers from a seed.
///
/// It ends with the process. From then on nothing is sent, received or run, and no timer expires.
class virtual_environment final : public core::environment {
  public:
    /// `strangers`: sources of datagrams are on other hosts, so output to them is limited.
    virtual_environment(network& net, node_run& process, std::uint64_t seed, bool strangers)
        : net_(net), process_(&process), chance_(seed), strangers_(strangers) {}

    [[nodiscard]] time_point now() const override;
    std::uint32_t random() override { return static_cast<std::uint32_t>(chance_.next()); }
    void post(std::shared_ptr<core::task> next) override;

    void start_timer(std::function<void()> due) override { on_due_ = std::move(due); }
    void set_timer(time_point due) override;
    void stop_timer() override { on_due_ = nullptr; }

    [[nodiscard]] bool has_transport(std::string_view scheme) const override;
    [[nodiscard]] bool is_trusted(const url& where) const override { return has_transport(where.scheme); }
    [[nodiscard]] bool is_exposed(const url&) const override { return true; }
    std::unique_ptr<acceptor> listen(const url& where, const limits& bounds) override;
    std::function<void()> dial(const url& where, std::string_view name, const limits& bounds,
                               dial_callback done) override;

    [[nodiscard]] std::string local_scope() const override { return "simulation"; }
    [[nodiscard]] bool is_open(const std::string&) const override { return false; }

    std::vector<core::network_interface> interfaces() override { return {find_interface("net0")}; }
    core::network_interface find_interface(const std::string& name) override;
    std::shared_ptr<core::group_port> join(const core::network_interface& by, const multicast_options& where) override;

    // For the simulation.
    /// The process has ended: the system closes its sockets; peers notice nothing else.
    void end();
    [[nodiscard]] bool has_ended() const noexcept { return process_ == nullptr; }
    /// Drops the tasks that did not run before `end`, and all later ones.
    void discard_tasks();
    /// For planted faults: shows the node another time while its timer expires.
    void run_timer_as_if(time_point shown);
    /// The clock has jumped: a timer that is due by now expires.
    void on_jump() { arm_timer(); }
    /// The maximum number of bytes that a link which others opened holds for its peer.
    [[nodiscard]] std::size_t most_held() const;
    /// Null if it does not take part in multicast.
    [[nodiscard]] group_port* group() const noexcept { return group_.get(); }

  private:
    class door;
    using on_link = std::function<void(link_ptr)>;

    void run_next();
    void arm_timer();
    void on_timer();
    void run_timer();
    void remember(const link_ptr& made, bool incoming);
    std::shared_ptr<datagram_port> make_port(const endpoint& at, bool strangers);

    network& net_;
    node_run* process_; // null: it has ended
    dice chance_;
    bool strangers_;
    std::deque<std::shared_ptr<core::task>> tasks_;
    bool discards_ = false;
    std::function<void()> on_due_;
    std::optional<time_point> due_;
    std::uint64_t timer_ = 0;                                 // the current one
    std::optional<time_point> shown_;                         // the time that a planted fault shows
    std::vector<std::pair<std::weak_ptr<link>, bool>> links_; // and whether others opened them
    std::vector<std::weak_ptr<datagram_port>> ports_;
    std::shared_ptr<group_port> group_;
};

} // namespace cles::simulation
