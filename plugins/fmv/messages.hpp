// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace fmv {

/// A frame of a stream, as `FMV_Processing` takes it.
struct frame_message {
    std::string stream{};    ///< whose frames belong together
    std::uint64_t frame = 0; ///< counted from the stream's first; some may be missing
    int width = 0;           ///< pixels
    int height = 0;
    std::uint64_t deadline_ms = 0; ///< as in the request: the waiting time is this minus the time left when work begins
    std::string pixels{};          ///< a byte each, from black to white, row by row, in base64
};
BOOST_DESCRIBE_STRUCT(frame_message, (), (stream, frame, width, height, deadline_ms, pixels))

/// A target that is followed. What comes from `FMV_Processing` has pixels of the stream's first frame, and pixels per
/// frame.
struct track {
    std::uint64_t id = 0; ///< of its stream, at its node
    double x = 0;
    double y = 0;
    double vx = 0;
    double vy = 0;
    int age = 0;    ///< frames since it was first seen
    int missed = 0; ///< frames since it was last seen; it is where it is predicted to be
};
BOOST_DESCRIBE_STRUCT(track, (), (id, x, y, vx, vy, age, missed))

/// What was found in a frame.
struct found {
    std::string node{};
    std::uint64_t frame = 0;
    bool ready = false; ///< the background is known; until then nothing is found
    std::vector<track> tracks{};
    double queue_ms = 0; ///< from the frame's arrival until work began
    double run_ms = 0;
};
BOOST_DESCRIBE_STRUCT(found, (), (node, frame, ready, tracks, queue_ms, run_ms))

} // namespace fmv
