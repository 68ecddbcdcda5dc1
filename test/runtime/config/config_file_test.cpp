// SPDX-License-Identifier: BSL-1.0
#include "config/config.hpp"
#include "config/config_file.hpp"

#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <ostream>
#include <string>

using namespace cles::runtime;
using namespace std::chrono_literals;

namespace config_file {
namespace {

config read(const std::string& text) {
    auto made = default_config("host", 4);
    read_config(text, "clesd.yaml", made);
    return made;
}

std::string refusal(const std::string& text) {
    try {
        read(text);
    } catch (const config_error& e) {
        return e.what();
    }
    return "accepted";
}

struct mistake {
    const char* text;
    const char* place; // with the key
    const char* why;
};

std::ostream& operator<<(std::ostream& out, const mistake& m) { return out << m.text; }

const mistake mistakes[] = {
    // unknown keys, at every depth
    {"node: a\nworker: 2\n", "clesd.yaml:2: worker: ", "unknown key; known here: allow_clash, busy_poll, drain, "},
    {"multicast:\n  group: 239.255.25.37\n  prot: 1\n", "clesd.yaml:3: multicast.prot: ", "unknown key"},
    {"log: {colour: red}\n", "clesd.yaml:1: log.colour: ", "unknown key; known here: format, level"},
    {"plugins:\n  - path: a.so\n  - path: b.so\n    args: {}\n", "clesd.yaml:4: plugins[1].args: ", "unknown key"},
    {"limits:\n\n  lines: 4096\n", "clesd.yaml:3: limits.lines: ", "unknown key"},
    // invalid values of each key
    {"node: a b\n", "clesd.yaml:1: node: ", "'a b' is not a valid node name"},
    {"node:\n", "clesd.yaml:1: node: ", "has no value"},
    {"node: [a]\n", "clesd.yaml:1: node: ", "has to be a single value"},
    {"listen: 127.0.0.1\n", "clesd.yaml:1: listen: ", ""},
    {"listen:\n  - tcp://127.0.0.1\n  - tcp://x:y\n", "clesd.yaml:3: listen[1]: ", ""},
    {"listen: {a: b}\n", "clesd.yaml:1: listen: ", "has to be a list"},
    {"insecure: maybe\n", "clesd.yaml:1: insecure: ", "'maybe' is neither true nor false"},
    {"networks: [10.0.0.0]\n", "clesd.yaml:1: networks[0]: ", "is not a network"},
    {"pool: a b\n", "clesd.yaml:1: pool: ", "'a b' is not a valid pool name"},
    {"multicast: lo,1.2.3.4\n", "clesd.yaml:1: multicast: ", "multicast group"},
    {"multicast: [[lo]]\n", "clesd.yaml:1: multicast[0]: ", "has to be a single value"},
    {"multicast: []\n", "clesd.yaml:1: multicast: ", "is not an interface"},
    {"multicast: [lo,\n  '']\n", "clesd.yaml:2: multicast[1]: ", "is not an interface"},
    {"multicast: [lo, off]\n", "clesd.yaml:1: multicast[1]: ", "is not an interface"},
    {"multicast: lo,\n", "clesd.yaml:1: multicast: ", "has an empty name of an interface"},
    {"multicast:\n  interface: [lo, eth0, lo]\n", "clesd.yaml:2: multicast.interface: ", "names 'lo' twice"},
    {"multicast: {interface: \"lo,auto\"}\n",
     "clesd.yaml:1: multicast.interface: ", "combines 'auto' with other names"},
    {"multicast: [a, b, c, d, e, f, g, h, i]\n", "clesd.yaml:1: multicast: ", "at most 8"},
    {"multicast: {group: 10.1.1.1}\n", "clesd.yaml:1: multicast.group: ", "multicast group"},
    {"multicast:\n  port: 70000\n", "clesd.yaml:2: multicast.port: ", "'70000' is not a number from 1 to 65535"},
    {"multicast: {interface: off}\n", "clesd.yaml:1: multicast.interface: ", "is not an interface"},
    {"multicast: {required: 1}\n", "clesd.yaml:1: multicast.required: ", "neither true nor false"},
    {"seeds:\n- tcp://a\n- mqtt://b\n", "clesd.yaml:3: seeds[1]: ", ""},
    {"links:\n- recon\n- not a name\n", "clesd.yaml:3: links[1]: ", ""},
    {"peers:\n  recon: there\n", "clesd.yaml:2: peers.recon: ", ""},
    {"peers: {any: tcp://127.0.0.1}\n", "clesd.yaml:1: peers.any: ", "is not a valid node name"},
    {"peers: []\n", "clesd.yaml:1: peers: ", "has to be a map"},
    {"workers: 0\n", "clesd.yaml:1: workers: ", "'0' is not a number from 1 to 1024"},
    {"queue: many\n", "clesd.yaml:1: queue: ", "'many' is not a number from 1 to 1000000"},
    {"stuck_after: 5\n", "clesd.yaml:1: stuck_after: ", "is not a duration"},
    {"replacements: -1\n", "clesd.yaml:1: replacements: ", "is not a number"},
    {"drain: forever\n", "clesd.yaml:1: drain: ", "is not a duration"},
    {"plugins: a.so\n", "clesd.yaml:1: plugins: ", "has to be a list"},
    {"plugins:\n  - config: {}\n", "clesd.yaml:2: plugins[0]: ", "has no 'path'"},
    {"plugins: [{path: ''}]\n", "clesd.yaml:1: plugins[0].path: ", "is empty"},
    {"plugins:\n  - path: a.so\n    config: 7\n", "clesd.yaml:3: plugins[0].config: ", "has to be a map or a list"},
    {"plugins: [{path: a.so, required: often}]\n", "clesd.yaml:1: plugins[0].required: ", "neither true nor false"},
    {"plugins: [{path: a.so, sha256: 12}]\n", "clesd.yaml:1: plugins[0].sha256: ", "is not a SHA-256"},
    {"plugin_path: {}\n", "clesd.yaml:1: plugin_path: ", "has to be a list"},
    {"log: loud\n", "clesd.yaml:1: log: ", "is not a log setting"},
    {"log: {level: loud}\n", "clesd.yaml:1: log.level: ", "is not one of debug"},
    {"log: {format: xml}\n", "clesd.yaml:1: log.format: ", "is neither text nor json"},
    {"limits: {links: 0}\n", "clesd.yaml:1: limits.links: ", "is not a number from 1 to 20000"},
    {"limits: {line: 1KB}\n", "clesd.yaml:1: limits.line: ", "is not a size"},
    {"limits: {stall: 0}\n", "clesd.yaml:1: limits.stall: ", "too short"},
    {"limits: {line: 255}\n", "clesd.yaml:1: limits.line: ", "is not a number from 256 to 67108864"},
    {"limits: {line: 17179869184GiB}\n", "clesd.yaml:1: limits.line: ", "is not a number from 256 to"},
    {"limits:\n  depth: 65\n", "clesd.yaml:2: limits.depth: ", "is not a number from 1 to 64"},
    {"limits: {publishers: 0}\n", "clesd.yaml:1: limits.publishers: ", "is not a number from 1 to 1000000"},
    {"limits: {lease: 61s}\n", "clesd.yaml:1: limits.lease: ", "is too long: 1min at most"},
    {"limits: {lease: 19ms}\n", "clesd.yaml:1: limits.lease: ", "is too short: 20ms at least"},
    {"limits: {memory: 1KiB}\n", "clesd.yaml:1: limits.memory: ", "is not a number from 65536 to"},
    {"busy_poll: 50\n", "clesd.yaml:1: busy_poll: ", "is not a duration"},
    {"wake_within: 7\n", "clesd.yaml:1: wake_within: ", "is not a duration"},
    {"wake_within: 0\n", "clesd.yaml:1: wake_within: ", "write off, or 0us"},
    {"real_time: 100\n", "clesd.yaml:1: real_time: ", "is not a number from 0 to 99"},
    {"security: {local_users: {root: car1}}\n", "clesd.yaml:1: security: ", "has no 'keys'"},
    {"security:\n  keys: /k\n  users: {}\n", "clesd.yaml:3: security.users: ", "unknown key"},
    {"security:\n  keys: /k\n  local_users:\n    root: any\n", "clesd.yaml:4: security.local_users.root: ", "any"},
    {"federation: {pool: north}\n", "clesd.yaml:1: federation: ", "has no 'nats'"},
    {"federation: {nats: 'nats://h'}\n", "clesd.yaml:1: federation: ", "has no 'pool'"},
    {"federation:\n  nats: h\n", "clesd.yaml:2: federation.nats: ", "is not the URL of a NATS server"},
    {"federation: {nats: 'nats://h', pool: any}\n", "clesd.yaml:1: federation.pool: ", "is not a valid name"},
    {"federation: {nats: 'nats://h', pool: n, tls: {key: /k}}\n", "clesd.yaml:1: federation.tls: ", "has only one of"},
    {"federation: on\n", "clesd.yaml:1: federation: ", "is not 'off'"},
    // other invalid files
    {"node: a\nworkers: 1\nnode: b\n", "clesd.yaml:3: node: ", "is a duplicate of the key in line 1"},
    {"- node\n", "clesd.yaml:1: ", "has to be a map"},
    {"just words\n", "clesd.yaml:1: ", "has to be a map"},
    {"node: a\n\tworkers: 2\n", "clesd.yaml:2: ", "is not valid YAML"},
    {"node: [a\n", "clesd.yaml:2: ", "is not valid YAML"},
    {"node: a\n---\nnode: b\n", "clesd.yaml: ", "contains 2 documents"},
    {"? [a, b]\n: c\n", "clesd.yaml:1: ", "keys have to be scalars"},
};

} // namespace
} // namespace config_file

BOOST_AUTO_TEST_SUITE(config_file)

BOOST_AUTO_TEST_CASE(every_key) {
    const auto c = read("node: sat1\n"
                        "pool: north\n"
                        "allow_clash: true\n"
                        "listen: [tcp://127.0.0.1:25370, udp://127.0.0.1:25370]\n"
                        "multicast: {group: 239.255.25.38, port: 25371, interface: lo}\n"
                        "seeds: [tcp://127.0.0.1:25371]\n"
                        "peers: {recon: tcp://127.0.0.1:25372}\n"
                        "workers: 2\n"
                        "queue: 512\n"
                        "stuck_after: 250ms\n"
                        "replacements: 1\n"
                        "sharing: false\n"
                        "drain: 3s\n"
                        "plugin_path: /opt/plugins\n"
                        "plugins:\n"
                        "  - path: libcles-system.so\n"
                        "  - path: libcles-primes.so\n"
                        "    config: {limit: 100000}\n"
                        "    required: false\n"
                        "  - libother.so\n"
                        "insecure: true\n"
                        "networks: [10.0.0.0/8]\n"
                        "log: {level: debug, format: json}\n"
                        "limits: {line: 64KiB, links: 16, stall: 10s}\n"
                        "busy_poll: 50us\n"
                        "real_time: 10\n"
                        "wake_within: 20us\n");
    BOOST_TEST(c.node == "sat1");
    BOOST_TEST(c.pool == "north");
    BOOST_TEST(c.allow_clash);
    BOOST_TEST(c.listen == (std::vector<std::string>{"tcp://127.0.0.1:25370", "udp://127.0.0.1:25370"}),
               boost::test_tools::per_element());
    BOOST_TEST(c.multicast.interface == "lo");
    BOOST_TEST(c.multicast.group == "239.255.25.38");
    BOOST_TEST(c.multicast.port == 25371U);
    BOOST_TEST(c.multicast.required);
    BOOST_REQUIRE_EQUAL(c.seeds.size(), 1U);
    BOOST_TEST(c.seeds[0] == "tcp://127.0.0.1:25371");
    BOOST_TEST(c.peers.at("recon") == "tcp://127.0.0.1:25372");
    BOOST_TEST(c.workers == 2U);
    BOOST_TEST(c.queue == 512U);
    BOOST_TEST((c.stuck_after == 250ms));
    BOOST_TEST(c.replacements == 1U);
    BOOST_TEST(!c.sharing);
    BOOST_TEST((c.drain == 3s));
    BOOST_REQUIRE_EQUAL(c.plugin_path.size(), 1U);
    BOOST_TEST(c.plugin_path[0] == "/opt/plugins");
    BOOST_REQUIRE_EQUAL(c.plugins.size(), 3U);
    BOOST_TEST((c.plugins[0] == plugin_config{.path = "libcles-system.so"}));
    BOOST_TEST((c.plugins[1] == plugin_config{"libcles-primes.so", R"({"limit":100000})", false}));
    BOOST_TEST((c.plugins[2] == plugin_config{.path = "libother.so"}));
    BOOST_TEST(c.insecure);
    BOOST_TEST(c.networks.at(0) == "10.0.0.0/8");
    BOOST_TEST((c.log == log_config{cles::log_level::debug, log_format::json}));
    BOOST_TEST(c.limits.line == 65536U);
    BOOST_TEST(c.limits.links == 16U);
    BOOST_TEST((c.limits.stall == 10s));
    BOOST_TEST((c.busy_poll == 50us));
    BOOST_TEST(c.real_time == 10U);
    BOOST_TEST((c.wake_within == 20us));
    check(c);
}

BOOST_AUTO_TEST_CASE(missing_keys_keep_their_values) {
    const auto c = read("# nothing\n");
    const auto d = default_config("host", 4);
    BOOST_TEST(c.node == "host");
    BOOST_TEST(c.listen == d.listen, boost::test_tools::per_element());
    BOOST_TEST((c.multicast == d.multicast));
    BOOST_TEST(c.workers == 4U);
    BOOST_TEST(c.plugins.empty());
    BOOST_TEST(c.origins.empty());
    BOOST_TEST(read("").node == "host");
}

BOOST_AUTO_TEST_CASE(multicast_as_a_scalar) {
    BOOST_TEST(!read("multicast: off\n").multicast.is_on());
    BOOST_TEST(read("multicast: \"off\"\n").multicast.is_on() == false);
    BOOST_TEST(read("multicast: eth0\n").multicast.interface == "eth0");
    BOOST_TEST(read("multicast: {port: 4000}\n").multicast.interface == "lo");
    BOOST_TEST(read("multicast: lo,eth0\n").multicast.interface == "lo,eth0");
    BOOST_TEST(read("multicast: [lo, eth0]\n").multicast.interface == "lo,eth0");
    BOOST_TEST(read("multicast: {interface: [lo, eth0], port: 4000}\n").multicast.interface == "lo,eth0");
    BOOST_TEST(read("multicast: {interface: auto}\n").multicast.interface == "auto");
}

BOOST_AUTO_TEST_CASE(a_duration_limit_is_rounded_up) {
    BOOST_TEST((read("limits: {first_line: 500us}\n").limits.first_line == 1ms));
    BOOST_TEST((read("limits: {first_line: 0.1us}\n").limits.first_line == 1ms));
    BOOST_TEST((read("limits: {first_line: 1500us}\n").limits.first_line == 2ms));
    BOOST_TEST((read("limits: {first_line: 0}\n").limits.first_line == 0ms));
    BOOST_TEST(refusal("limits: {lease: 60000001us}\n").find("is too long") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(each_value_has_its_line) {
    const auto c = read("node: sat1\n\nmulticast:\n  port: 4000\nplugins:\n  - path: a.so\n  - b.so\n");
    BOOST_TEST(c.origins.at("node") == "clesd.yaml:1");
    BOOST_TEST(c.origins.at("multicast.port") == "clesd.yaml:4");
    BOOST_TEST(c.location_of("plugins[0].path") == "clesd.yaml:6: plugins[0].path");
    BOOST_TEST(c.location_of("plugins[1].path") == "clesd.yaml:7: plugins[1].path");
    BOOST_TEST(c.location_of("workers") == "workers");
}

BOOST_DATA_TEST_CASE(an_error_names_file_line_and_key, boost::unit_test::data::make(mistakes), wrong) {
    const auto message = refusal(wrong.text);
    BOOST_TEST(message.starts_with(wrong.place), message);
    BOOST_TEST(message.find(wrong.why) != std::string::npos, message);
}

BOOST_AUTO_TEST_CASE(an_unreadable_file_is_an_error) {
    config c;
    BOOST_CHECK_EXCEPTION(read_config_file("/nowhere/clesd.yaml", c), config_error, [](const config_error& e) {
        return std::string{e.what()} == "/nowhere/clesd.yaml: cannot be read: No such file or directory";
    });
    BOOST_CHECK_EXCEPTION(read_config_file("/", c), config_error,
                          [](const config_error& e) { return std::string{e.what()}.starts_with("/: cannot be read"); });
    BOOST_CHECK_EXCEPTION(read_config_file("/dev/zero", c), config_error, [](const config_error& e) {
        return std::string{e.what()}.find("more than 1048576 bytes") != std::string::npos;
    });
}

BOOST_AUTO_TEST_SUITE_END()
