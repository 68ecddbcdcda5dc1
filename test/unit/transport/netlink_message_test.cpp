// SPDX-License-Identifier: BSL-1.0
// Which reports of the system lead to a look at the interfaces.
#include "transport/netlink_message.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

namespace netlink_message {
namespace {

using cles::transport::netlink_head;
namespace type = cles::transport::netlink_type;

constexpr std::uint16_t no_operation = 1;
constexpr std::uint16_t new_route = 24;
constexpr std::uint16_t new_neighbour = 28;

using bytes = std::vector<std::byte>;

/// Appends a message of that type, which states this length, and has as many bytes of data.
void append(bytes& all, std::uint16_t of, std::uint32_t length, std::size_t data) {
    const netlink_head head{.length = length, .type = of};
    const auto at = all.size();
    all.resize(at + sizeof head + data);
    std::memcpy(all.data() + at, &head, sizeof head);
}

bytes message(std::uint16_t of, std::size_t data = 8) {
    bytes one;
    append(one, of, static_cast<std::uint32_t>(sizeof(netlink_head) + data), data);
    return one;
}

bool reports(const bytes& all) { return cles::transport::may_report_interface(all); }

} // namespace
} // namespace netlink_message

BOOST_AUTO_TEST_SUITE(netlink_message)

BOOST_AUTO_TEST_CASE(links_and_addresses_are_reported) {
    for (const auto each : {type::new_link, type::deleted_link, type::new_address, type::deleted_address}) {
        BOOST_TEST(reports(message(each)));
    }
    BOOST_TEST(!reports(message(new_route)));
    BOOST_TEST(!reports(message(no_operation)));
    BOOST_TEST(!reports({}));
}

BOOST_AUTO_TEST_CASE(all_messages_are_looked_at) {
    auto all = message(new_route, 8);
    append(all, new_neighbour, sizeof(netlink_head) + 5, 8); // with padding
    BOOST_TEST(!reports(all));
    append(all, type::deleted_address, sizeof(netlink_head), 0);
    BOOST_TEST(reports(all));
}

BOOST_AUTO_TEST_CASE(the_last_message_may_lack_its_padding) { BOOST_TEST(!reports(message(new_route, 5))); }

BOOST_AUTO_TEST_CASE(what_is_not_well_formed_counts_as_a_report) {
    const auto whole = message(new_route, 4);
    for (std::size_t size = 1; size < whole.size(); ++size) {
        BOOST_TEST(reports({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)}));
    }
    for (const std::uint32_t length : {0U, 1U, 15U, 21U, 0xFFFFFFFFU}) { // of 20 bytes
        bytes one;
        append(one, new_route, length, 4);
        BOOST_TEST(reports(one));
    }
}

BOOST_AUTO_TEST_SUITE_END()
