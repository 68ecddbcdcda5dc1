// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles {
class registrar;
}

namespace tool {

/// The tasks of `cles serve` that need no publisher: echo, sleep, fail, notice.
void register_play_tasks(cles::registrar& tasks);

} // namespace tool
