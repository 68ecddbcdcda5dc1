// SPDX-License-Identifier: BSL-1.0
// The publisher's side of docs/protocol.md, "Multicast".
#include "node/publish/group_bindings.hpp"
#include "support/group_recorder.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace group_bindings {
namespace {

using namespace std::chrono_literals;
using namespace cles::test;

cles::limits few_leases() {
    cles::limits bounds;
    bounds.group_leases = 5;
    bounds.bindings = 3;
    return bounds;
}

struct fixture {
    explicit fixture(const cles::limits& bounds = {}) : node(bounds) {}

    /// Receives a message of a source; returns false if it was dropped.
    bool say(std::uint16_t source, const std::string& line) {
        cles::protocol::request_line r;
        cles::protocol::malformed_request why;
        BOOST_REQUIRE(cles::protocol::parse_request(line, r, why));
        return bindings.bind(source_at(source), r, node.clock.now());
    }
    /// The seq of each update that was sent.
    std::vector<std::uint64_t> seqs() {
        std::vector<std::uint64_t> all;
        for (const auto& line : out.take()) {
            cles::protocol::request_line r;
            cles::protocol::malformed_request why;
            BOOST_REQUIRE(cles::protocol::parse_request(line, r, why));
            all.push_back(*r.seq);
        }
        return all;
    }
    [[nodiscard]] std::uint64_t leases() const { return node.counts().group_leases; }

    test_node node;
    group_recorder out;
    std::optional<cles::core::group_bindings> made{std::in_place, *node.host, out, 7U};
    cles::core::group_bindings& bindings = *made;
};

struct small : fixture {
    small() : fixture(few_leases()) {}
};

const std::vector<std::uint64_t> nothing{};
std::vector<std::uint64_t> just(std::uint64_t seq) { return {seq}; }

} // namespace
} // namespace group_bindings

BOOST_FIXTURE_TEST_SUITE(group_bindings, fixture)

BOOST_AUTO_TEST_CASE(an_update_is_sent_once_for_any_number_of_subscribers) {
    for (std::uint16_t source = 1; source <= 8; ++source) {
        BOOST_TEST(say(source, "BIND all:speed"));
    }
    node.publish_now("speed", R"({"v":1})");
    const auto sent = out.take();
    BOOST_REQUIRE(sent.size() == 1U);
    BOOST_TEST(sent[0] == R"(UPDATE car1:speed seq=1 epoch=5f3a09c1 {"v":1})");
    node.publish_now("speed", R"({"v":2})");
    BOOST_TEST(seqs() == just(2));
}

BOOST_AUTO_TEST_CASE(without_a_lease_nothing_is_sent) {
    node.publish_now("speed", "{}");
    say(1, "BIND all:other");
    node.publish_now("speed", "{}");
    BOOST_TEST(out.take().empty());
}

BOOST_AUTO_TEST_CASE(a_bind_before_the_first_publication_is_kept) {
    say(1, "BIND all:speed");
    BOOST_TEST(!node.host->published.knows("speed")); // the lease does not open the task
    node.publish_now("speed", "{}");
    BOOST_TEST(seqs() == just(1));
}

BOOST_AUTO_TEST_CASE(a_new_subscriber_of_all_repeats_the_last_update_within_250_ms) {
    node.publish_now("speed", "{}");
    say(1, "BIND all:speed");
    BOOST_TEST(seqs() == nothing);
    node.pass(250ms);
    BOOST_TEST(seqs() == just(1));
    node.pass(5s);
    BOOST_TEST(seqs() == nothing);
}

BOOST_AUTO_TEST_CASE(the_jitter_is_not_the_same_for_all_nodes) {
    std::vector<int> waits;
    for (std::uint32_t seed = 1; seed <= 20; ++seed) {
        fixture other;
        other.made.emplace(*other.node.host, other.out, seed * 2654435761U);
        other.node.publish_now("speed", "{}");
        other.say(1, "BIND all:speed");
        int waited = 0;
        for (; other.out.count() == 0 && waited <= 250; ++waited) {
            other.node.pass(1ms);
        }
        BOOST_TEST(waited <= 250);
        waits.push_back(waited);
    }
    std::sort(waits.begin(), waits.end());
    BOOST_TEST(waits.back() - waits.front() > 50);
}

BOOST_AUTO_TEST_CASE(a_bind_by_name_repeats_it_at_once) {
    node.publish_now("speed", "{}");
    say(1, "BIND car1:speed");
    BOOST_TEST(seqs() == just(1));
}

BOOST_AUTO_TEST_CASE(a_renewal_does_not_repeat_it) {
    node.publish_now("speed", "{}");
    say(1, "BIND car1:speed");
    out.take();
    node.pass(3s);
    say(1, "BIND car1:speed");
    say(1, "BIND all:speed");
    node.pass(1s);
    BOOST_TEST(seqs() == nothing);
    BOOST_TEST(leases() == 1U);
}

BOOST_AUTO_TEST_CASE(repeats_for_several_subscribers_are_combined) {
    node.publish_now("speed", "{}");
    for (std::uint16_t source = 1; source <= 8; ++source) {
        say(source, "BIND all:speed");
    }
    node.pass(250ms);
    BOOST_TEST(seqs() == just(1));
}

BOOST_AUTO_TEST_CASE(repeats_of_a_noun_are_250_ms_apart) {
    node.publish_now("speed", "{}");
    for (std::uint16_t source = 1; source <= 100; ++source) {
        say(source, "BIND car1:speed");
        node.pass(10ms);
    }
    const auto sent = seqs().size();
    BOOST_TEST(sent >= 4U);
    BOOST_TEST(sent <= 5U);
    node.pass(250ms);
    BOOST_TEST(seqs().size() <= 1U);
}

BOOST_AUTO_TEST_CASE(a_publication_in_between_is_sent_at_once_and_replaces_the_repeat) {
    node.publish_now("speed", "{}");
    say(1, "BIND all:speed");
    node.publish_now("speed", "{}");
    BOOST_TEST(seqs() == just(2));
    node.pass(1s);
    BOOST_TEST(seqs() == nothing);
    say(2, "BIND all:speed"); // while no repeat is pending
    node.pass(1s);
    BOOST_TEST(seqs() == just(2));
}

BOOST_AUTO_TEST_CASE(an_update_that_is_not_sent_yet_is_not_repeated) {
    say(1, "BIND all:speed");
    node.publish("speed", "{}");
    say(2, "BIND car1:speed");
    node.drain();
    BOOST_TEST(seqs() == just(1));
}

BOOST_AUTO_TEST_CASE(a_lease_expires) {
    say(1, "BIND all:speed lease=1000");
    node.pass(999ms);
    node.publish_now("speed", "{}");
    BOOST_TEST(seqs() == just(1));
    node.pass(1ms);
    node.publish_now("speed", "{}");
    BOOST_TEST(seqs() == nothing);
    BOOST_TEST(leases() == 0U);
    BOOST_TEST(node.counts().leases_expired == 1U);
}

BOOST_AUTO_TEST_CASE(a_lease_is_10_s_by_default_and_60_s_at_most) {
    say(1, "BIND all:a");
    say(1, "BIND all:b lease=3600000");
    node.pass(9999ms);
    BOOST_TEST(leases() == 2U);
    node.pass(1ms);
    BOOST_TEST(leases() == 1U);
    node.pass(49999ms);
    BOOST_TEST(leases() == 1U);
    node.pass(1ms);
    BOOST_TEST(leases() == 0U);
}

BOOST_AUTO_TEST_CASE(renewals_extend_a_lease) {
    say(1, "BIND all:speed lease=1000");
    for (int i = 0; i < 10; ++i) {
        node.pass(900ms);
        say(1, "BIND all:speed lease=1000");
    }
    node.publish_now("speed", "{}");
    BOOST_TEST(seqs() == just(1));
}

BOOST_AUTO_TEST_CASE(one_live_lease_of_any_source_is_enough) {
    say(1, "BIND all:speed lease=1000");
    say(2, "BIND car1:speed lease=2000");
    node.pass(1500ms);
    node.publish_now("speed", "{}");
    BOOST_TEST(seqs() == just(1));
}

BOOST_AUTO_TEST_CASE(lease_0_drops_the_lease_of_its_source_only) {
    say(1, "BIND all:speed");
    say(2, "BIND all:speed");
    say(1, "BIND all:speed lease=0");
    BOOST_TEST(leases() == 1U);
    node.publish_now("speed", "{}");
    BOOST_TEST(seqs() == just(1));
    say(2, "BIND car1:speed lease=0"); // with either target
    BOOST_TEST(leases() == 0U);
    node.publish_now("speed", "{}");
    BOOST_TEST(seqs() == nothing);
    BOOST_TEST(say(3, "BIND all:never lease=0"));
}

BOOST_AUTO_TEST_CASE(every_and_keep_have_no_effect) {
    say(1, "BIND all:speed every=5000 keep=1");
    for (int i = 0; i < 100; ++i) {
        node.publish("speed", "{}");
    }
    node.drain();
    BOOST_TEST(seqs().size() == 100U);
}

BOOST_AUTO_TEST_CASE(parameters_belong_to_the_noun_and_are_compared_decoded) {
    say(1, "BIND all:speed/f%61st");
    node.publish_now("speed", "{}");
    BOOST_TEST(seqs() == nothing);
    node.publish_now("speed/fast", "{}");
    BOOST_TEST(seqs() == just(1));
}

BOOST_AUTO_TEST_CASE(an_update_over_1200_bytes_is_not_sent_but_counted_and_logged) {
    say(1, "BIND all:speed");
    node.publish_now("speed", R"({"x":")" + std::string(1200, 'x') + R"("})");
    node.publish_now("speed", "{}");
    BOOST_TEST(seqs() == just(2));
    BOOST_TEST(node.counts().updates_too_large == 1U);
}

BOOST_AUTO_TEST_CASE(updates_wait_while_the_port_is_not_writable) {
    say(1, "BIND all:speed");
    out.writable = false;
    node.publish_now("speed", "{}");
    node.publish_now("speed", "{}");
    BOOST_TEST(out.take().empty());
    out.writable = true;
    bindings.drain(node.clock.now());
    BOOST_TEST((seqs() == std::vector<std::uint64_t>{1, 2}));
}

BOOST_AUTO_TEST_CASE(a_noun_that_is_no_longer_bound_is_released) {
    const auto is_idle = node.host->deadlines.size();
    say(1, "BIND all:speed");
    node.pass(10s);
    BOOST_TEST(node.host->deadlines.size() == is_idle);
    node.publish_now("speed", "{}");
    say(1, "BIND all:speed");
    bindings.clear();
    BOOST_TEST(node.host->deadlines.size() == is_idle);
    node.publish_now("speed", "{}");
    BOOST_TEST(seqs() == nothing);
}

BOOST_FIXTURE_TEST_CASE(leases_are_bounded_for_a_source_and_in_all, small) {
    BOOST_TEST(say(1, "BIND all:a"));
    BOOST_TEST(say(1, "BIND all:b"));
    BOOST_TEST(say(1, "BIND all:c"));
    BOOST_TEST(!say(1, "BIND all:d"));
    BOOST_TEST(say(1, "BIND all:a")); // a renewal
    BOOST_TEST(say(2, "BIND all:a"));
    BOOST_TEST(say(2, "BIND all:b"));
    BOOST_TEST(!say(3, "BIND all:a"));
    BOOST_TEST(leases() == 5U);
    BOOST_TEST(say(1, "BIND all:c lease=0"));
    BOOST_TEST(say(3, "BIND all:a"));
}

BOOST_AUTO_TEST_CASE(a_noun_with_a_lease_does_not_retire) {
    fixture few{cles::limits{.nouns = 2}};
    few.node.publish_now("job/1", "[1]");
    BOOST_TEST(few.say(1, "BIND all:job/1"));
    for (int i = 2; i < 9; ++i) {
        few.node.publish_now("job/" + std::to_string(i), "[1]");
    }
    BOOST_TEST(few.node.host->published.find("job/1") != nullptr);
    BOOST_TEST(few.node.host->published.find("job/7") == nullptr);
    few.node.pass(11s); // the lease expires
    few.node.publish_now("job/9", "[1]");
    few.node.publish_now("job/10", "[1]");
    BOOST_TEST(few.node.host->published.find("job/1") == nullptr);
}

// The log sink is user code, and may do anything.
BOOST_AUTO_TEST_CASE(the_log_sink_is_not_called_inside_the_loop) {
    std::vector<cles::core::completion> due;
    std::vector<std::string> logged;
    test_node noisy{{},
                    {},
                    [&](cles::log_level, const cles::log_entry& what) { logged.emplace_back(what.text); },
                    [&](cles::core::completion c) { due.push_back(std::move(c)); }};
    cles::core::group_bindings in_it{*noisy.host, out, 7U};
    cles::protocol::request_line r;
    cles::protocol::malformed_request why;
    BOOST_REQUIRE(cles::protocol::parse_request("BIND all:speed", r, why));
    in_it.bind(source_at(1), r, noisy.clock.now());
    noisy.publish_now("speed", "[\"" + std::string(2000, 'x') + "\"]");
    BOOST_TEST(noisy.counts().updates_too_large == 1U);
    BOOST_TEST(logged.empty());
    BOOST_REQUIRE(due.size() == 1U);
    due.front()();
    BOOST_REQUIRE(logged.size() == 1U);
    BOOST_TEST(logged.front().starts_with("too_large: UPDATE car1:speed"), logged.front());
}

BOOST_AUTO_TEST_SUITE_END()
