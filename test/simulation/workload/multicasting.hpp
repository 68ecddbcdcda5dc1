// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/group_source.hpp"
#include "simulation/workload/follower_list.hpp"
#include "simulation/workload/group_follower.hpp"
#include "simulation/workload/part.hpp"

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::simulation {

class following;
class world;

/// Publishing and following by the multicast group: nodes bind each other's nouns there, by name or those of all. What
/// each publisher has been asked for and has sent is kept account of.
class multicasting final : public part {
  public:
    /// `published`: who has nodes publish what is bound here.
    multicasting(world& in, const following& published) noexcept : world_(in), published_(published) {}

    void perform(const action& what) override;
    void on_start(node_run& n) override;
    void on_crash(node_run& n) override;
    void on_group_heard(node_run& at, const core::group_source& from, std::string_view datagram) override;
    void on_group_sent(node_run& by, std::string_view line) override;
    void probe() override;
    void judge_probe() override;
    void wind_down() override;

  private:
    /// A publisher's noun, as the group has to do with it.
    struct noun {
        std::map<core::group_source, time_point> leases; // until when
        std::uint64_t sent = 0;                          // the last update's number
        bool newly_bound = false;                        // since the last update was repeated
    };

    void gather(const action& a);
    std::shared_ptr<group_follower> follow(node_run& n, const std::string& target, const std::string& path,
                                           std::uint32_t label, std::uint32_t slow);
    void judge_first(const std::vector<std::shared_ptr<group_follower>>& newcomers);

    world& world_;
    const following& published_;
    follower_list<group_follower> followers_;
    std::map<std::pair<const node_run*, std::string>, noun> nouns_;
    std::uint32_t next_probe_ = 10'000'000;
};

} // namespace cles::simulation
