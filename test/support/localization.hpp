// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe.hpp>

namespace cles::test {

/// The paper's example of the data that vehicles exchange.
struct localization {
    double utc = 0;
    double lat = 0;
    double lon = 0;
    bool operator==(const localization&) const = default;
};
BOOST_DESCRIBE_STRUCT(localization, (), (utc, lat, lon))

} // namespace cles::test
