// SPDX-License-Identifier: BSL-1.0
// Members open sessions while a stranger sends 2,000 HELLO a second, in virtual time.
#include "security/sealed_network.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

namespace hello_flood {
namespace {

using namespace std::chrono_literals;
using namespace cles::security;
using namespace cles::security::test;

constexpr int members = 12;
constexpr std::uint32_t target = 1;

datagram_path at(std::uint32_t host, std::uint16_t port = 25370) { return datagram_path::v4(0x0a000000U + host, port); }

// What the handshakes of the members came to.
struct outcome {
    std::size_t begun = 0;
    std::size_t succeeded = 0;
    std::vector<std::chrono::nanoseconds> took{}; // sorted; one that did not succeed took until the next one began

    [[nodiscard]] std::chrono::nanoseconds p99() const { return took.empty() ? 1h : took[took.size() * 99 / 100]; }
};

struct fleet_of_cars {
    test_fleet fleet{members + 1};
    sealed_network network{3};
    sealed_node node{network, fleet, target, at(target), 0x11111111};
    std::vector<std::unique_ptr<sealed_node>> cars;
    std::mt19937_64 random{5};

    fleet_of_cars() {
        for (int car = 2; car <= members + 1; ++car) {
            cars.push_back(
                std::make_unique<sealed_node>(network, fleet, car, at(static_cast<std::uint32_t>(car)), 0x22222222));
        }
    }

    // Each member opens a session twice a second, and `flood` is called 2,000 times a second.
    outcome run(std::chrono::seconds span, const std::function<void()>& flood) {
        outcome result;
        std::vector<cles::time_point> begun(cars.size());
        const auto begin = network.now;
        for (int tick = 0; network.now < begin + span; ++tick) {
            for (std::size_t i = 0; i < cars.size(); ++i) {
                auto& car = *cars[i];
                if (begun[i] != cles::time_point{} && !car.established_log.empty()) {
                    result.took.push_back(network.now - begun[i]);
                    begun[i] = {};
                    ++result.succeeded;
                }
                if (tick % 1000 == static_cast<int>(i) * 80) {
                    if (begun[i] != cles::time_point{}) {
                        result.took.push_back(network.now - begun[i]);
                    }
                    car.sessions.forget(target);
                    car.established_log.clear();
                    car.contact(node);
                    begun[i] = network.now;
                    ++result.begun;
                }
            }
            if (flood) {
                flood();
            }
            network.run(500us);
            network.sent.clear();
        }
        network.run(2s);
        std::ranges::sort(result.took);
        return result;
    }

    datagram_path any_address() {
        return at(static_cast<std::uint32_t>(0x10000 + random() % 0x10000), static_cast<std::uint16_t>(random()));
    }
    // With the number of a member.
    bytes forged(std::size_t size) {
        bytes made(size);
        for (auto& byte : made) {
            byte = static_cast<std::uint8_t>(random());
        }
        write_hello_head(datagram_kind::hello, static_cast<std::uint32_t>(2 + random() % members), random(),
                         made.data());
        return made;
    }
    void check(const std::function<void()>& flood) {
        const auto usual = run(20s, nullptr);
        BOOST_TEST(usual.succeeded * 100 >= usual.begun * 99);
        const auto under_flood = run(20s, flood);
        BOOST_TEST(under_flood.begun == usual.begun);
        BOOST_TEST(under_flood.succeeded * 100 >= under_flood.begun * 99);
        BOOST_TEST((under_flood.p99() <= 2 * usual.p99() + 5ms));
    }
};

} // namespace
} // namespace hello_flood

BOOST_FIXTURE_TEST_SUITE(hello_flood, fleet_of_cars)

BOOST_AUTO_TEST_CASE(forged_ones_with_a_mac_delay_nobody) {
    check([this] { node.receive(any_address(), forged(hello_with_mac_bytes)); });
}

BOOST_AUTO_TEST_CASE(forged_ones_without_a_mac_delay_nobody) {
    check([this] { node.receive(any_address(), forged(hello_bytes)); });
}

BOOST_AUTO_TEST_CASE(forged_ones_delay_nobody_if_datagrams_are_lost) {
    network.with.loss = 0.05;
    check([this] { node.receive(any_address(), forged(hello_bytes)); });
}

BOOST_AUTO_TEST_CASE(repeated_ones_delay_nobody) {
    std::vector<bytes> recorded;
    network.drop = [](const auto&) { return true; };
    for (const auto& car : cars) {
        for (int i = 0; i < 10; ++i) {
            car->sessions.forget(target);
            car->contact(node);
            recorded.push_back(network.sent.back().content);
        }
    }
    network.drop = nullptr;
    network.run(10s);
    check([this, recorded] { node.receive(any_address(), recorded[random() % recorded.size()]); });
}

BOOST_AUTO_TEST_SUITE_END()
