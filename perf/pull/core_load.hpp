// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/support/child_process.hpp"

#include <memory>
#include <vector>

namespace cles::perf {

/// Load on cores: processes on each that never sleep, but compute and copy memory.
class core_load {
  public:
    core_load(const std::vector<int>& cores, int processes_per_core);

  private:
    std::vector<std::unique_ptr<child_process>> processes_;
};

} // namespace cles::perf
