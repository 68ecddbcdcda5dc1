// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/responder.hpp>

namespace sgd {

/// Does the steps of a training until it has ended, and reports each percent of it. False if the job was stopped: it
/// has been answered then.
template <class Training>
bool take_steps(Training& work, const cles::responder& answer) {
    bool heard = true;
    int reported = 0;
    while (work.step()) {
        if (answer.stopped()) {
            answer.fail(cles::errc::cancelled, "stopped");
            return false;
        }
        if (const auto percent = static_cast<int>(work.part_done() * 100); heard && percent > reported) {
            reported = percent;
            heard = answer.progress(work.part_done());
        }
    }
    return true;
}

} // namespace sgd
