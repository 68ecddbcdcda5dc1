// SPDX-License-Identifier: BSL-1.0
// Links of the transport `tls` between nodes of one fleet. What all transports have in common is in test/contract.

#include <cles/link.hpp>

#include "security/fleet/fleet.hpp"
#include "security/fleet_fixture.hpp"
#include "security/link_admission.hpp"
#include "support/link_recorder.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"
#include "tls/tls_context.hpp"
#include "tls/tls_engine.hpp"
#include "tls/tls_error.hpp"
#include "tls/tls_transport.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <malloc.h>
#include <sys/resource.h>

namespace tls_link {
namespace {

using namespace cles::security;
using namespace cles::security::test;
using namespace std::chrono_literals;
using cles::test::link_recorder;
using cles::test::run_ready;
using cles::test::run_until;
using cles::test::scripted_peer;
using cles::tls::tls_errc;

// A node: its fleet, and its transport.
struct node_with_tls {
    node_with_tls(std::string_view name, std::shared_ptr<const roster> known, std::chrono::milliseconds to_open = 5s,
                  const admission_terms::handshake_turns::bounds& handshakes = admission_terms::usual_handshakes)
        : of(std::make_shared<fleet>(std::string{name}, key_of(name), std::move(known))),
          transport(cles::tls::make_tls_transport({.fleet = of,
                                                   .epoch = "5f3a09c1",
                                                   .report =
                                                       [this](const auto& refused) {
                                                           reports.emplace_back(refused.why);
                                                           sources.emplace_back(refused.source);
                                                       },
                                                   .time_to_open = to_open,
                                                   .handshakes = handshakes})) {}

    std::shared_ptr<fleet> of;
    std::vector<std::string> reports{};
    std::vector<std::string> sources{};
    std::unique_ptr<cles::link_transport> transport;
};

// An end of a link with its owner.
struct end {
    cles::link_ptr link{};
    std::shared_ptr<link_recorder> events = std::make_shared<link_recorder>();

    void adopt(cles::link_ptr made) {
        link = std::move(made);
        link->start(events);
    }
    void say(std::string_view text) const {
        link->output().append(text);
        link->flush();
    }
    ~end() {
        if (link) {
            link->close();
        }
    }
};

struct fixture {
    boost::asio::io_context io;
    fleet_authority authority = authority_with({"car1", "car2"});
    cles::limits bounds{};
    std::unique_ptr<cles::acceptor> listener{};
    std::vector<std::unique_ptr<end>> accepted{};

    void listen(node_with_tls& at) {
        listener = at.transport->listen(io.get_executor(), cles::parse_url("tls://127.0.0.1:0"), bounds);
        listener->start([this](cles::link_ptr made) {
            accepted.push_back(std::make_unique<end>());
            accepted.back()->adopt(std::move(made));
        });
    }
    // Dials, and returns the failure if there is one.
    boost::system::error_code dial(node_with_tls& by, end& out, std::string_view name = {}) {
        boost::system::error_code failed;
        bool done = false;
        by.transport->dial_node(io.get_executor(), listener->local(), name, bounds,
                                [&](boost::system::error_code code, cles::link_ptr made) {
                                    done = true;
                                    failed = code;
                                    if (made) {
                                        out.adopt(std::move(made));
                                    }
                                });
        run_until(io, [&] { return done; });
        return failed;
    }
    [[nodiscard]] scripted_peer socket() { return {io, "tcp" + to_string(listener->local()).substr(3)}; }
    // The same from another loopback address.
    [[nodiscard]] scripted_peer socket_from(const char* address) {
        boost::asio::ip::tcp::socket made{io, {boost::asio::ip::make_address(address), 0}};
        made.connect({boost::asio::ip::make_address("127.0.0.1"), listener->local().port});
        return {io, made.release()};
    }
    void wait_for_accepted() {
        run_until(io, [&] { return !accepted.empty(); });
    }
};

// A client that a test plays step by step, over a bare socket.
struct played_client {
    played_client(fixture& with, const node_with_tls& of) : played_client(with, of, with.socket()) {}
    played_client(fixture& with, const node_with_tls& of, scripted_peer by)
        : io(with.io), socket(std::move(by)), context(of.of->own_key()), terms(std::make_shared<admission_terms>()) {
        terms->fleet = of.of;
        terms->epoch = "00000001";
    }

    // Takes what has arrived.
    void receive() {
        static_cast<void>(socket.ended());
        const auto bytes = socket.unread().substr(seen);
        seen += bytes.size();
        for (const char byte : bytes) {
            engine.prepare()[0] = byte;
            engine.commit(1);
            step();
        }
    }
    void step() {
        boost::system::error_code why;
        if (!shaken) {
            shaken = engine.shake_hands(why) == cles::tls::tls_engine::status::done;
            return;
        }
        std::array<char, 1000> space{};
        std::size_t count = 0;
        while (engine.read(space, count, why) == cles::tls::tls_engine::status::done) {
            text.append(space.data(), count);
        }
    }
    void send() { socket.send(std::exchange(engine.encrypted(), {})); }
    void say(std::string_view what) {
        boost::system::error_code why;
        engine.write(what, why);
        send();
    }
    void shake_hands() {
        step();
        send();
        run_until(io, [&] {
            receive();
            return shaken;
        });
        send();
    }
    void wait_for(std::string_view what) {
        run_until(io, [&] {
            receive();
            return contains(text, what);
        });
    }
    void open() {
        shake_hands();
        say(hello + "PUSH self:cles/welcome reply=no\n");
        wait_for("cles/welcome");
    }

    inline static const std::string hello = "PUSH self:cles/hello reply=no {\"version\":3,\"epoch\":\"00000001\"}\n";
    boost::asio::io_context& io;
    scripted_peer socket;
    std::size_t seen = 0;
    cles::tls::tls_context context;
    cles::tls::tls_engine engine{context, cles::tls::tls_engine::role::client};
    std::shared_ptr<admission_terms> terms;
    bool shaken = false;
    std::string text{};
};

} // namespace
} // namespace tls_link

BOOST_FIXTURE_TEST_SUITE(tls_link, fixture)

BOOST_AUTO_TEST_CASE(both_ends_know_name_and_epoch) {
    node_with_tls car1{"car1", authority.share()};
    node_with_tls car2{"car2", authority.share()};
    listen(car2);
    end near;
    BOOST_TEST(!dial(car1, near, "car2"));
    BOOST_TEST(near.link->peer().name == "car2");
    BOOST_TEST(near.link->peer().transport == "tls");
    BOOST_TEST(near.link->epoch() == "5f3a09c1");
    near.say("PULL self:speed\n");
    run_until(io, [&] { return !accepted.empty() && accepted[0]->events->lines.size() == 1; });
    BOOST_TEST(accepted[0]->link->peer().name == "car1");
    BOOST_TEST(accepted[0]->link->epoch() == "5f3a09c1");
    BOOST_TEST(accepted[0]->events->lines[0] == "PULL self:speed"); // and nothing of the admission
}

BOOST_AUTO_TEST_CASE(another_name_than_expected_is_no_link) {
    node_with_tls car1{"car1", authority.share()};
    node_with_tls car2{"car2", authority.share()};
    listen(car2);
    end near;
    BOOST_TEST(dial(car1, near, "car3") == make_error_code(tls_errc::other_name));
    BOOST_TEST(car1.reports.at(0) == "the other end is car2, not car3");
    BOOST_TEST(car1.sources.at(0) == "127.0.0.1");
    run_until(io, [&] { return accepted.at(0)->events->lost(); });
    BOOST_TEST(accepted[0]->events->lines.empty());
}

BOOST_AUTO_TEST_CASE(a_key_that_is_not_in_the_roster_gets_no_link) {
    node_with_tls car1{"car1", authority.share()};
    node_with_tls stranger{"car3", authority.share()};
    listen(car1);
    end near;
    const auto code = dial(stranger, near);
    BOOST_TEST(code == make_error_code(tls_errc::refused_by_peer));
    BOOST_TEST(code == boost::system::errc::permission_denied);
    BOOST_TEST(contains(stranger.reports.at(0), "the key of this node is not in roster 3"));
    run_until(io, [&] { return accepted.at(0)->events->lost(); });
    BOOST_TEST(accepted[0]->events->why == make_error_code(tls_errc::not_member));
    BOOST_TEST(accepted[0]->events->lines.empty());
}

BOOST_AUTO_TEST_CASE(a_removed_key_gets_no_link) {
    const auto before = authority.share();
    authority.remove("car2");
    node_with_tls car1{"car1", authority.share()};
    node_with_tls car2{"car2", before};
    listen(car1);
    end near;
    BOOST_TEST(dial(car2, near) == make_error_code(tls_errc::refused_by_peer));
    BOOST_TEST(car2.of->in_force().version() == before->version());
}

BOOST_DATA_TEST_CASE_F(fixture, the_newer_roster_passes_in_both_directions, boost::unit_test::data::make({true, false}),
                       dialler_is_newer) {
    const auto before = authority.share();
    for (int i = 0; i < 300; ++i) { // several records
        authority.add(node("other" + std::to_string(i)));
    }
    node_with_tls newer{"car1", authority.share()};
    node_with_tls older{"car2", before};
    auto& dialling = dialler_is_newer ? newer : older;
    listen(dialler_is_newer ? older : newer);
    end near;
    BOOST_TEST(!dial(dialling, near));
    BOOST_TEST(older.of->in_force().version() == authority.newest().version());
}

BOOST_AUTO_TEST_CASE(the_links_of_a_removed_member_end_at_once_and_others_stay) {
    authority.add(node("car3"));
    node_with_tls car1{"car1", authority.share()};
    node_with_tls car2{"car2", authority.share()};
    node_with_tls car3{"car3", authority.share()};
    listen(car1);
    end removed;
    end stays;
    BOOST_TEST(!dial(car2, removed));
    BOOST_TEST(!dial(car3, stays));
    removed.say("one\n");
    stays.say("one\n");
    run_until(io, [&] {
        return accepted.size() == 2 && std::ranges::all_of(accepted, [](const auto& a) { return a->events->has('l'); });
    });
    authority.remove("car2");
    removed.say("too late\n");
    car1.of->offer(authority.newest().line());
    run_until(
        io, [&] { return accepted[0]->events->lost(); }, 1s);
    BOOST_TEST(accepted[0]->events->why == make_error_code(tls_errc::removed));
    BOOST_TEST(accepted[0]->events->lines.size() == 1U);
    run_until(io, [&] { return removed.events->lost(); });
    stays.say("two\n");
    run_until(io, [&] { return accepted[1]->events->lines.size() == 2; });
}

BOOST_AUTO_TEST_CASE(all_links_of_a_node_that_is_removed_itself_end) {
    node_with_tls car1{"car1", authority.share()};
    node_with_tls car2{"car2", authority.share()};
    listen(car2);
    end near;
    BOOST_TEST(!dial(car1, near));
    authority.remove("car1");
    car1.of->offer(authority.newest().line());
    run_until(io, [&] { return near.events->lost(); });
    BOOST_TEST(near.events->why == make_error_code(tls_errc::removed));
}

// -- a peer that keeps no rules ------------------------------------------------------------------------------------

BOOST_DATA_TEST_CASE_F(fixture, what_is_not_tls_ends_the_link,
                       boost::unit_test::data::make({"PULL self:cles\n", "GET / HTTP/1.1\r\n\r\n", "\x16\x03\x03\0"}),
                       bytes) {
    node_with_tls car1{"car1", authority.share(), 100ms};
    listen(car1);
    auto peer = socket();
    peer.send(bytes);
    BOOST_TEST(!contains(peer.rest(), "{"));
    run_until(io, [&] { return accepted.at(0)->events->lost(); });
    BOOST_TEST(accepted[0]->events->lines.empty());
}

BOOST_AUTO_TEST_CASE(a_peer_that_is_not_admitted_in_time_loses_its_link) {
    node_with_tls car1{"car1", authority.share(), 100ms};
    node_with_tls car2{"car2", authority.share()};
    listen(car1);
    const auto silent = socket();
    played_client shaken{*this, car2};
    shaken.shake_hands();
    played_client greets{*this, car2};
    greets.shake_hands();
    greets.say(played_client::hello);
    run_until(io, [&] { return accepted.size() == 3; });
    for (const auto& each : accepted) {
        run_until(io, [&] { return each->events->lost(); });
        BOOST_TEST(each->events->why == boost::asio::error::timed_out);
        BOOST_TEST(each->events->lines.empty());
    }
}

BOOST_AUTO_TEST_CASE(a_listener_that_is_silent_is_no_link) {
    node_with_tls car1{"car1", authority.share(), 100ms};
    const cles::test::scripted_listener silent{io, "tcp://127.0.0.1:0", 5};
    boost::system::error_code failed;
    int calls = 0;
    car1.transport->dial(io.get_executor(), cles::parse_url("tls" + silent.url().substr(3)), bounds,
                         [&](boost::system::error_code code, const cles::link_ptr&) {
                             ++calls;
                             failed = code;
                         });
    run_until(io, [&] { return calls != 0; });
    run_ready(io);
    BOOST_TEST(calls == 1);
    BOOST_TEST(failed == boost::asio::error::timed_out);
}

BOOST_AUTO_TEST_CASE(a_line_before_the_welcome_is_not_delivered) {
    node_with_tls car1{"car1", authority.share()};
    node_with_tls car2{"car2", authority.share()};
    listen(car1);
    played_client client{*this, car2};
    client.shake_hands();
    client.say(played_client::hello + "PUSH self:brake\nPUSH self:cles/welcome reply=no\nPUSH self:brake\n");
    run_until(io, [&] { return accepted.at(0)->events->lost(); });
    BOOST_TEST(accepted[0]->events->lines.empty());
    BOOST_TEST(accepted[0]->events->why == make_error_code(tls_errc::bad_admission));
}

BOOST_AUTO_TEST_CASE(a_line_that_is_too_long_before_the_welcome_ends_the_link) {
    node_with_tls car1{"car1", authority.share()};
    node_with_tls car2{"car2", authority.share()};
    listen(car1);
    played_client client{*this, car2};
    client.shake_hands();
    client.say(std::string(1025, 'x'));
    run_until(io, [&] { return accepted.at(0)->events->lost(); });
    BOOST_TEST(accepted[0]->events->why == make_error_code(tls_errc::bad_admission));
}

BOOST_AUTO_TEST_CASE(lines_that_follow_the_welcome_at_once_are_delivered) {
    node_with_tls car1{"car1", authority.share()};
    node_with_tls car2{"car2", authority.share()};
    listen(car1);
    played_client client{*this, car2};
    client.shake_hands();
    client.say(played_client::hello + "PUSH self:cles/welcome reply=no\none\ntwo\nthr");
    client.say("ee\n");
    run_until(io, [&] { return accepted.at(0)->events->lines.size() == 3; });
    BOOST_TEST((accepted[0]->events->lines == std::vector<std::string>{"one", "two", "three"}));
}

BOOST_AUTO_TEST_CASE(output_waits_until_the_peer_is_admitted) {
    node_with_tls car1{"car1", authority.share()};
    node_with_tls car2{"car2", authority.share()};
    listen(car1);
    played_client client{*this, car2};
    wait_for_accepted();
    accepted[0]->say("for a member\n");
    accepted[0]->link->urgent_output().append("first\n");
    accepted[0]->link->flush();
    BOOST_TEST(accepted[0]->link->unsent() == 19U);
    BOOST_TEST(accepted[0]->link->sent() == 0U);
    client.open();
    client.wait_for("first\nfor a member\n");
    BOOST_TEST(accepted[0]->link->sent() == 19U);
}

BOOST_AUTO_TEST_CASE(an_end_that_the_peer_has_not_stated_is_a_loss) {
    node_with_tls car1{"car1", authority.share()};
    node_with_tls car2{"car2", authority.share()};
    listen(car1);
    played_client client{*this, car2};
    client.open();
    client.say("one\n");
    client.socket.shut();
    run_until(io, [&] { return accepted.at(0)->events->lost(); });
    BOOST_TEST(accepted[0]->events->lines.size() == 1U);
    BOOST_TEST(!accepted[0]->events->has('e'));
}

BOOST_AUTO_TEST_CASE(a_half_close_is_an_end_and_replies_still_go_out) {
    node_with_tls car1{"car1", authority.share()};
    node_with_tls car2{"car2", authority.share()};
    listen(car1);
    played_client client{*this, car2};
    client.open();
    client.say("PULL self:speed\n");
    client.engine.finish();
    client.send();
    client.socket.shut();
    run_until(io, [&] { return accepted.at(0)->events->has('e'); });
    accepted[0]->say("{}\n");
    client.wait_for("{}\n");
    BOOST_TEST(!accepted[0]->events->lost());
    accepted[0]->link->finish();
    run_until(io, [&] { return accepted[0]->events->lost(); });
    BOOST_TEST(accepted[0]->events->in_order());
}

BOOST_AUTO_TEST_CASE(a_repeated_record_ends_the_link) {
    node_with_tls car1{"car1", authority.share()};
    node_with_tls car2{"car2", authority.share()};
    listen(car1);
    played_client client{*this, car2};
    client.open();
    boost::system::error_code why;
    client.engine.write("PUSH self:brake\n", why);
    const auto record = std::exchange(client.engine.encrypted(), {});
    client.socket.send(record + record);
    run_until(io, [&] { return accepted.at(0)->events->lost(); });
    BOOST_TEST(accepted[0]->events->lines.size() == 1U);
    BOOST_TEST(accepted[0]->events->why.message() != "");
}

BOOST_AUTO_TEST_CASE(a_link_may_be_closed_or_finished_before_it_is_open) {
    node_with_tls car1{"car1", authority.share()};
    node_with_tls car2{"car2", authority.share()};
    listen(car1);
    for (const bool finishes : {true, false}) {
        accepted.clear();
        played_client client{*this, car2};
        wait_for_accepted();
        accepted[0]->link->output().append("busy\n");
        if (finishes) {
            accepted[0]->link->finish();
        } else {
            accepted[0]->link->close();
        }
        BOOST_TEST(!contains(client.socket.rest(), "busy"));
    }
}

// -- strangers -----------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(strangers_that_state_high_versions_keep_out_no_newer_member) {
    node_with_tls car1{"car1", authority.share()};
    node_with_tls stranger{"spy", authority.share()};
    listen(car1);
    const std::string claim = "PUSH self:cles/hello reply=no {\"version\":4000000000,\"epoch\":\"00000001\"}\n";
    std::vector<std::unique_ptr<played_client>> strangers;
    for (int i = 0; i < 16; ++i) {
        auto& each = *strangers.emplace_back(std::make_unique<played_client>(*this, stranger));
        each.shake_hands();
        each.say(claim + "PUSH self:cles/roster reply=no " + std::string(20'000, 'x'));
        each.wait_for("cles/hello");
    }
    authority.add(node("car3"));
    node_with_tls car3{"car3", authority.share()};
    end near;
    BOOST_TEST(!dial(car3, near, "car1"));
    BOOST_TEST(car1.of->in_force().version() == authority.newest().version());
}

BOOST_AUTO_TEST_CASE(a_long_roster_from_another_address_ends_the_oldest_of_those_with_most) {
    node_with_tls car1{"car1", authority.share(), 60s};
    node_with_tls stranger{"spy", authority.share()};
    listen(car1);
    // 16 of them have space.
    const std::string part = "PUSH self:cles/hello reply=no {\"version\":4000000000,\"epoch\":\"00000001\"}\n"
                             "PUSH self:cles/roster reply=no " +
                             std::string(999'000, 'x');
    std::vector<std::unique_ptr<played_client>> strangers;
    for (int i = 0; i < 17; ++i) {
        auto& each = *strangers.emplace_back(std::make_unique<played_client>(*this, stranger));
        each.shake_hands();
        each.say(part);
        run_ready(io); // until all of it has been read
    }
    strangers.back()->wait_for("too many rosters"); // all are of one address
    played_client other{*this, stranger, socket_from("127.0.0.2")};
    other.shake_hands();
    other.say(part);
    strangers.front()->wait_for("too many rosters");
    run_until(io, [&] { return accepted.at(0)->events->lost(); });
    BOOST_TEST(accepted[0]->events->why == make_error_code(tls_errc::busy));
    BOOST_TEST(!accepted[1]->events->lost());
    BOOST_TEST(!accepted.back()->events->lost());
}

BOOST_AUTO_TEST_CASE(an_address_that_begins_many_handshakes_is_refused_and_others_are_not) {
    // So few that even a slow machine uses them up.
    node_with_tls car1{"car1",
                       authority.share(),
                       5s,
                       {.share = {.per_second = 1, .at_once = 2},
                        .shares = {.per_second = 1, .at_once = 8},
                        .common = {.per_second = 1, .at_once = 4}}};
    node_with_tls car2{"car2", authority.share()};
    listen(car1);
    const auto busy = make_error_code(tls_errc::busy);
    int begun = 0;
    do {
        auto client = socket();
        const auto number = accepted.size();
        client.send("GET / HTTP/1.1\r\n\r\n");
        client.close();
        run_until(io, [&] { return accepted.size() > number && accepted[number]->events->lost(); });
        ++begun;
    } while (accepted.back()->events->why != busy && begun < 30);
    BOOST_TEST(accepted.back()->events->why == busy);
    BOOST_TEST(begun > 6);
    played_client other{*this, car2, socket_from("127.0.0.2")};
    other.open();
    BOOST_TEST(!accepted.back()->events->lost());
}

// -- many ----------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_thousand_links_take_little_memory) {
    constexpr std::size_t count = 1000;
    const rlimit enough{4096, 4096};
    BOOST_REQUIRE(::setrlimit(RLIMIT_NOFILE, &enough) == 0);
    node_with_tls car1{"car1", authority.share()};
    node_with_tls car2{"car2", authority.share()};
    listen(car2);
    const auto before = ::mallinfo2().uordblks;
    std::vector<std::unique_ptr<end>> ends;
    for (std::size_t i = 0; i < count; ++i) {
        BOOST_REQUIRE(!dial(car1, *ends.emplace_back(std::make_unique<end>()), "car2"));
    }
    for (const auto& each : ends) {
        each->say("PULL self:speed\n");
    }
    run_until(io, [&] {
        return accepted.size() == count &&
               std::ranges::all_of(accepted, [](const auto& a) { return a->events->has('l'); });
    });
    const auto used = ::mallinfo2().uordblks - before;
    for (std::size_t i = 0; i < count; ++i) {
        ends[i]->link->shrink();
        accepted[i]->link->shrink();
    }
    run_ready(io);
    const auto idle = ::mallinfo2().uordblks - before;
    BOOST_TEST_MESSAGE("bytes per link: " << used / count / 2 << ", idle: " << idle / count / 2);
#ifndef __SANITIZE_ADDRESS__ // which counts differently
    BOOST_TEST(used / count / 2 < 64'000U);
    BOOST_TEST(idle / count / 2 < 24'000U);
#endif
    ends.back()->say("once more\n");
    run_until(
        io, [&] { return std::ranges::any_of(accepted, [](const auto& a) { return a->events->lines.size() == 2; }); });
}

BOOST_AUTO_TEST_SUITE_END()
