// SPDX-License-Identifier: BSL-1.0
// Announcements that others have repeated (docs/protocol.md, "Name ownership"; docs/protocol_security.md,
// "Announcements").
#include "node/membership/membership.hpp"
#include "support/watched_membership.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

namespace repeated_announcements {
namespace {

using namespace std::chrono_literals;
using cles::core::announcement;
using cles::core::group_source;
using cles::core::probe_outcome;
using cles::core::signed_announcement;

constexpr group_source here{0x0A000007, 40000};
constexpr group_source there{0x0A000008, 41000};
constexpr group_source repeater{0x0A000009, 42000};

struct fixture : cles::test::watched_membership {
    fixture() {
        table.set_prober([this](std::uint64_t ticket, std::string_view url) {
            last = ticket;
            asked.emplace_back(url);
        });
        table.begin({}, clock.now());
    }

    verdict receive(std::uint32_t epoch, std::uint64_t seq, const group_source& from,
                    const std::string& endpoint = "tcp://10.0.0.7:1", const std::string& node = "car1") {
        return table.apply_announcement({.node = node, .endpoints = {endpoint}}, epoch, seq, from, clock.now());
    }
    verdict receive_signed(std::uint32_t epoch, std::uint64_t seq, const group_source& from, bool again = false,
                           const std::vector<group_source>& sources = {here},
                           const std::string& endpoint = "tls://10.0.0.7:1") {
        announcement said{.node = "car1", .endpoints = {endpoint}, .sources = sources};
        said.original = std::make_shared<signed_announcement>();
        return table.apply_announcement(said, epoch, seq, from, clock.now(), again);
    }
    void is_absent() { table.on_probed(last, {.what = probe_outcome::kind::absent}, clock.now()); }
    void answers(std::uint32_t epoch) {
        table.on_probed(last, {probe_outcome::kind::answered, "car1", epoch, 1s}, clock.now());
    }

    std::uint64_t last = 0;
    std::vector<std::string> asked;
};

} // namespace
} // namespace repeated_announcements

BOOST_FIXTURE_TEST_SUITE(repeated_announcements, fixture)

BOOST_AUTO_TEST_CASE(a_copy_from_another_source_is_no_conflict) {
    for (std::uint64_t seq = 1; seq < 20; ++seq) {
        receive(1, seq, here);
        BOOST_TEST((receive(1, seq, repeater) == verdict::copied));
        pass(500ms);
        BOOST_TEST((receive(1, seq, repeater) == verdict::copied)); // late
        pass(500ms);
    }
    BOOST_TEST(asked.empty());
    BOOST_TEST(list().size() == 1U);
    check(changes, {"car1 appeared tcp://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(a_copy_that_arrives_first_is_no_conflict) {
    for (std::uint64_t seq = 1; seq < 20; ++seq) {
        receive(1, seq, repeater);
        BOOST_TEST((receive(1, seq, here) == verdict::copied));
        pass(1s);
    }
    BOOST_TEST(list().size() == 1U);
    check(changes, {"car1 appeared tcp://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(a_copy_of_this_nodes_own_is_no_conflict) {
    for (std::uint64_t seq = 1; seq < 10; ++seq) {
        BOOST_TEST((receive(0xAAAA, seq, repeater, "tcp://0.0.0.0:1", "me") == verdict::own));
        pass(1s);
    }
    BOOST_TEST(asked.empty());
    BOOST_TEST(list().empty());
    BOOST_TEST(changes.empty());
}

BOOST_AUTO_TEST_CASE(copies_do_not_keep_a_node_known) {
    receive(1, 1, here);
    for (int i = 0; i < 20; ++i) {
        pass(1s);
        receive(1, 1, repeater);
    }
    BOOST_TEST(list().empty());
    check(changes, {"car1 appeared tcp://10.0.0.7:1", "car1 silent tcp://10.0.0.7:1", "car1 gone tcp://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(a_copy_of_a_leave_ends_nothing) {
    receive(1, 1, here);
    table.apply_announcement({.node = "car1", .leaving = true}, 1, 2, repeater, clock.now());
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
}

BOOST_AUTO_TEST_CASE(an_unspecified_address_in_a_copy_is_another_one_but_no_conflict) {
    for (std::uint64_t seq = 1; seq < 20; ++seq) {
        receive(1, seq, here, "tcp://0.0.0.0:1");
        receive(1, seq, repeater, "tcp://0.0.0.0:1");
        if (seq == 1) {
            check(asked, {"tcp://10.0.0.7:1"});
            answers(1);
        }
        pass(1s);
    }
    BOOST_TEST(asked.size() == 1U); // the other address is that of the node, or nobody's
    BOOST_TEST(list().size() == 1U);
    check(changes, {"car1 appeared tcp://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(if_the_node_does_not_answer_at_the_address_of_a_copy_the_other_one_counts) {
    receive(1, 1, repeater, "tcp://0.0.0.0:1"); // repeated before it arrived
    receive(1, 1, here, "tcp://0.0.0.0:1");
    check(asked, {"tcp://10.0.0.9:1"});
    is_absent();
    check(asked, {"tcp://10.0.0.9:1", "tcp://10.0.0.7:1"});
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");
    answers(1);
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    pass(1s);
    BOOST_TEST((receive(1, 3, here, "tcp://0.0.0.0:1") == verdict::taken));
    BOOST_TEST(list().size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_node_that_answers_nowhere_stays_where_it_was) {
    receive(1, 1, here, "tcp://0.0.0.0:1");
    receive(1, 1, repeater, "tcp://0.0.0.0:1");
    is_absent();
    is_absent();
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
}

BOOST_AUTO_TEST_CASE(a_node_with_a_new_source_counts_when_it_answers_there) {
    receive(1, 1, here, "tcp://0.0.0.0:1");
    pass(1s);
    BOOST_TEST((receive(1, 2, there, "tcp://0.0.0.0:1") == verdict::copied)); // its address has changed
    check(asked, {"tcp://10.0.0.8:1"});
    answers(1);
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:1");
    BOOST_TEST(table.announced("car1")->sends_from(there));
    BOOST_TEST(!table.announced("car1")->sends_from(here));
    BOOST_TEST((receive(1, 3, there, "tcp://0.0.0.0:1") == verdict::taken));
    check(changes, {"car1 appeared tcp://10.0.0.7:1", "car1 moved tcp://10.0.0.8:1"});
}

BOOST_AUTO_TEST_CASE(a_node_with_another_port_at_its_address_counts_when_it_answers_there) {
    constexpr group_source again{here.address, 50000}; // it has joined the group anew
    receive(1, 1, here);
    pass(1s);
    receive(1, 2, again);
    check(asked, {"tcp://10.0.0.7:1"});
    answers(1);
    BOOST_TEST((receive(1, 3, again) == verdict::taken));
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
}

BOOST_AUTO_TEST_CASE(a_new_source_where_another_node_answers_does_not_count) {
    receive(1, 1, here, "tcp://0.0.0.0:1");
    receive(1, 2, repeater, "tcp://0.0.0.0:1");
    answers(7);
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    receive(1, 3, repeater, "tcp://0.0.0.0:1"); // it may listen by now
    is_absent();
    BOOST_TEST(asked.size() == 2U);
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    BOOST_TEST((receive(1, 4, here, "tcp://0.0.0.0:1") == verdict::taken));
}

BOOST_AUTO_TEST_CASE(a_new_source_that_states_another_address_is_not_asked_there) {
    receive(1, 1, here);
    receive(1, 2, repeater); // with the address of the node, which would answer
    BOOST_TEST(asked.empty());
    BOOST_TEST(!table.announced("car1")->sends_from(repeater));
}

BOOST_AUTO_TEST_CASE(a_new_source_that_the_old_one_states_makes_no_move) {
    receive(1, 1, here, "tcp://0.0.0.0:1");
    receive(1, 2, there, "tcp://0.0.0.0:1"); // by an interface that it has joined now
    table.apply_announcement({.node = "car1", .endpoints = {"tcp://0.0.0.0:1"}, .sources = {here, there}}, 1, 2, here,
                             clock.now());
    answers(1);
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    BOOST_TEST(table.announced("car1")->sends_from(there));
}

BOOST_AUTO_TEST_CASE(another_node_is_a_conflict_also_while_copies_arrive) {
    receive(1, 1, here, "tcp://0.0.0.0:1");
    receive(1, 1, repeater, "tcp://0.0.0.0:1");
    answers(1);
    receive(2, 1, there, "tcp://10.0.0.8:1");
    answers(1);
    answers(2);
    check(changes, {"car1 appeared tcp://10.0.0.7:1", "car1 clash 10.0.0.8"});
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1"); // the first keeps its requests
    BOOST_TEST(table.second_of("car1") == "tcp://10.0.0.8:1");
}

BOOST_AUTO_TEST_CASE(a_silent_node_is_received_from_another_source_by_a_newer_announcement_only) {
    receive(1, 5, here);
    pass(4s);
    BOOST_TEST((receive(1, 5, repeater) == verdict::copied));
    BOOST_TEST((list()[0].state == cles::peer_state::suspect));
    BOOST_TEST((receive(1, 6, there, "tcp://10.0.0.8:1") == verdict::taken));
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:1");
}

// -- signed --------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_newer_signed_one_may_state_other_sources) {
    receive_signed(1, 1, here);
    BOOST_TEST((receive_signed(1, 2, there, false, {there}, "tls://10.0.0.8:1") == verdict::taken));
    BOOST_TEST(where("car1") == "tls://10.0.0.8:1");
    BOOST_TEST(table.announced("car1")->sends_from(there));
    BOOST_TEST(!table.announced("car1")->sends_from(here));
    BOOST_TEST(list().size() == 1U);
    BOOST_TEST(asked.empty());
}

BOOST_AUTO_TEST_CASE(a_source_that_is_not_stated_any_more_is_not_used_any_more) {
    constexpr group_source loopback{0x7F000001, 39000};
    receive_signed(1, 1, loopback, false, {loopback, here}); // repeated there before the other one arrived
    receive_signed(1, 1, here, true, {here});                // those on the loopback of another host do not count
    BOOST_TEST((table.announced("car1")->from == here));
    BOOST_TEST(!table.announced("car1")->sends_from(loopback));
}

BOOST_AUTO_TEST_CASE(a_signed_one_that_has_counted_does_not_bring_a_node_back) {
    receive_signed(1, 5, here);
    table.apply_announcement({.node = "car1", .leaving = true}, 1, 6, here, clock.now());
    for (std::uint32_t other = 2; other <= 8; ++other) { // its end is forgotten
        clock.advance(60s);
        receive_signed(other, 1, here);
        pass(20s);
    }
    BOOST_TEST((receive_signed(1, 5, here, true) == verdict::old));
    BOOST_TEST(list().empty());
}

BOOST_AUTO_TEST_CASE(a_signed_one_that_has_counted_is_no_second_incarnation) {
    receive_signed(2, 1, here);
    BOOST_TEST((receive_signed(1, 5, here, true) == verdict::old));
    BOOST_TEST(asked.empty());
    BOOST_TEST((receive_signed(1, 6, here) == verdict::taken)); // another process with the key
    check(asked, {"tls://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(a_signed_one_that_has_counted_may_come_by_another_interface) {
    receive_signed(1, 5, here, false, {here, there});
    BOOST_TEST((receive_signed(1, 5, there, true, {here, there}) == verdict::duplicate));
    pass(600ms);
    receive_signed(1, 5, here, true, {here, there});
    BOOST_TEST((list()[0].age == 600ms));
}

BOOST_AUTO_TEST_CASE(a_known_incarnation_is_elsewhere_if_it_sends_from_other_sources) {
    BOOST_TEST(!table.is_elsewhere("car1", 1, repeater));
    receive_signed(1, 1, here, false, {here, there});
    BOOST_TEST(table.is_elsewhere("car1", 1, repeater));
    BOOST_TEST(!table.is_elsewhere("car1", 1, there));
    BOOST_TEST(!table.is_elsewhere("car1", 2, repeater));
}

BOOST_AUTO_TEST_SUITE_END()
