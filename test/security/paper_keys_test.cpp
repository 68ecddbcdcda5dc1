// SPDX-License-Identifier: BSL-1.0
// The paper's interface beyond loopback: it takes the keys that the environment names.
#include <cles/paper.hpp>

#include "security/secured_services.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdlib>
#include <memory>
#include <string>

BOOST_AUTO_TEST_SUITE(paper_keys)

namespace {

struct fixture {
    fixture() { ::setenv("CLES_MULTICAST", "off", 1); }
    ~fixture() { ::unsetenv("CLES_KEYS"); }

    std::unique_ptr<CLES_Service> device(const std::string& name, const char* interface) {
        ::setenv("CLES_KEYS", fleet.directory_of(name).c_str(), 1);
        return std::make_unique<CLES_Service>(name, interface, 0);
    }

    cles::security::test::secured_fleet fleet{"device1", "device2"};
};

} // namespace

BOOST_FIXTURE_TEST_CASE(beyond_loopback_it_listens_with_them, fixture) {
    const auto device1 = device("device1", "0.0.0.0");
    const auto device2 = device("device2", "0.0.0.0");
    const auto url = device1->native().endpoints().front();
    BOOST_TEST_REQUIRE(url.starts_with("tls://0.0.0.0:"), url);
    device1->registerPullFunction("zone", [](std::vector<std::string> args) { return args; });
    device2->native().set_peer("device1", "tls://127.0.0.1" + url.substr(url.rfind(':')));
    device1->run();
    device2->run();
    BOOST_TEST(boost::json::serialize(device2->makeCLESRequest("PULL device1:zone/UTC")) == R"({"value":["UTC"]})");
}

BOOST_FIXTURE_TEST_CASE(on_loopback_it_needs_none, fixture) {
    BOOST_TEST(device("device1", "127.0.0.1")->native().endpoints().front().starts_with("tcp://"));
}

BOOST_FIXTURE_TEST_CASE(keys_of_another_node_are_refused, fixture) {
    ::setenv("CLES_KEYS", fleet.directory_of("device1").c_str(), 1);
    BOOST_CHECK_THROW(CLES_Service("device3", "0.0.0.0", 0), cles::error);
    ::setenv("CLES_KEYS", "/nowhere", 1);
    BOOST_CHECK_THROW(CLES_Service("device1", "0.0.0.0", 0), cles::error);
}

BOOST_AUTO_TEST_SUITE_END()
