// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <cstdint>
#include <string>

namespace cles::test {

/// A number in the metrics of a service.
/// \param group the object in which it is, such as "memory"; empty: the first of that name
inline std::uint64_t metric(service& of, const std::string& name, const std::string& group = {}) {
    const auto all = of.request("PULL self:cles/metrics");
    std::size_t begin = 0;
    if (!group.empty()) {
        begin = all.find("\"" + group + "\":{");
        BOOST_REQUIRE(begin != std::string::npos);
    }
    const auto at = all.find("\"" + name + "\":", begin);
    BOOST_REQUIRE(at != std::string::npos);
    return std::stoull(all.substr(at + name.size() + 3));
}

} // namespace cles::test
