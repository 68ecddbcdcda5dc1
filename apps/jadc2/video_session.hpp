// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include <boost/describe/class.hpp>

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace jadc2 {

/// Which node processes the video, and what became of each frame. It only decides; its caller opens the video,
/// publishes frames and waits. Points in time are seconds of any clock.
///
/// One request opens the video at any node that offers the task. That node then gets the frames, and reports a result
/// for each. A node that is lost, refuses, or is silent for too long is given up: another one goes on with the next
/// frame. No frame is sent twice, because the next one is newer.
class video_session {
  public:
    struct totals {
        std::uint64_t captured = 0;                      ///< all frames that were due: done, missing and skipped
        std::uint64_t done = 0;                          ///< with a result
        std::uint64_t missing = 0;                       ///< without one
        std::uint64_t skipped = 0;                       ///< not taken, because those before took too long
        std::map<std::string, std::uint64_t> failures{}; ///< why nodes were given up, by the name of the error
        std::vector<std::string> nodes{};                ///< that processed frames, in their order
    };
    /// What a result shows.
    struct news {
        bool begins = false;       ///< the first one since the video was opened: the node knows no earlier frame
        std::uint64_t missing = 0; ///< frames without a result before it, since the last result
    };

    /// \param silent_s how long a frame may be without a result, or a node that was asked
    /// \param opening_s the same until the first result of all, because nodes have to be found
    video_session(double silent_s, double opening_s) : silent_s_(silent_s), opening_s_(opening_s) {}

    /// Whether the video has to be opened now.
    [[nodiscard]] bool has_to_open(double now) const noexcept { return !open_ && now >= next_; }
    void opened(double now);
    [[nodiscard]] bool is_open() const noexcept { return open_; }
    /// Whether a node processes it.
    [[nodiscard]] bool is_processed() const noexcept { return open_ && answered_; }
    /// Whether the node is silent, so that it has to be given up.
    [[nodiscard]] bool is_silent(double now) const;

    /// A frame was taken; it is published if the video is open.
    void captured(std::uint64_t frame, double now);
    /// A frame was due, and could not be taken.
    void skipped() noexcept {
        ++sums_.captured;
        ++sums_.skipped;
    }
    /// The result of a frame. Nothing, if it comes too late.
    std::optional<news> result(std::string_view by, std::uint64_t frame);
    /// The node was given up, or has ended. \return whether it was not for this reason the last time
    bool failed(const cles::error& why, double now);
    /// The video has ended: there are no more results.
    void ended();

    /// The node that processes the video, or did so last; empty, if there was none.
    [[nodiscard]] const std::string& node() const noexcept { return node_; }
    [[nodiscard]] const totals& sums() const noexcept { return sums_; }

  private:
    struct sent_frame {
        std::uint64_t number = 0;
        double at = 0;
    };

    void miss(std::uint64_t count) noexcept;
    void give_up_frames();

    double silent_s_;
    double opening_s_;
    bool open_ = false;
    bool answered_ = false; ///< there was a result since it was opened
    double opened_at_ = 0;
    double next_ = 0; ///< when it may be opened again
    std::string node_;
    std::string error_;             ///< the last one; empty after a result
    std::deque<sent_frame> sent_;   ///< without a result
    std::uint64_t before_next_ = 0; ///< missing frames since the last result
    totals sums_;
};
BOOST_DESCRIBE_STRUCT(video_session::totals, (), (captured, done, missing, skipped, failures, nodes))

} // namespace jadc2
