// SPDX-License-Identifier: BSL-1.0
// Names of members become names of files.

#include <cles/security/fleet_files.hpp>
#include <cles/security/member_names.hpp>
#include <cles/security/node_files.hpp>

#include "security/fleet/key_directory.hpp"
#include "security/fleet_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <vector>

namespace member_names {
namespace {

using namespace cles::security;
using namespace cles::security::test;

const std::vector<std::string> names_of_no_files{".", "..", ".hidden", "...", "-", "-rf"};
const std::vector<std::string> names_of_no_nodes{"",     "a/b", "../x", "car 1",
                                                 "self", "any", "all",  std::string(65, 'n')};
const std::vector<std::string> names{"car1", "a.b", "a..", "a-", "_", "0", "key", "roster", "x.pub", "x.join"};

// The line in NAME.pub that another program wrote.
std::string public_line(const std::string& name) { return to_line(node(name)); }

// What the function threw; empty if nothing.
template <class F>
std::string failure(F function) {
    try {
        function();
    } catch (const std::runtime_error& e) {
        return e.what();
    }
    return {};
}

} // namespace

BOOST_AUTO_TEST_SUITE(member_names)

BOOST_AUTO_TEST_CASE(a_name_that_cannot_be_that_of_a_file_is_no_members) {
    for (const auto& name : names) {
        BOOST_TEST(flaw_of_member_name(name) == "");
    }
    for (const auto& name : names_of_no_files) {
        BOOST_TEST(flaw_of_member_name(name) == "'" + name + "' cannot be the name of a member: it begins with '" +
                                                    name.front() + "', and files get that name");
    }
    for (const auto& name : names_of_no_nodes) {
        BOOST_TEST(flaw_of_member_name(name) != "");
    }
}

BOOST_AUTO_TEST_CASE(no_key_is_created_for_it) {
    const own_folder own;
    for (const auto& name : names_of_no_files) {
        BOOST_TEST(failure([&] { create_node_key((own / "new").string(), name); }) == flaw_of_member_name(name));
        BOOST_TEST(own.names().empty());
    }
}

BOOST_AUTO_TEST_CASE(it_is_not_added_to_a_fleet) {
    const own_folder own;
    create_fleet(own.path());
    const auto before = own.names();
    for (const auto& name : names_of_no_files) {
        BOOST_TEST(failure([&] {
                       add_members(own.path(), {public_line("car1"), public_line(name)}, {});
                   }) == flaw_of_member_name(name));
    }
    BOOST_TEST(describe_fleet(own.path()).version == 1U);
    BOOST_TEST(own.names() == before, boost::test_tools::per_element());
}

// Fleets of earlier versions may have such members.
BOOST_AUTO_TEST_CASE(a_member_that_has_such_a_name_already_stays_one) {
    const own_folder own;
    const key_directory files{own.path()};
    auto text = std::string{authority_with({"car1"}).newest().content()};
    const auto made = reread(roster::sign(replaced(text, R"("name":"car1")", R"("name":".hidden")"), key_of("fleet")));
    BOOST_TEST((made->find(".hidden") != nullptr));
    fleet_authority authority{key_of("fleet"), made};
    authority.rotate();
    BOOST_TEST(files.store_roster(authority.newest()));
    BOOST_TEST(describe_fleet(own.path()).members.front().name == ".hidden");
}

BOOST_AUTO_TEST_CASE(a_folder_in_the_authoritys_one_has_no_name_of_its_files) {
    BOOST_TEST(member_folder("fleet", "car1") == "fleet/car1");
    BOOST_TEST(member_folder("fleet/", "car1") == "fleet/car1");
    for (const auto* name : {"key", "fleet.key", "roster", "rules", "car1.join", "car1.pub"}) {
        BOOST_TEST(flaw_of_member_name(name) == "");
        BOOST_TEST(contains(failure([&] { static_cast<void>(member_folder("fleet", name)); }),
                            "cannot be the name of a folder in fleet"));
    }
    for (const auto& name : names_of_no_files) {
        BOOST_TEST(failure([&] { static_cast<void>(member_folder("fleet", name)); }) == flaw_of_member_name(name));
    }
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace member_names
