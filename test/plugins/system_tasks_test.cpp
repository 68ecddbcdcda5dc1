// SPDX-License-Identifier: BSL-1.0
// The tasks of `system`, in an application's service, on this machine.
#include <cles/service.hpp>

#include "support/run_until.hpp"
#include "system/disk.hpp"
#include "system/load.hpp"
#include "system/memory.hpp"
#include "system/network.hpp"
#include "system/processes.hpp"
#include "system/system.hpp"
#include "system/utc.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include <unistd.h>

namespace system_tasks {
namespace {

constexpr std::array<const char*, 6> nouns{"utc", "load", "memory", "disk", "network", "processes"};

struct fixture {
    fixture() { sysinfo::register_tasks(node, {.interval_ms = 10, .processes = 1000}); }
    template <class T>
    T pull(const std::string& noun) {
        return cles::from_json<T>(node.request("PULL self:" + noun));
    }
    boost::asio::io_context io;
    cles::service node{io, {.name = "node"}};
};

} // namespace
} // namespace system_tasks

BOOST_FIXTURE_TEST_SUITE(system_tasks, fixture)

BOOST_AUTO_TEST_CASE(utc_is_now) {
    const auto now = std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
    BOOST_TEST(std::abs(pull<sysinfo::utc>("utc").seconds - now) < 60);
}

BOOST_AUTO_TEST_CASE(system_time_is_that_of_the_paper) {
    using clock = std::chrono::system_clock;
    for (const std::string command : {"PULL self:systemTime", "PULL self:systemTime/UTC", "DELEGATE self:systemTime",
                                      "DELEGATE self:systemTime/UTC"}) {
        const auto pairs = cles::from_json<std::map<std::string, clock::time_point>>(node.request(command));
        BOOST_TEST(pairs.size() == 1U);
        BOOST_TEST((std::chrono::abs(pairs.at("systemTime") - clock::now()) < std::chrono::minutes{1}));
    }
    BOOST_CHECK_EXCEPTION(node.request("PULL self:systemTime/TAI"), cles::error,
                          [](const cles::error& e) { return e.code() == cles::errc::bad_request; });
}

BOOST_AUTO_TEST_CASE(this_machine_makes_sense) {
    const auto load = pull<sysinfo::load>("load");
    BOOST_TEST(load.cores > 0U);
    BOOST_TEST(load.busy >= 0);
    BOOST_TEST(load.busy <= 1);
    BOOST_TEST(load.threads > 0U);
    const auto memory = pull<sysinfo::memory>("memory");
    BOOST_TEST(memory.total > 1'000'000U);
    BOOST_TEST(memory.available <= memory.total);
    BOOST_TEST(pull<sysinfo::disk>("disk").file_systems.size() > 0U);
    BOOST_TEST(pull<sysinfo::network>("network").interfaces.size() > 0U);
    const auto processes = pull<sysinfo::processes>("processes");
    BOOST_TEST(processes.count > 0U);
    const auto own = std::find_if(processes.largest.begin(), processes.largest.end(),
                                  [](const auto& p) { return p.pid == ::getpid(); });
    BOOST_REQUIRE(own != processes.largest.end());
    BOOST_TEST(own->memory > 1'000'000U);
    BOOST_TEST(own->state.size() == 1U);
}

BOOST_DATA_TEST_CASE(each_noun_is_published_once_it_has_a_subscriber, boost::unit_test::data::make(nouns), noun) {
    fixture f;
    int updates = 0;
    using json_feed = cles::feed<cles::json_text>;
    std::shared_ptr<json_feed> kept;
    std::function<void()> next = [&] {
        kept->async_next([&](boost::system::error_code code, const auto& event) {
            BOOST_REQUIRE(!code);
            if (event.kind == cles::feed_event::update) {
                BOOST_TEST(event.value.text.starts_with("{\""));
                ++updates;
            }
            if (updates < 3) {
                next();
            }
        });
    };
    f.node.async_bind(std::string{"self:"} + noun, [&](boost::system::error_code code, json_feed feed) {
        BOOST_REQUIRE(!code);
        kept = std::make_shared<json_feed>(std::move(feed));
        next();
    });
    cles::test::run_until(f.io, [&] { return updates == 3; });
}

BOOST_AUTO_TEST_CASE(a_noun_has_no_parameters_to_bind) {
    std::string words;
    bool over = false;
    node.async_bind("self:load/fast", cles::bind_options{}.diagnostics(words),
                    [&](boost::system::error_code, const cles::feed<cles::json_text>&) { over = true; });
    cles::test::run_until(io, [&] { return over; });
    BOOST_TEST(words == "node: 'load' is published without parameters");
}

BOOST_AUTO_TEST_CASE(settings_out_of_range_are_refused) {
    BOOST_CHECK_THROW(sysinfo::register_tasks(node, {.interval_ms = 1, .processes = {}}), cles::error);
    BOOST_CHECK_THROW(sysinfo::register_tasks(node, {.interval_ms = {}, .processes = 5000}), cles::error);
}

BOOST_AUTO_TEST_SUITE_END()
