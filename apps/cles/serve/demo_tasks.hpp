// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles {
class registrar;
}

namespace tool {

/// The tasks of `cles serve` besides localization: echo, sleep, fail, notice.
void register_demo_tasks(cles::registrar& to);

} // namespace tool
