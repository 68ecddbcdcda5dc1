// SPDX-License-Identifier: BSL-1.0
// How lines are delivered, for every transport.

#include "support/data_test_case.hpp"
#include "support/link_pair.hpp"
#include "support/scripted_peer.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(link_lines)

using namespace cles::test;

namespace {

std::vector<std::string> numbered_lines(std::size_t count, char mark) {
    std::vector<std::string> lines;
    for (std::size_t i = 0; i < count; ++i) {
        lines.push_back(std::to_string(i) + std::string(i * 7 % 300, mark));
    }
    return lines;
}

// Sends them in batches, as handlers do.
void say_in_batches(link_end& from, const std::vector<std::string>& lines, std::size_t at_once) {
    std::string text;
    for (std::size_t i = 0; i < lines.size(); ++i) {
        text += lines[i] + "\n";
        if (i % at_once == at_once - 1 || i + 1 == lines.size()) {
            from.say(text);
            text.clear();
        }
    }
}

std::size_t bytes_of(const std::vector<std::string>& lines) {
    std::size_t bytes = 0;
    for (const auto& line : lines) {
        bytes += line.size() + 1;
    }
    return bytes;
}

} // namespace

CLES_DATA_TEST_CASE(lines_arrive_whole_and_in_order_in_both_directions, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    const auto there = numbered_lines(3000, 'x');
    const auto back = numbered_lines(2500, 'y');
    say_in_batches(pair.near, there, 7);
    say_in_batches(pair.far, back, 500);
    pair.until([&] { return pair.far.lines() == there.size() && pair.near.lines() == back.size(); });
    pair.until([&] { return pair.near.unsent() == 0 && pair.far.unsent() == 0; });

    BOOST_TEST(pair.far.run([&] { return pair.far.events->lines == there; }));
    BOOST_TEST((pair.near.events->lines == back));
    BOOST_TEST(pair.near.link->sent() == bytes_of(there));
    BOOST_TEST(pair.near.link->received() == bytes_of(back));
    BOOST_TEST(pair.far.run([&] { return pair.far.link->sent(); }) == bytes_of(back));
    BOOST_TEST(pair.far.run([&] { return pair.far.link->received(); }) == bytes_of(there));
    BOOST_TEST(!pair.near.over());
    BOOST_TEST(!pair.far.over());
}

CLES_DATA_TEST_CASE(what_was_said_before_the_peer_starts_waits_for_it, every_carrier, kind) {
    link_pair pair{kind};
    pair.connect();
    pair.near.start();
    pair.near.say("one\ntwo\n");
    run_ready(pair.io);
    BOOST_TEST(pair.far.lines() == 0U);
    pair.far.start();
    pair.until([&] { return pair.far.lines() == 2; });
    BOOST_TEST(pair.far.run([&] { return pair.far.events->lines.back(); }) == "two");
}

CLES_DATA_TEST_CASE(every_batch_ends_with_on_batch, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    pair.near.say("1\n2\n3\n");
    pair.until([&] { return pair.far.lines() == 3; });
    pair.near.say("4\n");
    pair.until([&] { return pair.far.lines() == 4; });
    BOOST_TEST(pair.far.run([&] { return pair.far.events->calls; }) == "lllblb");
}

// A link with thousands of lines to deliver must not delay other links.
CLES_DATA_TEST_CASE(a_flood_is_handed_over_in_turns, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    constexpr std::size_t flood = 20000;
    std::string text;
    for (std::size_t i = 0; i < flood; ++i) {
        text += "x\n";
    }
    pair.near.say(text);
    pair.until([&] { return pair.far.lines() == flood; });
    const auto calls = pair.far.run([&] { return pair.far.events->calls; });
    std::size_t longest = 0;
    for (std::size_t at = 0; at < calls.size();) {
        const auto end = std::min(calls.find('b', at), calls.size());
        longest = std::max(longest, end - at);
        at = end + 1;
    }
    BOOST_TEST(longest <= 4096U);
}

CLES_DATA_TEST_CASE(empty_lines_and_carriage_returns_are_handed_over_as_they_are, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    pair.near.say("\n\r\n a \n");
    pair.until([&] { return pair.far.lines() == 3; });
    BOOST_TEST(pair.far.run([&] { return pair.far.events->lines == std::vector<std::string>{"", "\r", " a "}; }));
}

CLES_DATA_TEST_CASE(a_line_of_just_the_limit_crosses, every_carrier, kind) {
    link_pair pair{kind, {.line = 5000}};
    pair.open();
    const std::string longest(5000, 'x');
    pair.near.say(longest + "\n" + longest + "\nend\n");
    pair.until([&] { return pair.far.lines() == 3; });
    BOOST_TEST(pair.far.run([&] { return pair.far.events->lines[1] == longest; }));
    BOOST_TEST(!pair.far.run([&] { return pair.far.events->has('o'); }));
}

CLES_DATA_TEST_CASE(lines_of_a_mebibyte_cross, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    const std::string longest(1U << 20U, 'x');
    for (int i = 0; i < 3; ++i) {
        pair.near.say(longest + "\nsmall\n");
    }
    pair.until([&] { return pair.far.lines() == 6; });
    BOOST_TEST(pair.far.run([&] { return pair.far.events->lines[4] == longest; }));
    BOOST_TEST(pair.far.run([&] { return pair.far.events->lines[5] == "small"; }));
}

CLES_DATA_TEST_CASE(one_over_the_limit_is_reported_once_and_no_line_follows, every_carrier, kind) {
    link_pair pair{kind, {.line = 5000}};
    pair.open();
    pair.near.say("before\n" + std::string(5001, 'x') + "\nafter\n");
    pair.until([&] { return pair.far.run([&] { return pair.far.events->has('o'); }); });
    pair.near.say("later\n");
    pair.far.run([&] {
        pair.far.link->pause(true);
        pair.far.link->pause(false);
    });
    run_ready(pair.io);
    pair.far.run([&] {
        const auto& seen = *pair.far.events;
        BOOST_TEST(seen.lines.size() == 1U);
        BOOST_TEST(seen.count('o') == 1U);
        BOOST_TEST((seen.head == std::string(seen.head.size(), 'x')));
        BOOST_TEST(seen.head.size() >= 5000U);
        BOOST_TEST(seen.calls.find('b', seen.calls.find('o')) != std::string::npos);
        BOOST_TEST(seen.in_order());
    });
}

CLES_DATA_TEST_CASE(bytes_one_at_a_time_make_the_same_lines, every_socket, kind) {
    link_pair pair{kind};
    scripted_peer peer{pair.io, to_string(pair.address())};
    pair.accept();
    pair.far.start();
    const std::string text = "PULL self:cles\r\n\n{\"a\":1}\nlast\n";
    for (const char byte : text) {
        peer.send(std::string(1, byte));
        while (pair.io.poll_one() != 0) {
        }
    }
    pair.until([&] { return pair.far.lines() == 4; });
    BOOST_TEST((pair.far.events->lines == std::vector<std::string>{"PULL self:cles\r", "", "{\"a\":1}", "last"}));
}

CLES_DATA_TEST_CASE(an_endless_line_is_reported_as_soon_as_it_is_too_long, every_socket, kind) {
    link_pair pair{kind, {.line = 5000}};
    scripted_peer peer{pair.io, to_string(pair.address())};
    pair.accept();
    pair.far.start();
    peer.send(std::string(5001, 'x')); // without an end of line
    pair.until([&] { return pair.far.events->has('o'); });
    BOOST_TEST(pair.far.lines() == 0U);
}

CLES_DATA_TEST_CASE(an_unfinished_line_at_the_end_is_no_line, every_socket, kind) {
    link_pair pair{kind};
    scripted_peer peer{pair.io, to_string(pair.address())};
    pair.accept();
    pair.far.start();
    peer.send("whole\npart");
    peer.shut();
    pair.until([&] { return pair.far.events->has('e'); });
    BOOST_TEST(pair.far.lines() == 1U);
    BOOST_TEST(pair.far.events->rest == "part");
    BOOST_TEST(pair.far.events->in_order());
}

BOOST_AUTO_TEST_SUITE_END()
