// SPDX-License-Identifier: BSL-1.0
// A program that is started by this one inherits no descriptor of a transport: one that listens, was dialled or was
// accepted.

#include "support/data_test_case.hpp"
#include "support/descriptors.hpp"
#include "support/link_pair.hpp"

#include <boost/test/unit_test.hpp>

#include <set>
#include <string>

BOOST_AUTO_TEST_SUITE(descriptors)

using namespace cles::test;

CLES_DATA_TEST_CASE(links_are_not_inherited, listening_carriers, kind) {
    const auto before = inherited_descriptors();
    link_pair pair{kind};
    BOOST_TEST(inherited_descriptors() == before, boost::test_tools::per_element());
    pair.open();
    BOOST_TEST(inherited_descriptors() == before, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_SUITE_END()
