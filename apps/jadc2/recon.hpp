// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "events.hpp"
#include "fmv/frame_codec.hpp"
#include "picture.hpp"
#include "scene.hpp"
#include "track_evaluation.hpp"
#include "video_session.hpp"

#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace jadc2 {

struct recon_options {
    std::string name = "recon";
    std::string listen = "tcp://127.0.0.1:25373";
    bool insecure = false;
    std::vector<std::string> satellites{"tcp://127.0.0.1:25370"};
    std::vector<std::string> camera_listen{"tcp://127.0.0.1:25372"}; ///< where satellites get the frames
    std::uint64_t seed = 1;
    std::string format = fmv::default_format(); ///< of frames
    double fps = 25;
    std::uint64_t frames = 0;         ///< 0: until it is stopped
    std::uint64_t deadline_ms = 1000; ///< for the result of a frame, after which its node is given up
    std::string keys{};               ///< the directory with its key; empty: without security
    std::string camera_keys{};        ///< the same of the node for the satellites
    bool json = false;
};

/// The reconnaissance aircraft: delegates its video to a node that processes it, which binds the frames, and publishes
/// the tracks.
///
/// It is two nodes: one for the mission centre and one for the satellites, so that neither side knows of the other, and
/// frames do not delay requests of the mission centre.
class recon {
  public:
    /// \throws cles::error if it cannot listen
    explicit recon(const recon_options& args);

    /// Runs until all frames have ended, or SIGINT or SIGTERM stops it. \return the exit code
    int run();

  private:
    /// A frame without a result.
    struct sent_frame {
        double captured = 0; ///< s since 1970
        double encode_ms = 0;
        std::chrono::steady_clock::time_point sent{};
    };

    boost::asio::awaitable<void> film();
    boost::asio::awaitable<void> end_video(std::uint64_t frames);
    void take_frame(std::uint64_t number);
    void publish(std::uint64_t number);
    void open_video();
    void give_up_video();
    void take(const fmv::found& seen);
    void take_correction(const fmv::found& seen);
    void report_missing(std::uint64_t missing, std::uint64_t frame);
    void on_failure(const cles::error& why);
    [[nodiscard]] double now() const; ///< s since the start
    [[nodiscard]] std::string explain(const cles::error& why) const;
    boost::asio::awaitable<assessment> watch_impact(impact at);
    [[nodiscard]] assessment assess(const impact& at, std::optional<std::size_t> vehicle) const;
    void report() const;

    recon_options args_;
    event_log events_;
    boost::asio::io_context io_{1};
    cles::service ground_;
    cles::service space_;
    boost::asio::steady_timer pace_{io_};
    scene scene_;
    video_session video_;
    std::uint64_t opening_ = 0;                                ///< counts how often the video was opened, or given up
    std::shared_ptr<boost::asio::cancellation_signal> stop_{}; ///< of the request that has opened it last
    std::map<std::uint64_t, sent_frame> sent_;                 ///< by number
    track_evaluation evaluation_{scene_};
    /// Tracks of the video since its opening that are under attack or hit: their node, and their numbers.
    std::set<std::pair<std::string, std::uint64_t>> engaged_;
    std::vector<picture> times_;      ///< the last ones, without tracks
    std::uint64_t picture_bytes_ = 0; ///< sent
    std::uint64_t pictures_ = 0;      ///< the same
    std::uint64_t corrected_ = 0;     ///< results
    bool is_corrected_ = false;       ///< the last one
    std::uint64_t untold_ = 0;        ///< missing frames that have not been reported
    double missing_told_ = 0;         ///< when some were, s since the start
    double reported_utc_ = 0;         ///< of the last error
    std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
    bool ending_ = false;
};

} // namespace jadc2
