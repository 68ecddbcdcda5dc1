// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/sealed_group_port.hpp"
#include "security/sealed_network.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace sealed_group_port {
namespace {

using namespace std::chrono_literals;
using namespace cles::security::test;
using cles::core::group_source;

constexpr group_source source_of(std::uint32_t member) { return {.address = 0x0a000000U + member, .port = 4000}; }

/// Keeps what is sent.
struct recording_port final : cles::core::group_port {
    explicit recording_port(std::uint32_t member) : own(source_of(member)) {}
    void start(cles::core::group_listener& owner) override { listener = &owner; }
    cles::core::datagrams_done send(cles::core::datagram_list all) override {
        cles::core::datagrams_done done;
        for (; !all.empty(); all.drop_first()) {
            ++done.count;
            done.bytes += all.first().size();
        }
        to_group += done.count;
        return done;
    }
    void send_to(const group_source&, std::string_view datagram) override { to_one.emplace_back(datagram); }
    void receive_own() override {}
    [[nodiscard]] std::size_t unsent() const noexcept override { return 0; }
    void close() override { listener = nullptr; }
    [[nodiscard]] const group_source& source() const noexcept override { return own; }

    group_source own;
    cles::core::group_listener* listener = nullptr;
    std::size_t to_group = 0;
    std::deque<std::string> to_one;
};

struct silent_listener final : cles::core::group_listener {
    void on_datagram(const cles::core::group_datagram&) override {}
    void on_writable() override {}
};

/// A node in the group.
struct group_node {
    group_node(const test_fleet& of, int car)
        : number(static_cast<std::uint32_t>(car)),
          known(test_fleet::name_of(car), test_fleet::key_of(car), of.authority.share()) {
        all->begin(number, time, {});
        port.start(above);
    }

    void adopt(const test_fleet& of) { static_cast<void>(known.offer(of.authority.newest().line())); }
    /// What another one has sent to this one.
    void take(group_node& from) {
        const auto datagram = from.below->to_one.front();
        from.below->to_one.pop_front();
        below->listener->on_datagram(
            {.from = source_of(from.number), .text = datagram, .request = nullptr, .to_group = false});
    }

    std::uint32_t number;
    cles::security::fleet known;
    cles::test::manual_clock time;
    std::shared_ptr<cles::security::sealed_datagrams> all = std::make_shared<cles::security::sealed_datagrams>(known);
    std::shared_ptr<recording_port> below = std::make_shared<recording_port>(number);
    silent_listener above;
    std::vector<std::vector<std::string>> wanted; ///< endpoints of those that have a newer roster
    cles::security::sealed_group_port port{
        all, below, [this](std::uint32_t, const std::vector<std::string>& endpoints) { wanted.push_back(endpoints); }};
};

struct two_cars {
    test_fleet fleet{2};
    group_node car1{fleet, 1};
    group_node car2{fleet, 2};

    /// Has car1, which has announced itself, receive a line of car2 that it cannot open.
    void ask_in_group(std::string_view datagram) {
        car1.below->listener->on_datagram({.from = source_of(2), .text = datagram, .request = nullptr});
        while (!car1.below->to_one.empty() || !car2.below->to_one.empty()) {
            if (!car1.below->to_one.empty()) {
                car2.take(car1);
            } else {
                car1.take(car2);
            }
        }
    }
};

} // namespace

BOOST_FIXTURE_TEST_SUITE(sealed_group_port, two_cars)

BOOST_AUTO_TEST_CASE(who_has_an_old_roster_fetches_the_newer_one_where_the_announcement_came_from) {
    const auto view = car2.all->seal_for_group("BIND all:cles");
    const std::string asked{reinterpret_cast<const char*>(view.data()), view.size()};
    fleet.authority.rotate();
    fleet.authority.rotate();
    car1.adopt(fleet);
    static_cast<void>(car1.port.send(std::string_view{"UPDATE car1:cles seq=1 epoch=00000001 {\"endpoints\":"
                                                      "[\"unix://@car1\",\"tls://0.0.0.0:25370\"]}\n"}));
    ask_in_group(asked);
    BOOST_REQUIRE_EQUAL(car2.wanted.size(), 1U);
    BOOST_TEST((car2.wanted.front() == std::vector<std::string>{"unix://@car1", "tls://10.0.0.1:25370"}));

    // Not again at once; and when it has the roster, it asks the group.
    car1.time.advance(1s);
    car2.time.advance(1s);
    ask_in_group(asked);
    BOOST_TEST(car2.wanted.size() == 1U);
    const auto before = car2.below->to_group;
    car2.adopt(fleet);
    BOOST_TEST(car2.below->to_group == before + 1);

    // Who repeats the old datagram causes nothing there any more.
    car1.time.advance(20s);
    car2.time.advance(20s);
    ask_in_group(asked);
    BOOST_TEST(car2.wanted.size() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace sealed_group_port
