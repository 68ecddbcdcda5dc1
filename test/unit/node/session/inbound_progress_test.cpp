// SPDX-License-Identifier: BSL-1.0
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <limits>
#include <string>

namespace inbound_progress {
namespace {

using cles::verb;

struct fixture {
    fixture() {
        node.on_later(verb::delegate, "work");
        node.on_later(verb::push, "store");
    }
    cles::core::call& call(std::size_t i = 0) { return *node.started.at(i)->call; }

    cles::test::test_node node;
    cles::test::test_link link{node};
};

} // namespace
} // namespace inbound_progress

BOOST_FIXTURE_TEST_SUITE(inbound_progress, fixture)

BOOST_AUTO_TEST_CASE(any_number_of_interim_replies_may_precede_the_result) {
    link.ask("DELEGATE car1:work id=7 progress=yes");
    BOOST_TEST(call().progress(0, "{}"));
    BOOST_TEST(call().progress(0.4, "{\"at\":\"x\"}"));
    BOOST_TEST(call().progress(1, "{}"));
    call().done("[1]");
    BOOST_TEST(link.take() == "id=7 progress=0 {}\nid=7 progress=0.4 {\"at\":\"x\"}\nid=7 progress=1 {}\nid=7 [1]\n");
}

BOOST_AUTO_TEST_CASE(progress_lies_between_0_and_1_and_never_falls) {
    link.ask("DELEGATE car1:work id=7 progress=yes");
    for (const double fraction : {-1.0, 0.5, 0.25, 0.5, 7.0, 0.9, std::numeric_limits<double>::quiet_NaN()}) {
        call().progress(fraction, "{}");
    }
    BOOST_TEST(link.take() == "id=7 progress=0 {}\nid=7 progress=0.5 {}\nid=7 progress=0.5 {}\nid=7 progress=0.5 {}\n"
                              "id=7 progress=1 {}\nid=7 progress=1 {}\nid=7 progress=1 {}\n");
}

BOOST_AUTO_TEST_CASE(without_progress_yes_there_is_none) {
    link.ask("DELEGATE car1:work id=7");
    BOOST_TEST(!call().progress(0.5, "{}"));
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(without_an_id_there_is_none) {
    link.ask("DELEGATE car1:work progress=yes");
    BOOST_TEST(!call().progress(0.5, "{}"));
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(on_another_verb_than_delegate_there_is_none) {
    link.ask("PUSH car1:store id=7 progress=yes");
    BOOST_TEST(!call().progress(0.5, "{}"));
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(after_the_result_there_is_none) {
    link.ask("DELEGATE car1:work id=7 progress=yes");
    call().done("[1]");
    link.take();
    BOOST_TEST(!call().progress(0.5, "{}"));
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(progress_wakes_the_link) {
    link.ask("DELEGATE car1:work id=7 progress=yes");
    const auto before = link.wakes;
    call().progress(0.5, "{}");
    BOOST_TEST(link.wakes == before + 1);
}

BOOST_AUTO_TEST_CASE(details_that_are_not_objects_are_wrapped_like_results) {
    link.ask("DELEGATE car1:work id=7 progress=yes");
    call().progress(0.1, "5");
    call().progress(0.2, "");
    call().progress(0.3, "[1]");
    BOOST_TEST(link.take() == "id=7 progress=0.1 {\"value\":5}\nid=7 progress=0.2 {}\nid=7 progress=0.3 [1]\n");
}

BOOST_AUTO_TEST_CASE(a_slow_peer_gets_no_more_progress) {
    link.ask("DELEGATE car1:work id=7 progress=yes");
    link.behind = true;
    BOOST_TEST(node.started.at(0)->call->progress(0.2, "{}"));
    BOOST_TEST(link.take().empty());
    link.behind = false;
    BOOST_TEST(node.started.at(0)->call->progress(0.3, "{}"));
    BOOST_TEST(link.take() == "id=7 progress=0.3 {}\n");
}

BOOST_AUTO_TEST_CASE(details_that_exceed_a_line_are_left_out) {
    cles::test::test_node small{cles::limits{.line = 100}};
    small.on_later(verb::delegate, "work");
    cles::test::test_link narrow{small};
    narrow.ask("DELEGATE car1:work id=7 progress=yes");
    small.started.at(0)->call->progress(0.5, "[\"" + std::string(200, 'x') + "\"]");
    BOOST_TEST(narrow.take() == "id=7 progress=0.5 {}\n");
}

BOOST_AUTO_TEST_CASE(details_whose_first_key_is_error_are_not_a_failure) {
    link.ask("DELEGATE car1:work id=7 progress=yes");
    call().progress(0.5, "{\"error\":\"x\"}");
    BOOST_TEST(link.take() == "id=7 progress=0.5 {\"error\":\"x\"}\n");
    call().done("[1]");
    BOOST_TEST(link.take() == "id=7 [1]\n");
}

BOOST_AUTO_TEST_SUITE_END()
