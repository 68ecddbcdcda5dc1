// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/fleet_authority.hpp"
#include "security/fleet_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace authority {
namespace {

using namespace cles::security;
using namespace cles::security::test;

const std::vector<std::string> nothing;

struct opened_keys {
    std::string current;
    std::string next;
};

opened_keys keys_for(const std::string& sealed, std::string_view receiver) {
    const auto opened = open_group_keys(sealed, key_of(receiver));
    return {to_hex(opened.current.view()), to_hex(opened.next.view())};
}

opened_keys keys_of(const fleet_authority& made) { return keys_for(made.newest().authority_keys(), "fleet"); }

// Whether all members, and the authority, can open the same keys.
bool all_have_the_keys(const fleet_authority& made) {
    const auto expected = keys_of(made);
    return std::ranges::all_of(made.newest().members(), [&](const member& entry) {
        const auto own = keys_for(entry.group_keys, entry.name);
        return own.current == expected.current && own.next == expected.next;
    });
}

// An authority that goes on from the newest roster with a changed content.
fleet_authority changed(const fleet_authority& made, std::string_view part, std::string_view by) {
    return {key_of("fleet"),
            reread(roster::sign(replaced(std::string{made.newest().content()}, part, by), key_of("fleet")))};
}

std::vector<public_identity> nodes(std::size_t count, const std::string& prefix) {
    std::vector<public_identity> made;
    for (std::size_t i = 0; i < count; ++i) {
        made.push_back(node(prefix + std::to_string(i)));
    }
    return made;
}

// The call is refused with this message, and changes nothing.
template <class Call>
void expect_refusal(fleet_authority& made, std::string_view message, Call call) {
    const auto before = made.share();
    const auto why = refusal([&] {
        call();
        return 0;
    });
    BOOST_TEST(contains(why, message), why);
    BOOST_TEST(made.share() == before);
}

} // namespace

BOOST_AUTO_TEST_SUITE(authority)

BOOST_AUTO_TEST_CASE(a_new_fleet_has_no_members) {
    const auto made = fleet_authority::found(key_of("fleet"));
    BOOST_TEST((made.newest().fleet() == key_of("fleet").public_part()));
    BOOST_TEST(made.newest().version() == 1U);
    BOOST_TEST(made.newest().last() == 0U);
    BOOST_TEST(made.newest().generation() == 1U);
    BOOST_TEST(made.newest().oldest() == 1U);
    BOOST_TEST(made.newest().members().empty());
    BOOST_TEST(keys_of(made).current != keys_of(made).next);
    BOOST_TEST(keys_of(made).current != keys_of(fleet_authority::found(key_of("fleet"))).current);
}

BOOST_AUTO_TEST_CASE(each_change_is_the_next_version) {
    auto made = authority_with({"car1", "car2"});
    BOOST_TEST(made.newest().version() == 3U);
    made.set_rights("car1", {});
    BOOST_TEST(made.newest().version() == 4U);
    made.rotate();
    BOOST_TEST(made.newest().version() == 5U);
    made.remove("car1");
    BOOST_TEST(made.newest().version() == 6U);
    made.add(nodes(3, "sat"));
    BOOST_TEST(made.newest().version() == 7U);
}

BOOST_AUTO_TEST_CASE(a_new_member_gets_the_keys_and_others_keep_theirs) {
    auto made = authority_with({"car1"});
    const auto before = keys_of(made);
    const auto sealed = made.newest().find("car1")->group_keys;
    made.add(node("car2"), {.may = {{"pull *:*"}}, .offers = nothing, .forwards = {"sat*", "uav*"}});
    const auto* const car2 = made.newest().find("car2");
    BOOST_REQUIRE(car2 != nullptr);
    BOOST_TEST(car2->number == 2U);
    BOOST_TEST((car2->key == key_of("car2").public_part()));
    BOOST_TEST((car2->may == std::vector<std::string>{"pull *:*"}));
    BOOST_TEST((car2->offers == nothing));
    BOOST_TEST((car2->forwards == std::vector<std::string>{"sat*", "uav*"}));
    BOOST_TEST(all_have_the_keys(made));
    BOOST_TEST(keys_of(made).current == before.current);
    BOOST_TEST(made.newest().find("car1")->group_keys == sealed);
}

BOOST_AUTO_TEST_CASE(several_members_are_one_version) {
    auto made = authority_with({});
    made.add(nodes(5, "car"), {.may = nothing});
    BOOST_TEST(made.newest().version() == 2U);
    BOOST_TEST(made.newest().members().size() == 5U);
    BOOST_TEST(made.newest().last() == 5U);
    BOOST_TEST(made.newest().find("car4")->number == 5U);
    BOOST_TEST(made.newest().find("car4")->may.has_value());
    BOOST_TEST(all_have_the_keys(made));
}

BOOST_AUTO_TEST_CASE(rights_are_replaced) {
    auto made = authority_with({"car1", "car2"});
    const auto before = *made.newest().find("car2");
    made.set_rights("car2", {.may = {{"push car1:target", "* \xc3\xa4:\"\\*/**"}}});
    const auto* const car2 = made.newest().find("car2");
    BOOST_TEST((car2->may == std::vector<std::string>{"push car1:target", "* \xc3\xa4:\"\\*/**"}));
    BOOST_TEST(!car2->offers);
    BOOST_TEST(car2->is(before));
    BOOST_TEST(car2->group_keys == before.group_keys);
    made.set_rights("car2", {.offers = nothing});
    BOOST_TEST(!made.newest().find("car2")->may);
    BOOST_TEST((made.newest().find("car2")->offers == nothing));
}

BOOST_AUTO_TEST_CASE(rotation_makes_the_next_key_the_current_one) {
    auto made = authority_with({"car1", "car2"});
    for (std::uint32_t generation = 2; generation < 5; ++generation) {
        const auto before = keys_of(made);
        made.rotate();
        BOOST_TEST(made.newest().generation() == generation);
        BOOST_TEST(made.newest().oldest() == generation - 1);
        BOOST_TEST(keys_of(made).current == before.next);
        BOOST_TEST(keys_of(made).next != before.next);
        BOOST_TEST(keys_of(made).next != before.current);
        BOOST_TEST(all_have_the_keys(made));
    }
}

BOOST_AUTO_TEST_CASE(removal_draws_both_keys_anew) {
    auto made = authority_with({"car1", "car2", "car3"});
    made.rotate();
    const auto before = keys_of(made);
    made.remove("car2");
    BOOST_TEST(made.newest().generation() == 4U);
    BOOST_TEST(made.newest().oldest() == 4U);
    BOOST_TEST(made.newest().find("car2") == nullptr);
    BOOST_TEST(made.newest().members().size() == 2U);
    const auto after = keys_of(made);
    for (const auto& key : {after.current, after.next}) {
        BOOST_TEST(key != before.current);
        BOOST_TEST(key != before.next);
    }
    BOOST_TEST(all_have_the_keys(made));
    made.remove(std::vector<std::string>{"car1", "car3"});
    BOOST_TEST(made.newest().generation() == 6U);
    BOOST_TEST(made.newest().members().empty());
}

BOOST_AUTO_TEST_CASE(a_number_is_never_given_again) {
    auto made = authority_with({"car1", "car2"});
    made.remove("car2");
    BOOST_TEST(made.newest().last() == 2U);
    made.add(node("car2"));
    BOOST_TEST(made.newest().find("car2")->number == 3U);
    made.remove("car1");
    made.add(node("car4"));
    BOOST_TEST(made.newest().find("car4")->number == 4U);
}

BOOST_AUTO_TEST_CASE(key_and_newest_roster_are_all_that_is_needed) {
    auto made = authority_with({"car1"});
    made.rotate();
    fleet_authority again{key_of("fleet"), reread(made.newest().line())};
    again.add(node("car2"), {.may = {{"pull *:*"}}});
    BOOST_TEST(again.newest().version() == 4U);
    BOOST_TEST(keys_of(again).current == keys_of(made).current);
    BOOST_TEST(all_have_the_keys(again));
    fleet_authority third{key_of("fleet"), reread(again.newest().line())};
    third.rotate();
    BOOST_TEST((third.newest().find("car2")->may == std::vector<std::string>{"pull *:*"}));
}

BOOST_AUTO_TEST_CASE(it_goes_on_only_from_what_it_understands) {
    auto made = authority_with({"car1"});
    BOOST_TEST(refusal([&] {
                   return fleet_authority{key_of("car1"), made.share()};
               }) == "the roster is of another fleet than the key");
    BOOST_TEST(contains(refusal([&] { return changed(made, R"("version")", R"("colour":1,"version")"); }),
                        "contains 'colour', which this version would drop"));
    BOOST_TEST(
        contains(refusal([&] { return changed(made, R"("number")", R"("since":1,"number")"); }), "contains 'since'"));
    BOOST_TEST(contains(
        refusal([&] { return changed(made, made.newest().authority_keys(), made.newest().find("car1")->group_keys); }),
        "sealed for another key"));
}

BOOST_AUTO_TEST_CASE(what_no_node_would_accept_is_refused) {
    auto made = authority_with({"car1"});
    const auto add = [&](const public_identity& who) { return [&made, who] { made.add(who); }; };
    expect_refusal(made, "car1 is already a member", add({"car1", key_of("other").public_part()}));
    expect_refusal(made, "is that of the member car1", add({"car2", key_of("car1").public_part()}));
    expect_refusal(made, "'car 2' is not a name", add({"car 2", key_of("car2").public_part()}));
    expect_refusal(made, "'' is not a name", add({"", key_of("car2").public_part()}));
    expect_refusal(made, "'all' is reserved", add({"all", key_of("car2").public_part()}));
    expect_refusal(made, "the key of 'car2' is not valid", add({"car2", {}}));
    expect_refusal(made, "two members have the name", [&] {
        made.add(std::vector<public_identity>{node("car2"), {"car2", key_of("car3").public_part()}});
    });
    expect_refusal(made, "two members have the key", [&] {
        made.add(std::vector<public_identity>{node("car2"), {"car3", key_of("car2").public_part()}});
    });
    expect_refusal(made, "is not UTF-8", [&] { made.add(node("car2"), {.may = {{"pull \xff:*"}}}); });
    expect_refusal(made, "is not UTF-8", [&] { made.set_rights("car1", {.offers = {{"\xc0\xaf"}}}); });
    expect_refusal(made, "is not UTF-8", [&] { made.set_rights("car1", {.forwards = {"\xed\xa0\x80"}}); });
    expect_refusal(made, "'car2' is not a member", [&] { made.remove("car2"); });
    expect_refusal(made, "'car2' is not a member", [&] { made.remove(std::vector<std::string>{"car1", "car2"}); });
    expect_refusal(made, "'car1' is not a member", [&] { made.remove(std::vector<std::string>{"car1", "car1"}); });
    expect_refusal(made, "'car2' is not a member", [&] { made.set_rights("car2", {}); });
    made.rotate(); // it still works
    BOOST_TEST(made.newest().version() == 3U);
}

BOOST_AUTO_TEST_CASE(numbers_end) {
    auto made = authority_with({"car1"});
    auto of_last_version = changed(made, R"("version":2)", R"("version":4294967294)");
    of_last_version.rotate();
    expect_refusal(of_last_version, "versions of the roster are used up", [&] { of_last_version.rotate(); });
    expect_refusal(of_last_version, "versions of the roster are used up", [&] { of_last_version.remove("car1"); });

    auto of_last_number = changed(made, R"("last":1)", R"("last":16777214)");
    of_last_number.add(node("car2"));
    BOOST_TEST(of_last_number.newest().find("car2")->number == 16777215U);
    expect_refusal(of_last_number, "numbers of members are used up", [&] { of_last_number.add(node("car3")); });

    auto of_last_generation =
        changed(made, R"("generation":1,"oldest":1)", R"("generation":4294967293,"oldest":4294967293)");
    expect_refusal(of_last_generation, "generations of the group key are used up",
                   [&] { of_last_generation.remove("car1"); });
    of_last_generation.rotate();
    BOOST_TEST(of_last_generation.newest().generation() == 4294967294U);
    expect_refusal(of_last_generation, "generations of the group key are used up",
                   [&] { of_last_generation.rotate(); });

    auto before = changed(made, R"("generation":1,"oldest":1)", R"("generation":4294967292,"oldest":4294967292)");
    before.remove("car1");
    BOOST_TEST(before.newest().generation() == 4294967294U);
}

BOOST_AUTO_TEST_CASE(a_roster_has_a_largest_size) {
    auto made = authority_with({"car1"});
    expect_refusal(made, "at most 4096 members", [&] { made.add(nodes(4096, "")); });
    expect_refusal(made, "bytes; it may have 1,000,000",
                   [&] { made.set_rights("car1", {.may = {{std::string(1'000'000, 'x')}}}); });
    made.remove("car1");
    made.add(nodes(4096, ""));
    BOOST_TEST(made.newest().members().size() == 4096U);
    expect_refusal(made, "at most 4096 members", [&] { made.add(node("car1")); });
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace authority
