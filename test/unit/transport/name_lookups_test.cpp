// SPDX-License-Identifier: BSL-1.0
#include "transport/name_lookups.hpp"

#include <boost/asio/error.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <vector>

namespace name_lookups {
namespace {

using cles::time_point;
using lookups = cles::transport::name_lookups;
using step = lookups::step;
using tickets = std::vector<lookups::ticket>;
using boost::asio::ip::make_address;
using namespace std::chrono_literals;

const time_point start{1h};
const lookups::outcome found{.found = {make_address("10.0.0.1")}};
const lookups::outcome unknown{.code = boost::asio::error::host_not_found};

struct fixture {
    step ask(const std::string& name, lookups::ticket who, time_point now = start) {
        return all.ask(name, who, now).what;
    }

    lookups all{{.at_once = 2, .names = 4}};
};

} // namespace
} // namespace name_lookups

BOOST_FIXTURE_TEST_SUITE(name_lookups, fixture)

BOOST_AUTO_TEST_CASE(a_slow_name_does_not_delay_another) {
    BOOST_TEST((ask("slow", 1) == step::start));
    BOOST_TEST((ask("good", 2) == step::start));
    BOOST_TEST((all.finish("good", found, start) == tickets{2}));
}

BOOST_AUTO_TEST_CASE(a_name_is_looked_up_once_for_all_who_ask) {
    BOOST_TEST((ask("car1", 1) == step::start));
    BOOST_TEST((ask("car1", 2) == step::waits));
    BOOST_TEST((all.finish("car1", found, start) == tickets{1, 2}));
}

BOOST_AUTO_TEST_CASE(a_result_is_kept_for_ten_seconds) {
    BOOST_TEST((ask("car1", 1) == step::start));
    all.finish("car1", found, start);
    const auto again = all.ask("car1", 2, start + 9'999ms);
    BOOST_TEST((again.what == step::known));
    BOOST_TEST((again.now_known.found == found.found));
    BOOST_TEST((ask("car1", 3, start + 10s) == step::start));
    BOOST_TEST((all.finish("car1", found, start + 10s) == tickets{3}));
}

BOOST_AUTO_TEST_CASE(a_failure_is_kept_for_one_second) {
    BOOST_TEST((ask("car1", 1) == step::start));
    all.finish("car1", unknown, start);
    const auto again = all.ask("car1", 2, start + 999ms);
    BOOST_TEST((again.what == step::known));
    BOOST_TEST((again.now_known.code == unknown.code));
    BOOST_TEST((ask("car1", 3, start + 1s) == step::start));
}

BOOST_AUTO_TEST_CASE(beyond_the_number_at_once_names_wait_for_their_turn) {
    BOOST_TEST((ask("slow1", 1) == step::start));
    BOOST_TEST((ask("slow2", 2) == step::start));
    BOOST_TEST((ask("car1", 3) == step::waits));
    BOOST_TEST((ask("car2", 4) == step::waits));
    BOOST_TEST(!all.next());
    all.finish("slow1", unknown, start);
    BOOST_TEST((all.next() == "car1"));
    BOOST_TEST(!all.next());
    BOOST_TEST((all.finish("car1", found, start) == tickets{3}));
    BOOST_TEST((all.next() == "car2"));
}

BOOST_AUTO_TEST_CASE(a_name_for_which_nobody_waits_any_more_is_not_looked_up) {
    ask("slow1", 1);
    ask("slow2", 2);
    ask("car1", 3);
    ask("car1", 4);
    all.forget("car1", 3);
    all.forget("car1", 4);
    all.finish("slow1", unknown, start);
    BOOST_TEST(!all.next());
}

BOOST_AUTO_TEST_CASE(a_lookup_that_runs_goes_on_for_those_who_ask_later) {
    ask("car1", 1);
    all.forget("car1", 1);
    BOOST_TEST((ask("car1", 2) == step::waits));
    BOOST_TEST((all.finish("car1", found, start) == tickets{2}));
    BOOST_TEST((ask("car1", 3) == step::known));
}

BOOST_AUTO_TEST_CASE(what_could_not_begin_is_not_kept) {
    ask("car1", 1);
    BOOST_TEST((all.abort("car1") == tickets{1}));
    BOOST_TEST((ask("car1", 2) == step::start));
    BOOST_TEST((ask("car2", 3) == step::start)); // the turn was given back
}

BOOST_AUTO_TEST_CASE(names_are_limited_and_the_oldest_results_make_space) {
    ask("car1", 1);
    all.finish("car1", found, start);
    ask("car2", 2);
    ask("car3", 3);
    ask("car4", 4);
    BOOST_TEST((ask("car5", 5, start + 9s) == step::refused));
    BOOST_TEST((ask("car5", 5, start + 10s) == step::waits));
    BOOST_TEST((ask("car6", 6, start + 1h) == step::refused)); // the others are being looked up, or wait
}

BOOST_AUTO_TEST_CASE(in_a_child_process_the_running_ones_begin_anew) {
    ask("car1", 1);
    ask("car2", 2);
    ask("car3", 3);
    all.finish("car1", found, start);
    BOOST_TEST((all.running() == std::vector<std::string>{"car2"}));
}

BOOST_AUTO_TEST_CASE(the_address_that_answered_is_remembered_by_place) {
    BOOST_TEST(!all.preferred("tcp://car1:4000"));
    all.prefer("tcp://car1:4000", make_address("10.0.0.2"));
    all.prefer("udp://car1:4000", make_address("10.0.0.3"));
    all.prefer("tcp://car1:4000", make_address("10.0.0.4"));
    BOOST_TEST((all.preferred("tcp://car1:4000") == make_address("10.0.0.4")));
    BOOST_TEST((all.preferred("udp://car1:4000") == make_address("10.0.0.3")));
    for (int i = 0; i < 200; ++i) {
        all.prefer("tcp://other:" + std::to_string(i), make_address("10.0.0.5"));
    }
    BOOST_TEST(!all.preferred("tcp://car1:4000"));
}

BOOST_AUTO_TEST_SUITE_END()
