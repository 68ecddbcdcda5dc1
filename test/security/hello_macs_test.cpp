// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/hello_macs.hpp"
#include "security/fleet_fixture.hpp"
#include "security/sealed_network.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>

namespace hello_macs {
namespace {

using namespace cles::security;
using namespace cles::security::test;

// The ends of the vectors.
struct vector_ends {
    fleet first = end("car1");
    fleet second = end("car2");
    bytes hello = from_hex(vector_text("handshake", "hello"));
    bytes mac = from_hex(vector_text("handshake", "hello_mac"));

    static fleet end(const char* name) { return {name, vector_key(name), reread(text_at(vectors(), "roster"))}; }
    [[nodiscard]] const member& car(std::uint32_t number) const { return *first.in_force().find(number); }
};

} // namespace
} // namespace hello_macs

BOOST_FIXTURE_TEST_SUITE(hello_macs, vector_ends)

BOOST_AUTO_TEST_CASE(the_vector_is_made_and_verified) {
    cles::security::hello_macs by{first};
    cles::security::hello_macs at{second};
    BOOST_TEST(to_hex(by.make(car(3), hello)) == to_hex(mac));
    BOOST_TEST(at.verify(car(1), hello, mac));
    BOOST_TEST(at.verify(car(1), hello, mac)); // from what was kept
    at.forget(1);
    BOOST_TEST(at.verify(car(1), hello, mac));
    BOOST_TEST(to_hex(by.make(car(3), hello)) == to_hex(mac));
}

BOOST_AUTO_TEST_CASE(every_bit_counts) {
    cles::security::hello_macs at{second};
    for (auto* const part : {&hello, &mac}) {
        for (std::size_t bit = 0; bit < part->size() * 8; ++bit) {
            (*part)[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
            BOOST_TEST(!at.verify(car(1), hello, mac));
            (*part)[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
        }
    }
    BOOST_TEST(!at.verify(car(1), hello, bytes_view{mac}.first(15)));
    BOOST_TEST(!at.verify(car(1), hello, {}));
    BOOST_TEST(at.verify(car(1), hello, mac));
}

BOOST_AUTO_TEST_CASE(it_is_of_one_direction_and_two_members) {
    cles::security::hello_macs by{first};
    cles::security::hello_macs at{second};
    BOOST_TEST(!by.verify(car(3), hello, mac)); // sent back
    BOOST_TEST(!at.verify(car(3), hello, mac)); // of another member
    BOOST_TEST(to_hex(at.make(car(1), hello)) != to_hex(mac));
}

BOOST_AUTO_TEST_SUITE_END()
