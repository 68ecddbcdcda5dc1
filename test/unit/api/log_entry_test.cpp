// SPDX-License-Identifier: BSL-1.0
#include <cles/log.hpp>

#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

namespace log_entry {
namespace {

struct heard {
    cles::log_level level{};
    std::string text;
    std::string peer;
    std::uint64_t request = 0;

    cles::log_sink sink() {
        return [this](cles::log_level at, const cles::log_entry& entry) {
            level = at;
            text = entry.text;
            peer = entry.peer;
            request = entry.request;
        };
    }
};

} // namespace
} // namespace log_entry

BOOST_AUTO_TEST_SUITE(log_entry)

BOOST_AUTO_TEST_CASE(a_sink_may_take_only_the_text) {
    std::string text;
    const cles::log_sink sink = [&](cles::log_level, std::string_view words) { text = words; };
    sink(cles::log_level::info, {"car2 is there", "tcp://127.0.0.1:1", 7});
    BOOST_TEST(text == "car2 is there");
}

BOOST_AUTO_TEST_CASE(a_text_on_its_own_has_no_peer_and_id) {
    heard last;
    last.sink()(cles::log_level::debug, std::string{"listening"});
    BOOST_TEST(last.text == "listening");
    BOOST_TEST(last.peer == "");
    BOOST_TEST(last.request == 0U);
}

BOOST_AUTO_TEST_CASE(an_entry_about_a_request_has_peer_and_id) {
    heard last;
    const auto errors = [sink = last.sink()](cles::log_level at, const cles::log_entry& entry) {
        if (at == cles::log_level::error) { // the denial is logged too
            sink(at, entry);
        }
    };
    cles::test::test_node node{
        {}, [](const cles::access&) -> bool { throw std::runtime_error{"the data base is gone"}; }, errors};
    cles::test::test_link link{node};
    link.ask("PULL car1:cles id=7");
    BOOST_TEST((last.level == cles::log_level::error));
    BOOST_TEST(last.text == "denied, because the access rules threw an exception: the data base is gone");
    BOOST_TEST(last.peer == "tcp://127.0.0.1:1");
    BOOST_TEST(last.request == 7U);
}

BOOST_AUTO_TEST_CASE(an_entry_about_a_link_has_its_peer) {
    heard last;
    cles::test::test_node node{{}, {}, last.sink()};
    cles::test::test_link link{node};
    link.ask("Host: 127.0.0.1");
    BOOST_TEST((last.level == cles::log_level::warning));
    BOOST_TEST(last.peer == "tcp://127.0.0.1:1");
    BOOST_TEST(last.request == 0U);
}

BOOST_AUTO_TEST_CASE(an_entry_of_a_handler_has_its_request) {
    heard last;
    cles::test::test_node node{{}, {}, last.sink()};
    node.on_later(cles::verb::delegate, "work");
    cles::test::test_link link{node};
    link.ask("DELEGATE car1:work id=9");
    BOOST_REQUIRE_EQUAL(node.started.size(), 1U);
    node.started[0]->call->write_log(cles::log_level::info, "half done");
    BOOST_TEST(last.text == "half done");
    BOOST_TEST(last.peer == "tcp://127.0.0.1:1");
    BOOST_TEST(last.request == 9U);
    link.reset();
    node.started[0]->call->write_log(cles::log_level::info, "for nobody");
    BOOST_TEST(last.peer == "");
    BOOST_TEST(last.request == 9U);
}

BOOST_AUTO_TEST_SUITE_END()
