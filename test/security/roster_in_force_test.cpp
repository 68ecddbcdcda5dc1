// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/fleet.hpp"
#include "security/fleet_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace roster_in_force {
namespace {

using namespace cles::security;
using namespace cles::security::test;
using verdict = fleet::verdict;

// A fleet of car1, car2 and car3, as car1 knows it, and the authority of its next rosters.
struct fixture {
    fleet_authority authority = authority_with({"car1", "car2", "car3"});
    fleet car1{"car1", key_of("car1"), authority.share()};

    verdict offer_newest(std::string* why = nullptr) { return car1.offer(authority.newest().line(), why); }
};

bool same(const secret_bytes* one, const secret_bytes& other) {
    return one != nullptr && std::ranges::equal(one->view(), other.view());
}

// The authority of another branch: what another person makes of the same roster.
fleet_authority branch_of(const fleet_authority& authority) { return {key_of("fleet"), authority.share()}; }

// A roster of the fleet's key with a changed content.
std::shared_ptr<const roster> changed(const roster& from, std::string_view part, std::string_view by) {
    return reread(roster::sign(replaced(std::string{from.content()}, part, by), key_of("fleet")));
}

} // namespace

BOOST_FIXTURE_TEST_SUITE(roster_in_force, fixture)

BOOST_AUTO_TEST_CASE(a_node_knows_its_entry) {
    BOOST_TEST(car1.name() == "car1");
    BOOST_REQUIRE(car1.self() != nullptr);
    BOOST_TEST(car1.self()->number == 1U);
    BOOST_TEST(&car1.in_force() == car1.share().get());
    BOOST_TEST((car1.own_key().public_part() == key_of("car1").public_part()));
    BOOST_TEST(car1.ring().current() == 1U);
}

BOOST_AUTO_TEST_CASE(a_newer_roster_comes_into_force) {
    authority.rotate();
    BOOST_TEST((offer_newest() == verdict::adopted));
    BOOST_TEST(car1.in_force().version() == authority.newest().version());
    BOOST_TEST((offer_newest() == verdict::known));
    // Versions may be skipped.
    authority.rotate();
    authority.rotate();
    authority.set_rights("car2", {.forwards = {"car*"}});
    BOOST_TEST((offer_newest() == verdict::adopted));
    BOOST_TEST(car1.in_force().find("car2")->forwards.size() == 1U);
    BOOST_TEST(car1.self() == car1.in_force().find("car1"));
}

BOOST_AUTO_TEST_CASE(a_node_never_returns_to_a_lower_version) {
    const auto old = authority.newest().line();
    authority.rotate();
    offer_newest();
    std::string why = "before";
    BOOST_TEST((car1.offer(old, &why) == verdict::older));
    BOOST_TEST(why == "");
    BOOST_TEST(car1.in_force().version() == authority.newest().version());
}

BOOST_AUTO_TEST_CASE(what_is_refused_changes_nothing) {
    const auto before = car1.share();
    auto other = fleet_authority::found(key_of("another fleet"));
    while (other.newest().version() <= before->version()) {
        other.rotate();
    }
    authority.rotate();
    auto broken = authority.newest().line();
    broken[broken.size() / 2] ^= 1;
    for (const auto& line : {other.newest().line(), broken, std::string{}, std::string{"{}"}}) {
        std::string why;
        BOOST_TEST((car1.offer(line, &why) == verdict::refused), line);
        BOOST_TEST(why != "");
        BOOST_TEST((car1.offer(line) == verdict::refused));
    }
    BOOST_TEST(car1.share() == before);
}

BOOST_AUTO_TEST_CASE(a_fork_is_reported_once_and_kept_out) {
    auto branch = branch_of(authority);
    auto third = branch_of(authority);
    authority.rotate();
    branch.rotate();
    third.remove("car3");
    offer_newest();
    const auto before = car1.share();
    std::string why;
    BOOST_TEST((car1.offer(branch.newest().line(), &why) == verdict::forked));
    BOOST_TEST(why == "there are two rosters of version 5; the next version ends the fork");
    BOOST_TEST((car1.offer(branch.newest().line(), &why) == verdict::forked));
    BOOST_TEST(why == "");
    BOOST_TEST((car1.offer(third.newest().line(), &why) == verdict::forked));
    BOOST_TEST(why == "");
    BOOST_TEST(car1.share() == before);
    // The next version ends it, and a later fork is reported again.
    branch.rotate();
    BOOST_TEST((car1.offer(branch.newest().line(), &why) == verdict::adopted));
    authority.rotate();
    BOOST_TEST((offer_newest(&why) == verdict::forked));
    BOOST_TEST(why == "there are two rosters of version 6; the next version ends the fork");
}

BOOST_AUTO_TEST_CASE(a_removed_node_has_no_entry_and_no_keys) {
    authority.remove("car1");
    BOOST_TEST((offer_newest() == verdict::adopted));
    BOOST_TEST(car1.self() == nullptr);
    BOOST_TEST(car1.ring().current() == 0U);
    for (const std::uint32_t generation : {1U, 2U, 3U, 4U}) {
        BOOST_TEST(car1.ring().find(generation) == nullptr);
    }
    // It may be added again, as another member.
    authority.add(node("car1"));
    BOOST_TEST((offer_newest() == verdict::adopted));
    BOOST_REQUIRE(car1.self() != nullptr);
    BOOST_TEST(car1.self()->number == 4U);
    BOOST_TEST(car1.ring().current() == 3U);
}

BOOST_AUTO_TEST_CASE(a_key_under_another_name_is_another_member) {
    authority.remove("car1");
    authority.add({"lead", key_of("car1").public_part()});
    BOOST_TEST((offer_newest() == verdict::adopted));
    BOOST_TEST(car1.self() == nullptr);
    BOOST_TEST(car1.ring().current() == 0U);
    BOOST_TEST(refusal([&] {
                   return fleet{"car1", key_of("car1"), authority.share()};
               }) == "the roster lists the key of car1 under the name lead");
}

BOOST_AUTO_TEST_CASE(a_node_need_not_be_in_its_first_roster) {
    fleet car4{"car4", key_of("car4"), authority.share()};
    BOOST_TEST(car4.self() == nullptr);
    BOOST_TEST(car4.ring().current() == 0U);
    authority.add(node("car4"));
    BOOST_TEST((car4.offer(authority.newest().line()) == verdict::adopted));
    BOOST_TEST(car4.self() != nullptr);
    BOOST_TEST(car4.ring().current() == 1U);
}

BOOST_AUTO_TEST_CASE(group_keys_that_cannot_be_opened_are_reported) {
    authority.rotate();
    const auto& newest = authority.newest();
    // car1 gets what is sealed for car2.
    const auto wrong = changed(newest, newest.find("car1")->group_keys, newest.find("car2")->group_keys);
    std::string why;
    BOOST_TEST((car1.offer(wrong->line(), &why) == verdict::adopted));
    BOOST_TEST(why == "version 5 of the roster: the group keys are sealed for another key");
    BOOST_TEST(car1.ring().current() == 0U);
    BOOST_TEST(car1.self() != nullptr);
    BOOST_CHECK_THROW((fleet{"car1", key_of("car1"), wrong}), security_error);
}

// --- Group keys ---

BOOST_AUTO_TEST_CASE(the_current_and_the_next_key_are_known) {
    const auto keys = open_group_keys(authority.newest().authority_keys(), key_of("fleet"));
    BOOST_TEST(same(car1.ring().find(1), keys.current));
    BOOST_TEST(same(car1.ring().find(2), keys.next));
    BOOST_TEST(car1.ring().find(0) == nullptr);
    BOOST_TEST(car1.ring().find(3) == nullptr);
    BOOST_TEST(!car1.ring().is_future(1));
    BOOST_TEST(!car1.ring().is_future(2));
    BOOST_TEST(car1.ring().is_future(3));
    BOOST_TEST(car1.ring().is_future(0xFFFFFFFFU));
}

BOOST_AUTO_TEST_CASE(rotation_keeps_the_previous_key) {
    const auto before = open_group_keys(authority.newest().authority_keys(), key_of("fleet"));
    authority.rotate();
    offer_newest();
    const auto after = open_group_keys(authority.newest().authority_keys(), key_of("fleet"));
    BOOST_TEST(car1.ring().current() == 2U);
    BOOST_TEST(same(car1.ring().find(1), before.current));
    BOOST_TEST(same(car1.ring().find(2), before.next));
    BOOST_TEST(same(car1.ring().find(3), after.next));
    // The one before the previous is forgotten.
    authority.rotate();
    offer_newest();
    BOOST_TEST(car1.ring().find(1) == nullptr);
    BOOST_TEST(same(car1.ring().find(2), before.next));
    BOOST_TEST(same(car1.ring().find(3), after.next));
    BOOST_TEST(car1.ring().find(4) != nullptr);
}

BOOST_AUTO_TEST_CASE(a_skipped_rotation_leaves_the_previous_key_if_it_is_known) {
    const auto before = open_group_keys(authority.newest().authority_keys(), key_of("fleet"));
    authority.rotate();
    authority.rotate();
    offer_newest();
    BOOST_TEST(car1.ring().current() == 3U);
    BOOST_TEST(same(car1.ring().find(2), before.next));
    authority.rotate();
    authority.rotate();
    authority.rotate();
    offer_newest();
    BOOST_TEST(car1.ring().current() == 6U);
    BOOST_TEST(car1.ring().find(5) == nullptr);
}

BOOST_AUTO_TEST_CASE(removal_forgets_all_earlier_keys) {
    const auto before = open_group_keys(authority.newest().authority_keys(), key_of("fleet"));
    authority.remove("car3");
    offer_newest();
    BOOST_TEST(car1.ring().current() == 3U);
    BOOST_TEST(car1.ring().find(1) == nullptr);
    BOOST_TEST(car1.ring().find(2) == nullptr);
    for (const std::uint32_t generation : {3U, 4U}) {
        BOOST_REQUIRE(car1.ring().find(generation) != nullptr);
        BOOST_TEST(!same(car1.ring().find(generation), before.current));
        BOOST_TEST(!same(car1.ring().find(generation), before.next));
    }
}

BOOST_AUTO_TEST_CASE(other_changes_keep_all_keys) {
    authority.rotate();
    offer_newest();
    std::vector<secret_bytes> before;
    for (const std::uint32_t generation : {1U, 2U, 3U}) {
        before.push_back(car1.ring().find(generation)->copy());
    }
    authority.add(node("car4"));
    authority.set_rights("car2", {});
    offer_newest();
    for (const std::uint32_t generation : {1U, 2U, 3U}) {
        BOOST_TEST(same(car1.ring().find(generation), before[generation - 1]));
    }
}

// --- Observers ---

BOOST_AUTO_TEST_CASE(an_observer_is_told_of_each_change_once) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> seen;
    auto observation =
        car1.observe([&](const roster& before) { seen.emplace_back(before.version(), car1.in_force().version()); });
    authority.rotate();
    offer_newest();
    offer_newest();
    car1.offer("nonsense");
    authority.rotate();
    offer_newest();
    BOOST_REQUIRE(seen.size() == 2U);
    BOOST_TEST((seen[0] == std::pair{4U, 5U}));
    BOOST_TEST((seen[1] == std::pair{5U, 6U}));
    observation.reset();
    authority.rotate();
    offer_newest();
    BOOST_TEST(seen.size() == 2U);
}

BOOST_AUTO_TEST_CASE(an_observer_may_end_observations) {
    std::vector<int> called;
    std::vector<std::shared_ptr<void>> observations(4);
    const auto whole = std::make_shared<int>(7); // its capture has to live as long as the call
    observations[0] = car1.observe([&](const roster&) { called.push_back(0); });
    observations[1] = car1.observe([&, whole](const roster&) {
        observations[0].reset();
        observations[1].reset();
        observations[2].reset();
        called.push_back(*whole);
    });
    observations[2] = car1.observe([&](const roster&) { called.push_back(2); });
    observations[3] = car1.observe([&](const roster&) { called.push_back(3); });
    authority.rotate();
    offer_newest();
    BOOST_TEST(called == (std::vector<int>{0, 7, 3}), boost::test_tools::per_element());
    called.clear();
    authority.rotate();
    offer_newest();
    BOOST_TEST(called == std::vector<int>{3}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(an_observer_may_start_observations) {
    int called = 0;
    std::vector<std::shared_ptr<void>> more;
    const auto first = car1.observe([&](const roster&) {
        for (int i = 0; i < 100; ++i) {
            more.push_back(car1.observe([&](const roster&) { ++called; }));
        }
    });
    authority.rotate();
    offer_newest();
    BOOST_TEST(called == 0);
    authority.rotate();
    offer_newest();
    BOOST_TEST(called == 100);
}

BOOST_AUTO_TEST_CASE(an_observer_that_throws_does_not_keep_others_from_knowing) {
    int called = 0;
    const auto first = car1.observe([&](const roster&) { throw std::runtime_error{"first"}; });
    const auto second = car1.observe([&](const roster&) { ++called; });
    const auto third = car1.observe([&](const roster&) { throw std::runtime_error{"third"}; });
    const auto fourth = car1.observe([&](const roster&) { ++called; });
    authority.rotate();
    BOOST_CHECK_EXCEPTION(offer_newest(), std::runtime_error,
                          [](const std::runtime_error& e) { return std::string{e.what()} == "first"; });
    BOOST_TEST(called == 2);
    BOOST_TEST(car1.in_force().version() == authority.newest().version());
}

BOOST_AUTO_TEST_CASE(an_observation_may_outlive_the_fleet) {
    std::shared_ptr<void> observation;
    {
        fleet car2{"car2", key_of("car2"), authority.share()};
        observation = car2.observe([](const roster&) {});
    }
    observation.reset();
    BOOST_TEST(!observation);
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace roster_in_force
