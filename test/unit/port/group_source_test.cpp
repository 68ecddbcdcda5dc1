// SPDX-License-Identifier: BSL-1.0
#include "port/group_port.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(group_source)

using cles::core::parse_group_source;

BOOST_AUTO_TEST_CASE(it_is_parsed_as_it_is_written) {
    const cles::core::group_source source{.address = 0xC0000207, .port = 65535};
    BOOST_TEST(to_text(source) == "192.0.2.7:65535");
    BOOST_TEST((parse_group_source("192.0.2.7:65535") == source));
}

BOOST_AUTO_TEST_CASE(anything_else_is_invalid) {
    for (const auto* text : {"", "192.0.2.7", "192.0.2.7:", "192.0.2.7:0", "192.0.2.7:65536", "192.0.2.256:1",
                             "192.0.2:1", "192.0.2.7.1:1", "192.0.2.7:1 ", " 192.0.2.7:1", "-1.0.2.7:1", "192.0.2.:1",
                             "192.0.2.7:1x", "[::1]:1", "4294967296.0.0.1:1"}) {
        BOOST_TEST(!parse_group_source(text), text);
    }
}

BOOST_AUTO_TEST_SUITE_END()
