// SPDX-License-Identifier: BSL-1.0
#include "gateway/access/tokens.hpp"
#include "support/temporary_folder.hpp"

#include <boost/test/unit_test.hpp>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>

namespace tokens {
namespace {

const std::string hash = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"; // of "abc", in FIPS 180-4

/// A file, and what it contains.
struct fixture {
    cles::test::temporary_folder folder{"cles-tokens"};
    std::filesystem::path path = folder / "tokens";
    gateway::token_file file{path.string()};

    void write(const std::string& text, unsigned mode = 0600) const {
        std::filesystem::remove(path); // so that it is another file, whatever the resolution of its time
        std::ofstream{path} << text;
        std::filesystem::permissions(path, static_cast<std::filesystem::perms>(mode));
    }
    /// Why it cannot be read; empty if it can.
    [[nodiscard]] std::string failure() {
        try {
            BOOST_TEST(file.read_if_changed().has_value());
            return {};
        } catch (const std::runtime_error& e) {
            return e.what();
        }
    }
};

std::string failure_of(const std::string& text) {
    try {
        static_cast<void>(gateway::token_table::read(text));
        return {};
    } catch (const std::runtime_error& e) {
        return e.what();
    }
}

} // namespace
} // namespace tokens

BOOST_AUTO_TEST_SUITE(tokens)

BOOST_AUTO_TEST_CASE(hashes_are_those_of_the_standard) {
    BOOST_TEST(gateway::sha256_of("abc") == hash);
    BOOST_TEST(gateway::random_text().size() == 64U);
    BOOST_TEST(gateway::random_text() != gateway::random_text());
}

BOOST_AUTO_TEST_CASE(a_line_names_a_member) {
    const auto table = gateway::token_table::read("# those of the fleet\n\noperator " + hash + "\n  viewer   " +
                                                  std::string(64, 'a') + "  # on the wall\n");
    BOOST_TEST(table.size() == 2U);
    BOOST_TEST(table.name_of(hash) == "operator");
    BOOST_TEST(table.name_of(std::string(64, 'a')) == "viewer");
    BOOST_TEST(table.name_of(std::string(64, 'b')) == "");
    BOOST_TEST(table.name_of("") == "");
}

BOOST_AUTO_TEST_CASE(a_wrong_line_is_named) {
    BOOST_TEST(failure_of("operator " + hash + "\noperator").starts_with("line 2: "));
    BOOST_TEST(failure_of("operator " + hash.substr(1)).starts_with("line 1: "));
    BOOST_TEST(failure_of("operator A" + hash.substr(1)).starts_with("line 1: "));
    BOOST_TEST(failure_of("a " + hash + "\nb " + hash) == "line 2: the token is in the file already");
    BOOST_TEST(failure_of("a b " + hash).starts_with("line 1: "));
}

BOOST_FIXTURE_TEST_CASE(the_file_is_read_when_it_is_another_one, fixture) {
    write("operator " + hash + "\n");
    auto table = file.read_if_changed();
    BOOST_TEST_REQUIRE(table.has_value());
    BOOST_TEST(table->name_of(hash) == "operator");
    BOOST_TEST(!file.read_if_changed().has_value());
    write("viewer " + hash + "\n# another length\n");
    table = file.read_if_changed();
    BOOST_TEST_REQUIRE(table.has_value());
    BOOST_TEST(table->name_of(hash) == "viewer");
}

BOOST_FIXTURE_TEST_CASE(others_must_not_read_or_change_it, fixture) {
    write("", 0640);
    BOOST_TEST(failure().find("chmod 600") != std::string::npos);
    BOOST_TEST(!file.read_if_changed().has_value()); // it is told once
    write("", 0622);
    BOOST_TEST(failure() != "");
    write("", 0600);
    BOOST_TEST(failure() == "");
    std::filesystem::remove(path);
    BOOST_TEST(failure() != "");
}

BOOST_FIXTURE_TEST_CASE(the_last_line_may_have_no_end, fixture) {
    write("operator " + hash);
    const auto token = file.add("viewer");
    const auto table = file.read_if_changed();
    BOOST_TEST_REQUIRE(table.has_value());
    BOOST_TEST(table->name_of(hash) == "operator");
    BOOST_TEST(table->name_of(gateway::sha256_of(token)) == "viewer");
}

BOOST_FIXTURE_TEST_CASE(a_token_is_made, fixture) {
    const auto first = file.add("operator");
    const auto second = file.add("viewer");
    BOOST_TEST(first != second);
    BOOST_TEST((std::filesystem::status(path).permissions() == static_cast<std::filesystem::perms>(0600)));
    const auto table = file.read_if_changed();
    BOOST_TEST_REQUIRE(table.has_value());
    BOOST_TEST(table->name_of(gateway::sha256_of(first)) == "operator");
    BOOST_TEST(table->name_of(gateway::sha256_of(second)) == "viewer");
    std::ifstream stored{path};
    const std::string text{std::istreambuf_iterator<char>{stored}, {}};
    BOOST_TEST(text.find(first) == std::string::npos); // who reads the file learns no token
}

BOOST_AUTO_TEST_SUITE_END()
