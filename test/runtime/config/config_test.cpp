// SPDX-License-Identifier: BSL-1.0
#include "config/config.hpp"
#include "support/test_suite.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <vector>

using namespace cles::runtime;

namespace {

std::string refusal(const config& whole) {
    try {
        check(whole);
    } catch (const config_error& e) {
        return e.what();
    }
    return "accepted";
}

} // namespace

CLES_TEST_SUITE(config)

BOOST_AUTO_TEST_CASE(the_defaults_are_valid) {
    const auto c = default_config("host", 0);
    BOOST_TEST(refusal(c) == "accepted");
    BOOST_TEST(c.workers == 1U);
    BOOST_TEST(c.multicast.interface == "lo");
    BOOST_TEST(!c.multicast.required);
}

BOOST_AUTO_TEST_CASE(the_node_name_defaults_to_the_host_name) {
    BOOST_TEST(default_config("sat1.example.org", 1).node == "sat1");
    BOOST_TEST(default_config("my host", 1).node == "my-host");
    BOOST_TEST(default_config("", 1).node == "node");
    BOOST_TEST(default_config("any", 1).node == "node");
    BOOST_TEST(default_config(std::string(100, 'x'), 1).node.size() == 64U);
}

BOOST_AUTO_TEST_CASE(listening_for_other_hosts_requires_insecure) {
    auto c = default_config("host", 1);
    c.listen = {"tcp://127.0.0.1", "tcp://0.0.0.0"};
    c.origins["listen[1]"] = "clesd.yaml:3";
    BOOST_TEST(refusal(c) == "clesd.yaml:3: listen[1]: 'tcp://0.0.0.0' can be reached from other hosts, which requires "
                             "'insecure: true'");
    c.insecure = true;
    BOOST_TEST(refusal(c) == "accepted");
}

BOOST_AUTO_TEST_CASE(with_security_it_listens_for_other_hosts) {
    auto c = default_config("host", 1);
    c.security.keys = "/etc/cles/keys";
    apply_security_defaults(c);
    BOOST_TEST(c.listen == (std::vector<std::string>{"tls://0.0.0.0:25370", "udp://0.0.0.0:25370"}),
               boost::test_tools::per_element());
    BOOST_TEST(refusal(c) == "accepted");
    c.peers = {{"car1", "udp://10.0.0.1"}};
    BOOST_TEST(refusal(c) == "accepted");
    c.seeds = {"udp://10.0.0.1"};
    BOOST_TEST(refusal(c).find("names no node") != std::string::npos);
    c.seeds.clear();
    c.peers = {{"car1", "tcp://10.0.0.1"}};
    BOOST_TEST(refusal(c).find("use 'tls'") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(links_are_to_other_nodes_and_at_most_sixteen) {
    auto c = default_config("sat1", 1);
    c.links = {"recon", "car1"};
    BOOST_TEST(refusal(c) == "accepted");
    c.links.emplace_back("sat1");
    BOOST_TEST(refusal(c).find("'sat1' is this node itself") != std::string::npos);
    c.links.assign(17, "recon");
    BOOST_TEST(refusal(c).find("17 names; at most 16 fit") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(multicast_to_other_hosts_requires_insecure) {
    auto c = default_config("host", 1);
    c.multicast.interface = "eth0";
    c.origins["multicast"] = "CLES_MULTICAST";
    BOOST_TEST(refusal(c).starts_with("CLES_MULTICAST: multicast: 'eth0' can be reached from other hosts"));
    for (const auto* several : {"lo,eth0", "auto"}) {
        c.multicast.interface = several;
        BOOST_TEST(refusal(c).find("can be reached from other hosts") != std::string::npos);
    }
    c.insecure = true;
    BOOST_TEST(refusal(c) == "accepted");
}

BOOST_AUTO_TEST_CASE(with_security_other_hosts_are_reached_by_default) {
    auto c = default_config("host", 1);
    c.security.keys = "/etc/cles/keys";
    apply_security_defaults(c);
    BOOST_TEST(c.listen == (std::vector<std::string>{"tls://0.0.0.0:25370", "udp://0.0.0.0:25370"}),
               boost::test_tools::per_element());
    BOOST_TEST(c.multicast.interface == "auto");
    BOOST_TEST(!c.multicast.required);
    BOOST_TEST(refusal(c) == "accepted");
}

BOOST_AUTO_TEST_CASE(security_leaves_what_is_configured) {
    auto c = default_config("host", 1);
    c.security.keys = "/etc/cles/keys";
    c.listen = {"unix:///run/cles.sock"};
    c.origins["listen[0]"] = "clesd.yaml:2";
    c.origins["multicast.port"] = "clesd.yaml:3";
    apply_security_defaults(c);
    BOOST_TEST(c.listen == std::vector<std::string>{"unix:///run/cles.sock"}, boost::test_tools::per_element());
    BOOST_TEST(c.multicast.interface == "lo");
}

BOOST_AUTO_TEST_CASE(with_security_plain_addresses_are_refused) {
    for (const auto* plain : {"tcp://127.0.0.1", "tcp://10.0.0.1:7"}) {
        auto c = default_config("host", 1);
        c.security.keys = "/etc/cles/keys";
        c.listen = {plain};
        c.origins["listen"] = "clesd.yaml:3";
        BOOST_TEST(refusal(c) ==
                   "clesd.yaml:3: listen[0]: '" + std::string{plain} + "' is refused with 'security': use 'tls'");
        c.listen = {"tls://0.0.0.0"};
        c.seeds = {plain};
        c.origins["seeds"] = "clesd.yaml:4";
        BOOST_TEST(refusal(c).starts_with("clesd.yaml:4: seeds[0]: "));
        c.seeds.clear();
        c.peers["car2"] = plain;
        c.origins["peers.car2"] = "clesd.yaml:5";
        BOOST_TEST(refusal(c).starts_with("clesd.yaml:5: peers.car2: "));
    }
}

BOOST_AUTO_TEST_CASE(tls_requires_security) {
    auto c = default_config("host", 1);
    c.listen = {"tls://0.0.0.0"};
    c.origins["listen"] = "clesd.yaml:3";
    BOOST_TEST(refusal(c) == "clesd.yaml:3: listen[0]: 'tls://0.0.0.0' requires 'security'");
}

BOOST_AUTO_TEST_CASE(a_peer_may_not_have_the_nodes_name) {
    auto c = default_config("host", 1);
    c.peers["host"] = "tcp://127.0.0.1:1";
    c.origins["peers.host"] = "clesd.yaml:4";
    BOOST_TEST(refusal(c) == "clesd.yaml:4: peers.host: is this node's own name");
}

BOOST_AUTO_TEST_CASE(a_plugin_is_listed_once) {
    auto c = default_config("host", 1);
    c.plugins = {{.path = "a.so"}, {.path = "b.so"}, {.path = "a.so"}};
    c.origins["plugins[2]"] = "clesd.yaml:9";
    BOOST_TEST(refusal(c) == "clesd.yaml:9: plugins[2].path: 'a.so' is listed twice");
}

BOOST_AUTO_TEST_CASE(a_location_falls_back_to_the_containing_value) {
    auto c = default_config("host", 1);
    c.origins["listen"] = "clesd.yaml:3";
    BOOST_TEST(c.location_of("listen[1]") == "clesd.yaml:3: listen[1]");
    BOOST_TEST(c.location_of("listen") == "clesd.yaml:3: listen");
    BOOST_TEST(c.location_of("log.level") == "log.level");
    BOOST_TEST(c.location_of("queue") == "queue");
}

BOOST_AUTO_TEST_SUITE_END()
