// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/workload/part.hpp"

#include <memory>
#include <vector>

namespace cles::simulation {

class talker;
class world;

/// People with netcat: clients on streams whose requests bear no id, and who therefore count on the order of answers.
/// They send faster than they are answered, make mistakes, read slowly, and end in each way there is.
class talking final : public part {
  public:
    explicit talking(world& in) noexcept : world_(in) {}
    ~talking() override;

    void perform(const action& what) override;
    void on_crash(node_run& n) override;
    void on_leaving(node_run& n) override;
    void wind_down() override;

  private:
    void excuse(unsigned host);
    world& world_;
    std::vector<std::shared_ptr<talker>> talkers_;
};

} // namespace cles::simulation
