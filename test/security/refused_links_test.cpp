// SPDX-License-Identifier: BSL-1.0
#include "security/refused_links.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <string>

namespace refused_links {
namespace {

using namespace std::chrono_literals;
using kind = cles::security::link_admission::reason;
using cles::security::refused_link;

struct fixture {
    bool take(kind of, const std::string& source, const std::string& why) {
        return logged.take({.kind = of, .source = source, .why = why}, now);
    }
    /// How many of these are logged.
    std::size_t count(kind of, std::size_t sources, std::size_t each) {
        std::size_t found = 0;
        for (std::size_t s = 0; s < sources; ++s) {
            for (std::size_t i = 0; i < each; ++i) {
                found += take(of, "10.0.0." + std::to_string(s), "no " + std::to_string(i)) ? 1U : 0U;
            }
        }
        return found;
    }

    cles::security::refused_links logged;
    cles::time_point now{1h};
};

} // namespace
} // namespace refused_links

BOOST_FIXTURE_TEST_SUITE(refused_links, fixture)

BOOST_AUTO_TEST_CASE(each_is_logged_once_a_minute) {
    BOOST_TEST(take(kind::not_member, "10.0.0.1", "a"));
    BOOST_TEST(!take(kind::not_member, "10.0.0.1", "a"));
    BOOST_TEST(take(kind::not_member, "10.0.0.1", "b"));
    BOOST_TEST(take(kind::not_member, "10.0.0.2", "a"));
    now += 1min - 1ns;
    BOOST_TEST(!take(kind::not_member, "10.0.0.1", "a"));
    now += 1ns;
    BOOST_TEST(take(kind::not_member, "10.0.0.1", "a"));
}

BOOST_AUTO_TEST_CASE(the_line_names_the_address_and_the_key) {
    using cles::security::text_of;
    BOOST_TEST(text_of({.source = "10.0.0.7", .why = "a", .key = "nJ3"}) == "a (10.0.0.7, key nJ3)");
    BOOST_TEST(text_of({.source = "10.0.0.7", .why = "a"}) == "a (10.0.0.7)");
    BOOST_TEST(text_of({.why = "a", .key = "nJ3"}) == "a (key nJ3)");
    BOOST_TEST(text_of({.why = "a"}) == "a");
}

BOOST_AUTO_TEST_CASE(another_key_of_a_source_is_logged_too) {
    const auto taken = [&](const std::string& key) {
        return logged.take({.kind = kind::not_member, .source = "10.0.0.1", .why = "a", .key = key}, now);
    };
    BOOST_TEST(taken("one"));
    BOOST_TEST(taken("two"));
    BOOST_TEST(!taken("one"));
}

BOOST_AUTO_TEST_CASE(a_source_does_not_silence_another) {
    BOOST_TEST(count(kind::by_peer, 1, 1000) == cles::security::refused_links::most_of_source);
    BOOST_TEST(take(kind::by_peer, "10.0.1.1", "a"));
}

BOOST_AUTO_TEST_CASE(strangers_do_not_silence_what_concerns_a_removed_member) {
    for (const auto of : {kind::not_member, kind::by_peer, kind::protocol, kind::busy, kind::other_name}) {
        BOOST_TEST(count(of, 200, 5) == cles::security::refused_links::most_of_kind);
    }
    BOOST_TEST(take(kind::removed, "car3", "car3 was removed"));
}

BOOST_AUTO_TEST_SUITE_END()
