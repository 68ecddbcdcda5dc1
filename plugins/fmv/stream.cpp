// SPDX-License-Identifier: BSL-1.0
#include "stream.hpp"

#include <utility>

namespace fmv {

void stream::take(grey frame, int frames) {
    if (std::exchange(begun_, true)) {
        align(still_.reference(), frame, size_, register_with(still_.reference(), frame, size_));
    }
    if (!still_.known()) {
        still_.learn(frame);
        return;
    }
    tracker_.step(detector_.look(frame, still_.values()), frames);
    still_.follow(frame, detector_.moving());
}

} // namespace fmv
