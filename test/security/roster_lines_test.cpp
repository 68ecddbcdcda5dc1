// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/group_keys.hpp"
#include "security/fleet/roster.hpp"
#include "security/fleet_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace roster_lines {
namespace {

using namespace cles::security;
using namespace cles::security::test;

// The roster of the vectors: version 7, car1 with the number 1, car2 with the number 3.
const std::string& vector_line() {
    static const auto line = text_at(vectors(), "roster");
    return line;
}

std::string vector_content() { return std::string{reread(vector_line())->content()}; }

std::shared_ptr<const roster> read(std::string_view line) {
    return roster::read(line, vector_key("fleet").public_part());
}

// Reads a roster with this content, signed by the fleet's key.
std::shared_ptr<const roster> read_content(std::string_view content) {
    return read(roster::sign(content, vector_key("fleet")));
}

std::string key_text(std::string_view name) { return to_base64url(key_of(name).public_part()); }

// A roster of this many members with short names.
std::string content_with_members(std::size_t count) {
    const auto sealed = seal_group_keys(group_keys::random(), key_of("car1").agreement_part());
    std::string members;
    for (std::size_t i = 1; i <= count; ++i) {
        const auto number = std::to_string(i);
        members += (i == 1 ? "" : ",");
        members += R"({"number":)" + number + R"(,"name":")" + number + R"(","key":")" + key_text(number) +
                   R"(","keys":")" + sealed + R"("})";
    }
    return R"({"fleet":")" + to_base64url(vector_key("fleet").public_part()) + R"(","version":1,"last":)" +
           std::to_string(count) + R"(,"generation":1,"oldest":1,"keys":")" + sealed + R"(","members":[)" + members +
           "]}";
}

} // namespace

BOOST_AUTO_TEST_SUITE(roster_lines)

BOOST_AUTO_TEST_CASE(the_vector_is_read) {
    const auto read_one = read(vector_line());
    BOOST_TEST(read_one->line() == vector_line());
    BOOST_TEST((read_one->fleet() == vector_key("fleet").public_part()));
    BOOST_TEST(read_one->version() == 7U);
    BOOST_TEST(read_one->last() == 3U);
    BOOST_TEST(read_one->generation() == 5U);
    BOOST_TEST(read_one->oldest() == 4U);
    BOOST_TEST(read_one->ignored_key() == "");
    BOOST_REQUIRE(read_one->members().size() == 2U);

    const auto& car1 = read_one->members()[0];
    BOOST_TEST(car1.number == 1U);
    BOOST_TEST(car1.name == "car1");
    BOOST_TEST((car1.key == vector_key("car1").public_part()));
    BOOST_TEST((car1.agreement == vector_key("car1").agreement_part()));
    BOOST_TEST(!car1.may);
    BOOST_TEST(!car1.offers);
    BOOST_TEST(car1.forwards.empty());

    const auto& car2 = read_one->members()[1];
    BOOST_TEST(car2.number == 3U);
    BOOST_REQUIRE(car2.may);
    BOOST_TEST(*car2.may == (std::vector<std::string>{"pull,bind *:localization", "push car1:target"}),
               boost::test_tools::per_element());
    BOOST_TEST(!car2.offers);
    BOOST_TEST(car2.forwards == std::vector<std::string>{"sat*"}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(the_group_keys_of_the_vector_open_for_each_receiver) {
    const auto& keys = vectors().at("group_keys").as_object();
    const auto read_one = read(vector_line());
    for (const auto& [who, sealed] :
         {std::pair{"fleet", read_one->authority_keys()}, std::pair{"car1", read_one->members()[0].group_keys},
          std::pair{"car2", read_one->members()[1].group_keys}}) {
        const auto opened = open_group_keys(sealed, vector_key(who));
        BOOST_TEST(to_hex(opened.current.view()) == text_at(keys, "current"));
        BOOST_TEST(to_hex(opened.next.view()) == text_at(keys, "next"));
    }
    BOOST_CHECK_THROW(open_group_keys(read_one->members()[0].group_keys, vector_key("car2")), security_error);
    BOOST_CHECK_THROW(open_group_keys("short", vector_key("car2")), security_error);
}

BOOST_AUTO_TEST_CASE(a_member_is_found_by_number_name_and_key) {
    const auto read_one = read(vector_line());
    const auto* const car2 = &read_one->members()[1];
    BOOST_TEST(read_one->find(std::uint32_t{3}) == car2);
    BOOST_TEST(read_one->find("car2") == car2);
    BOOST_TEST(read_one->find(car2->key) == car2);
    for (const std::uint32_t number : {0U, 2U, 4U, 0xFFFFFFFFU}) {
        BOOST_TEST(read_one->find(number) == nullptr);
    }
    for (const std::string_view name : {"", "car", "car3", "CAR1", "self"}) {
        BOOST_TEST(read_one->find(name) == nullptr);
    }
    BOOST_TEST(read_one->find(vector_key("fleet").public_part()) == nullptr);
}

BOOST_AUTO_TEST_CASE(each_of_many_members_is_found) {
    const auto read_one = read_content(content_with_members(300));
    BOOST_REQUIRE(read_one->members().size() == 300U);
    for (const auto& entry : read_one->members()) {
        BOOST_TEST(read_one->find(entry.number) == &entry);
        BOOST_TEST(read_one->find(entry.name) == &entry);
        BOOST_TEST(read_one->find(entry.key) == &entry);
    }
}

BOOST_AUTO_TEST_CASE(each_bit_of_a_line_counts) {
    const auto fleet = vector_key("fleet").public_part();
    auto line = vector_line();
    for (std::size_t bit = 0; bit < 8 * line.size(); ++bit) {
        auto& byte = line[bit / 8];
        const auto before = byte;
        byte = static_cast<char>(static_cast<unsigned char>(byte) ^ (1U << bit % 8));
        BOOST_TEST(refusal([&] { return roster::read(line, fleet); }) != "", "bit " << bit % 8 << " in " << line);
        byte = before;
    }
    for (std::size_t size = 0; size < line.size(); ++size) {
        BOOST_CHECK_THROW(roster::read(std::string_view{line}.substr(0, size), fleet), security_error);
    }
}

BOOST_AUTO_TEST_CASE(a_line_has_exactly_one_form) {
    const auto line = vector_line();
    const auto content = vector_content();
    const auto sig = [](std::string_view signed_content) {
        return to_base64url(vector_key("fleet").sign("cles roster 1\n" + std::string{signed_content}));
    };
    const std::vector<std::string> others{
        "",
        "{}",
        " " + line,
        line + " ",
        line + "\n",
        line + "\r",
        "[" + line + "]",
        content,
        replaced(line, R"("signature":)", R"("signature": )"),
        replaced(line, R"(,"roster")", R"(, "roster")"),
        replaced(line, R"("signature")", R"("Signature")"),
        R"({"roster":)" + content + R"(,"signature":")" + sig(content) + R"("})",
        R"({"signature":")" + sig(content) + R"(=","roster":)" + content + "}",
        R"({"signature":")" + sig(content) + R"(==","roster":)" + content + "}",
        R"({"signature":")" + sig(" " + content) + R"(","roster": )" + content + "}",
        R"({"signature":")" + sig(content + " ") + R"(","roster":)" + content + " }",
        R"({"signature":")" + sig("[" + content + "]") + R"(","roster":[)" + content + "]}",
        R"({"signature":")" + sig(R"("text")") + R"(","roster":"text"})",
        R"({"signature":")" + sig("") + R"(","roster":})",
        R"({"signature":")" + sig("{") + R"(","roster":{})",
        R"({"signature":")" + sig(content) + R"(","roster":)" + content + R"(,"more":1})",
        R"({"signature":null,"roster":)" + content + "}",
        roster::sign(replaced(content, R"(,"version")", ",\n\"version\""), vector_key("fleet")),
    };
    for (const auto& other : others) {
        const auto why = refusal([&] { return read(other); });
        BOOST_TEST(contains(why, "is a line of the form"), other << ": " << why);
    }
}

BOOST_AUTO_TEST_CASE(the_signature_covers_the_bytes_as_written) {
    // Other spellings of the same values are valid rosters if they are signed, and only then.
    const auto content = vector_content();
    for (const auto& spelled :
         {replaced(content, R"(,"version")", "\t, \"version\""), replaced(content, R"("version")", R"("\u0076ersion")"),
          replaced(content, R"("name":"car1")", R"("name":"c\u0061r1")")}) {
        BOOST_TEST(read_content(spelled)->find("car1") != nullptr);
        BOOST_TEST(refusal([&] { return read(replaced(vector_line(), content, spelled)); }) ==
                   "the roster is not signed by the fleet's key");
    }
}

BOOST_AUTO_TEST_CASE(a_roster_of_another_fleet_is_refused) {
    const auto other = key_of("another fleet");
    BOOST_TEST(refusal([&] { return roster::read(vector_line(), other.public_part()); }) ==
               "the roster is not signed by the fleet's key");
    // Signed by a key that the roster does not name.
    BOOST_TEST(refusal([&] { return roster::read(roster::sign(vector_content(), other), other.public_part()); }) ==
               "the roster is of another fleet");
}

BOOST_AUTO_TEST_CASE(a_signature_of_something_else_is_refused) {
    const auto content = vector_content();
    for (const std::string_view start :
         {"", "cles roster 2\n", "cles update 1\n", "cles roster 1", "cles roster 1\r\n"}) {
        const auto sig = to_base64url(vector_key("fleet").sign(std::string{start} + content));
        BOOST_TEST(contains(refusal([&] { return read(R"({"signature":")" + sig + R"(","roster":)" + content + "}"); }),
                            "not signed"));
    }
}

BOOST_AUTO_TEST_CASE(what_the_page_refuses_is_refused) {
    struct wrong {
        std::string part;         // of the content
        std::string by;           // what it is replaced by
        std::string_view message; // a part of it
    };
    const auto read_one = read(vector_line());
    const auto car1 = to_base64url(read_one->members()[0].key);
    const auto car2 = to_base64url(read_one->members()[1].key);
    const auto& keys1 = read_one->members()[0].group_keys;
    const auto& keys_fleet = read_one->authority_keys();
    const auto fleet = to_base64url(read_one->fleet());
    const auto key_field = R"("key":")" + car2 + "\"";
    const auto key_hex = [](std::string_view hex) { return R"("key":")" + to_base64url(from_hex(hex)) + "\""; };
    const auto keys_field = R"("keys":")" + keys1 + "\"";
    const auto fleet_field = R"("fleet":")" + fleet + "\"";
    const auto fleet_keys_field = R"("keys":")" + keys_fleet + "\"";
    const auto name_of_65 = R"("name":")" + std::string(65, 'c') + "\"";
    const auto first_member = R"({"number":1,"name":"car1","key":")" + car1 + R"(","keys":")" + keys1 + R"("},)";
    const auto deep = R"("version":7,"deep":)" + std::string(40, '[') + std::string(40, ']');
    const std::vector<wrong> cases{
        // whole numbers
        {R"("version":7)", R"("version":0)", "version: expected a whole number from 1 to 4294967295"},
        {R"("version":7)", R"("version":-1)", "version"},
        {R"("version":7)", R"("version":4294967296)", "version: expected a whole number"},
        {R"("version":7)", R"("version":18446744073709551617)", "version: an integer out of range"},
        {R"("version":7)", R"("version":7.0)", "version: expected an integer"},
        {R"("version":7)", R"("version":7e0)", "version: expected an integer"},
        {R"("version":7)", R"("version":70E-1)", "version: expected an integer"},
        {R"("version":7)", R"("version":07)", "leading zeros"},
        {R"("version":7)", R"("version":+7)", "not JSON"},
        {R"("version":7)", R"("version":"7")", "version: expected a number, got a string"},
        {R"("version":7)", R"("version":true)", "version: expected a number"},
        {R"("version":7)", R"("version":null)", "version: expected a number"},
        {R"("version":7,)", "", "'version' is missing"},
        {R"("last":3)", R"("last":2)", "above 'last'"},
        {R"("last":3)", R"("last":16777216)", "last: expected a whole number from 0 to 16777215"},
        {R"("last":3)", R"("last":3.0)", "last: expected an integer"},
        {R"("last":3,)", "", "'last' is missing"},
        {R"("generation":5)", R"("generation":0)", "generation"},
        {R"("generation":5,"oldest":4)", R"("generation":4294967295,"oldest":4294967294)", "generation"},
        {R"("generation":5,)", "", "'generation' is missing"},
        {R"("oldest":4)", R"("oldest":3)", "neither the generation nor the one before"},
        {R"("oldest":4)", R"("oldest":6)", "neither the generation nor the one before"},
        {R"("generation":5,"oldest":4)", R"("generation":1,"oldest":0)", "oldest"},
        {R"("oldest":4,)", "", "'oldest' is missing"},
        // the roster's texts
        {fleet_field, R"("fleet":")" + car1 + "\"", "of another fleet"},
        {fleet_field, R"("fleet":")" + fleet + "=\"", "fleet: expected 32 bytes as base64url"},
        {fleet_field, R"("fleet":7)", "fleet: expected a string"},
        {fleet_field + ",", "", "'fleet' is missing"},
        {fleet_keys_field, R"("keys":"AAAA")", "keys: expected sealed group keys"},
        {fleet_keys_field, R"("keys":")" + keys_fleet.substr(0, 149) + "x\"", "keys: expected sealed group keys"},
        {fleet_keys_field, R"("keys":[])", "keys: expected a string"},
        {fleet_keys_field + ",", "", "'keys' is missing"},
        // keys that are repeated or must be understood
        {R"("version":7)", R"("version":7,"version":7)", "'version' occurs twice"},
        {R"("version":7)", R"("version":7,"\u0076ersion":8)", "'version' occurs twice"},
        {R"("number":1)", R"("number":1,"number":1)", "'number' occurs twice"},
        {R"("version":7)", R"("version":7,"x":1,"x":1)", "'x' occurs twice"},
        {R"("version":7)", R"("version":7,"x":[{"y":{"z":1,"z":2}}])", "'z' occurs twice"},
        {R"("version":7)", R"("version":7,"must_wait":1)", "must_wait: this version does not know the key"},
        {R"("version":7)", R"("version":7,"\u006dust_":null)", "does not know the key"},
        {R"("number":1)", R"("must_wait":{},"number":1)", "members[0].must_wait: this version does not know the key"},
        // members
        {R"("number":1)", R"("number":0)", "members[0].number: expected a whole number from 1 to 16777215"},
        {R"("number":1)", R"("number":1.0)", "members[0].number: expected an integer"},
        {R"("number":1)", R"("number":3)", "ascending order"},
        {R"("number":3)", R"("number":4)", "above 'last'"},
        {R"("number":1)", R"("number":16777216)", "members[0].number"},
        {R"("number":1,)", "", "members[0]: the key 'number' is missing"},
        {R"("name":"car1")", R"("name":"")", "members[0].name: '' is not a name"},
        {R"("name":"car1")", R"("name":"car 1")", "is not a name"},
        {R"("name":"car1")", R"("name":"car/1")", "is not a name"},
        {R"("name":"car1")", R"("name":"c\u00e4r")", "is not a name"},
        {R"("name":"car1")", R"("name":"car1\u0000")", "members[0].name: 'car1"},
        {R"("name":"car1")", name_of_65, "is not a name"},
        {R"("name":"car1")", R"("name":"self")", "is a reserved name"},
        {R"("name":"car1")", R"("name":"any")", "is a reserved name"},
        {R"("name":"car1")", R"("name":"all")", "is a reserved name"},
        {R"("name":"car1")", R"("name":1)", "members[0].name: expected a string"},
        {R"("name":"car1")", R"("name":"car2")", "two members have the name 'car2'"},
        {R"("name":"car1",)", "", "members[0]: the key 'name' is missing"},
        {key_field, R"("key":")" + car1 + "\"", "two members have the key"},
        {key_field, R"("key":")" + car2 + "=\"", "members[1].key: expected 32 bytes as base64url"},
        {key_field, R"("key":")" + car2.substr(0, 42) + "x\"", "members[1].key: expected 32 bytes as base64url"},
        {key_field, R"("key":7)", "members[1].key: expected a string"},
        {key_field + ",", "", "members[1]: the key 'key' is missing"},
        {key_field, key_hex("0000000000000000000000000000000000000000000000000000000000000000"), "prime order"},
        {key_field, key_hex("0100000000000000000000000000000000000000000000000000000000000000"), "prime order"},
        {key_field, key_hex("ecffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f"), "prime order"},
        {key_field, key_hex("f0ffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f"), "prime order"},
        {key_field, key_hex("ffffffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff"), "prime order"},
        {keys_field, R"("keys":")" + keys1.substr(2) + "\"", "members[0].keys: expected sealed group keys"},
        {"," + keys_field, "", "members[0]: the key 'keys' is missing"},
        {R"("may":["pull,bind *:localization","push car1:target"])", R"("may":"pull *:*")", "may: expected an array"},
        {R"("may":["pull,bind *:localization","push car1:target"])", R"("may":[1])", "may: expected a string"},
        {R"("may":["pull,bind *:localization","push car1:target"])", R"("may":null)", "may: expected an array"},
        {R"("number":1)", R"("number":1,"offers":{})", "offers: expected an array"},
        {R"("number":1)", R"("number":1,"offers":[["pull"]])", "offers: expected a string"},
        {R"("forwards":["sat*"])", R"("forwards":"sat*")", "forwards: expected an array"},
        {R"("forwards":["sat*"])", R"("forwards":[null])", "forwards: expected a string"},
        {first_member, "1,", "members[0]: expected an object"},
        {first_member, "[],", "members[0]: expected an object"},
        {R"("members":[)", R"("members":{"x":[)", "expected ',' or '}'"},
        {R"("members":[)", R"("of":[)", "'members' is missing"},
        // JSON
        {R"("version":7)", R"("version":7,)", "expected a member's name"},
        {R"("version":7)", R"("version":)", "expected a value"},
        {R"("version":7)", R"("version":7 "x":1)", "expected ',' or '}'"},
        {R"("version":7)", R"("version":7,"x":NaN)", "got something that is not JSON"},
        {R"("version":7)", R"("version":7,"x":"\ud800")", "surrogate"},
        {R"("version":7)", "\"version\":7,\"x\":\"\xff\"", "invalid UTF-8"},
        {R"("version":7)", "\"version\":7,\"x\":\"\t\"", "a control character"},
        {R"("version":7)", deep, "nested deeper than 32 levels"},
    };
    const auto content = vector_content();
    for (const auto& [part, by, message] : cases) {
        const auto why = refusal([&] { return read_content(replaced(content, part, by)); });
        BOOST_TEST(contains(why, message), part << " as " << by << ": '" << why << "' instead of '" << message << "'");
    }
    BOOST_TEST(cases.size() > 80U);
}

BOOST_AUTO_TEST_CASE(members_are_in_ascending_order) {
    const auto content = vector_content();
    const auto first = content.find(R"({"number":1)");
    const auto second = content.find(R"({"number":3)");
    const auto members_end = content.size() - 2;
    const auto swapped = content.substr(0, first) + content.substr(second, members_end - second) + "," +
                         content.substr(first, second - 1 - first) + content.substr(members_end);
    BOOST_TEST(contains(refusal([&] { return read_content(swapped); }), "ascending order"));
}

BOOST_AUTO_TEST_CASE(other_valid_values_are_accepted) {
    const auto content = vector_content();
    BOOST_TEST(read_content(replaced(content, R"("version":7)", R"("version":4294967295)"))->version() == 4294967295U);
    BOOST_TEST(read_content(replaced(content, R"("last":3)", R"("last":16777215)"))->last() == 16777215U);
    BOOST_TEST(read_content(replaced(content, R"("oldest":4)", R"("oldest":5)"))->oldest() == 5U);
    BOOST_TEST(read_content(
                   replaced(content, R"("generation":5,"oldest":4)", R"("generation":4294967294,"oldest":4294967293)"))
                   ->generation() == 4294967294U);
    BOOST_TEST(read_content(replaced(content, R"("name":"car1")", R"("name":"A-9_.")"))->find("A-9_.") != nullptr);
    const auto closed =
        read_content(replaced(content, R"("number":1)", R"("number":1,"may":[],"offers":["* *:*/**"],"forwards":[])"));
    BOOST_REQUIRE(closed->members()[0].may);
    BOOST_TEST(closed->members()[0].may->empty());
    BOOST_REQUIRE(closed->members()[0].offers);
    BOOST_TEST(closed->members()[0].offers->size() == 1U);
    const auto empty = content_with_members(0);
    BOOST_TEST(read_content(empty)->members().empty());
    BOOST_TEST(read_content(empty)->find("car1") == nullptr);
    BOOST_TEST(contains(refusal([&] { return read_content(replaced(empty, R"("last":0)", R"("last":-0)")); }), "last"));
}

BOOST_AUTO_TEST_CASE(unknown_keys_are_ignored_and_reported) {
    const auto content = vector_content();
    BOOST_TEST(
        read_content(replaced(content, R"("version":7)", R"("version":7,"colour":{"a":[1.5e3]})"))->ignored_key() ==
        "colour");
    const auto of_member = read_content(replaced(content, R"("number":1)", R"("x":null,"number":1)"));
    BOOST_TEST(of_member->ignored_key() == "x");
    BOOST_TEST(of_member->find("car1") != nullptr);
    // Only keys of the roster and of members must be understood.
    BOOST_TEST(read_content(replaced(content, R"("version":7)", R"("version":7,"x":{"must_wait":1})"))->version() ==
               7U);
}

BOOST_AUTO_TEST_CASE(a_line_has_at_most_a_million_bytes) {
    const auto with_padding = [](std::size_t size) {
        return replaced(vector_content(), R"("version":7)", R"("version":7,"x":")" + std::string(size, 'x') + "\"");
    };
    const auto padding = max_roster_line - roster::sign(with_padding(0), vector_key("fleet")).size();
    const auto longest = roster::sign(with_padding(padding), vector_key("fleet"));
    BOOST_TEST(longest.size() == 1'000'000U);
    BOOST_TEST(read(longest)->line() == longest);
    BOOST_TEST(contains(refusal([&] { return roster::sign(with_padding(padding + 1), vector_key("fleet")); }),
                        "would have 1000001 bytes"));
    BOOST_TEST(refusal([&] { return read(longest + " "); }) == "a roster has at most 1,000,000 bytes");
}

BOOST_AUTO_TEST_CASE(a_roster_has_at_most_4096_members) {
    const auto most = read_content(content_with_members(4096));
    BOOST_TEST(most->members().size() == 4096U);
    BOOST_TEST(most->find("4096") == &most->members().back());
    const auto too_many = roster::sign(content_with_members(4097), vector_key("fleet"));
    const auto why = refusal([&] { return roster::read(too_many, vector_key("fleet").public_part(), most.get()); });
    BOOST_TEST(contains(why, "members: more than 4096 members"), why);
}

BOOST_AUTO_TEST_CASE(keys_of_a_known_roster_need_no_check) {
    const auto known = read(vector_line());
    const auto again = roster::read(vector_line(), known->fleet(), known.get());
    BOOST_TEST((again->members()[0].agreement == known->members()[0].agreement));
    const auto wrong = replaced(vector_content(), to_base64url(known->members()[0].key), std::string(43, 'A'));
    BOOST_CHECK_THROW(roster::read(roster::sign(wrong, vector_key("fleet")), known->fleet(), known.get()),
                      security_error);
}

BOOST_AUTO_TEST_CASE(an_unverified_line_names_its_fleet) {
    BOOST_TEST((roster::named_fleet(vector_line()) == vector_key("fleet").public_part()));
    const auto content = vector_content();
    const auto fleet = to_base64url(vector_key("fleet").public_part());
    for (const auto& other : {replaced(content, R"("fleet")", R"("flee")"), replaced(content, fleet, "short"),
                              replaced(content, "\"" + fleet + "\"", "7"), std::string{"{}"}, std::string{"{x}"}}) {
        const auto why = refusal([&] { return roster::named_fleet(roster::sign(other, vector_key("fleet"))); });
        BOOST_TEST(contains(why, "names no fleet"), why);
    }
    BOOST_CHECK_THROW(roster::named_fleet(""), security_error);
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace roster_lines
