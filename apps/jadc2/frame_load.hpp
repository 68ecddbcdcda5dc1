// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <string>

namespace jadc2 {

struct load_options {
    std::string at = "tcp://127.0.0.1:25370";
    std::uint64_t streams = 4; ///< each of which has a frame on its way at any time
    double duration_s = 5;     ///< 0: until it is told to end
    std::uint64_t seed = 1;
};

/// Sends frames to a node as fast as it answers, all encoded before the first is sent, until the time is over or it is
/// told to end by SIGINT or SIGTERM; prints what became of them, and "loading" on a line of its own once each stream
/// has had an answer. \throws cles::error where the node does not answer
int load_with_frames(const load_options& wanted);

} // namespace jadc2
