// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/announcer.hpp"
#include "core/first_round.hpp"
#include "core/group_output.hpp"
#include "core/group_session.hpp"
#include "core/presence.hpp"
#include "simulation/group_port.hpp"
#include "simulation/group_watch.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <string_view>

namespace cles::simulation {

class node_run;

/// A node's part in the multicast group: what it is bound to there, what others are bound to here, and who they are.
/// Does for the machines what shell/group.hpp and shell/neighbours.hpp do; they are to be kept alike.
class group_seat final : public core::group_output,
                         private group_port::events,
                         private core::group_presence,
                         private core::presence::watcher,
                         private core::announcer::voice,
                         private core::first_round::listener {
  public:
    group_seat(node_run& host, std::shared_ptr<group_port> port, group_watch& judge, std::uint32_t seed);
    ~group_seat();

    /// Joins, asks who is there, and says so of itself.
    void start();
    /// Says farewell, and ends all that it had by the group.
    void leave();
    /// Says nothing of itself any more, and still hears others.
    void fall_silent() noexcept { announcer_.stop(); }
    /// Asks the node of that name where it is.
    void ask_for(std::string_view node);

    bool send(std::string_view line) override;
    [[nodiscard]] bool has_room() const override;
    [[nodiscard]] std::size_t unsent() const noexcept { return port_->unsent(); }
    [[nodiscard]] core::group_source source() const noexcept { return port_->source(); }
    [[nodiscard]] core::group_feeds& feeds() noexcept { return intake_.feeds(); }
    /// Its first round of asking is over.
    [[nodiscard]] bool settled() const noexcept { return round_.over(); }

  private:
    void say(std::chrono::milliseconds interval, bool leaving);
    [[nodiscard]] bool is_swallowed(std::string_view line);

    void on_datagram(const core::group_source& from, std::string_view datagram) override;
    void on_room() override;
    void on_solicitation(bool by_name, time_point now) override;
    void on_announcement(const core::group_source& from, const protocol::request_line& update, time_point now) override;
    void on_peer(std::string_view node, core::presence::change what, std::string_view where) override;
    void announce(std::chrono::milliseconds interval) override;
    [[nodiscard]] std::size_t others() const override;
    void on_round_over() override {}

    node_run& node_;
    std::shared_ptr<group_port> port_;
    group_watch& judge_;
    core::group_intake intake_;
    core::group_session session_;
    core::announcer announcer_;
    core::first_round round_;
    std::uint64_t seq_ = 0;
    std::set<std::string, std::less<>> bound_; // for a planted fault
};

} // namespace cles::simulation
