// SPDX-License-Identifier: BSL-1.0
#include "feed_watch.hpp"

#include <utility>

namespace jadc2 {

bool feed_watch::heard(double now) {
    heard_ = now;
    next_ = now + silent_s_;
    expects_ = true;
    return std::exchange(silent_, false);
}

bool feed_watch::shows_silence(double now) {
    if (!expects_ || now < next_) {
        return false;
    }
    silent_ = true;
    next_ = now + 1;
    return true;
}

} // namespace jadc2
