// SPDX-License-Identifier: BSL-1.0
#include "config/config_file.hpp"

#include <boost/test/unit_test.hpp>

#include <string>

using namespace cles::runtime;

namespace config_to_yaml {
namespace {

config all_set() {
    auto c = default_config("host", 4);
    read_config("node: \"007\"\npool: north\nallow_clash: on\nlisten: [tcp://127.0.0.1:1, unix://@a b]\ninsecure: "
                "on\nnetworks: [fd00::/8]\n"
                "multicast: {port: 4000, required: false}\nseeds: [tcp://127.0.0.1:2]\n"
                "peers: {a: tcp://127.0.0.1:3, b.c: udp://127.0.0.1:3}\n"
                "federation: {nats: [nats://a, tls://b:1], pool: north, token: /t, tls: {ca: /c, certificate: /d, key: "
                "/e}}\nworkers: 3\nqueue: 9\nstuck_after: 1500ms\n"
                "replacements: 0\ndrain: 2min\nplugin_path: [/a, 'b: c']\n"
                "plugins: [{path: x.so, config: {a: [1, '2', null], b: \"q\\\"\"}, required: false}, y.so,\n"
                "  {path: z.so, sha256: 0000000000000000000000000000000000000000000000000000000000000007}]\n"
                "log: error,json\nbusy_poll: 50us\nreal_time: 7\nwake_within: 0us\nlimits: {depth: 8, lease: 5s}\n",
                "clesd.yaml", c);
    return c;
}

std::string without_comments(std::string text) {
    std::string out;
    for (std::size_t from = 0; from < text.size();) {
        const auto end = text.find('\n', from);
        auto line = text.substr(from, end - from);
        line = line.substr(0, line.find("  # "));
        out += line.starts_with("#") ? "" : line + "\n";
        from = end + 1;
    }
    return out;
}

} // namespace
} // namespace config_to_yaml

BOOST_AUTO_TEST_SUITE(config_to_yaml)

BOOST_AUTO_TEST_CASE(printed_configuration_reads_back) {
    for (const auto& before : {all_set(), default_config("host", 4)}) {
        auto after = default_config("other", 1);
        const auto text = to_yaml(before);
        read_config(text, "printed", after);
        BOOST_TEST(without_comments(to_yaml(after)) == without_comments(text));
        BOOST_TEST((after.multicast == before.multicast));
        BOOST_TEST((after.plugins == before.plugins));
        BOOST_TEST((after.peers == before.peers));
        BOOST_TEST((after.federation == before.federation));
        BOOST_TEST((after.limits.lease == before.limits.lease));
        BOOST_TEST((after.wake_within == before.wake_within));
    }
}

BOOST_AUTO_TEST_CASE(several_interfaces_read_back) {
    auto c = default_config("host", 1);
    c.multicast.interface = "lo,eth0";
    auto after = default_config("host", 1);
    read_config(to_yaml(c), "printed", after);
    BOOST_TEST((after.multicast == c.multicast));
}

BOOST_AUTO_TEST_CASE(disabled_multicast_reads_back) {
    auto c = default_config("host", 4);
    c.multicast.interface.clear();
    auto after = default_config("other", 1);
    read_config(to_yaml(c), "printed", after);
    BOOST_TEST(!after.multicast.is_on());
}

BOOST_AUTO_TEST_CASE(each_value_has_its_origin) {
    const auto text = to_yaml(all_set());
    BOOST_TEST(text.find("node: \"007\"  # clesd.yaml:1\n") != std::string::npos, text);
    BOOST_TEST(text.find("drain: 2min  # clesd.yaml:15\n") != std::string::npos, text);
    BOOST_TEST(to_yaml(default_config("host", 4)).find("queue: 1024\n") != std::string::npos);
}

BOOST_AUTO_TEST_SUITE_END()
