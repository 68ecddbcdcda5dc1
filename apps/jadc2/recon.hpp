// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "events.hpp"
#include "frame_fates.hpp"
#include "picture.hpp"
#include "scene.hpp"
#include "score.hpp"

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
    double fps = 25;
    std::uint64_t frames = 0; ///< 0: until it is told to end
    std::uint64_t deadline_ms = 1000;
    bool json = false;
};

/// The reconnaissance aircraft: has its video processed by nodes that offer it, and publishes what was found.
///
/// It is two nodes: one for the mission centre, and one without an address of its own for the satellites, so that
/// neither side learns of the other, and no frame is in the way of what the mission centre asks.
class recon {
  public:
    /// \throws cles::error where it cannot listen
    explicit recon(const recon_options& wanted);

    /// Until all frames have their fates, or it is told to end by SIGINT or SIGTERM. Gives the exit code.
    int run();

  private:
    boost::asio::awaitable<void> film();
    boost::asio::awaitable<void> process(std::uint64_t number);
    void take(std::uint64_t number, const fmv::found& seen, picture times);
    void tell_trouble(const cles::error& why);
    [[nodiscard]] std::string explain(const cles::error& why) const;
    [[nodiscard]] assessment assess(const impact& at) const;
    void report() const;

    recon_options wanted_;
    events tell_;
    boost::asio::io_context io_{1};
    cles::service ground_;
    cles::service space_;
    boost::asio::steady_timer pace_{io_};
    scene scene_;
    frame_fates fates_;
    std::string run_;           ///< no other run has the same
    std::uint64_t episode_ = 0; ///< of the video: another node is another stream, which begins anew
    std::uint64_t first_ = 0;   ///< frame of the episode
    bool fresh_ = true;         ///< no frame of the episode has been processed
    score score_;
    std::uint64_t ready_frames_ = 0; ///< of the episode, since its node knows what stands still
    std::vector<picture> times_;     ///< the last ones, without tracks
    double begun_utc_ = 0;           ///< of frame 0
    double told_utc_ = 0;            ///< of the trouble
    bool ending_ = false;
};

} // namespace jadc2
