// SPDX-License-Identifier: BSL-1.0
// The load that members of a secured fleet report in the group between signed announcements (docs/protocol_security.md,
// "Announcements").
#include "node/membership/membership.hpp"
#include "support/watched_membership.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

namespace load_reports {
namespace {

using namespace std::chrono_literals;
using cles::core::announcement;
using cles::core::group_source;
using cles::core::signed_announcement;

constexpr group_source first{0x0A000007, 40000};
constexpr group_source second{0x0A010007, 41000};
constexpr group_source stranger{0x0A000009, 42000};

struct fixture : cles::test::watched_membership {
    static announcement car1() {
        announcement said{.node = "car1", .endpoints = {"tls://10.0.0.7:1"}, .sources = {first, second}};
        said.original = std::make_shared<signed_announcement>();
        return said;
    }
    verdict announce(std::uint64_t seq, std::uint32_t epoch = 1, const group_source& from = first) {
        return table.apply_announcement(car1(), epoch, seq, from, clock.now());
    }
    verdict report(std::uint64_t seq, std::uint32_t queued = 0, std::uint32_t epoch = 1,
                   const group_source& from = first, const std::string& node = "car1") {
        return table.apply_load(node, epoch, seq, {.queued = queued}, from, clock.now());
    }
    [[nodiscard]] std::uint32_t queued() const { return table.find_member("car1")->load.queued; }
};

} // namespace
} // namespace load_reports

BOOST_FIXTURE_TEST_SUITE(load_reports, fixture)

BOOST_AUTO_TEST_CASE(a_node_that_reports_is_alive) {
    announce(1);
    for (int i = 0; i < 20; ++i) {
        pass(1s);
        BOOST_TEST((report(1) == verdict::taken));
    }
    check(changes, {"car1 appeared tls://10.0.0.7:1"});
    pass(4s);
    BOOST_TEST((report(1) == verdict::taken));
    check(changes,
          {"car1 appeared tls://10.0.0.7:1", "car1 silent tls://10.0.0.7:1", "car1 returned tls://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(the_load_is_the_reported_one) {
    announce(1);
    report(1, 3);
    BOOST_TEST(queued() == 3U);
    report(2, 4); // the announcement before it was lost
    BOOST_TEST(queued() == 4U);
    BOOST_TEST((announce(2) == verdict::taken));
    BOOST_TEST(queued() == 0U);
}

BOOST_AUTO_TEST_CASE(one_before_the_last_announcement_is_outdated) {
    announce(2);
    BOOST_TEST((report(1, 3) == verdict::old));
    BOOST_TEST(queued() == 0U);
}

BOOST_AUTO_TEST_CASE(only_a_known_incarnation_reports_and_from_its_own_sources) {
    BOOST_TEST((report(1) == verdict::unknown));
    BOOST_TEST(list().empty());
    announce(1);
    BOOST_TEST((report(1, 3, 2) == verdict::unknown));
    BOOST_TEST((report(1, 3, 1, stranger) == verdict::unknown));
    BOOST_TEST((report(1, 3, 1, first, "car2") == verdict::unknown));
    BOOST_TEST(queued() == 0U);
    BOOST_TEST((report(1, 3, 1, second) == verdict::taken));
    BOOST_TEST(where("car1") == "tls://10.0.0.7:1");
}

BOOST_AUTO_TEST_CASE(a_node_that_announces_itself_unsigned_does_not_report) {
    auto said = car1();
    said.original = nullptr;
    table.apply_announcement(said, 1, 1, first, clock.now());
    BOOST_TEST((report(1, 3) == verdict::unknown));
}

BOOST_AUTO_TEST_CASE(this_node_ignores_its_own) {
    BOOST_TEST((report(1, 0, 0xAAAA, first, "me") == verdict::own));
    BOOST_TEST((report(1, 0, 0xAAAB, first, "me") == verdict::unknown));
}

BOOST_AUTO_TEST_CASE(a_second_incarnation_that_reports_stays_known_and_is_no_conflict_by_itself) {
    announce(1);
    announce(1, 2, stranger); // its sources are those of the announcement, and it was received from elsewhere
    for (int i = 0; i < 5; ++i) {
        pass(1s);
        BOOST_TEST((report(1, 0, 2, stranger) == verdict::taken));
    }
    // The owner has been silent, so the name passes to the other one, which is alive.
    BOOST_TEST((table.apply_announcement(car1(), 2, 2, stranger, clock.now()) == verdict::taken));
    BOOST_TEST(table.find_member("car1")->epoch == 2U);
    for (const auto& each : changes) {
        BOOST_TEST(each.find("clash") == std::string::npos);
    }
}

BOOST_AUTO_TEST_CASE(a_node_that_is_gone_returns_with_its_next_announcement) {
    announce(1);
    pass(20s);
    BOOST_TEST((report(1) == verdict::unknown));
    BOOST_TEST((announce(2) == verdict::taken));
    BOOST_TEST(where("car1") == "tls://10.0.0.7:1");
}

BOOST_AUTO_TEST_SUITE_END()
