// SPDX-License-Identifier: BSL-1.0
#include "polled_subscriptions.hpp"

#include "perf/support/descriptor.hpp"

namespace cles::perf::peers {

void polled_subscriptions::take_for(std::chrono::milliseconds at_most, inbox& into) {
    const auto end = std::chrono::steady_clock::now() + at_most;
    for (auto left = at_most; left.count() > 0 && !(into.look().complete && into.all_reached());
         left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now())) {
        if (checked(::poll(sockets_.data(), sockets_.size(), static_cast<int>(left.count())), "poll") == 0) {
            return;
        }
        for (std::size_t i = 0; i < sockets_.size(); ++i) {
            if (sockets_[i].revents != 0) {
                read(i, into);
            }
        }
    }
}

} // namespace cles::perf::peers
