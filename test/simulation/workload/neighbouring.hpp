// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/workload/part.hpp"
#include "simulation/world/rule.hpp"

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>

namespace cles::simulation {

class world;

/// Who is there: nodes announce themselves to the group, leave it in order or without a word, begin again, and some
/// bear another's name. What each has heard is kept account of, to judge what it makes of that.
class neighbouring final : public part {
  public:
    explicit neighbouring(world& in) noexcept : world_(in) {}
    ~neighbouring() override;

    void perform(const action& what) override;
    void on_start(node_run& n) override;
    void on_crash(node_run& n) override;
    void on_group_heard(node_run& at, const core::group_source& from, std::string_view datagram) override;
    void on_neighbour(node_run& at, std::string_view node, core::membership::change what) override;
    void on_calm() override;
    void probe() override;
    void judge_probe() override;
    void wind_down() override;

  private:
    /// What a node has heard of a run of another one.
    struct heard_run {
        std::string node;
        std::uint64_t seq = 0;
        time_point at{};
        std::chrono::milliseconds interval{0};
        bool left = false; ///< said so, and was listed then
    };
    /// What a node has heard, and said of it.
    struct account {
        std::map<std::uint32_t, heard_run> runs;                  // by epoch
        std::map<std::string, std::uint32_t, std::less<>> owners; // of names: their epochs
        std::set<std::string, std::less<>> silent;
        std::set<std::string, std::less<>> clashes;
    };

    void begin_namesake(unsigned of);
    void end_namesake(unsigned of, bool silently);
    void look_at_all();
    void look_at(node_run& n);
    void look_at(node_run& n, const core::membership::member& other);
    void expect_all_known(const char* when);
    [[nodiscard]] static time_point last_chance(const node_run& n, const heard_run& r);
    [[nodiscard]] bool could_answer(node_run& at, std::string_view node, std::uint32_t epoch);
    void record_begin(node_run& n);
    [[nodiscard]] bool has_precedence(std::uint32_t epoch, std::uint32_t over) const;
    void complain(rule which, node_run& at, const std::string& what);

    world& world_;
    std::map<const node_run*, account> accounts_;
    std::map<unsigned, std::shared_ptr<node_run>> namesakes_; // by host
    std::map<std::uint32_t, time_point> began_;               // of each run, by epoch
    unsigned namesake_runs_ = 0;
    bool looking_ = false;
};

} // namespace cles::simulation
