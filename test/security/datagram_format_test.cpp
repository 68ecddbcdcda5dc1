// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/datagram_format.hpp"
#include "security/datagrams/datagram_path.hpp"
#include "security/sealed_network.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <unordered_set>

namespace datagram_format {
namespace {

using namespace cles::security;
using namespace cles::security::test;

bytes of_kind(int kind, std::size_t size) {
    bytes made(size);
    if (size > 0) {
        made[0] = static_cast<std::uint8_t>(kind);
    }
    return made;
}

} // namespace

BOOST_AUTO_TEST_SUITE(datagram_format)

BOOST_AUTO_TEST_CASE(lengths_are_those_of_the_page) {
    BOOST_TEST(hello_bytes == 100U);
    BOOST_TEST(hello_with_mac_bytes == 116U);
    BOOST_TEST(max_data == 1236U);
    BOOST_TEST(max_sealed == 1248U);
}

BOOST_AUTO_TEST_CASE(the_first_byte_distinguishes_sealed_datagrams_from_lines) {
    for (int byte = 0; byte < 256; ++byte) {
        BOOST_TEST(is_sealed(of_kind(byte, 1)) == (byte >= 0x80));
    }
    BOOST_TEST(!is_sealed({}));
}

BOOST_AUTO_TEST_CASE(heads_of_the_vectors_are_read) {
    const auto hello = read_head(from_hex(vector_text("handshake", "hello")));
    BOOST_REQUIRE(hello);
    BOOST_TEST((hello->kind == datagram_kind::hello));
    BOOST_TEST(hello->sender == 1U);
    BOOST_TEST(hello->index == 0x8d00cab345b28793U);
    const auto welcome = read_head(from_hex(vector_text("handshake", "welcome")));
    BOOST_REQUIRE(welcome);
    BOOST_TEST((welcome->kind == datagram_kind::welcome));
    BOOST_TEST(welcome->sender == 3U);
    BOOST_TEST(welcome->index == hello->index);
    const auto data = read_head(from_hex(text_at(vectors().at("data").at(1).as_object(), "datagram")));
    BOOST_REQUIRE(data);
    BOOST_TEST((data->kind == datagram_kind::data));
    BOOST_TEST(data->index == hello->index);
    BOOST_TEST(data->counter == 9U);
    const auto group = read_head(from_hex(vector_text("group", "datagram")));
    BOOST_REQUIRE(group);
    BOOST_TEST((group->kind == datagram_kind::group));
    BOOST_TEST(group->sender == 3U);
    BOOST_TEST(group->generation == 5U);
    BOOST_TEST(to_hex(group->salt) == vector_text("group", "salt"));
    BOOST_TEST(group->counter == 17U);
}

BOOST_AUTO_TEST_CASE(heads_are_written_as_they_are_read) {
    bytes data(data_head_bytes + seal_bytes);
    write_data_head(0xabcdef, 0x0102030405060708, 0x1112131415161718, data.data());
    BOOST_TEST(to_hex(data).substr(0, 40) == "83abcdef01020304050607081112131415161718");
    bytes group(group_head_bytes + seal_bytes);
    group_salt salt{};
    salt.fill(0x55);
    write_group_head(1, 0x01020304, salt, 0x1112131415161718, group.data());
    BOOST_TEST(to_hex(group).substr(0, 64) == "8400000101020304555555555555555555555555555555551112131415161718");
    const auto head = read_head(group);
    BOOST_REQUIRE(head);
    BOOST_TEST(head->salt == salt);
    BOOST_TEST(head->counter == 0x1112131415161718U);
    hello_datagram hello{};
    write_hello_head(datagram_kind::hello, 0xffffff, ~std::uint64_t{0}, hello.data());
    BOOST_TEST(read_head(hello)->sender == 0xffffffU);
}

BOOST_AUTO_TEST_CASE(other_lengths_are_refused) {
    const struct {
        int kind;
        std::size_t least;
        std::size_t most;
    } lengths[] = {{0x82, 100, 100}, {0x83, 36, 1236}, {0x84, 48, 1248}};
    for (const auto& [kind, least, most] : lengths) {
        for (std::size_t size = 0; size < 1400; ++size) {
            BOOST_REQUIRE_MESSAGE(read_head(of_kind(kind, size)).has_value() == (size >= least && size <= most),
                                  "kind " << kind << ", " << size << " bytes");
        }
    }
    for (std::size_t size = 0; size < 1400; ++size) {
        BOOST_REQUIRE_MESSAGE(read_head(of_kind(0x81, size)).has_value() == (size == 100 || size == 116),
                              "HELLO, " << size << " bytes");
    }
}

BOOST_AUTO_TEST_CASE(other_kinds_are_refused) {
    for (int kind = 0; kind < 256; ++kind) {
        BOOST_TEST(read_head(of_kind(kind, 100)).has_value() == (kind >= 0x81 && kind <= 0x84));
    }
}

BOOST_AUTO_TEST_CASE(a_statement_is_read_as_it_was_written) {
    node_statement stated{.roster = 0x01020304, .epoch = 0x5f3a09c1, .counter = 0x0102030405060708};
    stated.salt.fill(0x77);
    const auto payload = write_statement(0x1112131415161718, stated);
    BOOST_TEST(to_hex(payload) == "1112131415161718010203045f3a09c1777777777777777777777777777777770102030405060708");
    std::uint64_t index = 0;
    BOOST_TEST((read_statement(payload, index) == stated));
    BOOST_TEST(index == 0x1112131415161718U);
}

BOOST_AUTO_TEST_CASE(the_prologue_is_that_of_the_vectors) {
    const auto hello = from_hex(vector_text("handshake", "hello"));
    BOOST_TEST(to_hex(hello_prologue(vector_key("fleet").public_part(), 3,
                                     std::span<const std::uint8_t>{hello}.first<hello_head_bytes>())) ==
               vector_text("handshake", "prologue"));
}

BOOST_AUTO_TEST_CASE(a_path_is_an_address_a_port_and_a_socket) {
    const auto v4 = datagram_path::v4(0xc0000201, 25370, 2);
    BOOST_TEST(v4.is_v4());
    BOOST_TEST(v4.v4_address() == 0xc0000201U);
    const std::array<std::uint8_t, 16> address{0xfe, 0x80, 0, 0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8};
    const auto v6 = datagram_path::v6(address, 25370, 3, 2);
    BOOST_TEST(!v6.is_v4());
    BOOST_TEST(v6.v6_address() == address);
    const std::array<std::uint8_t, 16> mapped{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff, 0xc0, 0, 2, 1};
    BOOST_TEST((datagram_path::v6(mapped, 25370, 0, 2) == v4));

    std::unordered_set<std::size_t> hashes;
    std::vector<datagram_source> sources{{.path = v4, .member = 1}};
    sources.push_back({.path = v4, .member = 2});
    sources.push_back({.path = datagram_path::v4(0xc0000202, 25370, 2), .member = 1});
    sources.push_back({.path = datagram_path::v4(0xc0000201, 25371, 2), .member = 1});
    sources.push_back({.path = datagram_path::v4(0xc0000201, 25370, 3), .member = 1});
    sources.push_back({.path = v6, .member = 1});
    sources.push_back({.path = datagram_path::v6(address, 25370, 4, 2), .member = 1});
    for (std::size_t i = 0; i < sources.size(); ++i) {
        hashes.insert(datagram_source::hash{}(sources[i]));
        for (std::size_t j = 0; j < sources.size(); ++j) {
            BOOST_TEST((sources[i] == sources[j]) == (i == j));
        }
    }
    BOOST_TEST(hashes.size() == sources.size());
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace datagram_format
