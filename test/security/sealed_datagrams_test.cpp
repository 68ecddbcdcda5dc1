// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/sealed_datagrams.hpp"
#include "security/sealed_network.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

namespace sealed_datagrams {
namespace {

using namespace std::chrono_literals;
using namespace cles::security;
using namespace cles::security::test;

constexpr std::uint16_t port = 4000;

std::uint32_t address_of(std::uint32_t host) { return 0x0a000000U + host; }

/// A socket that keeps what is reported, and what is to be sent.
struct recording_socket final : datagram_socket {
    explicit recording_socket(cles::security::sealed_datagrams& by) : all(by), number(by.add(*this)) {}
    recording_socket(const recording_socket&) = delete;
    recording_socket& operator=(const recording_socket&) = delete;
    ~recording_socket() { all.remove(number); }

    void send_sealed(const datagram_path&, bytes_view datagram) override {
        sent.emplace_back(datagram.begin(), datagram.end());
    }
    void on_opened(const datagram_source&, std::uint32_t, std::string_view line) override { opened.emplace_back(line); }
    void on_established(const datagram_source&, std::uint32_t) override {}
    void on_gave_up(const datagram_source&, bool) override {}
    void on_announcement(const datagram_source&, std::string_view line) override { announced.emplace_back(line); }
    void on_outdated(const datagram_source& which) override { outdated.push_back(which); }

    cles::security::sealed_datagrams& all;
    const std::uint32_t number;
    std::deque<bytes> sent;
    std::vector<std::string> opened;
    std::vector<std::string> announced;
    std::vector<datagram_source> outdated;
};

/// A node with one socket.
struct node_end {
    node_end(const test_fleet& of, int car)
        : number(static_cast<std::uint32_t>(car)), random(number),
          known(test_fleet::name_of(car), test_fleet::key_of(car), of.authority.share()) {
        all.begin(number, time, {});
    }

    /// Another one, as seen here.
    [[nodiscard]] datagram_source source_of(const node_end& other) const {
        return {.path = datagram_path::v4(address_of(other.number), port, socket.number), .member = other.number};
    }

    std::uint32_t number;
    seeded_entropy random;
    cles::security::fleet known;
    cles::test::manual_clock time;
    cles::security::sealed_datagrams all{known, random};
    recording_socket socket{all};
};

struct two_cars {
    test_fleet fleet{3};
    node_end car1{fleet, 1};
    node_end car2{fleet, 2};

    /// Delivers what both send.
    void deliver() {
        while (deliver(car1, car2) || deliver(car2, car1)) {
        }
    }
    static bool deliver(node_end& from, node_end& to) {
        if (from.socket.sent.empty()) {
            return false;
        }
        const auto datagram = from.socket.sent.front();
        from.socket.sent.pop_front();
        to.all.receive(to.source_of(from).path, datagram);
        return true;
    }
    /// In a new session.
    void tell(std::string_view line) {
        car1.all.contact(car1.source_of(car2));
        deliver();
        BOOST_REQUIRE(car1.all.send(car1.source_of(car2), line));
        deliver();
    }
};

} // namespace

BOOST_AUTO_TEST_SUITE(sealed_datagrams)

BOOST_AUTO_TEST_CASE(an_announcement_in_a_session_is_reported_only_if_it_is_of_a_newer_roster) {
    two_cars on;
    const std::string announcement = "UPDATE car1:cles seq=1 {}";
    on.tell(announcement);
    BOOST_TEST(on.car2.socket.announced.empty());
    on.fleet.authority.rotate();
    static_cast<void>(on.car1.known.offer(on.fleet.authority.newest().line()));
    on.tell(announcement);
    BOOST_TEST((on.car2.socket.announced == std::vector{announcement}));
    static_cast<void>(on.car2.known.offer(on.fleet.authority.newest().line()));
    on.tell(announcement);
    BOOST_TEST(on.car2.socket.announced.size() == 1U);
    BOOST_TEST(on.car2.socket.opened.empty()); // no link gets one
    on.tell("UPDATE car1:cles/load seq=1 {}");
    BOOST_TEST(on.car2.socket.opened.size() == 1U);
}

BOOST_AUTO_TEST_CASE(what_the_group_brings_and_cannot_be_opened_has_a_counter_of_its_own) {
    test_fleet fleet{2};
    fleet.authority.rotate();
    fleet.authority.rotate();
    const test_fleet older{2};
    node_end car1{fleet, 1};
    const auto take = [&](const test_fleet& of, int car) {
        seeded_entropy random{7};
        cles::security::fleet sender{test_fleet::name_of(car), test_fleet::key_of(car), of.authority.share()};
        group_sender sealing{sender, random};
        car1.all.open_group(datagram_path::v4(address_of(2), port, car1.socket.number), sealing.seal("line"));
    };
    take(fleet, 2); // under an unknown salt, but it can be opened
    BOOST_TEST(car1.all.group_unopened() == 0U);
    take(older, 2); // of an earlier generation, under keys of its own
    BOOST_TEST(car1.all.group_unopened() == 1U);
    const auto own = car1.all.seal_for_group("line"); // which the group returns
    car1.all.open_group(datagram_path::v4(address_of(1), port, car1.socket.number), own);
    BOOST_TEST(car1.all.group_unopened() == 1U);
    BOOST_TEST(car1.all.unsealed() == 0U);
}

BOOST_AUTO_TEST_CASE(who_has_an_old_roster_is_reported_to_the_socket_that_has_heard_it) {
    test_fleet fleet{2};
    seeded_entropy random{1};
    cles::security::fleet old{"car2", test_fleet::key_of(2), fleet.authority.share()};
    group_sender sender{old, random};
    const auto view = sender.seal("line");
    const bytes datagram{view.begin(), view.end()};
    fleet.authority.rotate();
    fleet.authority.rotate();
    node_end car1{fleet, 1};
    recording_socket second{car1.all};
    for (std::uint32_t i = 0; i < 40; ++i) { // two of these arrive until the next source is chosen
        const auto local = i % 2 == 0 ? car1.socket.number : second.number;
        car1.all.open_group(datagram_path::v4(address_of(i), port, local), datagram);
        car1.time.advance(100ms);
    }
    for (const auto* const each : {&car1.socket, &second}) {
        BOOST_TEST(!each->outdated.empty());
        for (const auto& which : each->outdated) {
            BOOST_TEST(which.path.local == each->number);
        }
    }
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace sealed_datagrams
