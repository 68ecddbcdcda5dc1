// SPDX-License-Identifier: BSL-1.0
// Services with security that reach each other by sealed datagrams.

#include <cles/responder.hpp>
#include <cles/url.hpp>

#include "security/recording_path.hpp"
#include "security/secured_services.hpp"
#include "support/impaired_path.hpp"

#include <boost/asio/ip/udp.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace sealed_udp {
namespace {

using namespace cles::security::test;
using namespace std::chrono_literals;
using boost::asio::ip::udp;
using cles::errc;

const std::string speed = "{\"value\":7}";

/// How often each handler has run, in all processes of a node.
struct executions {
    int pulls = 0;
    int pushes = 0;
    int delegates = 0;
    std::vector<cles::responder> unanswered;
    cles::identity peer;
};

/// What happens to a feed of numbers.
struct followed {
    void bind(cles::service& by, const std::string& noun) {
        by.async_bind<int>(noun, [this](boost::system::error_code code, cles::feed<int> made) {
            BOOST_REQUIRE_MESSAGE(!code, code.message());
            feed = std::move(made);
            next();
        });
    }
    void next() {
        feed.async_next([this](boost::system::error_code failed, const auto& event) {
            if (failed) {
                return;
            }
            lost += event.kind == cles::feed_event::lost ? 1 : 0;
            rebound += event.kind == cles::feed_event::rebound ? 1 : 0;
            if (event.kind == cles::feed_event::current || event.kind == cles::feed_event::update) {
                values.push_back(event.value);
            }
            next();
        });
    }
    cles::feed<int> feed;
    std::vector<int> values;
    int lost = 0;
    int rebound = 0;
};

struct outcome {
    std::optional<boost::system::error_code> code;
    std::string why;
    cles::json_text reply;
};

struct fixture {
    /// car1 serves, car2 asks.
    fixture() {
        start_car1();
        start_car2();
    }

    [[nodiscard]] cles::service_options options(const std::string& name, const std::string& listen) const {
        auto made = fleet.options(name);
        made.listen = {listen};
        return made;
    }
    /// Always at the same port.
    void start_car1() {
        car1.reset();
        car1 = std::make_unique<cles::service>(io, options("car1", where));
        where = car1->endpoints().front();
        car1->on_pull("speed", [this](const cles::request& r) {
            ++ran.pulls;
            ran.peer = r.peer();
            return 7;
        });
        car1->on_push("note", [this](const std::string&) { ++ran.pushes; });
        car1->on_delegate("plan", [this](int n) {
            ++ran.delegates;
            return n + 1;
        });
        car1->on_push("wait", [this](const cles::request&, cles::responder answer) {
            ++ran.pushes;
            ran.unanswered.push_back(std::move(answer));
        });
    }
    void start_car2() { start_car2(where); }
    void start_car2(const std::string& at) {
        car2.reset();
        auto wanted = options("car2", own);
        wanted.peers.emplace("car1", at);
        wanted.limits.lease = lease;
        car2 = std::make_unique<cles::service>(io, std::move(wanted));
        own = car2->endpoints().front();
    }
    [[nodiscard]] std::string ask(const std::string& command) { return cles::security::test::ask(io, *car2, command); }
    std::shared_ptr<outcome> begin(const std::string& command, const cles::call_options& how = {}) {
        auto made = std::make_shared<outcome>();
        auto with = how;
        car2->async_request(command, std::move(with.diagnostics(made->why)),
                            [made](boost::system::error_code code, const cles::json_text& reply) {
                                made->code = code;
                                made->reply = reply;
                            });
        return made;
    }
    template <class Condition>
    void until(Condition&& holds, const std::source_location& at = std::source_location::current()) {
        cles::test::run_until(io, std::forward<Condition>(holds), cles::test::patience, at);
    }
    std::uint64_t counted(cles::service& by, const std::string& what) {
        const auto all = cles::security::test::ask(io, by, "PULL self:cles/metrics");
        const auto at = all.find("\"" + what + "\":");
        BOOST_REQUIRE_MESSAGE(at != std::string::npos, all);
        return std::stoull(all.substr(at + what.size() + 3));
    }
    [[nodiscard]] std::uint16_t port() const { return cles::parse_url(where).port; }

    boost::asio::io_context io;
    secured_fleet fleet{"car1", "car2", "car3"};
    executions ran;
    std::string where = "udp://127.0.0.1:0";
    std::string own = "udp://127.0.0.1:0";
    std::chrono::milliseconds lease{10'000};
    std::unique_ptr<cles::service> car1;
    std::unique_ptr<cles::service> car2;
};

} // namespace
} // namespace sealed_udp

BOOST_FIXTURE_TEST_SUITE(sealed_udp, fixture)

BOOST_AUTO_TEST_CASE(requests_are_answered) {
    BOOST_TEST(ask("PULL car1:speed") == speed);
    BOOST_TEST(ask("PUSH car1:note {\"value\":\"hi\"}") == "{}");
    BOOST_TEST(ask("DELEGATE car1:plan {\"value\":4}") == "{\"value\":5}");
    BOOST_TEST(ran.pulls == 1);
    BOOST_TEST(ran.pushes == 1);
    BOOST_TEST(ran.delegates == 1);
    BOOST_TEST(ran.peer.name == "car2");
    BOOST_TEST(ran.peer.transport == "udp");
    BOOST_TEST(where.starts_with("udp://127.0.0.1:"));
}

BOOST_AUTO_TEST_CASE(both_ends_may_ask) {
    car1->set_peer("car2", own);
    car2->on_pull("fuel", [] { return 3; });
    for (int i = 0; i < 5; ++i) {
        BOOST_TEST(ask("PULL car1:speed") == speed);
        BOOST_TEST(cles::security::test::ask(io, *car1, "PULL car2:fuel") == "{\"value\":3}");
    }
}

BOOST_AUTO_TEST_CASE(nothing_is_sent_in_the_clear) {
    recording_path path{io, port()};
    start_car2(path.url());
    BOOST_TEST(ask("PUSH car1:note {\"value\":\"secret\"}") == "{}");
    BOOST_TEST(!path.to_node.empty());
    BOOST_TEST(!path.to_client.empty());
    for (const auto* all : {&path.to_node, &path.to_client}) {
        for (const auto& each : *all) {
            BOOST_TEST(static_cast<unsigned char>(each.at(0)) >= 0x80U);
            BOOST_TEST(each.size() <= 1236U);
            BOOST_TEST(!contains(each, "secret"));
            BOOST_TEST(!contains(each, "note"));
        }
    }
}

BOOST_AUTO_TEST_CASE(large_lines_are_refused_as_by_plain_datagrams) {
    const auto body = [](std::size_t size) { return "PUSH car1:note {\"value\":\"" + std::string(size, 'x') + "\"}"; };
    BOOST_TEST(ask(body(1100)) == "{}");
    BOOST_TEST(contains(ask(body(1200)), "at most 1200 bytes"));
    car1->on_pull("much", [] { return std::string(1300, 'x'); });
    const auto asked = begin("PULL car1:much");
    until([&] { return asked->code.has_value(); });
    BOOST_TEST((*asked->code == errc::too_large), asked->code->message());
}

BOOST_AUTO_TEST_CASE(what_is_not_sealed_is_dropped_and_counted) {
    udp::socket plain{io, {boost::asio::ip::address_v4::loopback(), 0}};
    const udp::endpoint to{boost::asio::ip::address_v4::loopback(), port()};
    for (const std::string text : {"PULL car1:speed id=1", "", "x"}) {
        plain.send_to(boost::asio::buffer(text), to);
    }
    until([&] { return counted(*car1, "datagrams_unsealed") == 3; });
    BOOST_TEST(plain.available() == 0U);
    BOOST_TEST(ran.pulls == 0);
    BOOST_TEST(counted(*car1, "links_accepted") == 0U);
}

BOOST_AUTO_TEST_CASE(a_lossy_path_runs_nothing_twice) {
    cles::test::impaired_path path{io, where, {.loss = 0.2, .twice = 0.3, .most_delay = 20ms}, 7};
    start_car2(path.url());
    until([&] { return ask("PULL car1:speed") == speed; });
    std::vector<std::shared_ptr<outcome>> asked;
    for (int i = 0; i < 40; ++i) {
        asked.push_back(
            begin("PUSH car1:note {\"value\":\"" + std::to_string(i) + "\"}", cles::call_options{}.deadline(15s)));
    }
    for (const auto& each : asked) {
        until([&] { return each->code.has_value(); });
        BOOST_TEST(!*each->code, each->why);
    }
    BOOST_TEST(ran.pushes == 40);
}

BOOST_AUTO_TEST_SUITE(who)

BOOST_AUTO_TEST_CASE(an_address_without_a_name_is_refused) {
    const auto asked = begin("PULL car1:speed", cles::call_options{}.at(where));
    until([&] { return asked->code.has_value(); });
    BOOST_TEST((*asked->code == errc::denied));
    BOOST_TEST(contains(asked->why, "use 'tls'"), asked->why);
    BOOST_TEST(ran.pulls == 0);
}

BOOST_AUTO_TEST_CASE(another_member_does_not_pass_for_the_one_that_is_meant) {
    car2->set_peer("car3", where);
    const auto asked = begin("PULL car3:speed", cles::call_options{}.deadline(10s));
    until([&] { return asked->code.has_value(); });
    BOOST_TEST((*asked->code == errc::unavailable));
    BOOST_TEST(contains(asked->why, "car3 does not answer at udp://127.0.0.1:"), asked->why);
    BOOST_TEST(ran.pulls == 0);
    BOOST_TEST(ask("PULL car1:speed") == speed); // its own links are not affected
}

BOOST_AUTO_TEST_CASE(a_name_without_a_member_is_refused) {
    car2->set_peer("car9", where);
    const auto outcome = ask("PULL car9:speed");
    BOOST_TEST(contains(outcome, "may not send"), outcome);
}

BOOST_AUTO_TEST_CASE(a_stranger_gets_no_answer) {
    secured_fleet other{"car1", "car2"};
    auto wanted = other.options("car2");
    wanted.peers.emplace("car1", where);
    cles::service impostor{io, std::move(wanted)};
    const auto outcome = cles::security::test::ask(io, impostor, "PULL car1:speed");
    BOOST_TEST(contains(outcome, "does not answer"), outcome);
    BOOST_TEST(ran.pulls == 0);
    BOOST_TEST(counted(*car1, "links_accepted") == 0U);
}

BOOST_AUTO_TEST_CASE(a_removed_member_loses_its_links) {
    car1->update("pose", 1);
    followed pose;
    pose.bind(*car2, "car1:pose");
    until([&] { return pose.values.size() == 1; });
    fleet.authority.remove("car2");
    BOOST_TEST(cles::security::test::ask(io, *car1, "PUSH self:cles/roster " + fleet.authority.newest().line()) ==
               "{}");
    until([&] { return counted(*car1, "links_lost") != 0; });
    const auto before = ran.pulls;
    const auto outcome = ask("PULL car1:speed");
    BOOST_TEST(outcome != speed);
    car1->update("pose", 2);
    cles::test::run_ready(io);
    BOOST_TEST(ran.pulls == before);
    BOOST_TEST(pose.values.size() == 1U);
    pose.feed.close();
}

// It is not in the roster of the node that it asks, which gets the newer one over TLS.
BOOST_AUTO_TEST_CASE(a_new_member_brings_the_roster_by_tls) {
    fleet.with_newest = false;
    fleet.add("car4");
    car1->listen("tls://127.0.0.1:" + std::to_string(port()));
    auto wanted = fleet.options("car4");
    wanted.peers.emplace("car1", where);
    cles::service car4{io, std::move(wanted)};
    until([&] { return cles::security::test::ask(io, car4, "PULL car1:speed") == speed; });
    BOOST_TEST(ran.peer.name == "car4");
    BOOST_TEST(ran.peer.transport == "udp");
}

// A session states the version, and the roster itself, which is too long for a datagram, comes over TLS.
BOOST_AUTO_TEST_CASE(a_stated_newer_roster_is_fetched_by_tls) {
    fleet.with_newest = false;
    fleet.add("car4");
    car1->listen("tls://127.0.0.1:" + std::to_string(port()));
    BOOST_TEST(cles::security::test::ask(io, *car1, "PUSH self:cles/roster " + fleet.authority.newest().line()) ==
               "{}");
    BOOST_TEST(ask("PULL car1:speed") == speed);
    const auto version = "\"roster\":" + std::to_string(fleet.authority.newest().version());
    until([&] { return contains(ask("PULL self:cles"), version); });
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(feeds)

BOOST_AUTO_TEST_CASE(leases_are_renewed) {
    lease = 200ms; // long enough for a busy machine to renew it in time
    start_car2();
    followed pose;
    car1->update("pose", 0);
    pose.bind(*car2, "car1:pose");
    until([&] { return pose.values.size() == 1; });
    const auto begun = std::chrono::steady_clock::now();
    int value = 0;
    while (std::chrono::steady_clock::now() - begun < 10 * lease) {
        car1->update("pose", ++value);
        until([&] { return pose.values.back() == value; });
    }
    BOOST_TEST(pose.lost == 0);
    BOOST_TEST(counted(*car2, "requests_sent") > 5U);
    pose.feed.close();
}

BOOST_AUTO_TEST_CASE(they_are_bound_again_when_the_publisher_restarts) {
    lease = 1s; // longer than the new session takes: otherwise it is lost again at once
    start_car2();
    followed pose;
    car1->update("pose", 1);
    pose.bind(*car2, "car1:pose");
    until([&] { return pose.values.size() == 1; });
    start_car1();
    car1->update("pose", 2);
    until([&] { return pose.values.back() == 2; });
    BOOST_TEST(pose.lost == 1);
    BOOST_TEST(pose.rebound == 1);
    car1->update("pose", 3);
    until([&] { return pose.values.back() == 3; });
    pose.feed.close();
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(restarts)

BOOST_AUTO_TEST_CASE(a_restarted_responder_answers_after_one_exchange) {
    BOOST_TEST(ask("PULL car1:speed") == speed);
    for (int i = 0; i < 3; ++i) {
        start_car1();
        const auto begun = std::chrono::steady_clock::now();
        BOOST_TEST(ask("PULL car1:speed") == speed);
        const auto took = std::chrono::steady_clock::now() - begun;
        BOOST_TEST((took < 550ms)); // one copy of the request: the second would be sent after 600 ms
        BOOST_TEST_MESSAGE("live again after " << std::chrono::duration_cast<std::chrono::milliseconds>(took).count()
                                               << " ms");
    }
    BOOST_TEST(counted(*car2, "links_lost") == 0U);
}

BOOST_AUTO_TEST_CASE(a_restarted_requester_is_served_at_once) {
    recording_path path{io, port()}; // so that it keeps its address
    start_car2(path.url());
    BOOST_TEST(ask("PUSH car1:note {\"value\":\"a\"}") == "{}");
    for (int i = 0; i < 3; ++i) {
        start_car2(path.url());
        const auto begun = std::chrono::steady_clock::now();
        BOOST_TEST(ask("PUSH car1:note {\"value\":\"a\"}") == "{}");
        BOOST_TEST((std::chrono::steady_clock::now() - begun < 150ms)); // no copy was needed
    }
    BOOST_TEST(ran.pushes == 4);
}

BOOST_AUTO_TEST_CASE(what_may_have_run_fails_and_the_rest_is_asked_again) {
    recording_path path{io, port()};
    start_car2(path.url());
    BOOST_TEST(ask("PULL car1:speed") == speed);
    path.drop = [](std::string_view, bool to_node) { return !to_node; };
    const auto push = begin("PUSH car1:wait", cles::call_options{}.deadline(20s));
    const auto pull = begin("PULL car1:speed", cles::call_options{}.deadline(20s));
    until([&] { return ran.pushes == 1 && ran.pulls == 2; });
    ran.unanswered.clear();
    start_car1();
    path.drop = nullptr;
    until([&] { return push->code && pull->code; });
    BOOST_TEST((*push->code == errc::unavailable));
    BOOST_TEST(contains(push->why, "restarted"), push->why);
    BOOST_TEST(!*pull->code);
    BOOST_TEST(pull->reply.text == speed);
    BOOST_TEST(ran.pushes == 1);
    BOOST_TEST(ask("PUSH car1:note {\"value\":\"a\"}") == "{}");
}

BOOST_AUTO_TEST_CASE(a_node_that_is_gone_is_reported) {
    BOOST_TEST(ask("PULL car1:speed") == speed);
    car1.reset();
    const auto asked = begin("PULL car1:speed", cles::call_options{}.deadline(1s));
    until([&] { return asked->code.has_value(); });
    BOOST_TEST((*asked->code == errc::deadline)); // there is a session, so it may only be out of reach
    start_car2();
    const auto other = begin("PULL car1:speed", cles::call_options{}.deadline(10s));
    until([&] { return other->code.has_value(); });
    BOOST_TEST((*other->code == errc::unavailable));
    BOOST_TEST(contains(other->why, "does not answer"), other->why);
}

BOOST_AUTO_TEST_CASE(a_replayed_conversation_runs_nothing) {
    recording_path path{io, port()};
    start_car2(path.url());
    const auto talk = [&] {
        BOOST_TEST(ask("PULL car1:speed") == speed);
        BOOST_TEST(ask("PUSH car1:note {\"value\":\"a\"}") == "{}");
        BOOST_TEST(ask("DELEGATE car1:plan {\"value\":1}") == "{\"value\":2}");
    };
    const auto replay = [&] {
        const auto before = std::array{ran.pulls, ran.pushes, ran.delegates};
        path.replay();
        cles::test::run_ready(io);
        BOOST_TEST((std::array{ran.pulls, ran.pushes, ran.delegates} == before));
    };
    talk();
    replay();
    start_car1();
    replay();
    talk();
    replay();
    start_car2(path.url());
    replay();
    talk();
    replay();
    start_car1();
    start_car2(path.url());
    replay();
    talk();
    replay();
    BOOST_TEST(ran.pushes == 4);
    BOOST_TEST(ran.delegates == 4);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
