// SPDX-License-Identifier: BSL-1.0
// The transport `tls`, for links of a node to itself.

#include <cles/link.hpp>

#include "security/fleet/fleet.hpp"
#include "security/fleet/fleet_authority.hpp"
#include "security/keys/keys.hpp"
#include "tls/tls_transport.hpp"

#include <boost/test/unit_test.hpp>

#include <memory>
#include <utility>

namespace {

struct tls_carrier {
    tls_carrier() {
        using namespace cles::security;
        auto key = signing_key::generate();
        auto authority = fleet_authority::found(signing_key::generate());
        authority.add({"node", key.public_part()});
        cles::register_transport(
            "tls",
            cles::tls::make_tls_transport(
                {.fleet = std::make_shared<fleet>("node", std::move(key), authority.share()), .epoch = "5f3a09c1"}));
    }
};

} // namespace

BOOST_TEST_GLOBAL_FIXTURE(tls_carrier);
