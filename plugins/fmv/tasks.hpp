// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/registrar.hpp>

#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>

namespace fmv {

struct settings {
    std::optional<std::uint64_t> streams{}; ///< 1 to 64, 8 unless set: each takes some megabytes while it begins
    std::optional<std::uint64_t> idle_s{}; ///< 1 to 3600, 10 unless set: after which a stream of FMV_Frame is forgotten
    std::optional<bool> plots{};           ///< whether it has a (simulated) radar, whose plots are fused with a video
    std::optional<std::uint64_t> seed{};   ///< of the traffic that the radar sees, 1 unless set

    /// \throws cles::setting_error
    void check() const;
};
BOOST_DESCRIBE_STRUCT(settings, (), (streams, idle_s, plots, seed))

/// Finds what moves in full motion video (paper, sections 2.2 and 4.2).
///
/// - DELEGATE FMV_Processing: receives a video from its requester, until it ends; see `video_message`, `video_frame`,
/// `found`, which is its progress, and `video_result`. Not idempotent: a node that goes on with a video takes the next
/// frame, not the first.
/// - DELEGATE FMV_Frame: the tracks after one more frame of a stream; see `frame_message` and `found`. A frame that has
/// been taken already changes nothing.
/// - PULL FMV_Processing: streams, and what became of the frames
void register_tasks(cles::registrar& to, const settings& wanted);

} // namespace fmv
