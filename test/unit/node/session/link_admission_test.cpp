// SPDX-License-Identifier: BSL-1.0
#include "node/session/link_monitor.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <deque>
#include <string>
#include <string_view>

namespace link_admission {
namespace {

using namespace std::chrono_literals;
using cles::core::link_admission;
using cles::core::link_monitor;

struct fixture;

/// An accepted link, in the state that the test needs.
struct peer final : link_monitor::owner {
    peer(fixture& in, std::string called);

    [[nodiscard]] bool is_idle() const override { return rests; }
    void evict() override;
    void on_silence() override {}
    void on_probe() override {}

    fixture& world;
    std::string name;
    link_monitor watch;
    bool rests = false;
};

struct fixture {
    fixture() { bounds.links = 4; }

    /// Opens a link from that address; "busy" if it is refused.
    peer& open(const std::string& name, std::string_view address) {
        auto& made = peers.emplace_back(*this, name);
        if (admission.ensure_capacity(address, clock.now())) {
            admission.enter(made.watch, address);
        } else {
            made.name = "busy";
        }
        return made;
    }
    /// The same for a link that sends a line at once.
    peer& talk(const std::string& name, std::string_view address = "10.0.0.1") {
        auto& made = open(name, address);
        made.watch.on_line(clock.now());
        return made;
    }
    /// The links evicted since the last call, in order.
    std::string gone() { return std::exchange(left, {}); }

    cles::limits bounds;
    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    link_admission admission{bounds};
    std::deque<peer> peers;
    std::string left;
};

peer::peer(fixture& in, std::string called)
    : world(in), name(std::move(called)), watch(*this, in.deadlines, in.bounds, in.clock.now()) {}

void peer::evict() {
    world.left += name + " ";
    world.admission.leave(watch);
}

} // namespace
} // namespace link_admission

BOOST_FIXTURE_TEST_SUITE(link_admission, fixture)

BOOST_AUTO_TEST_CASE(links_in_use_stay_and_the_next_is_refused) {
    for (const auto* name : {"a", "b", "c", "d"}) {
        BOOST_TEST(talk(name).name == name);
    }
    clock.advance(1h);
    BOOST_TEST(talk("e").name == "busy");
    BOOST_TEST(gone().empty());
    admission.leave(peers.front().watch);
    BOOST_TEST(talk("f").name == "f");
    BOOST_TEST(admission.size() == 4U);
}

BOOST_AUTO_TEST_CASE(the_oldest_half_closed_link_is_evicted_first) {
    talk("a");
    auto& b = talk("b");
    auto& c = talk("c");
    open("silent", "10.0.0.1");
    clock.advance(1min);
    c.watch.on_end(clock.now());
    clock.advance(1s);
    b.watch.on_end(clock.now());
    BOOST_TEST(talk("e").name == "e");
    BOOST_TEST(gone() == "c ");
    talk("f");
    BOOST_TEST(gone() == "b ");
    talk("g");
    BOOST_TEST(gone() == "silent ");
}

BOOST_AUTO_TEST_CASE(then_the_oldest_that_sent_no_line_in_time) {
    open("a", "10.0.0.1");
    clock.advance(1s);
    open("b", "10.0.0.1");
    talk("c");
    talk("d");
    BOOST_TEST(talk("e").name == "e");
    BOOST_TEST(gone() == "a ");
    BOOST_TEST(talk("f").name == "busy"); // b has only just been opened
    clock.advance(1s);
    BOOST_TEST(talk("g").name == "g");
    BOOST_TEST(gone() == "b ");
}

BOOST_AUTO_TEST_CASE(then_the_one_idle_for_longest_and_at_least_a_minute) {
    auto& a = talk("a");
    auto& b = talk("b");
    clock.advance(1s);
    auto& c = talk("c");
    talk("d");
    a.rests = b.rests = c.rests = true;
    clock.advance(10s);
    a.watch.on_line(clock.now());
    clock.advance(48s);
    BOOST_TEST(talk("e").name == "busy");
    clock.advance(1s);
    BOOST_TEST(talk("f").name == "f");
    BOOST_TEST(gone() == "b ");
    BOOST_TEST(talk("g").name == "busy");
    clock.advance(1s);
    BOOST_TEST(talk("h").name == "h");
    BOOST_TEST(gone() == "c ");
}

BOOST_AUTO_TEST_CASE(an_address_beyond_its_share_is_evicted_for_others_only) {
    bounds.links = 8; // of which one address may keep 6
    for (int i = 0; i < 8; ++i) {
        talk("greedy" + std::to_string(i), "10.0.0.1");
        clock.advance(1ms);
    }
    BOOST_TEST(talk("more", "10.0.0.1").name == "busy");
    BOOST_TEST(talk("x", "10.0.0.2").name == "x");
    BOOST_TEST(gone() == "greedy7 "); // none is idle: the newest
    peers[3].rests = true;
    BOOST_TEST(talk("y", "10.0.0.3").name == "y");
    BOOST_TEST(gone() == "greedy3 ");
    BOOST_TEST(talk("z", "10.0.0.4").name == "busy"); // its share is six
    BOOST_TEST(gone().empty());
}

BOOST_AUTO_TEST_CASE(one_address_may_have_all_links_if_no_other_needs_them) {
    bounds.links = 100;
    for (int i = 0; i < 100; ++i) {
        BOOST_TEST(talk("a", "10.0.0.1").name == "a");
    }
    BOOST_TEST(gone().empty());
}

BOOST_AUTO_TEST_CASE(the_share_can_be_set) {
    bounds.links_per_address = 2;
    for (const auto* name : {"a", "b", "c", "d"}) {
        talk(name, "10.0.0.1");
        clock.advance(1ms);
    }
    talk("x", "10.0.0.2");
    talk("y", "10.0.0.2");
    BOOST_TEST(gone() == "d c ");
    BOOST_TEST(talk("z", "10.0.0.2").name == "busy");
}

BOOST_AUTO_TEST_CASE(silent_links_do_not_lock_out_others) {
    bounds.links = 100;
    int refused = 0;
    for (int second = 0; second < 10; ++second) {
        for (int i = 0; i < 1000; ++i) {
            open("silent", "10.0.0.66");
        }
        clock.advance(1s);
        refused += talk("honest" + std::to_string(second), "10.0.0.2").name == "busy" ? 1 : 0;
    }
    BOOST_TEST(refused == 0);
    BOOST_TEST(gone().find("honest") == std::string::npos);
}

BOOST_AUTO_TEST_CASE(the_address_with_most_silent_links_gives_way_to_one_with_fewer) {
    bounds.links = 8;
    for (const auto* name : {"a", "b", "c"}) {
        open(name, "10.0.0.1");
    }
    for (const auto* name : {"d", "e", "f", "g"}) {
        open(name, "10.0.0.2");
    }
    talk("member", "10.0.0.3");
    BOOST_TEST(open("h", "10.0.0.2").name == "busy"); // nobody has more, and all are new
    BOOST_TEST(open("i", "10.0.0.4").name == "i");
    BOOST_TEST(open("j", "10.0.0.4").name == "j");
    BOOST_TEST(gone() == "d a "); // then both have three: the oldest
    BOOST_TEST(talk("k", "10.0.0.5").name == "k");
    BOOST_TEST(gone() == "e ");
}

// Several programs of one host start at the same time, while others say nothing.
BOOST_AUTO_TEST_CASE(a_link_that_has_long_said_nothing_gives_way_to_further_ones_of_one_address) {
    talk("member", "10.0.0.3");
    open("silent", "10.0.0.1");
    clock.advance(1s);
    open("a", "10.0.0.2");
    open("b", "10.0.0.2");
    BOOST_TEST(open("c", "10.0.0.2").name == "c");
    BOOST_TEST(gone() == "silent ");
    BOOST_TEST(open("d", "10.0.0.2").name == "busy"); // those left are new
}

// Each address would be within any share of its own.
BOOST_AUTO_TEST_CASE(many_addresses_that_say_nothing_do_not_shut_out_others) {
    bounds.links = 1024;
    constexpr int honest = 100;
    int number = 0;
    int served = 0;
    const auto flood = [&](std::chrono::microseconds span) { // 200 addresses, 2,000 links a second
        for (; span > 0us; span -= 500us, ++number) {
            open("silent", "10.0.1." + std::to_string(number % 200));
            clock.advance(500us);
        }
    };
    flood(2s);
    for (int i = 0; i < honest; ++i) {
        flood(50ms);
        auto& link = open("honest", "10.0.2." + std::to_string(i % 4));
        flood(100ms); // until its first line, also if it is far away
        if (link.name == "honest" && gone().find("honest") == std::string::npos) {
            ++served;
            link.watch.on_line(clock.now());
            admission.leave(link.watch);
        }
    }
    BOOST_TEST(served == honest);
}

BOOST_AUTO_TEST_CASE(a_flood_of_new_links_does_not_cost_a_search_each) {
    for (const auto* name : {"a", "b", "c", "d"}) {
        talk(name).rests = true;
    }
    clock.advance(59'950ms);
    BOOST_TEST(talk("e").name == "busy");
    clock.advance(50ms);
    BOOST_TEST(talk("f").name == "busy"); // the last search was too recent
    clock.advance(50ms);
    BOOST_TEST(talk("g").name == "g");
}

BOOST_AUTO_TEST_CASE(a_limit_of_one_link_works) {
    bounds.links = 1;
    talk("a", "10.0.0.1");
    BOOST_TEST(talk("b", "10.0.0.2").name == "busy");
    peers.front().watch.on_end(clock.now());
    clock.advance(100ms);
    BOOST_TEST(talk("c", "10.0.0.2").name == "c");
    BOOST_TEST(gone() == "a ");
}

BOOST_AUTO_TEST_SUITE_END()
