// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/workload/follower.hpp"
#include "simulation/workload/follower_list.hpp"
#include "simulation/workload/part.hpp"

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace cles::simulation {

class world;

/// Publishing and following: every node publishes some nouns and follows those of others.
class following final : public part {
  public:
    explicit following(world& in);
    ~following() override;

    void perform(const action& what) override;
    void on_start(node_run& n) override;
    void on_crash(node_run& n) override;
    void probe() override;
    void judge_probe() override;
    void wind_down() override;
    void judge_rest() override;

    /// How much the present run of a host has published of a noun.
    [[nodiscard]] std::uint64_t count(unsigned host, unsigned noun) const { return published_[host][noun]; }

  private:
    static constexpr std::size_t own_nouns = 3; ///< that a node publishes by itself; the last one when there is room

    void follow(const action& a);
    void publish(unsigned host, unsigned noun, unsigned count, std::size_t size);
    void offer(unsigned host, unsigned count, std::size_t size);
    [[nodiscard]] std::string body(unsigned host, unsigned noun, std::size_t size);

    world& world_;
    follower_list<follower> followers_;
    std::map<std::uint32_t, std::uint64_t> seen_before_probe_;
    std::vector<std::array<std::uint64_t, own_nouns>> published_; // by the present run of each host
    std::size_t offers_ = 0;                                      // that have not ended
};

} // namespace cles::simulation
