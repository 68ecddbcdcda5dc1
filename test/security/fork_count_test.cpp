// SPDX-License-Identifier: BSL-1.0
#include "security/child_process.hpp"
#include "security/datagrams/fork_count.hpp"

#include <boost/test/unit_test.hpp>

namespace fork_count {

using namespace cles::security;
using cles::security::test::in_child;

BOOST_AUTO_TEST_SUITE(fork_count)

BOOST_AUTO_TEST_CASE(a_child_process_is_detected_once) {
    fork_detector detector;
    BOOST_TEST(!detector.forked());
    BOOST_TEST(in_child([&] { return detector.forked() && !detector.forked(); }));
    BOOST_TEST(!detector.forked());
}

BOOST_AUTO_TEST_CASE(the_child_of_a_child_process_is_detected) {
    fork_detector detector;
    BOOST_TEST(in_child([&] { return in_child([&] { return detector.forked() && !detector.forked(); }); }));
    BOOST_TEST(in_child([&] { return detector.forked() && in_child([&] { return detector.forked(); }); }));
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace fork_count
