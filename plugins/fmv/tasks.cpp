// SPDX-License-Identifier: BSL-1.0
#include "tasks.hpp"

#include <cles/setting_error.hpp>

#include "frame_checks.hpp"
#include "messages.hpp"
#include "video_job.hpp"
#include "workshop.hpp"

#include <algorithm>
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

namespace fmv {
namespace {

using steady = std::chrono::steady_clock;
using milliseconds = std::chrono::duration<double, std::milli>;

struct fates {
    std::uint64_t streams = 0, frames = 0, repeated = 0, refused = 0, bad = 0;
};
BOOST_DESCRIBE_STRUCT(fates, (), (streams, frames, repeated, refused, bad))

extent checked(const frame_message& what) {
    require(!what.stream.empty() && what.stream.size() <= 64, "stream: 1 to 64 characters");
    const auto size = checked_size(what.width, what.height, what.format);
    check_utc(what.utc);
    check(what.camera);
    return size;
}

// \param picture nothing, if it has not been decoded yet
found look(kept_stream& at, const frame_message& what, extent size, std::optional<grey> picture, workshop& counts) {
    require(at.video.size() == size, "the stream began with frames of another size");
    found out{.frame = what.frame};
    if (what.frame < at.next) {
        ++counts.repeated;
    } else {
        require(!at.video.utc() || what.utc > *at.video.utc(), "utc: later than that of the frame before");
        at.video.take(picture ? *picture : decoded(what.picture, size, what.format), what.camera, what.utc);
        at.next = what.frame + 1;
        ++counts.frames;
    }
    out.ready = at.video.ready();
    out.tracks = at.video.tracks();
    return out;
}

void process(const cles::request& asked, const cles::responder& answer, workshop& here) {
    const auto begun = steady::now();
    const auto left = asked.deadline() - cles::time_point::clock::now();
    try {
        const auto what = asked.as<frame_message>();
        const auto size = checked(what);
        auto at = here.all.find(what.stream, begun);
        std::optional<grey> first;
        if (!at && here.all.count() < here.all.most()) {
            first = decoded(what.picture, size, what.format); // what is no picture begins no stream
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
    } catch (const cles::error&) {
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
    const auto radar = wanted.plots.value_or(false) ? std::optional{wanted.seed.value_or(1)} : std::nullopt;
    const auto here =
        std::make_shared<workshop>(wanted.streams.value_or(8), std::chrono::seconds{wanted.idle_s.value_or(10)}, radar);
    to.on_pull("FMV_Processing",
               [here] {
                   return fates{.streams = here->all.count(),
                                .frames = here->frames,
                                .repeated = here->repeated,
                                .refused = here->refused,
                                .bad = here->bad};
               },
               {.description = "Streams, and the outcomes of their frames", .idempotent = true, .inline_ok = true});
    to.on_delegate(
        "FMV_Processing",
        [here](const cles::request& asked, const cles::responder& answer) { open_video(asked, answer, here); },
        {.description = "Receives a video, and reports the tracks of what moves in each frame",
         .local = true}); // the frames come to this node
    to.on_delegate("FMV_Frame",
                   [here](const cles::request& asked, const cles::responder& answer) { process(asked, answer, *here); },
                   {.description = "Tracks of what moves, after one more frame of a stream",
                    .idempotent = true,
                    .local = true}); // this node has the stream's earlier frames
}

} // namespace fmv
