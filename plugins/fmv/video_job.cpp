// SPDX-License-Identifier: BSL-1.0
#include "video_job.hpp"

#include <cles/call_options.hpp>
#include <cles/error.hpp>
#include <cles/job_feed.hpp>

#include "frame_account.hpp"
#include "frame_checks.hpp"
#include "messages.hpp"
#include "plot_fusion.hpp"

#include <boost/system/error_code.hpp>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace fmv {
namespace {

using cles::errc;
using cles::error;
using steady = std::chrono::steady_clock;
using milliseconds = std::chrono::duration<double, std::milli>;

constexpr std::uint32_t kept = 2; // frames that wait: older ones are not worth a worker's time

std::string_view node_in(std::string_view noun) { return noun.substr(0, noun.find(':')); }

/// One video. Only one callback of its job runs at a time.
class video_job : public std::enable_shared_from_this<video_job> {
  public:
    video_job(const cles::request& asked, cles::responder answer, video_message what, extent size,
              std::shared_ptr<kept_stream> at, std::shared_ptr<workshop> here)
        : node_(asked.node()), answer_(std::move(answer)), what_(std::move(what)), size_(size), at_(std::move(at)),
          here_(std::move(here)) {
        if (here_->radar_seed) {
            fusion_.emplace(*here_->radar_seed);
        }
    }

    void begin() {
        frames_ = answer_.bind(what_.frames, cles::bind_options{}.keep(kept));
        await();
    }

  private:
    void await() {
        frames_.next([self = shared_from_this()](boost::system::error_code code, const cles::job_event& event) {
            self->take(code, event);
        });
    }
    void take(boost::system::error_code code, const cles::job_event& event);
    /// Whether there are more frames to come.
    bool look(const cles::job_event& event);
    void process(const video_frame& what, const cles::job_event& event, steady::time_point begun);

    const std::string node_;
    const cles::responder answer_;
    const video_message what_;
    const extent size_;
    const std::shared_ptr<kept_stream> at_;
    const std::shared_ptr<workshop> here_;
    cles::job_feed frames_;
    frame_account account_;
    std::optional<plot_fusion> fusion_; ///< if it has a radar
    std::uint64_t done_ = 0, bad_ = 0;
};

void video_job::take(boost::system::error_code code, const cles::job_event& event) {
    if (code) {
        // With its own code, it would seem as if this node were not found, or had no such task.
        const error why{code, std::string{event.text}};
        answer_.fail(errc::unavailable, "the frames of " + what_.frames + ": " + why.what());
        return;
    }
    // What is missed shows in the numbers of frames. The last value may be old, and the requester tells if it is lost.
    if (event.kind != cles::feed_event::update || look(event)) {
        await();
    }
}

bool video_job::look(const cles::job_event& event) {
    const auto begun = steady::now();
    try {
        const auto what = event.as<video_frame>();
        if (what.picture.empty()) {
            answer_.done(video_result{.node = node_, .frames = done_, .missing = account_.missing(), .bad = bad_});
            return false;
        }
        process(what, event, begun);
    } catch (const error& e) {
        ++bad_;
        if (here_->bad++ == 0) {
            answer_.log(cles::log_level::warning,
                        "a frame of " + what_.frames + " is bad (logged once): " + e.message());
        }
    }
    return true;
}

void video_job::process(const video_frame& what, const cles::job_event& event, steady::time_point begun) {
    if (!account_.take(what.frame)) {
        ++here_->repeated;
        return;
    }
    check_utc(what.utc);
    check(what.camera);
    auto& video = at_->video;
    require(!video.utc() || what.utc > *video.utc(), "utc: later than that of the frame before");
    const auto pixels = decoded(what.picture, size_, what_.format);
    video.take(pixels, what.camera, what.utc);
    ++done_;
    ++here_->frames;
    found seen{.node = node_, .frame = what.frame, .ready = video.ready(), .tracks = video.tracks()};
    if (const auto accuracy = video.error_of_places(); fusion_ && accuracy) {
        seen.corrected_by = fusion_->correct(seen.tracks, *accuracy, what.utc);
    }
    seen.queue_ms = milliseconds{event.waited}.count();
    seen.run_ms = milliseconds{steady::now() - begun}.count();
    answer_.progress(0, seen);
}

} // namespace

void open_video(const cles::request& asked, const cles::responder& answer, const std::shared_ptr<workshop>& here) {
    try {
        auto what = asked.as<video_message>();
        const auto size = checked_size(what.width, what.height, what.format);
        // This node's rights are not for others to use.
        if (!asked.requester().empty() && node_in(what.frames) != asked.requester()) {
            throw error(errc::denied, "frames: a noun of " + std::string{asked.requester()});
        }
        auto at = here->all.open(size, steady::now());
        if (!at) {
            ++here->refused;
            answer.refuse("the limit of streams is reached", std::chrono::seconds{1});
            return;
        }
        std::make_shared<video_job>(asked, answer, std::move(what), size, std::move(at), here)->begin();
    } catch (const error&) {
        ++here->bad;
        throw;
    }
}

} // namespace fmv
