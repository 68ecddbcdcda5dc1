// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "fmv/frame_codec.hpp"

#include <cstdint>
#include <string>

namespace jadc2 {

struct load_options {
    std::string at = "tcp://127.0.0.1:25370";
    std::uint64_t streams = 4; ///< each with one frame in flight at any time
    double duration_s = 5;     ///< 0: until it is stopped
    std::uint64_t seed = 1;
    std::string format = fmv::default_format();
    std::string keys{}; ///< the directory with the key of a member; empty: without security
};

/// Sends frames, which are encoded in advance, to a node as fast as it answers, until the time is over, or SIGINT or
/// SIGTERM stops it; prints the results, and "loading" on a separate line as soon as each stream has had an answer.
/// \throws cles::error if the node does not answer
int run_load(const load_options& args);

} // namespace jadc2
