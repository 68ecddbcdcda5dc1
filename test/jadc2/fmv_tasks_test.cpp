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

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <cmath>
#include <limits>
#include <string>

namespace fmv_tasks {
namespace {

using jadc2::scene;

struct fixture : cles::test::asked_node {
    fixture() { fmv::register_tasks(node, {.streams = 2}); }
    std::string send(const fmv::frame_message& what) {
        return ask("DELEGATE self:FMV_Processing " + cles::to_json(what));
    }
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
    BOOST_TEST(ask("DELEGATE self:FMV_Processing {}").starts_with("bad_request: node: the body is invalid: stream"));
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

BOOST_AUTO_TEST_SUITE_END()
