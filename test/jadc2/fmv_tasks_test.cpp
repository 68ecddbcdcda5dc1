// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>

#include "fmv/base64.hpp"
#include "fmv/frame_codec.hpp"
#include "fmv/messages.hpp"
#include "fmv/streams.hpp"
#include "fmv/tasks.hpp"
#include "jadc2/scene.hpp"
#include "support/answer.hpp"
#include "support/asked_node.hpp"
#include "support/run_until.hpp"

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace fmv_tasks {
namespace {

using cles::test::run_ready;
using cles::test::run_until;
using jadc2::scene;

struct fixture : cles::test::asked_node {
    fixture() { fmv::register_tasks(node, {.streams = 2}); }
    std::string send(const fmv::frame_message& what) { return ask("DELEGATE self:FMV_Frame " + cles::to_json(what)); }
    [[nodiscard]] fmv::frame_message frame(std::uint64_t number, const std::string& stream = "a") const {
        return {.stream = stream,
                .frame = number,
                .utc = time_of(number),
                .width = scene::size.width,
                .height = scene::size.height,
                .deadline_ms = 30'000,
                .camera = ground.reported(time_of(number)),
                .format = "grey",
                .picture = fmv::to_base64(ground.frame(number, time_of(number)))};
    }
    static double time_of(std::uint64_t number) { return 1000 + static_cast<double>(number) * 0.04; }

    scene ground{1};
};

// The node films for itself: the next frame is published when there is a result of the last one.
struct filming : fixture {
    filming() {
        node.on_bind("video", [this](const cles::request&) { ++bound; });
    }
    void open(const std::string& frames = "self:video") {
        const fmv::video_message what{
            .frames = frames, .width = scene::size.width, .height = scene::size.height, .format = "grey"};
        const auto options = end.options().on_progress([this](double, std::string_view json) {
            all.push_back(cles::from_json<fmv::found>(json));
            if (on_result) {
                on_result();
            }
        });
        node.async_delegate<fmv::video_result>("self:FMV_Processing", what, options,
                                               boost::asio::bind_cancellation_slot(stop.slot(), end.take()));
        run_until(io, [&] { return bound == 1 || end.done(); });
    }
    void publish(std::uint64_t number, bool good = true) {
        const auto whole = frame(number);
        node.update("video", fmv::video_frame{.frame = number,
                                              .utc = whole.utc,
                                              .camera = whole.camera,
                                              .picture = good ? whole.picture : "no picture"});
    }
    void publish_end(std::uint64_t number) { node.update("video", fmv::video_frame{.frame = number}); }
    void until_results(std::size_t count) {
        run_until(io, [&] { return all.size() == count; });
    }

    int bound = 0;
    std::vector<fmv::found> all;
    std::function<void()> on_result;
    cles::test::answer<fmv::video_result> end;
    boost::asio::cancellation_signal stop;
};

} // namespace
} // namespace fmv_tasks

BOOST_FIXTURE_TEST_SUITE(fmv_tasks, fixture)

BOOST_AUTO_TEST_CASE(its_jobs_stay_on_this_node) {
    BOOST_TEST(ask("PULL self:cles").find("\"local\":true") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(frames_become_tracks) {
    fmv::found last;
    for (std::uint64_t i = 0; i < 60; ++i) {
        last = cles::from_json<fmv::found>(send(frame(i)));
        BOOST_TEST(last.node == "node");
        BOOST_TEST(last.frame == i);
        BOOST_TEST(last.run_ms > 0);
        BOOST_TEST(last.queue_ms >= 0);
        BOOST_TEST(last.queue_ms < 1000);
        BOOST_TEST(last.ready == (i + 1 >= fmv::background::learning));
    }
    BOOST_TEST_REQUIRE(last.tracks.size() >= 2U);
    for (const auto& t : last.tracks) { // on the ground, near the middle of the area
        const auto at = scene::plane().to_plane({.lat = t.lat, .lon = t.lon});
        BOOST_TEST(std::hypot(at.east, at.north) < 120);
        BOOST_TEST(std::hypot(t.ve, t.vn) > 5);
        BOOST_TEST(std::hypot(t.ve, t.vn) < 30);
        BOOST_TEST(t.sigma > 2);
        BOOST_TEST(t.sigma < 4);
    }
    BOOST_TEST(ask("PULL self:FMV_Processing") == R"({"streams":1,"frames":60,"repeated":0,"refused":0,"bad":0})");
}

BOOST_AUTO_TEST_CASE(a_message_with_a_frame_fits_into_a_line) {
    BOOST_TEST(cles::to_json(frame(0)).size() < 1'000'000U);
    BOOST_TEST(fmv::to_base64(fmv::grey(700'000)).size() + 1000 < (1U << 20U));
}

BOOST_AUTO_TEST_CASE(a_frame_that_comes_twice_changes_nothing) {
    for (std::uint64_t i = 0; i < 50; ++i) {
        send(frame(i));
    }
    const auto once = cles::from_json<fmv::found>(send(frame(50)));
    const auto twice = cles::from_json<fmv::found>(send(frame(50)));
    const auto old = cles::from_json<fmv::found>(send(frame(20)));
    BOOST_TEST(cles::to_json(once.tracks) == cles::to_json(twice.tracks));
    BOOST_TEST(cles::to_json(once.tracks) == cles::to_json(old.tracks));
    BOOST_TEST(ask("PULL self:FMV_Processing") == R"({"streams":1,"frames":51,"repeated":2,"refused":0,"bad":0})");
}

BOOST_AUTO_TEST_CASE(streams_are_apart_and_no_more_than_so_many) {
    BOOST_TEST(cles::from_json<fmv::found>(send(frame(0))).frame == 0U);
    BOOST_TEST(cles::from_json<fmv::found>(send(frame(7, "b"))).frame == 7U);
    BOOST_TEST(send(frame(0, "c")) == "busy: node: the limit of streams is reached");
    BOOST_TEST(ask("PULL self:FMV_Processing") == R"({"streams":2,"frames":2,"repeated":0,"refused":1,"bad":0})");
}

// Decoding takes a worker's time.
BOOST_AUTO_TEST_CASE(what_is_refused_or_known_is_not_decoded) {
    send(frame(0));
    send(frame(0, "b"));
    auto what = frame(0, "c");
    what.picture = "no picture";
    BOOST_TEST(send(what) == "busy: node: the limit of streams is reached");
    what = frame(0);
    what.picture = "no picture";
    BOOST_TEST(cles::from_json<fmv::found>(send(what)).frame == 0U);
    BOOST_TEST(ask("PULL self:FMV_Processing") == R"({"streams":2,"frames":2,"repeated":1,"refused":1,"bad":0})");
}

BOOST_AUTO_TEST_CASE(what_is_no_picture_begins_no_stream) {
    auto what = frame(0);
    what.picture = "no picture";
    BOOST_TEST(send(what).starts_with("bad_request: node: picture: "));
    BOOST_TEST(ask("PULL self:FMV_Processing") == R"({"streams":0,"frames":0,"repeated":0,"refused":0,"bad":1})");
}

BOOST_AUTO_TEST_CASE(what_cannot_be_is_refused) {
    auto what = frame(0);
    what.picture.pop_back();
    BOOST_TEST(send(what) == "bad_request: node: picture: not the base64 of 76800 bytes");
    what = frame(0);
    what.picture.front() = '!';
    BOOST_TEST(send(what) == "bad_request: node: picture: not the base64 of 76800 bytes");
    what = frame(0);
    what.format = "png";
    BOOST_TEST(send(what) == "bad_request: node: format: grey or jpeg");
    what.format = "jpeg"; // which it is not
    BOOST_TEST(send(what) == (fmv::has_jpeg()
                                  ? "bad_request: node: picture: not the base64 of a JPEG of 320 x 240 pixels"
                                  : "bad_request: node: format: this node is built without libjpeg-turbo, "
                                    "and takes only grey (recon --format grey)"));
    for (const auto& [width, height] : {std::pair{63, 240}, {240, -1}, {1025, 240}, {1024, 1024}}) {
        what = frame(0);
        what.width = width;
        what.height = height;
        BOOST_TEST(send(what).starts_with("bad_request: node: width and height: 64 to 1024, 700000 pixels at most"));
    }
    what = frame(0);
    what.stream = "";
    BOOST_TEST(send(what) == "bad_request: node: stream: 1 to 64 characters");
    what.stream = std::string(65, 'a');
    BOOST_TEST(send(what) == "bad_request: node: stream: 1 to 64 characters");
    BOOST_TEST(ask("DELEGATE self:FMV_Frame {}").starts_with("bad_request: node: the body is invalid: stream"));
    send(frame(0));
    what = frame(1);
    what.utc = frame(0).utc;
    BOOST_TEST(send(what) == "bad_request: node: utc: later than that of the frame before");
    what = frame(1);
    std::swap(what.width, what.height);
    BOOST_TEST(send(what) == "bad_request: node: the stream began with frames of another size");
}

BOOST_AUTO_TEST_CASE(cameras_that_cannot_be_are_refused) {
    const auto refused = [this](auto change) {
        auto what = frame(0);
        change(what.camera);
        return send(what);
    };
    using camera = fmv::camera_message;
    BOOST_TEST(refused([](camera& c) { c.lat = 90; }) == "bad_request: node: camera.lat: -89 to 89 degrees");
    BOOST_TEST(refused([](camera& c) { c.lon = 181; }) == "bad_request: node: camera.lon: -180 to 180 degrees");
    BOOST_TEST(refused([](camera& c) { c.height = 0; }) ==
               "bad_request: node: camera.height: 1 to 50000 m above the ground");
    BOOST_TEST(refused([](camera& c) { c.azimuth = std::numeric_limits<double>::infinity(); }) ==
               "bad_request: node: camera.azimuth: -360 to 360 degrees");
    BOOST_TEST(refused([](camera& c) { c.depression = 0; }) ==
               "bad_request: node: camera.depression: 10 to 90 degrees below the horizon");
    BOOST_TEST(refused([](camera& c) { c.field_of_view = 180; }) ==
               "bad_request: node: camera.field_of_view: 0.01 to 120 degrees");
    BOOST_TEST(refused([](camera& c) { c.position_sigma = -1; }) ==
               "bad_request: node: camera.position_sigma: 0 to 1000 m");
    BOOST_TEST(refused([](camera& c) { c.pointing_sigma = 11; }) ==
               "bad_request: node: camera.pointing_sigma: 0 to 10 degrees");
    BOOST_TEST(ask("PULL self:FMV_Processing") == R"({"streams":0,"frames":0,"repeated":0,"refused":0,"bad":8})");
}

BOOST_FIXTURE_TEST_CASE(a_video_is_opened_once_and_each_frame_has_a_result, filming) {
    constexpr std::uint64_t frames = 60;
    std::uint64_t next = 0;
    on_result = [&] { ++next < frames ? publish(next) : publish_end(next); };
    open();
    publish(0);
    run_until(io, [&] { return end.done(); });
    BOOST_TEST(cles::to_json(end.value) == R"({"node":"node","frames":60,"missing":0,"bad":0})");
    BOOST_TEST_REQUIRE(all.size() == frames);
    for (std::uint64_t i = 0; i < frames; ++i) {
        BOOST_TEST(all[i].node == "node");
        BOOST_TEST(all[i].frame == i);
        BOOST_TEST(all[i].run_ms > 0);
        BOOST_TEST(all[i].queue_ms >= 0);
        BOOST_TEST(all[i].ready == (i + 1 >= fmv::background::learning));
    }
    BOOST_TEST(all.back().tracks.size() >= 2U);
    BOOST_TEST(ask("PULL self:FMV_Processing") == R"({"streams":0,"frames":60,"repeated":0,"refused":0,"bad":0})");
}

BOOST_FIXTURE_TEST_CASE(frames_that_are_missing_or_bad_are_counted, filming) {
    publish(7); // before it is opened: of unknown age
    open();
    for (const std::uint64_t number : {10U, 11U, 15U}) {
        publish(number);
        run_ready(io);
    }
    publish(16, false);
    run_ready(io);
    publish(11); // comes late
    run_ready(io);
    publish(17);
    until_results(4);
    publish_end(18);
    run_until(io, [&] { return end.done(); });
    BOOST_TEST(cles::to_json(end.value) == R"({"node":"node","frames":4,"missing":3,"bad":1})");
    BOOST_TEST(all.front().frame == 10U);
    BOOST_TEST(all.back().frame == 17U);
    BOOST_TEST(ask("PULL self:FMV_Processing") == R"({"streams":0,"frames":4,"repeated":1,"refused":0,"bad":1})");
}

BOOST_FIXTURE_TEST_CASE(a_video_ends_with_its_requester, filming) {
    open();
    publish(0);
    until_results(1);
    BOOST_TEST(ask("PULL self:FMV_Processing").starts_with(R"({"streams":1,)"));
    stop.emit(boost::asio::cancellation_type::terminal);
    run_until(io, [&] { return end.done(); });
    run_ready(io);
    BOOST_TEST(ask("PULL self:FMV_Processing") == R"({"streams":0,"frames":1,"repeated":0,"refused":0,"bad":0})");
}

BOOST_FIXTURE_TEST_CASE(why_the_frames_do_not_come_is_the_answer, filming) {
    open("self:nothing");
    BOOST_TEST(end.code == cles::make_error_code(cles::errc::unavailable));
    BOOST_TEST(end.words == "node: the frames of self:nothing: no_task: node has no BIND 'nothing'");
}

BOOST_FIXTURE_TEST_CASE(a_video_is_a_stream_among_others, filming) {
    open();
    send(frame(0));
    BOOST_TEST(send(frame(0, "b")) == "busy: node: the limit of streams is reached");
    BOOST_TEST(
        ask(R"(DELEGATE self:FMV_Processing {"frames":"self:video","width":320,"height":240,"format":"grey"})") ==
        "busy: node: the limit of streams is reached");
    stop.emit(boost::asio::cancellation_type::terminal);
    run_until(io, [&] { return end.done(); });
}

BOOST_AUTO_TEST_CASE(a_video_that_cannot_be_is_refused) {
    for (const auto* what :
         {R"({"frames":"self:video","width":10,"height":240,"format":"grey"})",
          R"({"frames":"self:video","width":320,"height":240,"format":"png"})", R"({"width":320,"height":240})"}) {
        BOOST_TEST(ask(std::string{"DELEGATE self:FMV_Processing "} + what).starts_with("bad_request: node: "));
    }
    BOOST_TEST(ask("PULL self:FMV_Processing") == R"({"streams":0,"frames":0,"repeated":0,"refused":0,"bad":3})");
}

BOOST_AUTO_TEST_CASE(settings_that_cannot_be) {
    for (const auto& wrong : {fmv::settings{.streams = 0}, fmv::settings{.streams = 65}, fmv::settings{.idle_s = 0}}) {
        boost::asio::io_context other;
        cles::service there{other, {.name = "there"}};
        BOOST_CHECK_THROW(fmv::register_tasks(there, wrong), cles::error);
    }
}

BOOST_AUTO_TEST_CASE(a_stream_that_is_idle_is_forgotten) {
    using namespace std::chrono_literals;
    const auto now = std::chrono::steady_clock::time_point{} + 1h;
    fmv::streams all{1, 10s};
    BOOST_TEST((all.find("a", now) == nullptr));
    const auto first = all.begin("a", scene::size, now);
    BOOST_TEST((all.begin("a", scene::size, now) == first));
    BOOST_TEST((all.find("a", now + 9s) == first));
    BOOST_TEST((all.find("b", now + 18s) == nullptr));
    BOOST_TEST((all.begin("b", scene::size, now + 18s) == nullptr));
    BOOST_TEST((all.find("b", now + 20s) == nullptr));
    BOOST_TEST((all.begin("b", scene::size, now + 20s) != nullptr));
    BOOST_TEST(all.count() == 1U);
}

BOOST_AUTO_TEST_CASE(the_stream_of_a_job_is_forgotten_with_it) {
    using namespace std::chrono_literals;
    const auto now = std::chrono::steady_clock::time_point{} + 1h;
    fmv::streams all{2, 10s};
    auto job = all.open(scene::size, now);
    BOOST_TEST((job != nullptr));
    BOOST_TEST((all.begin("a", scene::size, now) != nullptr));
    BOOST_TEST(all.count() == 2U);
    BOOST_TEST((all.open(scene::size, now + 9s) == nullptr));
    BOOST_TEST((all.begin("b", scene::size, now + 9s) == nullptr));
    job.reset();
    BOOST_TEST(all.count() == 1U);
    job = all.open(scene::size, now + 9s);
    BOOST_TEST((job != nullptr));
    BOOST_TEST((all.open(scene::size, now + 20s) != nullptr)); // the other one has been idle
}

BOOST_AUTO_TEST_SUITE_END()
