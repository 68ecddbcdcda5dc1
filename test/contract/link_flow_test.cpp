// SPDX-License-Identifier: BSL-1.0
// Flow control of a link when one end is slower than the other, for every transport.

#include "support/data_test_case.hpp"
#include "support/link_pair.hpp"
#include "support/scripted_peer.hpp"

#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cstddef>
#include <string>

BOOST_AUTO_TEST_SUITE(link_flow)

using namespace cles::test;

namespace {

const auto line_lengths = boost::unit_test::data::make({std::size_t{1'000}, std::size_t{200'000}});

std::string many_lines(std::size_t count, std::size_t length) {
    std::string text;
    for (std::size_t i = 0; i < count; ++i) {
        text += std::to_string(i) + std::string(length, '.') + "\n";
    }
    return text;
}

} // namespace

CLES_DATA_TEST_CASE(what_a_peer_does_not_read_waits_and_nothing_is_lost, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    pair.far.run([&] { pair.far.link->pause(true); });
    constexpr std::size_t count = 8000;
    const auto text = many_lines(count, 1000);
    pair.near.say(text);
    run_ready(pair.io);
    BOOST_TEST(pair.near.link->unsent() > 0U);
    BOOST_TEST(!pair.near.events->has('r'));
    pair.near.say("more\n"); // output queued behind pending output
    const auto unsent = pair.near.link->unsent();
    BOOST_TEST(unsent > 0U);

    pair.far.run([&] { pair.far.link->pause(false); });
    pair.until([&] { return pair.far.lines() == count + 1; });
    pair.until([&] { return pair.near.link->unsent() == 0; });
    pair.until([&] { return pair.near.events->has('r'); });
    BOOST_TEST(pair.near.link->sent() == text.size() + 5);
    BOOST_TEST(pair.far.run([&] { return pair.far.events->lines[count - 1].starts_with("7999."); }));
    BOOST_TEST(pair.far.run([&] { return pair.far.events->lines.back(); }) == "more");
}

// As short lines and as long ones, one of which is always in transit.
BOOST_DATA_TEST_CASE(what_is_urgent_passes_what_waits_and_breaks_no_line, every_stream* line_lengths, kind, length) {
    link_pair pair{kind};
    pair.open();
    pair.far.run([&] { pair.far.link->pause(true); });
    const std::size_t count = 16'000'000 / length;
    pair.near.say(many_lines(count, length));
    run_ready(pair.io);
    BOOST_TEST(pair.near.link->unsent() > 0U);
    for (const auto* line : {"first\n", "second\n"}) {
        pair.near.link->urgent_output().append(line);
        pair.near.link->flush();
    }

    pair.far.run([&] { pair.far.link->pause(false); });
    pair.until([&] { return pair.far.lines() == count + 2; });
    auto lines = pair.far.run([&] { return pair.far.events->lines; });
    const auto first = std::find(lines.begin(), lines.end(), "first");
    BOOST_REQUIRE((lines.end() - first > 2)); // some have been delivered
    BOOST_TEST(*(first + 1) == "second");
    lines.erase(first, first + 2);
    for (std::size_t i = 0; i < count; ++i) {
        BOOST_REQUIRE(lines[i].starts_with(std::to_string(i) + "."));
        BOOST_REQUIRE(lines[i].size() == std::to_string(i).size() + length);
    }
}

CLES_DATA_TEST_CASE(on_writable_is_not_called_from_inside_flush, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    bool flushing = false;
    bool told_inside = false;
    pair.near.events->hook = [&](char call) { told_inside = told_inside || (flushing && call != 'b'); };
    const auto text = many_lines(2000, 1000);
    for (int i = 0; i < 3; ++i) {
        flushing = true;
        pair.near.say(text);
        flushing = false;
        pair.until([&] { return pair.near.link->unsent() == 0; });
    }
    pair.until([&] { return pair.far.lines() == 6000; });
    BOOST_TEST(!told_inside);
}

// An owner that waits after a flush that could not write everything is notified, even if only a little was left.
CLES_DATA_TEST_CASE(on_writable_follows_any_flush_that_left_something, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    pair.far.run([&] { pair.far.link->pause(true); });
    pair.near.say("little\n");
    run_ready(pair.io);
    const bool left = pair.near.link->unsent() != 0;
    pair.far.run([&] { pair.far.link->pause(false); });
    pair.until([&] { return pair.far.lines() == 1; });
    pair.until([&] { return pair.near.link->unsent() == 0; });
    run_ready(pair.io);
    BOOST_TEST(pair.near.events->has('r') == left);
}

CLES_DATA_TEST_CASE(a_paused_link_delivers_nothing_until_it_is_resumed, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    pair.far.run([&] { pair.far.link->pause(true); });
    pair.near.say("one\ntwo\n");
    run_ready(pair.io);
    BOOST_TEST(pair.far.lines() == 0U);
    pair.far.run([&] {
        pair.far.link->pause(true); // a second call has no effect
        pair.far.link->pause(false);
    });
    pair.until([&] { return pair.far.lines() == 2; });
    pair.near.say("three\n");
    pair.until([&] { return pair.far.lines() == 3; });
}

CLES_DATA_TEST_CASE(a_pause_during_hand_over_holds_back_the_next_line, every_carrier, kind) {
    link_pair pair{kind};
    pair.connect();
    pair.far.run([&] {
        pair.far.events->hook = [&](char call) {
            if (call == 'l' && pair.far.events->lines.size() == 3) {
                pair.far.link->pause(true);
            }
        };
    });
    pair.near.start();
    pair.far.start();
    pair.near.say("1\n2\n3\n4\n5\n");
    pair.until([&] { return pair.far.lines() == 3; });
    run_ready(pair.io);
    BOOST_TEST(pair.far.lines() == 3U);
    BOOST_TEST(pair.far.run([&] { return pair.far.events->calls.back(); }) == 'b');
    pair.far.run([&] { pair.far.link->pause(false); });
    pair.until([&] { return pair.far.lines() == 5; });
}

CLES_DATA_TEST_CASE(pausing_and_going_on_at_every_line_loses_nothing, every_carrier, kind) {
    link_pair pair{kind};
    pair.connect();
    pair.far.run([&] {
        pair.far.events->hook = [&](char call) {
            if (call == 'l') {
                pair.far.link->pause(true);
                boost::asio::post(pair.far_io(), [&] {
                    if (pair.far.link) {
                        pair.far.link->pause(false);
                    }
                });
            }
        };
    });
    pair.near.start();
    pair.far.start();
    pair.near.say(many_lines(300, 20));
    pair.until([&] { return pair.far.lines() == 300; });
    BOOST_TEST(pair.far.run([&] { return pair.far.events->lines.back().starts_with("299."); }));
}

CLES_DATA_TEST_CASE(a_paused_link_still_writes, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    pair.far.run([&] { pair.far.link->pause(true); });
    pair.far.say("said while paused\n");
    pair.until([&] { return pair.near.lines() == 1; });
}

CLES_DATA_TEST_CASE(an_unread_socket_fills_and_drains, every_socket, kind) {
    link_pair pair{kind};
    scripted_peer peer{pair.io, to_string(pair.address()), buffers::small};
    pair.accept();
    pair.far.start();
    const auto text = many_lines(12000, 1000);
    pair.far.say(text);
    run_ready(pair.io);
    BOOST_TEST(pair.far.link->unsent() > 0U);
    BOOST_TEST(pair.far.link->sent() + pair.far.link->unsent() == text.size());
    std::string got;
    for (int i = 0; i < 12000; ++i) {
        got += peer.line() + "\n";
    }
    BOOST_TEST((got == text));
    pair.until([&] { return pair.far.events->has('r'); });
    BOOST_TEST(pair.far.link->unsent() == 0U);
    BOOST_TEST(pair.far.events->count('r') == 1U);
}

CLES_DATA_TEST_CASE(an_idle_link_gives_back_what_a_large_line_took, every_stream, kind) {
    link_pair pair{kind};
    pair.open();
    const auto large = std::string(1'000'000, 'x') + "\n";
    const auto buffered = [](link_end& end) { return end.run([&] { return end.link->buffered(); }); };
    pair.near.say(large);
    pair.until([&] { return pair.far.lines() == 1; });
    pair.far.say(large);
    pair.until([&] { return pair.near.lines() == 1; });
    // A very large buffer is freed at once; one that may be needed again is kept for a while.
    BOOST_TEST(buffered(pair.near) < 400'000U);
    BOOST_TEST(buffered(pair.far) < 400'000U);
    pair.near.run([&] { pair.near.link->shrink(); });
    pair.far.run([&] { pair.far.link->shrink(); });
    pair.until([&] { return buffered(pair.near) < 5'000 && buffered(pair.far) < 5'000; });
    pair.near.say(large);
    pair.until([&] { return pair.far.lines() == 2; });
    pair.far.say(large);
    pair.until([&] { return pair.near.lines() == 2; });
}

CLES_DATA_TEST_CASE(nothing_is_lost_while_a_link_gives_back_memory, every_stream, kind) {
    link_pair pair{kind};
    pair.open();
    for (std::size_t i = 0; i < 300; ++i) {
        const auto line = std::to_string(i) + std::string(i * 37, '.');
        pair.near.say(line + "\n" + line.substr(0, line.size() / 2)); // the rest follows later
        pair.far.run([&] { pair.far.link->shrink(); });
        pair.near.say(line.substr(line.size() / 2) + "\n");
        pair.near.run([&] { pair.near.link->shrink(); });
        pair.far.run([&] { pair.far.link->shrink(); });
    }
    pair.until([&] { return pair.far.lines() == 600; });
    const auto lines = pair.far.run([&] { return pair.far.events->lines; });
    for (std::size_t i = 0; i < 600; ++i) {
        BOOST_REQUIRE(lines[i] == std::to_string(i / 2) + std::string(i / 2 * 37, '.'));
    }
    BOOST_TEST(!pair.far.lost());
}

BOOST_AUTO_TEST_SUITE_END()
