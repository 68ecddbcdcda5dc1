// SPDX-License-Identifier: BSL-1.0
#include "tasks.hpp"

#include <cles/setting_error.hpp>

#include "frame_codec.hpp"
#include "messages.hpp"
#include "streams.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

namespace fmv {
namespace {

using cles::errc;
using cles::error;
using steady = std::chrono::steady_clock;
using milliseconds = std::chrono::duration<double, std::milli>;

constexpr int least_side = 64;
constexpr int most_side = 1024;
constexpr std::size_t most_pixels = 700'000; ///< of which the base64 and the rest fit into a line

struct fates {
    std::uint64_t streams = 0, frames = 0, repeated = 0, refused = 0, bad = 0;
};
BOOST_DESCRIBE_STRUCT(fates, (), (streams, frames, repeated, refused, bad))

struct shop {
    explicit shop(const settings& wanted)
        : all(wanted.streams.value_or(8), std::chrono::seconds{wanted.idle_s.value_or(10)}) {}

    streams all;
    std::atomic<std::uint64_t> frames{0}, repeated{0}, refused{0}, bad{0};
};

void require(bool fits, const char* what) {
    if (!fits) {
        throw error(errc::bad_request, what);
    }
}

bool is_within(double value, double low, double high) { return value >= low && value <= high; } // false for NaN

void check(const camera_message& from) {
    require(is_within(from.lat, -89, 89), "camera.lat: -89 to 89 degrees");
    require(is_within(from.lon, -180, 180), "camera.lon: -180 to 180 degrees");
    require(is_within(from.height, 1, 50'000), "camera.height: 1 to 50000 m above the ground");
    require(is_within(from.azimuth, -360, 360), "camera.azimuth: -360 to 360 degrees");
    require(is_within(from.depression, 10, 90), "camera.depression: 10 to 90 degrees below the horizon");
    require(is_within(from.field_of_view, 0.01, 120), "camera.field_of_view: 0.01 to 120 degrees");
    require(is_within(from.position_sigma, 0, 1000), "camera.position_sigma: 0 to 1000 m");
    require(is_within(from.pointing_sigma, 0, 10), "camera.pointing_sigma: 0 to 10 degrees");
}

extent checked(const frame_message& what) {
    const extent size{.width = what.width, .height = what.height};
    require(!what.stream.empty() && what.stream.size() <= 64, "stream: 1 to 64 characters");
    if (std::min(size.width, size.height) < least_side || std::max(size.width, size.height) > most_side ||
        size.pixels() > most_pixels) {
        throw error(errc::bad_request, "width and height: " + std::to_string(least_side) + " to " +
                                           std::to_string(most_side) + ", " + std::to_string(most_pixels) +
                                           " pixels at most");
    }
    require(what.format == "grey" || what.format == "jpeg", "format: grey or jpeg");
    require(what.format == "grey" || has_jpeg(),
            "format: this node is built without libjpeg-turbo, and takes only grey (recon --format grey)");
    require(is_within(what.utc, 0, 1e11), "utc: seconds since 1970");
    check(what.camera);
    return size;
}

grey decoded(const frame_message& what, extent size) {
    auto pixels = decode(what.picture, size, what.format);
    if (!pixels) {
        throw error(errc::bad_request, what.format == "jpeg"
                                           ? "picture: not the base64 of a JPEG of " + std::to_string(size.width) +
                                                 " x " + std::to_string(size.height) + " pixels"
                                           : "picture: not the base64 of " + std::to_string(size.pixels()) + " bytes");
    }
    return std::move(*pixels);
}

// \param picture nothing, if it has not been decoded yet
found look(kept_stream& at, const frame_message& what, extent size, std::optional<grey> picture, shop& counts) {
    require(at.video.size() == size, "the stream began with frames of another size");
    found out{.frame = what.frame};
    if (what.frame < at.next) {
        ++counts.repeated;
    } else {
        require(!at.video.utc() || what.utc > *at.video.utc(), "utc: later than that of the frame before");
        at.video.take(picture ? *picture : decoded(what, size), what.camera, what.utc);
        at.next = what.frame + 1;
        ++counts.frames;
    }
    out.ready = at.video.ready();
    out.tracks = at.video.tracks();
    return out;
}

void process(const cles::request& asked, const cles::responder& answer, shop& here) {
    const auto begun = steady::now();
    const auto left = asked.deadline() - cles::time_point::clock::now();
    try {
        const auto what = asked.as<frame_message>();
        const auto size = checked(what);
        auto at = here.all.find(what.stream, begun);
        std::optional<grey> first;
        if (!at && here.all.count() < here.all.most()) {
            first = decoded(what, size); // what is no picture begins no stream
            at = here.all.begin(what.stream, size, begun);
        }
        if (!at) { // decoding takes long: not for what is refused
            ++here.refused;
            answer.refuse("the limit of streams is reached", std::chrono::seconds{1});
            return;
        }
        std::unique_lock mine{at->lock, std::try_to_lock};
        if (!mine) {
            ++here.refused;
            answer.refuse("the stream's last frame is still being processed", std::chrono::milliseconds{5});
            return;
        }
        auto out = look(*at, what, size, std::move(first), here);
        mine.unlock(); // the next frame may come as soon as this one is answered
        out.node = asked.node();
        const auto whole = milliseconds{static_cast<double>(what.deadline_ms)};
        out.queue_ms = std::max(0.0, (whole - milliseconds{left}).count());
        out.run_ms = milliseconds{steady::now() - begun}.count();
        answer.done(out);
    } catch (const error&) {
        ++here.bad;
        throw;
    }
}

} // namespace

void settings::check() const {
    if (const auto n = streams.value_or(8); n < 1 || n > 64) {
        throw cles::setting_error("streams", "streams: 1 to 64");
    }
    if (const auto s = idle_s.value_or(10); s < 1 || s > 3600) {
        throw cles::setting_error("idle_s", "idle_s: 1 to 3600");
    }
}

void register_tasks(cles::registrar& to, const settings& wanted) {
    wanted.check();
    const auto here = std::make_shared<shop>(wanted);
    to.on_pull("FMV_Processing",
               [here] {
                   return fates{.streams = here->all.count(),
                                .frames = here->frames,
                                .repeated = here->repeated,
                                .refused = here->refused,
                                .bad = here->bad};
               },
               {.description = "Streams, and the outcomes of their frames", .idempotent = true, .inline_ok = true});
    to.on_delegate("FMV_Processing",
                   [here](const cles::request& asked, const cles::responder& answer) { process(asked, answer, *here); },
                   {.description = "Tracks of what moves, after one more frame of a stream",
                    .idempotent = true,
                    .local = true}); // this node has the stream's earlier frames
}

} // namespace fmv
