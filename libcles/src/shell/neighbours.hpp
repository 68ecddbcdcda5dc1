// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/gossip.hpp>

#include "core/announcer.hpp"
#include "core/first_round.hpp"
#include "core/group_intake.hpp"
#include "core/presence.hpp"
#include "shell/gossip_part.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::shell {

class local_node;

class group;

/// The other nodes: finds and asks who they are, and tells them of this one, in the multicast group and by gossip.
/// Without either there are none.
class neighbours final : private core::group_presence,
                         private core::presence::watcher,
                         private core::presence::prober,
                         private core::announcer::voice,
                         private core::first_round::listener {
  public:
    neighbours(local_node& host, std::uint32_t seed);
    neighbours(const neighbours&) = delete;
    neighbours& operator=(const neighbours&) = delete;
    ~neighbours();

    /// The group is there.
    void join(group& through);
    /// Takes part in gossip from now on, with these seeds. \throws cles::error where one of them is no URL
    void gossip(const gossip_options& how);
    /// What is said follows when the environment runs.
    void start();
    /// Says farewell, and goes on hearing of the others. Repeating it does nothing.
    void leave();
    /// Leaves, and ends.
    void stop();

    /// As `presence::find`.
    [[nodiscard]] std::optional<std::string_view> find(std::string_view node) const noexcept;
    /// Where a second live node of that name is, where both have answered.
    [[nodiscard]] std::optional<std::string_view> second_of(std::string_view node) const noexcept;
    /// Asks the node of that name where it is.
    void ask_for(std::string_view node);
    /// Whether a name that is not known may be heard any moment.
    [[nodiscard]] bool expects_more() const noexcept { return !round_.over(); }
    /// Whether a node that is known, at no address that can be used, may be heard any moment by another of its
    /// interfaces.
    [[nodiscard]] bool expects_more_of(std::string_view node) const noexcept;
    /// What presence reports changes to; a test may put itself between.
    [[nodiscard]] core::presence::watcher& presence_watcher() noexcept { return *this; }
    /// Why a name is not known, as the first part of a sentence; empty without a group.
    [[nodiscard]] std::string why_unknown() const;

  private:
    void begin();
    void announce(std::chrono::milliseconds interval) override;
    void announce(std::chrono::milliseconds interval, bool leaving);
    [[nodiscard]] std::size_t others() const override;
    void on_round_over() override;
    void on_solicitation(bool by_name, time_point now) override;
    void on_announcement(const core::group_source& from, const protocol::request_line& update, time_point now) override;
    void on_peer(std::string_view node, core::presence::change what, std::string_view where) override;
    void probe(std::uint64_t ticket, std::string_view url) override;
    void follow_run(const std::string& name);
    void on_name_taken(const std::string& where);
    void announce_to_group(core::announcement& said);
    [[nodiscard]] std::vector<std::string> endpoints_for_group(bool loopback) const;
    [[nodiscard]] std::vector<std::string> endpoints_for_gossip() const;

    local_node& host_;
    core::announcer announcer_;
    core::first_round round_;
    std::unique_ptr<detail::gossip_host> gossiper_; // null: it takes no part
    std::uint32_t seed_;
    group* group_ = nullptr;
    std::map<std::string, std::uint32_t, std::less<>> runs_; // of each name: its epoch
    std::uint64_t seq_ = 0;
    bool begun_ = false;
    bool left_ = false;
};

} // namespace cles::shell
