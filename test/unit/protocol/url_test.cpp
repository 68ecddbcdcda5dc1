// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/url.hpp>

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

BOOST_AUTO_TEST_SUITE(url)

BOOST_AUTO_TEST_CASE(a_url_is_parsed_and_written_again) {
    struct example {
        std::string_view text;
        std::string_view scheme;
        std::string_view host;
        std::uint16_t port;
        std::string_view path;
        std::string_view written;
    };
    const example examples[] = {
        {"tcp://127.0.0.1:25370", "tcp", "127.0.0.1", 25370, "", "tcp://127.0.0.1:25370"},
        {"tcp://127.0.0.1", "tcp", "127.0.0.1", 25370, "", "tcp://127.0.0.1:25370"},
        {"tcp://car1.local:7", "tcp", "car1.local", 7, "", "tcp://car1.local:7"},
        {"tcp://0.0.0.0:0", "tcp", "0.0.0.0", 0, "", "tcp://0.0.0.0:0"},
        {"tcp://localhost:65535", "tcp", "localhost", 65535, "", "tcp://localhost:65535"},
        {"tcp://[::1]:8", "tcp", "::1", 8, "", "tcp://[::1]:8"},
        {"tcp://[::]", "tcp", "::", 25370, "", "tcp://[::]:25370"},
        {"tcp://[fe80::1%25eth0]:9", "tcp", "fe80::1%eth0", 9, "", "tcp://[fe80::1%25eth0]:9"},
        {"tcp://[::ffff:10.0.0.2]:9", "tcp", "::ffff:10.0.0.2", 9, "", "tcp://[::ffff:10.0.0.2]:9"},
        {"unix:///run/car1.sock", "unix", "", 0, "/run/car1.sock", "unix:///run/car1.sock"},
        {"unix://@car1", "unix", "", 0, "@car1", "unix://@car1"},
        {"unix:///a b/c:d", "unix", "", 0, "/a b/c:d", "unix:///a b/c:d"},
        {"inproc://car1", "inproc", "car1", 0, "", "inproc://car1"},
        {"pool://north", "pool", "north", 0, "", "pool://north"},
        {"tcp://10.0.0.2:7?dscp=46", "tcp", "10.0.0.2", 7, "", "tcp://10.0.0.2:7?dscp=46"},
        {"tls://10.0.0.2", "tls", "10.0.0.2", 25370, "", "tls://10.0.0.2:25370"},
        {"udp://[::1]?dscp=0", "udp", "::1", 25370, "", "udp://[::1]:25370?dscp=0"},
        {"unix:///run/a?dscp=1", "unix", "", 0, "/run/a?dscp=1", "unix:///run/a?dscp=1"}, // a file's name
        {"shm://10.0.0.2:5", "shm", "10.0.0.2", 5, "", "shm://10.0.0.2:5"},               // schemes may be added
    };
    for (const auto& e : examples) {
        const auto u = cles::parse_url(e.text);
        BOOST_TEST(u.scheme == e.scheme, e.text);
        BOOST_TEST(u.host == e.host, e.text);
        BOOST_TEST(u.port == e.port, e.text);
        BOOST_TEST(u.path == e.path, e.text);
        BOOST_TEST(to_string(u) == e.written, e.text);
        BOOST_TEST(to_string(cles::parse_url(to_string(u))) == e.written, e.text);
    }
}

BOOST_AUTO_TEST_CASE(a_dscp_is_parsed_if_present) {
    BOOST_TEST((cles::parse_url("tcp://10.0.0.2").dscp == std::nullopt));
    BOOST_TEST((cles::parse_url("tcp://10.0.0.2?dscp=63").dscp == std::uint8_t{63}));
}

BOOST_AUTO_TEST_CASE(an_invalid_url_is_refused_with_its_text_and_the_reason) {
    struct example {
        std::string text;
        std::string_view says;
    };
    const example examples[] = {
        {"", "scheme"},
        {"localhost", "scheme"},
        {"localhost:25370", "scheme"},
        {"://localhost", "scheme"},
        {"tcp:/localhost", "scheme"},
        {"tcp://", "host is missing"},
        {"tcp://:80", "host is missing"},
        {"tcp://[]:80", "IPv6"},
        {"tcp://localhost:", "port"},
        {"tcp://localhost:x", "port"},
        {"tcp://localhost:-1", "port"},
        {"tcp://localhost:+1", "port"},
        {"tcp://localhost:65536", "port"},
        {"tcp://localhost:99999999999", "port"},
        {"tcp://localhost:80x", "port"},
        {"tcp://::1", "brackets"},
        {"tcp://::1:80", "brackets"},
        {"tcp://[::1", "']'"},
        {"tcp://[::1]80", "']'"},
        {"tcp://[localhost]:80", "brackets are for IPv6"},
        {"tcp://localhost/path", "ends after its port"},
        {"tcp://localhost:80/", "ends after its port"},
        {"tcp://user@localhost", "ends after its port"},
        {"tcp://local host", "ends after its port"},
        {"tcp://localhost?", "0 to 63"},
        {"tcp://localhost:80?x=1", "0 to 63"},
        {"tcp://localhost:80?dscp=", "0 to 63"},
        {"tcp://localhost:80?dscp=64", "0 to 63"},
        {"tcp://localhost:80?dscp=-1", "0 to 63"},
        {"tcp://localhost:80?dscp=46&x", "0 to 63"},
        {"tcp://localhost:80?dscp=99999999999", "0 to 63"},
        {"unix://", "absolute path"},
        {"unix:///", "absolute path"},
        {"unix://@", "absolute path"},
        {"unix://run/car1.sock", "absolute path"},
        {"unix:///" + std::string(107, 'x'), "107"},
        {"inproc://", "name is missing"},
    };
    for (const auto& e : examples) {
        std::string message;
        try {
            const auto u = cles::parse_url(e.text);
            message = "(taken as " + to_string(u) + ")";
        } catch (const cles::error& refused) {
            BOOST_TEST((refused.code() == cles::errc::invalid_url));
            message = refused.message();
            BOOST_TEST(message.starts_with("'" + e.text + "'"), message);
        }
        BOOST_TEST(message.find(e.says) != std::string::npos, e.text << " gives: " << message);
    }
}

BOOST_AUTO_TEST_CASE(a_unix_path_of_maximum_length_is_valid) {
    BOOST_TEST(cles::parse_url("unix:///" + std::string(106, 'x')).path.size() == 107U);
}

BOOST_AUTO_TEST_CASE(some_links_stay_on_the_host) {
    for (const auto* scheme : {"unix", "inproc"}) {
        BOOST_TEST(cles::stays_on_host(scheme), scheme);
    }
    for (const auto* scheme : {"tcp", "tls", "udp", "pool", "other", ""}) {
        BOOST_TEST(!cles::stays_on_host(scheme), scheme);
    }
}

BOOST_AUTO_TEST_SUITE_END()
