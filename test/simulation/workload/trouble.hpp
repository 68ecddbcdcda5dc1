// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/workload/part.hpp"

namespace cles::simulation {

class world;

/// What goes wrong: nodes crash and begin again, processes are stopped for a while, streams are reset, hosts do not
/// reach each other, and the network is at its worst.
class trouble final : public part {
  public:
    explicit trouble(world& in) noexcept : world_(in) {}
    void perform(const action& what) override;

  private:
    world& world_;
};

} // namespace cles::simulation
