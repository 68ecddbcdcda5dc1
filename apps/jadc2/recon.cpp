// SPDX-License-Identifier: BSL-1.0
#include "recon.hpp"

#include "fmv/base64.hpp"

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/signal_set.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <limits>

namespace jadc2 {
namespace {

using steady = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr std::size_t most_times = 10'000;
constexpr std::uint64_t settled = 10; ///< frames after which what is found is judged

double ms_since(steady::time_point begin) {
    return std::chrono::duration<double, std::milli>(steady::now() - begin).count();
}

struct medians {
    double encode_ms = 0, way_ms = 0, queue_ms = 0, run_ms = 0;
};
BOOST_DESCRIBE_STRUCT(medians, (), (encode_ms, way_ms, queue_ms, run_ms))

struct summary {
    frame_fates::totals frames{};
    std::uint64_t judged = 0; ///< frames
    double recall = 0;
    double false_per_frame = 0;
    medians median{};
};
BOOST_DESCRIBE_STRUCT(summary, (), (frames, judged, recall, false_per_frame, median))

double median_of(const std::vector<picture>& all, double picture::*member) {
    std::vector<double> values;
    std::transform(all.begin(), all.end(), std::back_inserter(values),
                   [member](const picture& p) { return p.*member; });
    if (values.empty()) {
        return 0;
    }
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

} // namespace

recon::recon(const recon_options& wanted)
    : wanted_(wanted), tell_(wanted.name, wanted.json),
      ground_(io_, {.name = wanted.name, .listen = {wanted.listen}, .insecure = wanted.insecure}),
      space_(io_,
             {.name = wanted.name + "-camera", .gossip = cles::gossip(wanted.satellites), .routing = cles::routing()}),
      scene_(wanted.seed), run_(some_run()) {
    ground_.on_bind("tracks", {.description = "What moves on the ground, frame by frame"});
    ground_.on_push("impact", [this](const impact& at) { return assess(at); },
                    {.description = "Where and when something struck; what is seen of it is answered"});
    tell_.tell("listening", "listening on " + ground_.endpoints().front());
}

int recon::run() {
    boost::asio::signal_set signals{io_, SIGINT, SIGTERM};
    signals.async_wait([this](boost::system::error_code code, int) {
        if (!code) {
            ending_ = true;
            pace_.cancel();
        }
    });
    boost::asio::co_spawn(io_, film(), [&](const std::exception_ptr&) {
        signals.cancel();
        space_.stop();
        ground_.stop();
    });
    io_.run();
    report();
    return fates_.sums().done != 0 ? 0 : fates_.sums().failures.contains("no_target") ? 3 : 5;
}

boost::asio::awaitable<void> recon::film() {
    const auto begun = steady::now();
    begun_utc_ = utc_now();
    for (std::uint64_t number = 0; wanted_.frames == 0 || number < wanted_.frames; ++number) {
        const std::chrono::duration<double> after{static_cast<double>(number) / wanted_.fps};
        pace_.expires_at(begun + std::chrono::duration_cast<steady::duration>(after));
        co_await pace_.async_wait(boost::asio::as_tuple(boost::asio::use_awaitable));
        if (ending_) {
            break;
        }
        if (fates_.open()) {
            fates_.skipped();
        } else {
            fates_.captured();
            boost::asio::co_spawn(io_, process(number), boost::asio::detached);
        }
    }
    ending_ = true;
    while (fates_.open()) { // its deadline comes
        pace_.expires_at(steady::time_point::max());
        co_await pace_.async_wait(boost::asio::as_tuple(boost::asio::use_awaitable));
    }
}

boost::asio::awaitable<void> recon::process(std::uint64_t number) {
    const auto pixels = scene_.frame(number);
    picture times{.frame = number, .captured = utc_now()};
    const auto begun = steady::now();
    const fmv::frame_message message{.stream = wanted_.name + "-" + run_ + "-" + std::to_string(episode_),
                                     .frame = number,
                                     .width = scene::size.width,
                                     .height = scene::size.height,
                                     .deadline_ms = wanted_.deadline_ms,
                                     .pixels = fmv::to_base64(pixels)};
    times.encode_ms = ms_since(begun);
    const auto noun = fates_.target() + ":FMV_Processing";
    const auto options = cles::call_options{}.deadline(milliseconds{wanted_.deadline_ms});
    std::optional<cles::error> failure;
    try {
        const auto seen = co_await space_.async_delegate<fmv::found>(noun, message, options);
        times.queue_ms = seen.queue_ms;
        times.run_ms = seen.run_ms;
        times.way_ms = ms_since(begun) - times.encode_ms - seen.queue_ms - seen.run_ms;
        take(number, seen, std::move(times));
    } catch (const cles::error& e) {
        failure = e;
    }
    if (failure) {
        tell_trouble(*failure);
    }
    if (ending_) {
        pace_.cancel();
    }
}

void recon::take(std::uint64_t number, const fmv::found& seen, picture times) {
    if (std::exchange(fresh_, false)) {
        first_ = number;
        ready_frames_ = 0;
    }
    if (fates_.done(seen.node)) {
        tell_.tell("processing", seen.node + " processes the video, from frame " + std::to_string(number) + " on");
    }
    times.by = seen.node;
    times.ready = seen.ready;
    if (times_.size() == most_times) {
        times_.erase(times_.begin(), times_.begin() + most_times / 2);
    }
    times_.push_back(times);

    // What is found is told in pixels of the stream's first frame.
    const auto from = scene_.camera(first_);
    std::vector<fmv::point> places;
    times.tracks = seen.tracks;
    for (auto& t : times.tracks) {
        t.x += from.x;
        t.y += from.y;
        t.vx *= wanted_.fps;
        t.vy *= wanted_.fps;
        places.push_back({t.x, t.y});
    }
    if (seen.ready && ++ready_frames_ > settled) {
        score_.add(scene_.truth(static_cast<double>(number)), places);
    }
    times.published = utc_now();
    ground_.update("tracks", times);
}

// The first of its kind, and then once a second, so that those who look at old tracks know that they are old.
void recon::tell_trouble(const cles::error& why) {
    const auto asked = fates_.target();
    const bool news = fates_.failed(why);
    if (fates_.target() != asked) {
        ++episode_;
        fresh_ = true;
    }
    if (const double now = utc_now(); news || now - told_utc_ >= 1) {
        told_utc_ = now;
        const auto text = explain(why);
        tell_.tell("trouble", "no processing: " + text);
        ground_.update("tracks", picture{.trouble = text, .published = now});
    }
}

std::string recon::explain(const cles::error& why) const {
    if (why.code() != cles::errc::no_target) {
        return why.what();
    }
    std::string names;
    for (const auto& other : space_.peers()) {
        names += (names.empty() ? "" : ", ") + other.node + " (" + std::string{to_string(other.state)} + ")";
    }
    return names.empty() ? "no node answers where it was told to ask (--satellite): is clesd running there?"
                         : why.message() + ", of " + names + ": is libcles-fmv.so among the plugins of a node?";
}

assessment recon::assess(const impact& at) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& vehicle : scene_.truth((at.utc - begun_utc_) * wanted_.fps)) {
        nearest = std::min(nearest, std::hypot(vehicle.x - at.x, vehicle.y - at.y));
    }
    return {.missed_by = nearest, .hit = nearest <= score::near};
}

void recon::report() const {
    const auto& all = fates_.sums();
    const summary out{.frames = all,
                      .judged = score_.sums().frames,
                      .recall = score_.recall(),
                      .false_per_frame = score_.false_per_frame(),
                      .median = {.encode_ms = median_of(times_, &picture::encode_ms),
                                 .way_ms = median_of(times_, &picture::way_ms),
                                 .queue_ms = median_of(times_, &picture::queue_ms),
                                 .run_ms = median_of(times_, &picture::run_ms)}};
    std::string text = std::to_string(all.captured) + " frames: " + std::to_string(all.done) + " done, " +
                       std::to_string(all.failed) + " failed, " + std::to_string(all.skipped) + " skipped; ";
    text += out.judged == 0
                ? "none judged"
                : "recall " + fixed(out.recall, 3) + ", " + fixed(out.false_per_frame, 3) + " false tracks a frame";
    tell_.tell("report", text, out);
}

} // namespace jadc2
