// SPDX-License-Identifier: BSL-1.0
#include "recon.hpp"

#include "client/member_key.hpp"

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/signal_set.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <iterator>
#include <optional>
#include <string_view>
#include <utility>

namespace jadc2 {
namespace {

using steady = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr std::size_t max_times = 10'000;
constexpr std::size_t max_engaged = 1'000;
constexpr double longest_flight_s = 60;
constexpr double search_s = 5; // for the first node that processes the video, besides the time for a result
constexpr std::uint64_t last_search_ms = 1000; // the same when the film has ended

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
    out.listen = args.camera_listen;
    out.insecure = args.insecure;
    out.gossip = cles::gossip(args.satellites);
    out.routing = cles::routing();
    return out;
}

struct medians {
    double encode_ms = 0, way_ms = 0, queue_ms = 0, run_ms = 0;
};
BOOST_DESCRIBE_STRUCT(medians, (), (encode_ms, way_ms, queue_ms, run_ms))

struct summary {
    video_session::totals frames{};
    std::uint64_t judged = 0;      ///< frames
    std::uint64_t to_be_found = 0; ///< vehicles in sight for long enough, summed over these frames
    double recall = 0;             ///< the share of them that was found; 0 if there were none
    double false_per_frame = 0;
    std::uint64_t corrected = 0; ///< frames whose tracks were corrected by plots of the node's own
    double place_error = 0;      ///< m, per axis, root mean square
    double velocity_error = 0;   ///< m/s, the same
    double picture_bytes = 0;    ///< of a frame's picture in base64, mean
    medians median{};
};
BOOST_DESCRIBE_STRUCT(summary, (),
                      (frames, judged, to_be_found, recall, false_per_frame, corrected, place_error, velocity_error,
                       picture_bytes, median))

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
      space_(io_, options_for_space(args)), scene_(args.seed),
      video_(static_cast<double>(args.deadline_ms) / 1000, static_cast<double>(args.deadline_ms) / 1000 + search_s) {
    ground_.on_bind("tracks", {.description = "Objects that move on the ground, frame by frame"});
    ground_.on_push("impact", [this](impact at) { return watch_impact(std::move(at)); },
                    {.description = "Where and when a weapon will strike; the answer describes what is seen then"});
    space_.on_bind("video", {.description = "The frames of the camera"});
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
    return video_.sums().done != 0 ? 0 : video_.sums().failures.contains("no_target") ? 3 : 5;
}

double recon::now() const { return std::chrono::duration<double>(steady::now() - begun_).count(); }

boost::asio::awaitable<void> recon::film() {
    begun_ = steady::now();
    const std::chrono::duration<double> interval{1 / args_.fps};
    std::uint64_t number = 0;
    for (; !ending_ && (args_.frames == 0 || number < args_.frames); ++number) {
        const auto due = begun_ + std::chrono::duration_cast<steady::duration>(static_cast<double>(number) * interval);
        if (steady::now() - due > interval) { // the next one is due, too
            video_.skipped();
            continue;
        }
        pace_.expires_at(due);
        co_await pace_.async_wait(boost::asio::as_tuple(boost::asio::use_awaitable));
        if (ending_) {
            break;
        }
        take_frame(number);
    }
    ending_ = true;
    co_await end_video(number);
}

// Frames that are on their way still get their results. A node that is looked for gets a moment, so that it is known
// why there is none.
boost::asio::awaitable<void> recon::end_video(std::uint64_t frames) {
    space_.update("video", fmv::video_frame{.frame = frames});
    const auto until =
        steady::now() +
        milliseconds{video_.is_processed() ? args_.deadline_ms : std::min(args_.deadline_ms, last_search_ms)};
    while (video_.is_open() && steady::now() < until) {
        pace_.expires_at(until);
        co_await pace_.async_wait(boost::asio::as_tuple(boost::asio::use_awaitable));
    }
    if (video_.is_open()) {
        ++opening_;
        stop_->emit(boost::asio::cancellation_type::terminal);
        video_.ended();
    }
}

void recon::take_frame(std::uint64_t number) {
    if (video_.is_silent(now())) {
        give_up_video();
    }
    if (video_.has_to_open(now())) {
        open_video();
    }
    video_.captured(number, now());
    if (video_.is_open()) {
        publish(number);
    }
}

void recon::publish(std::uint64_t number) {
    const double captured = utc_now();
    const auto begun = steady::now();
    const auto pixels = scene_.frame(number, captured);
    const fmv::video_frame message{.frame = number,
                                   .utc = captured,
                                   .camera = scene_.reported(captured),
                                   .picture = fmv::encode(pixels, scene::size, args_.format)};
    picture_bytes_ += message.picture.size();
    ++pictures_;
    const double encode_ms = microseconds(ms_since(begun));
    sent_[number] = {.captured = captured, .encode_ms = encode_ms, .sent = steady::now()};
    space_.update("video", message); // the node may begin before this returns
}

// It lasts as long as the video: a day, and then it is opened again.
void recon::open_video() {
    video_.opened(now());
    const auto opening = ++opening_;
    stop_ = std::make_shared<boost::asio::cancellation_signal>();
    const auto why = std::make_shared<std::string>();
    const fmv::video_message what{.frames = space_.name() + ":video",
                                  .width = scene::size.width,
                                  .height = scene::size.height,
                                  .format = args_.format};
    auto options = cles::call_options{};
    options.deadline(std::chrono::hours{24}).diagnostics(*why);
    options.on_progress([this, opening](double, std::string_view json) {
        fmv::found seen;
        if (opening == opening_ && cles::from_json(json, seen)) {
            take(seen);
        }
    });
    auto ended = [this, opening, why, stop = stop_](boost::system::error_code code, const fmv::video_result&) {
        if (opening != opening_) {
            return;
        }
        if (code || !ending_) {
            on_failure(code ? cles::error{code, *why}
                            : cles::error{cles::errc::unavailable, "the node says that the video has ended"});
        } else {
            video_.ended();
        }
        if (ending_) {
            pace_.cancel();
        }
    };
    space_.async_delegate<fmv::video_result>("any:FMV_Processing", what, options,
                                             boost::asio::bind_cancellation_slot(stop_->slot(), std::move(ended)));
}

// What the node still says about it does not count.
void recon::give_up_video() {
    const auto whom = video_.is_processed() ? video_.node() : std::string{"the node"};
    ++opening_;
    stop_->emit(boost::asio::cancellation_type::terminal);
    on_failure(cles::error{cles::errc::deadline,
                           whom + " has reported nothing for " + std::to_string(args_.deadline_ms) + " ms"});
}

void recon::take(const fmv::found& seen) {
    const auto news = video_.result(seen.node, seen.frame);
    const auto at = sent_.find(seen.frame);
    if (!news || at == sent_.end()) {
        return;
    }
    const auto frame = at->second;
    sent_.erase(sent_.begin(), std::next(at));
    picture times{.by = seen.node, .frame = seen.frame, .ready = seen.ready, .captured = frame.captured};
    times.encode_ms = frame.encode_ms;
    times.queue_ms = microseconds(seen.queue_ms);
    times.run_ms = microseconds(seen.run_ms);
    times.way_ms = microseconds(ms_since(frame.sent) - seen.queue_ms - seen.run_ms);
    if (news->begins) {
        evaluation_.begin(seen.frame, frame.captured);
        events_.log("processing",
                    seen.node + " processes the video, from frame " + std::to_string(seen.frame) + " on" +
                        (news->missing == 0 ? "" : "; " + std::to_string(news->missing) + " before it are missing"));
    } else {
        report_missing(news->missing, seen.frame);
    }
    if (times_.size() == max_times) {
        times_.erase(times_.begin(), times_.begin() + max_times / 2);
    }
    times_.push_back(times);

    take_correction(seen);
    evaluation_.add(frame.captured, seen.tracks, seen.ready, seen.corrected_by.value_or(fmv::place_shift{}));
    if (news->missing != 0) {
        times.missing = news->missing;
    }
    times.tracks = seen.tracks;
    for (const auto& each : seen.tracks) {
        if (engaged_.contains({seen.node, each.id})) {
            if (!times.engaged) {
                times.engaged.emplace();
            }
            times.engaged->push_back(each.id);
        }
    }
    times.published = utc_now();
    ground_.update("tracks", times);
}

// Told when it begins.
void recon::take_correction(const fmv::found& seen) {
    corrected_ += seen.corrected_by ? 1U : 0U;
    if (std::exchange(is_corrected_, seen.corrected_by.has_value()) || !seen.corrected_by) {
        return;
    }
    events_.log("fusion", seen.node + " corrects the places of tracks by plots of its own: the camera's are off by " +
                              fixed(seen.corrected_by->east, 1) + " m to the east and " +
                              fixed(seen.corrected_by->north, 1) + " m to the north");
}

// At most once per second.
void recon::report_missing(std::uint64_t missing, std::uint64_t frame) {
    untold_ += missing;
    if (untold_ != 0 && now() - missing_told_ >= 1) {
        missing_told_ = now();
        events_.log("missing", std::to_string(std::exchange(untold_, 0)) + " frames before frame " +
                                   std::to_string(frame) + " are missing");
    }
}

// Each new error, and then once per second, so that binders know that their tracks are old.
void recon::on_failure(const cles::error& why) {
    const bool is_new = video_.failed(why, now());
    engaged_.clear(); // the tracks get other numbers
    sent_.clear();
    is_corrected_ = false;
    if (const double utc = utc_now(); is_new || utc - reported_utc_ >= 1) {
        reported_utc_ = utc;
        const auto text = explain(why);
        events_.log("trouble", "no processing: " + text);
        ground_.update("tracks", picture{.trouble = text, .published = utc});
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

// Until the impact, and afterwards if it hits, other mission centres see that the target has been attacked.
boost::asio::awaitable<assessment> recon::watch_impact(impact at) {
    if (!(std::abs(at.lat) <= 89 && std::abs(at.lon) <= 180 && std::abs(at.utc) <= 1e11)) { // false for NaN, too
        throw cles::error(cles::errc::bad_request,
                          "lat, lon and utc: degrees, -89 to 89 and -180 to 180, and seconds since 1970");
    }
    if (at.utc - utc_now() > longest_flight_s) {
        throw cles::error(cles::errc::bad_request, "utc: " + fixed(longest_flight_s, 0) + " s from now at most");
    }
    const bool known = video_.is_processed() && at.by == video_.node();
    const auto vehicle = known ? evaluation_.vehicle_of(at.target) : std::nullopt;
    const auto track = std::pair{at.by, at.target};
    if (known && engaged_.size() < max_engaged) {
        engaged_.insert(track);
    }
    boost::asio::steady_timer pause{io_};
    while (!ending_ && utc_now() < at.utc) {
        const auto left = std::chrono::duration<double>{at.utc - utc_now()};
        pause.expires_after(std::min(milliseconds{50}, std::chrono::ceil<milliseconds>(left))); // or until it ends
        co_await pause.async_wait(boost::asio::as_tuple(boost::asio::use_awaitable));
    }
    const auto seen = assess(at, vehicle);
    if (!seen.hit) {
        engaged_.erase(track);
    }
    co_return seen;
}

assessment recon::assess(const impact& at, std::optional<std::size_t> vehicle) const {
    const auto place = scene::plane().to_plane({.lat = at.lat, .lon = at.lon});
    std::vector<double> distances;
    for (const auto& each : scene_.truth(at.utc)) {
        distances.push_back(std::hypot(each.at.east - place.east, each.at.north - place.north));
    }
    const double missed_by = vehicle ? distances[*vehicle] : *std::min_element(distances.begin(), distances.end());
    return {.missed_by = missed_by, .hit = missed_by <= effective_radius, .is_target = vehicle.has_value()};
}

void recon::report() const {
    const auto& all = video_.sums();
    const summary out{.frames = all,
                      .judged = evaluation_.found().sums().frames,
                      .to_be_found = evaluation_.found().sums().vehicles,
                      .recall = evaluation_.found().recall(),
                      .false_per_frame = evaluation_.found().false_per_frame(),
                      .corrected = corrected_,
                      .place_error = evaluation_.place_error(),
                      .velocity_error = evaluation_.velocity_error(),
                      .picture_bytes = static_cast<double>(picture_bytes_) /
                                       static_cast<double>(std::max<std::uint64_t>(1, pictures_)),
                      .median = {.encode_ms = median_of(times_, &picture::encode_ms),
                                 .way_ms = median_of(times_, &picture::way_ms),
                                 .queue_ms = median_of(times_, &picture::queue_ms),
                                 .run_ms = median_of(times_, &picture::run_ms)}};
    std::string text = std::to_string(all.captured) + " frames: " + std::to_string(all.done) + " done, " +
                       std::to_string(all.missing) + " missing, " + std::to_string(all.skipped) + " skipped; ";
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
