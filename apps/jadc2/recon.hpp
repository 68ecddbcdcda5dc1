// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "events.hpp"
#include "fmv/frame_codec.hpp"
#include "frame_fates.hpp"
#include "picture.hpp"
#include "scene.hpp"
#include "track_evaluation.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>

#include <string>
#include <vector>

namespace jadc2 {

struct recon_options {
    std::string name = "recon";
    std::string listen = "tcp://127.0.0.1:25373";
    bool insecure = false;
    std::vector<std::string> satellites{"tcp://127.0.0.1:25370"};
    std::uint64_t seed = 1;
    std::string format = fmv::default_format(); ///< of frames
    double fps = 25;
    std::uint64_t frames = 0; ///< 0: until it is stopped
    std::uint64_t deadline_ms = 1000;
    std::string keys{};        ///< the directory with its key; empty: without security
    std::string camera_keys{}; ///< the same of the node for the satellites
    bool json = false;
};

/// The reconnaissance aircraft: delegates its video to nodes that process it, and publishes the tracks.
///
/// It is two nodes: one for the mission centre, and one without an address of its own for the satellites, so that
/// neither side knows of the other, and frames do not delay requests of the mission centre.
class recon {
  public:
    /// \throws cles::error if it cannot listen
    explicit recon(const recon_options& args);

    /// Runs until all frames have ended, or SIGINT or SIGTERM stops it. \return the exit code
    int run();

  private:
    boost::asio::awaitable<void> film();
    boost::asio::awaitable<void> process(std::uint64_t number);
    void take(const fmv::found& seen, picture times);
    void report_error(const cles::error& why);
    [[nodiscard]] std::string explain(const cles::error& why) const;
    [[nodiscard]] assessment assess(const impact& at) const;
    void report() const;

    recon_options args_;
    event_log events_;
    boost::asio::io_context io_{1};
    cles::service ground_;
    cles::service space_;
    boost::asio::steady_timer pace_{io_};
    scene scene_;
    frame_fates fates_;
    std::string run_;           ///< unique
    std::uint64_t episode_ = 0; ///< of the video: each node has its own stream
    bool fresh_ = true;         ///< no frame of the episode has been processed
    track_evaluation evaluation_{scene_};
    std::vector<picture> times_;      ///< the last ones, without tracks
    std::uint64_t picture_bytes_ = 0; ///< sent
    double reported_utc_ = 0;         ///< of the last error
    bool ending_ = false;
};

} // namespace jadc2
