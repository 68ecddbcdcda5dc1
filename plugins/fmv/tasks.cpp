// SPDX-License-Identifier: BSL-1.0
#include "tasks.hpp"

#include <cles/setting_error.hpp>

#include "base64.hpp"
#include "messages.hpp"
#include "streams.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <string>

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

extent checked(const frame_message& what) {
    const extent size{.width = what.width, .height = what.height};
    if (what.stream.empty() || what.stream.size() > 64) {
        throw error(errc::bad_request, "stream: 1 to 64 characters");
    }
    if (std::min(size.width, size.height) < least_side || std::max(size.width, size.height) > most_side ||
        size.pixels() > most_pixels) {
        throw error(errc::bad_request, "width and height: " + std::to_string(least_side) + " to " +
                                           std::to_string(most_side) + ", " + std::to_string(most_pixels) +
                                           " pixels at most");
    }
    return size;
}

found look(kept_stream& at, const frame_message& what, grey frame, shop& counts) {
    found out{.frame = what.frame};
    if (what.frame < at.next) {
        ++counts.repeated;
    } else {
        at.video.take(std::move(frame), static_cast<int>(std::min<std::uint64_t>(what.frame + 1 - at.next, 1000)));
        at.next = what.frame + 1;
        ++counts.frames;
    }
    out.ready = at.video.ready();
    for (const auto& t : at.video.targets()) {
        out.tracks.push_back({.id = t.id,
                              .x = t.at.x,
                              .y = t.at.y,
                              .vx = t.velocity.x,
                              .vy = t.velocity.y,
                              .age = t.age,
                              .missed = t.missed});
    }
    return out;
}

void process(const cles::request& asked, const cles::responder& answer, shop& here) {
    const auto begun = steady::now();
    const auto left = asked.deadline() - cles::time_point::clock::now();
    try {
        const auto what = asked.as<frame_message>();
        const auto size = checked(what);
        auto pixels = from_base64(what.pixels, size.pixels());
        if (!pixels) {
            throw error(errc::bad_request, "pixels: not the base64 of " + std::to_string(size.pixels()) + " bytes");
        }
        const auto at = here.all.find(what.stream, size, begun);
        if (!at) {
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
        if (at->video.size() != size) {
            throw error(errc::bad_request, "the stream began with frames of another size");
        }
        auto out = look(*at, what, std::move(*pixels), here);
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
