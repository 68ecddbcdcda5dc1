// SPDX-License-Identifier: BSL-1.0
#include "config/config_values.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <functional>
#include <string>
#include <string_view>

using namespace cles::runtime;
using namespace std::chrono_literals;
using std::chrono::microseconds;

namespace config_values {
namespace {

std::string refusal(const std::function<void()>& read) {
    try {
        read();
    } catch (const invalid_value& e) {
        return e.what();
    }
    return "accepted";
}

} // namespace
} // namespace config_values

BOOST_AUTO_TEST_SUITE(config_values)

BOOST_AUTO_TEST_CASE(booleans) {
    for (const auto* text : {"true", "on", "yes"}) {
        BOOST_TEST(to_bool(text));
    }
    for (const auto* text : {"false", "off", "no"}) {
        BOOST_TEST(!to_bool(text));
    }
    for (const auto* text : {"", "True", "1", "enabled"}) {
        BOOST_TEST(refusal([&] { to_bool(text); }).ends_with("is neither true nor false"), text);
    }
}

BOOST_AUTO_TEST_CASE(counts_are_bounded) {
    BOOST_TEST(to_count("1", 1, 99) == 1U);
    BOOST_TEST(to_count("99", 1, 99) == 99U);
    for (const auto* text : {"0", "100", "-1", "+1", "1.0", "1e1", "", "0x10", " 1", "99999999999999999999"}) {
        BOOST_TEST(refusal([&] { to_count(text, 1, 99); }) ==
                   "'" + std::string{text} + "' is not a number from 1 to 99");
    }
}

BOOST_AUTO_TEST_CASE(sizes_have_units) {
    constexpr auto most = std::uint64_t{1} << 30U;
    BOOST_TEST(to_size("4096", 1, most) == 4096U);
    BOOST_TEST(to_size("64KiB", 1, most) == 65536U);
    BOOST_TEST(to_size("1MiB", 1, most) == 1048576U);
    BOOST_TEST(to_size("1GiB", 1, most) == most);
    for (const auto* text : {"", "KiB", "1KB", "1 MiB", "1mib", "1.5MiB"}) {
        BOOST_TEST(refusal([&] { to_size(text, 1, most); }).find("is not a size") != std::string::npos, text);
    }
    for (const auto* text : {"0", "2GiB", "18446744073709551615GiB", "17179869184GiB"}) {
        BOOST_TEST(refusal([&] { to_size(text, 1, most); }).find("is not a number from") != std::string::npos, text);
    }
}

BOOST_AUTO_TEST_CASE(durations_have_units) {
    BOOST_TEST((to_duration("250ms") == 250ms));
    BOOST_TEST((to_duration("50us") == 50us));
    BOOST_TEST((to_duration("1.5s") == 1500ms));
    BOOST_TEST((to_duration("2min") == 2min));
    BOOST_TEST((to_duration("24h") == 24h));
    BOOST_TEST((to_duration("0") == 0us));
    BOOST_TEST((to_duration("0us") == 0us));
    BOOST_TEST((to_duration("0.4us") == 1us)); // 0 has a special meaning
    for (const auto* text : {"250", "ms", "", "1 s", "-1s", "1S", "nans", "infs", "1e999s", "s1"}) {
        BOOST_TEST(refusal([&] { to_duration(text); }).find("is not a duration") != std::string::npos, text);
    }
    BOOST_TEST(refusal([] { to_duration("25h"); }) == "'25h' is more than a day");
}

BOOST_AUTO_TEST_CASE(durations_read_back) {
    for (const auto* text : {"0", "1us", "250ms", "1500ms", "90s", "2min", "1h", "24h"}) {
        BOOST_TEST(to_string(to_duration(text)) == text);
    }
}

BOOST_AUTO_TEST_CASE(node_names) {
    BOOST_TEST(to_node_name("car-1.front_2") == "car-1.front_2");
    BOOST_TEST(to_node_name(std::string(64, 'x')).size() == 64U);
    for (const auto& text : {std::string{}, std::string(65, 'x'), std::string{"a b"}, std::string{"a:b"}}) {
        BOOST_TEST(refusal([&] { to_node_name(text); }).find("is not a valid node name") != std::string::npos, text);
    }
    for (const auto* text : {"self", "any", "all"}) {
        BOOST_TEST(refusal([&] { to_node_name(text); }).find("is not a valid node name") != std::string::npos, text);
    }
}

BOOST_AUTO_TEST_CASE(urls_that_others_can_reach) {
    for (const auto* text : {"tcp://127.0.0.1:25370", "udp://[::1]", "unix:///run/x", "unix://@x"}) {
        BOOST_TEST(to_url(text) == text);
    }
    BOOST_TEST(refusal([] { to_url("inproc://x"); }).find("from outside the process") != std::string::npos);
    BOOST_TEST(refusal([] { to_url("http://127.0.0.1"); }).find("unknown scheme") != std::string::npos);
    BOOST_TEST(refusal([] { to_url("tcp://127.0.0.1:70000"); }) != "accepted");
    BOOST_TEST(refusal([] { to_url("127.0.0.1:25370"); }) != "accepted");
}

BOOST_AUTO_TEST_CASE(networks) {
    BOOST_TEST(to_network("10.0.0.0/8") == "10.0.0.0/8");
    BOOST_TEST(to_network("fd00::/8") == "fd00::/8");
    for (const auto* text : {"", "10.0.0.0", "10.0.0.0/33", "fd00::/129", "x/8"}) {
        BOOST_TEST(refusal([&] { to_network(text); }).find("is not a network") != std::string::npos, text);
    }
}

BOOST_AUTO_TEST_CASE(multicast) {
    BOOST_TEST(!to_multicast("off").is_on());
    const auto where = to_multicast("eth0,239.255.0.7:4000");
    BOOST_TEST(where.interface == "eth0");
    BOOST_TEST(where.port == 4000U);
    BOOST_TEST(refusal([] { to_multicast("eth0,10.0.0.1"); }).find("multicast group") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(sha256) {
    const std::string digits = "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";
    BOOST_TEST(to_sha256(digits) == digits);
    BOOST_TEST(to_sha256("0123456789ABCDEF0123456789abcdef0123456789ABCDEF0123456789abcdef") == digits);
    for (const auto& text : {std::string{}, digits.substr(1), digits + "0", digits.substr(1) + "g",
                             "0x" + digits.substr(2), digits.substr(1) + " "}) {
        BOOST_TEST(refusal([&] { to_sha256(text); }).find("is not a SHA-256") != std::string::npos, text);
    }
}

BOOST_AUTO_TEST_CASE(log_settings) {
    const log_config before{.level = cles::log_level::warning, .format = log_format::json};
    BOOST_TEST((to_log_config("debug", before) == log_config{cles::log_level::debug, log_format::json}));
    BOOST_TEST((to_log_config("text", before) == log_config{cles::log_level::warning, log_format::text}));
    BOOST_TEST((to_log_config("error,text", before) == log_config{cles::log_level::error, log_format::text}));
    for (const auto* text : {"", "loud", "debug,", "debug;json"}) {
        BOOST_TEST(refusal([&] { to_log_config(text, before); }).find("is not a log setting") != std::string::npos,
                   text);
    }
    BOOST_TEST(refusal([] { to_log_level("json"); }).find("is not one of debug") != std::string::npos);
    BOOST_TEST(refusal([] { to_log_format("debug"); }).find("is neither text nor json") != std::string::npos);
}

BOOST_AUTO_TEST_SUITE_END()
