// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/test/unit_test.hpp>

// BOOST_AUTO_TEST_SUITE for a suite with the name of a type that other tests use. A suite is a namespace to the
// compiler, so sources that are compiled as one unit could not use the type: the namespace of this suite has a longer
// name.
#define CLES_TEST_SUITE(suite)                                                                                         \
    namespace suite##_suite {                                                                                          \
        BOOST_AUTO_TU_REGISTRAR(suite)                                                                                 \
        (BOOST_STRINGIZE(suite), __FILE__, __LINE__, boost::unit_test::decorator::collector_t::instance());
