// SPDX-License-Identifier: BSL-1.0
#include "security/fleet_fixture.hpp"
#include "security/keys/identity.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace identity_lines {
namespace {

using namespace cles::security;
using namespace cles::security::test;

std::string text_of(const secret_bytes& secret) { return {secret.view().begin(), secret.view().end()}; }

bytes_view bytes_of(std::string_view text) { return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}; }

const std::string car1_seed = "NsW-hllSlggTSmGo1LU964aphdPtN2MQhNew5rM0eF4";
// The seed and the public key of car1 in the vectors.
const std::string car1_key = "TXqpzm-x5K34kGI37MPz17rZTZOx8qmlc5gOpn6h9YA";

} // namespace

BOOST_AUTO_TEST_SUITE(identity_lines)

BOOST_AUTO_TEST_CASE(a_private_key_is_written_and_read) {
    const node_identity car1{"car1", vector_key("car1")};
    const auto line = to_line(car1);
    BOOST_TEST(text_of(line) == R"({"name":"car1","seed":")" + car1_seed + "\"}\n");
    const auto read = read_node_identity(line.view());
    BOOST_TEST(read.name == "car1");
    BOOST_TEST((read.key.public_part() == car1.key.public_part()));
    // The LF is optional.
    BOOST_TEST(read_node_identity(line.view().first(line.size() - 1)).name == "car1");
}

BOOST_AUTO_TEST_CASE(a_public_key_is_written_and_read) {
    const public_identity car1{"car1", vector_key("car1").public_part()};
    const auto line = to_line(car1);
    BOOST_TEST(line == R"({"name":"car1","key":")" + car1_key + "\"}\n");
    const auto read = read_public_identity(line);
    BOOST_TEST(read.name == "car1");
    BOOST_TEST((read.key == car1.key));
    BOOST_TEST(read_public_identity(std::string_view{line}.substr(0, line.size() - 1)).name == "car1");
}

BOOST_AUTO_TEST_CASE(a_fingerprint_is_that_of_the_vectors_and_of_name_and_key) {
    const public_identity car1{"car1", vector_key("car1").public_part()};
    BOOST_TEST(fingerprint_of(car1) == text_at(vectors(), "fingerprint"));
    BOOST_TEST(fingerprint_of({"car2", car1.key}) != fingerprint_of(car1));
    BOOST_TEST(fingerprint_of({"car1", vector_key("car2").public_part()}) != fingerprint_of(car1));
}

BOOST_AUTO_TEST_CASE(a_fleet_key_is_written_and_read) {
    const auto line = fleet_key_line(vector_key("car1"));
    BOOST_TEST(text_of(line) == R"({"seed":")" + car1_seed + "\"}\n");
    BOOST_TEST((read_fleet_key(line.view()).public_part() == vector_key("car1").public_part()));
    BOOST_TEST((read_fleet_key(line.view().first(line.size() - 1)).public_part() == vector_key("car1").public_part()));
}

BOOST_AUTO_TEST_CASE(the_longest_and_the_shortest_name_are_read) {
    for (const auto& name : {std::string(64, 'n'), std::string{"n"}}) {
        BOOST_TEST(read_node_identity(to_line(node_identity{name, key_of(name)}).view()).name == name);
        BOOST_TEST(read_public_identity(to_line(node(name))).name == name);
    }
}

BOOST_AUTO_TEST_CASE(another_private_key_line_is_refused) {
    const auto good = R"({"name":"car1","seed":")" + car1_seed + R"("})";
    for (const auto& wrong : std::vector<std::string>{
             "",
             "\n",
             "{}",
             good + "\n\n",
             good + " ",
             " " + good,
             good.substr(0, good.size() - 1),
             good.substr(1),
             R"({"name": "car1","seed":")" + car1_seed + R"("})",
             R"({"seed":")" + car1_seed + R"(","name":"car1"})",
             R"({"name":"car1","seed":")" + car1_seed + R"(="})",
             R"({"name":"car1","seed":")" + car1_seed.substr(1) + R"("})",
             R"({"name":"car1","seed":")" + car1_seed.substr(0, 42) + R"(V"})", // a stray bit
             R"({"name":"car1","seed":")" + car1_seed.substr(0, 42) + R"(+"})",
             R"({"name":"car1","seed":")" + car1_seed + R"(","x":1})",
             R"({"name":"car1","key":")" + car1_key + R"("})",
             R"({"seed":")" + car1_seed + R"("})",
         }) {
        BOOST_TEST(refusal([&] { return read_node_identity(bytes_of(wrong)); }) ==
                       R"(expected a line of the form {"name":"car1","seed":"<43 characters>"})",
                   wrong);
    }
    for (const std::string_view name : {"", "car 1", "car\\u00311", "self", "car1\",\"x\":\""}) {
        const auto line = replaced(good, "car1", name);
        BOOST_TEST(refusal([&] { return read_node_identity(bytes_of(line)); }) != "", line);
    }
}

BOOST_AUTO_TEST_CASE(another_public_key_line_is_refused) {
    const auto good = R"({"name":"car1","key":")" + car1_key + R"("})";
    for (const auto& wrong : std::vector<std::string>{
             "",
             "{}",
             good + "\n\n",
             " " + good,
             good.substr(0, good.size() - 1),
             replaced(good, ":", ": "),
             replaced(good, "\"key\"", "\"Key\""),
             replaced(good, car1_key, car1_key + "="),
             replaced(good, car1_key, car1_key.substr(0, 42) + "B"), // a stray bit
             replaced(good, "\"key\"", "\"seed\""),
         }) {
        BOOST_TEST(refusal([&] { return read_public_identity(wrong); }) ==
                       R"(expected a line of the form {"name":"car1","key":"<43 characters>"})",
                   wrong);
    }
    BOOST_TEST(refusal([&] { return read_public_identity(replaced(good, car1_key, std::string(43, 'A'))); }) ==
               "the key is not valid");
    BOOST_TEST(contains(refusal([&] { return read_public_identity(replaced(good, "car1", "any")); }), "reserved"));
    BOOST_TEST(contains(refusal([&] { return read_public_identity(replaced(good, "car1", "c/1")); }), "not a name"));
}

BOOST_AUTO_TEST_CASE(another_fleet_key_line_is_refused) {
    const auto good = R"({"seed":")" + car1_seed + R"("})";
    for (const auto& wrong : std::vector<std::string>{
             "", "{}", good + "\n\n", " " + good, good.substr(1), replaced(good, ":", ": "),
             replaced(good, car1_seed, car1_seed + "A"), replaced(good, car1_seed, car1_seed.substr(0, 42) + "V"),
             R"({"name":"car1","seed":")" + car1_seed + R"("})"}) {
        BOOST_TEST(refusal([&] { return read_fleet_key(bytes_of(wrong)); }) ==
                       R"(expected a line of the form {"seed":"<43 characters>"})",
                   wrong);
    }
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace identity_lines
