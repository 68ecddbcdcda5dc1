// SPDX-License-Identifier: BSL-1.0
#include "recon.hpp"

#include "client/member_key.hpp"

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/signal_set.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <optional>

namespace jadc2 {
namespace {

using steady = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr std::size_t max_times = 10'000;

double ms_since(steady::time_point begin) {
    return std::chrono::duration<double, std::milli>(steady::now() - begin).count();
}

cles::service_options options_for_ground(const recon_options& args) {
    auto out = tool::options_of_member(args.name, args.keys);
    out.listen = {args.listen};
    out.insecure = args.insecure;
    return out;
}

cles::service_options options_for_space(const recon_options& args) {
    auto out = tool::options_of_member(args.name + "-camera", args.camera_keys);
    out.gossip = cles::gossip(args.satellites);
    out.routing = cles::routing();
    return out;
}

struct medians {
    double encode_ms = 0, way_ms = 0, queue_ms = 0, run_ms = 0;
};
BOOST_DESCRIBE_STRUCT(medians, (), (encode_ms, way_ms, queue_ms, run_ms))

struct summary {
    frame_fates::totals frames{};
    std::uint64_t judged = 0;      ///< frames
    std::uint64_t to_be_found = 0; ///< vehicles in sight for long enough, summed over these frames
    double recall = 0;             ///< the share of them that was found; 0 if there were none
    double false_per_frame = 0;
    double place_error = 0;    ///< m, per axis, root mean square
    double velocity_error = 0; ///< m/s, the same
    double picture_bytes = 0;  ///< of a frame's picture in base64, mean
    medians median{};
};
BOOST_DESCRIBE_STRUCT(summary, (),
                      (frames, judged, to_be_found, recall, false_per_frame, place_error, velocity_error, picture_bytes,
                       median))

double microseconds(double ms) { return std::round(ms * 1000) / 1000; } // fewer digits make a message shorter

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

recon::recon(const recon_options& args)
    : args_(args), events_(args.name, args.json), ground_(io_, options_for_ground(args)),
      space_(io_, options_for_space(args)), scene_(args.seed), run_(run_id()) {
    ground_.on_bind("tracks", {.description = "Objects that move on the ground, frame by frame"});
    ground_.on_push("impact", [this](const impact& at) { return assess(at); },
                    {.description = "Where and when a weapon struck; the answer describes what is seen"});
    events_.log("listening", "listening on " + ground_.endpoints().front());
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
    for (std::uint64_t number = 0; args_.frames == 0 || number < args_.frames; ++number) {
        const std::chrono::duration<double> after{static_cast<double>(number) / args_.fps};
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
    while (fates_.open()) { // until its deadline at the latest
        pace_.expires_at(steady::time_point::max());
        co_await pace_.async_wait(boost::asio::as_tuple(boost::asio::use_awaitable));
    }
}

boost::asio::awaitable<void> recon::process(std::uint64_t number) {
    picture times{.frame = number, .captured = utc_now()};
    const auto begun = steady::now();
    const auto pixels = scene_.frame(number, times.captured);
    const fmv::frame_message message{.stream = args_.name + "-" + run_ + "-" + std::to_string(episode_),
                                     .frame = number,
                                     .utc = times.captured,
                                     .width = scene::size.width,
                                     .height = scene::size.height,
                                     .deadline_ms = args_.deadline_ms,
                                     .camera = scene_.reported(times.captured),
                                     .format = args_.format,
                                     .picture = fmv::encode(pixels, scene::size, args_.format)};
    picture_bytes_ += message.picture.size();
    const double encode_ms = ms_since(begun);
    times.encode_ms = microseconds(encode_ms);
    const auto noun = fates_.target() + ":FMV_Processing";
    const auto options = cles::call_options{}.deadline(milliseconds{args_.deadline_ms});
    std::optional<cles::error> failure;
    try {
        const auto seen = co_await space_.async_delegate<fmv::found>(noun, message, options);
        times.queue_ms = microseconds(seen.queue_ms);
        times.run_ms = microseconds(seen.run_ms);
        times.way_ms = microseconds(ms_since(begun) - encode_ms - seen.queue_ms - seen.run_ms);
        take(seen, std::move(times));
    } catch (const cles::error& e) {
        failure = e;
    }
    if (failure) {
        report_error(*failure);
    }
    if (ending_) {
        pace_.cancel();
    }
}

void recon::take(const fmv::found& seen, picture times) {
    if (std::exchange(fresh_, false)) {
        evaluation_.begin(times.frame, times.captured);
    }
    if (fates_.done(seen.node)) {
        events_.log("processing",
                    seen.node + " processes the video, from frame " + std::to_string(times.frame) + " on");
    }
    times.by = seen.node;
    times.ready = seen.ready;
    if (times_.size() == max_times) {
        times_.erase(times_.begin(), times_.begin() + max_times / 2);
    }
    times_.push_back(times);

    evaluation_.add(times.captured, seen.tracks, seen.ready);
    times.tracks = seen.tracks;
    times.published = utc_now();
    ground_.update("tracks", times);
}

// Each new error, and then once per second, so that binders know that their tracks are old.
void recon::report_error(const cles::error& why) {
    const auto asked = fates_.target();
    const bool is_new = fates_.failed(why);
    if (fates_.target() != asked) {
        ++episode_;
        fresh_ = true;
    }
    if (const double now = utc_now(); is_new || now - reported_utc_ >= 1) {
        reported_utc_ = now;
        const auto text = explain(why);
        events_.log("trouble", "no processing: " + text);
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
    return names.empty() ? "no node answers at the given address (--satellite): is clesd running there?"
                         : why.message() + ", of " + names + ": is libcles-fmv.so among the plugins of a node" +
                               (args_.keys.empty() ? "?" : ", and may " + space_.name() + " request it?");
}

assessment recon::assess(const impact& at) const {
    if (!(std::abs(at.lat) <= 89 && std::abs(at.lon) <= 180 && std::abs(at.utc) <= 1e11)) { // false for NaN, too
        throw cles::error(cles::errc::bad_request,
                          "lat, lon and utc: degrees, -89 to 89 and -180 to 180, and seconds since 1970");
    }
    const auto place = scene::plane().to_plane({.lat = at.lat, .lon = at.lon});
    std::vector<double> distances;
    for (const auto& vehicle : scene_.truth(at.utc)) {
        distances.push_back(std::hypot(vehicle.at.east - place.east, vehicle.at.north - place.north));
    }
    const auto target = at.by == fates_.target() ? evaluation_.vehicle_of(at.target) : std::nullopt;
    const double missed_by = target ? distances[*target] : *std::min_element(distances.begin(), distances.end());
    return {.missed_by = missed_by, .hit = missed_by <= effective_radius, .is_target = target.has_value()};
}

void recon::report() const {
    const auto& all = fates_.sums();
    const summary out{.frames = all,
                      .judged = evaluation_.found().sums().frames,
                      .to_be_found = evaluation_.found().sums().vehicles,
                      .recall = evaluation_.found().recall(),
                      .false_per_frame = evaluation_.found().false_per_frame(),
                      .place_error = evaluation_.place_error(),
                      .velocity_error = evaluation_.velocity_error(),
                      .picture_bytes = static_cast<double>(picture_bytes_) /
                                       static_cast<double>(std::max<std::uint64_t>(1, all.done + all.failed)),
                      .median = {.encode_ms = median_of(times_, &picture::encode_ms),
                                 .way_ms = median_of(times_, &picture::way_ms),
                                 .queue_ms = median_of(times_, &picture::queue_ms),
                                 .run_ms = median_of(times_, &picture::run_ms)}};
    std::string text = std::to_string(all.captured) + " frames: " + std::to_string(all.done) + " done, " +
                       std::to_string(all.failed) + " failed, " + std::to_string(all.skipped) + " skipped; ";
    if (out.judged == 0) {
        text += "no frames scored";
    } else {
        text += (out.to_be_found == 0 ? "no vehicle in sight for long enough" : "recall " + fixed(out.recall, 3)) +
                ", " + fixed(out.false_per_frame, 3) + " false tracks a frame, off by " + fixed(out.place_error, 1) +
                " m and " + fixed(out.velocity_error, 1) + " m/s";
    }
    events_.log("report", text, out);
}

} // namespace jadc2
