// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace fmv {

/// Where a camera was and where it pointed, as far as its aircraft knows.
struct camera_message {
    double lat = 0, lon = 0;   ///< degrees, WGS 84
    double height = 0;         ///< m above the ground, which is flat
    double azimuth = 0;        ///< degrees, of the optical axis, clockwise from north
    double depression = 0;     ///< degrees, of the optical axis, below the horizon
    double field_of_view = 0;  ///< degrees, over the width of the picture
    double position_sigma = 0; ///< m, standard deviation of its position, per axis
    double pointing_sigma = 0; ///< degrees, the same of the direction of the optical axis
};
BOOST_DESCRIBE_STRUCT(camera_message, (),
                      (lat, lon, height, azimuth, depression, field_of_view, position_sigma, pointing_sigma))

/// What `FMV_Processing` needs to begin receiving a video.
struct video_message {
    std::string frames{}; ///< the noun at the requester that is updated with each frame: "recon-camera:video"
    int width = 0;        ///< pixels
    int height = 0;
    std::string format{}; ///< as in `frame_message`
};
BOOST_DESCRIBE_STRUCT(video_message, (), (frames, width, height, format))

/// An update of that noun.
struct video_frame {
    std::uint64_t frame = 0; ///< as in `frame_message`, and so on
    double utc = 0;
    camera_message camera{};
    std::string picture{}; ///< empty: the video has ended
};
BOOST_DESCRIBE_STRUCT(video_frame, (), (frame, utc, camera, picture))

/// The result of `FMV_Processing` when the video has ended.
struct video_result {
    std::string node{};
    std::uint64_t frames = 0;  ///< that were processed
    std::uint64_t missing = 0; ///< since the first one
    std::uint64_t bad = 0;     ///< that could not be processed
};
BOOST_DESCRIBE_STRUCT(video_result, (), (node, frames, missing, bad))

/// A frame of a stream, as `FMV_Frame` takes it.
struct frame_message {
    std::string stream{};    ///< whose frames belong together
    std::uint64_t frame = 0; ///< counted from the stream's first; some may be missing
    double utc = 0;          ///< when it was taken, in seconds since 1970
    int width = 0;           ///< pixels
    int height = 0;
    std::uint64_t deadline_ms = 0; ///< as in the request: the waiting time is this minus the time left when work begins
    camera_message camera{};
    std::string format{}; ///< of the picture: `grey`, a byte for each pixel, from black to white, row by row; or `jpeg`
    std::string picture{}; ///< in base64
};
BOOST_DESCRIBE_STRUCT(frame_message, (), (stream, frame, utc, width, height, deadline_ms, camera, format, picture))

/// A target that is followed, at the time of the frame.
struct track {
    std::uint64_t id = 0; ///< of its stream, at its node
    double lat = 0;       ///< degrees, WGS 84
    double lon = 0;
    double ve = 0;      ///< m/s, to the east
    double vn = 0;      ///< m/s, to the north
    double sigma = 0;   ///< m, standard deviation of the place, per axis
    double sigma_v = 0; ///< m/s, the same of the velocity
    double age = 0;     ///< s since it was first seen
    int missed = 0;     ///< frames since it was last seen; it is where it is predicted to be
};
BOOST_DESCRIBE_STRUCT(track, (), (id, lat, lon, ve, vn, sigma, sigma_v, age, missed))

/// A distance, m.
struct place_shift {
    double east = 0;
    double north = 0;
};
BOOST_DESCRIBE_STRUCT(place_shift, (), (east, north))

/// What was found in a frame.
struct found {
    std::string node{};
    std::uint64_t frame = 0;
    bool ready = false; ///< the background is known; until then nothing is found
    std::vector<track> tracks{};
    /// By how much the camera's places were wrong, as the node's own plots show: those of the tracks are corrected. If
    /// it is missing, they are the camera's alone.
    std::optional<place_shift> corrected_by{};
    double queue_ms = 0; ///< from the frame's arrival until work began
    double run_ms = 0;
};
BOOST_DESCRIBE_STRUCT(found, (), (node, frame, ready, tracks, corrected_by, queue_ms, run_ms))

} // namespace fmv
