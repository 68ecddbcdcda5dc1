// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/key_directory.hpp"
#include "security/fleet_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <sys/stat.h>

namespace key_files {
namespace {

namespace fs = std::filesystem;
using namespace cles::security;
using namespace cles::security::test;

// The directory of car1, and the authority of its fleet.
struct fixture {
    own_folder own{};
    key_directory files{own.path()};
    fleet_authority authority = authority_with({"car1", "car2"});

    void put(std::string_view name, std::string_view text, unsigned mode = 0644) const {
        write_file(own / name, text);
        BOOST_REQUIRE(chmod((own / name).c_str(), mode) == 0);
    }
    void put_key(std::string_view name) const {
        const auto line = to_line(node_identity{std::string{name}, key_of(name)});
        put("key", {reinterpret_cast<const char*>(line.data()), line.size()}, 0600);
    }
    void put_roster(std::string_view name, const roster& content) const { put(name, content.line() + "\n"); }
    [[nodiscard]] std::string path(std::string_view name) const { return (own / name).string(); }
    [[nodiscard]] std::string node_refusal() const {
        return refusal([&] { return files.read_node(); });
    }
};

unsigned mode_of(const fs::path& path) {
    struct stat status {};
    BOOST_REQUIRE(stat(path.c_str(), &status) == 0);
    return status.st_mode & 07777U;
}

} // namespace

BOOST_FIXTURE_TEST_SUITE(key_files, fixture)

BOOST_AUTO_TEST_CASE(a_key_is_created_and_read) {
    const auto made = files.create_key("car1");
    BOOST_TEST(made.name == "car1");
    BOOST_TEST(own.names() == (std::vector<std::string>{"car1.pub", "key"}), boost::test_tools::per_element());
    BOOST_TEST(mode_of(own / "key") == 0600U);
    BOOST_TEST(mode_of(own / "car1.pub") == 0644U);
    const auto read = files.read_key();
    BOOST_TEST(read.name == "car1");
    BOOST_TEST((read.key.public_part() == made.key.public_part()));
    BOOST_TEST((files.read_public_identity("car1.pub").key == made.key.public_part()));
    BOOST_TEST(files.read_public_identity("car1.pub").name == "car1");
}

BOOST_AUTO_TEST_CASE(an_existing_key_is_never_replaced) {
    files.create_key("car1");
    const auto before = read_file(own / "key");
    BOOST_TEST(refusal([&] { return files.create_key("car1"); }) == "cannot create " + path("key") + ": File exists");
    BOOST_TEST(refusal([&] { return files.create_key("car2"); }) == "cannot create " + path("key") + ": File exists");
    BOOST_TEST(read_file(own / "key") == before);
    BOOST_TEST(own.names() == (std::vector<std::string>{"car1.pub", "key"}), boost::test_tools::per_element());
    // What can be derived from it can be written again.
    fs::remove(own / "car1.pub");
    files.write_public_identity(files.read_key().public_part());
    BOOST_TEST((files.read_public_identity("car1.pub").key == files.read_key().key.public_part()));
    BOOST_TEST(contains(refusal([&] { return files.create_key("any"); }), "reserved"));
    BOOST_TEST(contains(refusal([&] { return files.create_key("../car1"); }), "not a name"));
    BOOST_TEST(contains(refusal([&] { return files.create_key(".hidden"); }), "begins with '.'"));
}

BOOST_AUTO_TEST_CASE(the_fleets_key_is_created_and_read) {
    files.create_fleet_key(key_of("fleet"));
    BOOST_TEST(mode_of(own / "fleet.key") == 0600U);
    BOOST_TEST((files.read_fleet_key().public_part() == key_of("fleet").public_part()));
    BOOST_TEST(refusal([&] {
                   files.create_fleet_key(key_of("other"));
                   return 0;
               }) == "cannot create " + path("fleet.key") + ": File exists");
    BOOST_TEST((files.read_fleet_key().public_part() == key_of("fleet").public_part()));
}

BOOST_AUTO_TEST_CASE(missing_files_are_named) {
    BOOST_TEST(contains(refusal([&] { return files.read_key(); }), path("key") + " does not exist: 'cles keys new'"));
    BOOST_TEST(contains(refusal([&] { return files.read_fleet_key(); }), path("fleet.key") + " does not exist"));
    BOOST_TEST(refusal([&] { return files.read_public_identity("x.pub"); }) == path("x.pub") + " does not exist");
    BOOST_TEST(contains(node_refusal(), path("key") + " does not exist"));
    put_key("car1");
    BOOST_TEST(contains(node_refusal(), "contains no roster: put car1.join there"));
}

BOOST_AUTO_TEST_CASE(malformed_files_are_named) {
    put("key", "{}", 0600);
    BOOST_TEST(contains(refusal([&] { return files.read_key(); }), path("key") + ": expected a line of the form"));
    put("fleet.key", "{}", 0600);
    BOOST_TEST(contains(refusal([&] { return files.read_fleet_key(); }), path("fleet.key") + ": expected a line"));
    put("x.pub", "{}");
    BOOST_TEST(contains(refusal([&] { return files.read_public_identity("x.pub"); }), path("x.pub") + ": expected"));
    put("key", std::string(2000, 'x'), 0600);
    BOOST_TEST(contains(refusal([&] { return files.read_key(); }), path("key") + " has 2000 bytes; at most 1024"));
}

BOOST_AUTO_TEST_CASE(files_of_a_wrong_mode_are_refused) {
    put_key("car1");
    put_roster("roster", authority.newest());
    BOOST_TEST(node_refusal() == "");
    BOOST_REQUIRE(chmod(path("key").c_str(), 0640) == 0);
    BOOST_TEST(node_refusal() == path("key") + " is accessible to other users: chmod 600 " + path("key"));
    put_key("car1");
    BOOST_REQUIRE(chmod(path("roster").c_str(), 0664) == 0);
    BOOST_TEST(node_refusal() == path("roster") + " can be changed by other users: chmod go-w " + path("roster"));
    put_roster("roster", authority.newest());
    put_roster("car1.join", authority.newest());
    BOOST_REQUIRE(chmod(path("car1.join").c_str(), 0646) == 0);
    BOOST_TEST(contains(node_refusal(), path("car1.join") + " can be changed by other users"));
    put("fleet.key", "", 0644);
    BOOST_TEST(contains(refusal([&] { return files.read_fleet_key(); }), "chmod 600"));
}

BOOST_AUTO_TEST_CASE(a_node_begins_with_its_join_file) {
    put_key("car1");
    put_roster("car1.join", authority.newest());
    const auto read = files.read_node();
    BOOST_TEST(read.own.name == "car1");
    BOOST_TEST((read.own.key.public_part() == key_of("car1").public_part()));
    BOOST_TEST(read.newest->line() == authority.newest().line());
    BOOST_TEST(read.warnings.empty());
}

BOOST_AUTO_TEST_CASE(the_highest_version_is_in_force) {
    put_key("car1");
    put_roster("a.join", authority.newest());
    authority.rotate();
    put_roster("roster", authority.newest());
    BOOST_TEST(files.read_node().newest->version() == 4U);
    authority.rotate();
    put_roster("b.join", authority.newest());
    BOOST_TEST(files.read_node().newest->version() == 5U);
    // An older one in `roster` does not take the node back.
    put("roster", read_file(own / "a.join"));
    BOOST_TEST(files.read_node().newest->version() == 5U);
    BOOST_TEST(files.read_node().warnings.empty());
}

BOOST_AUTO_TEST_CASE(a_fork_is_reported_and_the_roster_file_counts) {
    put_key("car1");
    fleet_authority branch{key_of("fleet"), authority.share()};
    authority.rotate();
    branch.rotate();
    put_roster("car1.join", branch.newest());
    put_roster("roster", authority.newest());
    const auto read = files.read_node();
    BOOST_TEST(read.newest->line() == authority.newest().line());
    BOOST_REQUIRE(read.warnings.size() == 1U);
    BOOST_TEST(read.warnings[0] == path("car1.join") + " differs from " + path("roster") +
                                       " and has the same version, so it is ignored; the next version ends the fork");
    // The same roster twice is no fork.
    put_roster("car1.join", authority.newest());
    BOOST_TEST(files.read_node().warnings.empty());
}

BOOST_AUTO_TEST_CASE(rosters_of_two_fleets_are_refused) {
    put_key("car1");
    auto other = fleet_authority::found(key_of("another fleet"));
    other.add(node("car1"));
    put_roster("roster", authority.newest());
    put_roster("car1.join", other.newest());
    BOOST_TEST(node_refusal() == path("car1.join") + " is of another fleet than " + path("roster") +
                                     ": remove the wrong one, a node belongs to one fleet");
    fs::remove(own / "roster");
    put_roster("b.join", authority.newest());
    BOOST_TEST(contains(node_refusal(), path("car1.join") + " is of another fleet than " + path("b.join")));
}

BOOST_AUTO_TEST_CASE(a_damaged_roster_is_refused) {
    put_key("car1");
    const auto line = authority.newest().line();
    for (const auto& damaged : {std::string{}, line.substr(0, line.size() / 2), line + "\n\n", "\n" + line,
                                replaced(line, "car2", "car3"), line + line}) {
        put("roster", damaged);
        BOOST_TEST(node_refusal().starts_with(path("roster") + ": "), damaged);
    }
    put("roster", std::string(1'000'002, ' '));
    BOOST_TEST(contains(node_refusal(), "has 1000002 bytes"));
    put_roster("roster", authority.newest());
    put("car1.join", line.substr(1));
    BOOST_TEST(node_refusal().starts_with(path("car1.join") + ": "));
    fs::remove(own / "car1.join");
    fs::create_symlink("roster", own / "car1.join");
    BOOST_TEST(contains(node_refusal(), "symbolic link"));
}

BOOST_AUTO_TEST_CASE(a_node_that_is_not_in_the_roster_is_told_what_to_do) {
    put_key("car3");
    put_roster("roster", authority.newest());
    BOOST_TEST(node_refusal() == own.path() + ": car3's key is not in version 3 of the roster: run 'cles fleet add "
                                              "car3.pub --may RIGHT' where the fleet's key is, and put the new "
                                              "car3.join into this directory");
    authority.add({"car3", key_of("other").public_part()});
    put_roster("roster", authority.newest());
    BOOST_TEST(contains(node_refusal(), "version 4 of the roster has another key for car3"));
    authority.add({"car4", key_of("car3").public_part()});
    put_roster("roster", authority.newest());
    BOOST_TEST(contains(node_refusal(), "car3's key is in version 5 of the roster under the name car4"));
}

BOOST_AUTO_TEST_CASE(a_newer_roster_is_stored) {
    put_key("car1");
    BOOST_TEST(files.store_roster(authority.newest()));
    BOOST_TEST(read_file(own / "roster") == authority.newest().line() + "\n");
    BOOST_TEST(mode_of(own / "roster") == 0644U);
    const auto old = authority.share();
    fleet_authority branch{key_of("fleet"), authority.share()};
    authority.rotate();
    branch.rotate();
    BOOST_TEST(files.store_roster(authority.newest()));
    BOOST_TEST(files.store_roster(authority.newest())); // it is there
    // Another process has stored a newer one, or another branch.
    BOOST_TEST(!files.store_roster(*old));
    BOOST_TEST(!files.store_roster(branch.newest()));
    BOOST_TEST(read_file(own / "roster") == authority.newest().line() + "\n");
    BOOST_TEST(files.read_node().newest->version() == authority.newest().version());
    BOOST_TEST(contains(refusal([&] { return files.store_roster(fleet_authority::found(key_of("x")).newest()); }),
                        "is of another fleet"));
    BOOST_TEST(own.names() == (std::vector<std::string>{".roster.lock", "key", "roster"}),
               boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(a_join_file_is_written_for_the_new_node) {
    files.write_join("car2", authority.newest());
    BOOST_TEST(read_file(own / "car2.join") == authority.newest().line() + "\n");
    put_key("car2");
    BOOST_TEST(files.read_node().newest->version() == authority.newest().version());
    for (const auto* name : {"../car2", ".", "..", ".hidden", "-rf"}) {
        BOOST_CHECK_THROW(files.write_join(name, authority.newest()), security_error);
    }
}

BOOST_AUTO_TEST_CASE(the_directory_is_created_if_wanted) {
    const auto made = key_directory::create(path("new"));
    made.create_key("car1");
    BOOST_TEST(mode_of(own / "new") == 0700U);
    BOOST_TEST(contains(refusal([&] { return key_directory{path("none")}; }), "cannot open the folder"));
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace key_files
