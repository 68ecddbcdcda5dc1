// SPDX-License-Identifier: BSL-1.0
// How a link ends, for every transport.

#include "support/data_test_case.hpp"
#include "support/link_pair.hpp"
#include "support/scripted_peer.hpp"
#include "support/test_suite.hpp"

#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>

CLES_TEST_SUITE(link_end)

using namespace cles::test;
using namespace std::chrono_literals;

namespace {

std::string many_lines(std::size_t count) {
    std::string text;
    for (std::size_t i = 0; i < count; ++i) {
        text += std::to_string(i) + std::string(1000, '.') + "\n";
    }
    return text;
}

} // namespace

CLES_DATA_TEST_CASE(finish_writes_what_is_left_and_both_ends_see_the_end, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    pair.near.run([&] {
        pair.near.link->output().append(many_lines(3000));
        pair.near.link->finish();
        pair.near.link->finish(); // a second call has no effect
    });
    pair.until([&] { return pair.far.run([&] { return pair.far.events->has('e'); }); });
    BOOST_TEST(pair.far.lines() == 3000U);
    BOOST_TEST(!pair.far.lost());
    pair.far.run([&] { pair.far.link->finish(); });
    pair.until([&] { return pair.near.lost() && pair.far.lost(); });
    BOOST_TEST(pair.near.events->in_order());
    BOOST_TEST(pair.far.run([&] { return pair.far.events->in_order(); }));
    BOOST_TEST(!pair.near.events->has('e')); // events after its own end are not examined
}

CLES_DATA_TEST_CASE(finish_at_both_ends_at_once_ends_the_link, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    pair.near.run([&] { pair.near.link->finish(); });
    pair.far.run([&] { pair.far.link->finish(); });
    pair.until([&] { return pair.near.lost() && pair.far.lost(); });
}

CLES_DATA_TEST_CASE(finish_does_not_wait_for_a_peer_that_stays, every_carrier, kind) {
    link_pair pair{kind, {.discard = 100ms}};
    pair.open();
    pair.near.run([&] { pair.near.link->finish(); });
    pair.until([&] { return pair.far.run([&] { return pair.far.events->has('e'); }); });
    pair.until([&] { return pair.near.lost(); });
}

CLES_DATA_TEST_CASE(finish_discards_what_the_peer_still_sends, every_carrier, kind) {
    link_pair pair{kind, {.discard = patience}}; // even on a slow machine
    pair.open();
    pair.far.say(many_lines(200));
    pair.near.run([&] {
        pair.near.link->output().append("goodbye\n");
        pair.near.link->finish();
    });
    const auto seen = pair.near.lines();
    pair.far.say(many_lines(3000));
    pair.until([&] { return pair.far.run([&] { return pair.far.events->has('e'); }); });
    BOOST_TEST(pair.far.run([&] { return pair.far.events->lines.front(); }) == "goodbye");
    pair.until([&] { return pair.far.run([&] { return pair.far.link->unsent(); }) == 0U || pair.far.lost(); });
    BOOST_TEST(!pair.far.lost());
    pair.far.run([&] { pair.far.link->finish(); });
    pair.until([&] { return pair.near.lost() && pair.far.lost(); });
    BOOST_TEST(pair.near.lines() == seen);
}

CLES_DATA_TEST_CASE(finish_waits_for_a_peer_that_reads_slowly, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    pair.far.run([&] { pair.far.link->pause(true); });
    pair.near.run([&] {
        pair.near.link->output().append(many_lines(8000));
        pair.near.link->finish();
    });
    run_ready(pair.io);
    BOOST_TEST(!pair.near.lost());
    pair.far.run([&] { pair.far.link->pause(false); });
    pair.until([&] { return pair.far.run([&] { return pair.far.events->has('e'); }); });
    BOOST_TEST(pair.far.lines() == 8000U);
}

CLES_DATA_TEST_CASE(after_the_peers_end_there_is_still_writing, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    pair.near.run([&] { pair.near.link->finish(); });
    pair.until([&] { return pair.far.run([&] { return pair.far.events->has('e'); }); });
    pair.far.say("an answer\n");
    pair.until([&] { return pair.far.run([&] { return pair.far.link->unsent(); }) == 0U; });
    BOOST_TEST(!pair.far.lost());
    BOOST_TEST(pair.far.run([&] { return pair.far.link->sent(); }) == 10U);
}

// Not detected by reading.
CLES_DATA_TEST_CASE(a_peer_that_vanishes_after_its_end_of_stream_is_noticed, every_socket, kind) {
    link_pair pair{kind};
    scripted_peer peer{pair.io, to_string(pair.address())};
    pair.accept();
    pair.far.start();
    peer.send("BIND self:place\n");
    peer.shut();
    pair.until([&] { return pair.far.events->has('e'); });
    pair.far.say("an update\n");
    BOOST_TEST(peer.line() == "an update");
    run_ready(pair.io);
    BOOST_TEST(!pair.far.lost()); // it still reads

    peer.close();
    if (kind == carrier::tcp4 || kind == carrier::tcp6) { // with TCP, only sending detects it
        run_ready(pair.io);
        BOOST_TEST(!pair.far.lost());
        pair.far.say("\n");
    }
    pair.until([&] { return pair.far.lost(); });
    BOOST_TEST(pair.far.events->in_order());
}

CLES_DATA_TEST_CASE(no_event_follows_close_and_the_peer_is_notified, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    pair.far.say("on its way\n");
    pair.near.run([&] {
        pair.near.link->close();
        pair.near.link->close();
    });
    const auto calls = pair.near.events->calls;
    pair.until([&] { return pair.far.over(); });
    pair.far.run([&] { pair.far.link->finish(); });
    pair.until([&] { return pair.far.lost(); });
    run_ready(pair.io);
    BOOST_TEST(pair.near.events->calls == calls);
    BOOST_TEST(pair.far.run([&] { return pair.far.events->in_order(); }));
}

CLES_DATA_TEST_CASE(what_was_flushed_before_close_arrives, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    std::string text;
    for (int i = 0; i < 5000; ++i) {
        text += "x\n";
    }
    pair.near.run([&] {
        pair.near.link->output().append(text);
        pair.near.link->flush();
        pair.near.link->close();
    });
    pair.until([&] { return pair.far.over(); });
    BOOST_TEST(pair.far.lines() == 5000U);
}

CLES_DATA_TEST_CASE(what_was_flushed_before_close_arrives_even_before_the_peer_starts, every_carrier, kind) {
    link_pair pair{kind};
    pair.connect();
    pair.near.start();
    pair.near.run([&] {
        pair.near.link->output().append("busy\n");
        pair.near.link->flush();
        pair.near.link->close();
        pair.near.link.reset();
    });
    run_ready(pair.io);
    pair.far.start();
    pair.until([&] { return pair.far.over(); });
    BOOST_TEST(pair.far.lines() == 1U);
}

CLES_DATA_TEST_CASE(all_calls_on_a_closed_link_do_nothing, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    pair.near.run([&] {
        pair.near.link->close();
        pair.near.link->output().append("nobody hears this\n");
        pair.near.link->flush();
        pair.near.link->pause(true);
        pair.near.link->pause(false);
        pair.near.link->finish();
    });
    pair.until([&] { return pair.far.over(); });
    run_ready(pair.io);
    BOOST_TEST(pair.near.events->calls.empty());
    BOOST_TEST(pair.far.lines() == 0U);
}

// Every callback except `on_writable` and `on_overlong`, which have separate cases below.
BOOST_DATA_TEST_CASE(close_from_inside_a_callback_is_the_end,
                     every_carrier* boost::unit_test::data::make({'l', 'b', 'e', 'x'}), kind, at) {
    link_pair pair{kind};
    pair.connect();
    pair.far.run([&, at = at] {
        pair.far.events->hook = [&pair, at](char call) {
            if (call == at) {
                pair.far.link->close();
            }
        };
    });
    pair.near.start();
    pair.far.start();
    pair.near.say("1\n2\n3\n");
    if (at == 'e' || at == 'x') {
        pair.until([&] { return pair.far.lines() == 3; });
        pair.near.run([&] { pair.near.link->finish(); });
        if (at == 'x') {
            pair.until([&] { return pair.far.over(); });
            pair.far.run([&] { pair.far.link->finish(); });
        }
    }
    pair.until([&, at = at] { return pair.far.run([&] { return pair.far.events->has(at); }); });
    pair.until([&] { return pair.near.over(); });
    run_ready(pair.io);
    pair.far.run([&, at = at] {
        BOOST_TEST(pair.far.events->count(at) == 1U);
        BOOST_TEST(pair.far.events->calls.back() == at);
    });
}

CLES_DATA_TEST_CASE(close_from_inside_on_overlong_is_the_end, every_carrier, kind) {
    link_pair pair{kind, {.line = 100}};
    pair.connect();
    bool head_is_whole = false;
    pair.far.run([&] {
        pair.far.events->hook = [&](char call) {
            if (call == 'o') {
                pair.far.link->close();
                head_is_whole = pair.far.events->head.size() >= 100;
            }
        };
    });
    pair.near.start();
    pair.far.start();
    pair.near.say(std::string(101, 'x') + "\nmore\n");
    pair.until([&] { return pair.near.over(); });
    run_ready(pair.io);
    pair.far.run([&] { BOOST_TEST(pair.far.events->calls == "o"); });
    BOOST_TEST(head_is_whole);
}

CLES_DATA_TEST_CASE(close_from_inside_on_writable_is_the_end, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    pair.near.events->hook = [&](char call) {
        if (call == 'r') {
            pair.near.link->close();
        }
    };
    pair.far.run([&] { pair.far.link->pause(true); });
    pair.near.say(many_lines(8000));
    run_ready(pair.io);
    pair.far.run([&] { pair.far.link->pause(false); });
    pair.until([&] { return pair.near.events->has('r'); });
    pair.until([&] { return pair.far.over(); });
    run_ready(pair.io);
    BOOST_TEST(pair.near.events->calls.back() == 'r');
    BOOST_TEST(pair.far.lines() == 8000U);
}

// Closes the link in the middle of a line and accesses that line again.
struct prying_owner final : cles::link_events {
    cles::link_ptr link{};
    bool finishing = false;
    std::string seen{};

    void on_line(std::string_view line) override {
        end();
        seen = line;
    }
    void on_overlong(std::string_view head) override { on_line(head); }
    void on_batch() override {}
    void on_end() override {}
    void on_lost(boost::system::error_code) override {}
    void on_writable() override {}

    void end() const {
        if (finishing) {
            link->finish();
        } else {
            link->close();
        }
    }
};

// A handler may stop its service and continue to read its request.
BOOST_DATA_TEST_CASE(a_line_stays_valid_for_its_call_even_if_the_link_is_closed_meanwhile,
                     every_carrier* boost::unit_test::data::make({false, true}) *
                         boost::unit_test::data::make({60, 101}),
                     kind, finishing, length) {
    link_pair pair{kind, {.line = 100}};
    pair.connect();
    const auto owner = std::make_shared<prying_owner>();
    pair.near.start();
    const std::string line(static_cast<std::size_t>(length), 'x');
    pair.far.run([&, finishing = finishing] {
        owner->link = pair.far.link;
        owner->finishing = finishing;
        pair.far.link->start(owner);
    });
    pair.near.say(line + "\n");
    pair.until([&] { return pair.far.run([&] { return !owner->seen.empty(); }); });
    pair.far.run([&] {
        BOOST_TEST(line.starts_with(owner->seen));
        owner->link.reset();
    });
    pair.near.run([&] { pair.near.link->finish(); });
    pair.until([&] { return pair.near.lost(); });
}

CLES_DATA_TEST_CASE(finish_from_inside_on_line_hands_no_more_lines_over, every_carrier, kind) {
    link_pair pair{kind};
    pair.connect();
    pair.far.run([&] {
        pair.far.events->hook = [&](char call) {
            if (call == 'l' && pair.far.events->lines.size() == 2) {
                pair.far.link->output().append("enough\n");
                pair.far.link->finish();
            }
        };
    });
    pair.near.start();
    pair.far.start();
    pair.near.say("1\n2\n3\n4\n");
    pair.until([&] { return pair.near.run([&] { return pair.near.events->has('e'); }); });
    pair.near.run([&] { pair.near.link->finish(); });
    pair.until([&] { return pair.far.lost() && pair.near.lost(); });
    BOOST_TEST(pair.far.lines() == 2U);
    BOOST_TEST(pair.near.events->lines.front() == "enough");
}

CLES_DATA_TEST_CASE(half_close_is_an_end_and_answers_still_go_out, every_socket, kind) {
    link_pair pair{kind};
    scripted_peer peer{pair.io, to_string(pair.address())};
    pair.accept();
    pair.far.start();
    peer.send("question\n");
    peer.shut();
    pair.until([&] { return pair.far.events->has('e'); });
    BOOST_TEST(pair.far.lines() == 1U);
    pair.far.say("answer\n");
    BOOST_TEST(peer.line() == "answer");
    pair.far.link->finish();
    BOOST_TEST(peer.rest().empty());
    BOOST_TEST(!peer.was_reset());
    pair.until([&] { return pair.far.lost(); });
    BOOST_TEST(pair.far.events->in_order());
}

CLES_DATA_TEST_CASE(a_reset_is_a_loss, every_socket, kind) {
    link_pair pair{kind};
    scripted_peer peer{pair.io, to_string(pair.address())};
    pair.accept();
    pair.far.start();
    pair.far.say("unread\n"); // closing a Unix socket with unread data resets it
    peer.send("one\n");
    pair.until([&] { return pair.far.lines() == 1; });
    peer.reset();
    pair.until([&] { return pair.far.lost(); });
    BOOST_TEST(pair.far.events->in_order());
    BOOST_TEST(pair.far.events->why.message() != "");
    pair.far.say("nobody is there\n");
    run_ready(pair.io);
    BOOST_TEST(pair.far.events->count('x') == 1U);
}

CLES_DATA_TEST_CASE(a_reset_while_output_waits_is_a_loss, every_socket, kind) {
    link_pair pair{kind};
    scripted_peer peer{pair.io, to_string(pair.address())};
    pair.accept();
    pair.far.start();
    pair.far.say(many_lines(8000));
    pair.far.run([&] { pair.far.link->pause(true); });
    run_ready(pair.io);
    peer.reset();
    pair.until([&] { return pair.far.lost(); });
    BOOST_TEST(pair.far.events->count('x') == 1U);
}

CLES_DATA_TEST_CASE(a_reset_while_finishing_is_a_loss, every_socket, kind) {
    link_pair pair{kind};
    scripted_peer peer{pair.io, to_string(pair.address())};
    pair.accept();
    pair.far.start();
    pair.far.link->output().append(many_lines(8000));
    pair.far.link->finish();
    run_ready(pair.io);
    peer.reset();
    pair.until([&] { return pair.far.lost(); });
    BOOST_TEST(pair.far.events->count('x') == 1U);
}

CLES_DATA_TEST_CASE(a_write_to_a_closed_peer_is_a_loss_reported_later, every_socket, kind) {
    link_pair pair{kind};
    scripted_peer peer{pair.io, to_string(pair.address())};
    pair.accept();
    pair.far.start();
    pair.far.link->pause(true); // so that writing detects the loss
    pair.far.say("unread\n");
    peer.reset();
    bool inside = false;
    bool told_inside = false;
    pair.far.events->hook = [&](char) { told_inside = told_inside || inside; };
    pair.until([&] {
        inside = true;
        pair.far.say("more\n");
        inside = false;
        return pair.far.lost();
    });
    BOOST_TEST(!told_inside);
    BOOST_TEST(pair.far.events->count('x') == 1U);
}

CLES_DATA_TEST_CASE(links_may_go_with_everything_under_way, every_carrier, kind) {
    for (int stage = 0; stage < 6; ++stage) {
        link_pair pair{kind};
        pair.connect();
        if (stage >= 1) {
            pair.near.start();
            pair.far.start();
        }
        if (stage >= 2) {
            pair.near.say(many_lines(3000));
            pair.far.say(many_lines(3000));
        }
        if (stage >= 3) {
            pair.io.poll_one();
        }
        if (stage == 4) {
            pair.near.link->finish();
        }
        if (stage == 5) { // not even closed
            pair.near.link.reset();
            pair.far.run([&] { pair.far.link.reset(); });
            run_ready(pair.io);
        }
    }
    BOOST_TEST(true);
}

BOOST_AUTO_TEST_SUITE_END()
