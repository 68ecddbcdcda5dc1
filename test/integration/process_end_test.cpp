// SPDX-License-Identifier: BSL-1.0
// How processes end: with services in static objects, and as children of a process that goes on with its services.

#include <cles/responder.hpp>
#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/feed_log.hpp"
#include "support/group_address.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

BOOST_AUTO_TEST_SUITE(process_end)

using namespace cles::test;

namespace {

// Made before anything that the library keeps in static objects, and so destroyed after it.
std::optional<boost::asio::io_context> context_of_process;
std::optional<cles::service> service_of_process;

// The status of a child process in which a function runs; 1 if it throws.
template <class F>
int status_of_child(F function) {
    const auto child = ::fork();
    BOOST_REQUIRE(child >= 0);
    if (child == 0) {
        try {
            function();
        } catch (...) {
            ::_exit(1);
        }
        ::_exit(0);
    }
    int status = 0;
    BOOST_REQUIRE(::waitpid(child, &status, 0) == child);
    return status;
}

bool exists(const std::string& path) {
    struct stat what {};
    return ::lstat(path.c_str(), &what) == 0;
}

std::string path_of(const std::string& unix_url) { return unix_url.substr(std::string{"unix://"}.size()); }

constexpr std::array carriers{carrier::tcp4, carrier::unix_file, carrier::unix_abstract, carrier::inproc,
                              carrier::udp4};

/// A service that a program shares with its children, and another one that knows it.
struct parent {
    parent() {
        auto options = listening("car1");
        options.listen.push_back(file);
        options.multicast = fresh_group();
        car = std::make_unique<cles::service>(*io, options);
        car->on_pull("speed", [] { return 7; });
        car->on_pull("later", [this](const cles::request&, cles::responder answer) { held = std::move(answer); });
        car->update("position", 1);
    }
    void end() {
        held.reset();
        feed.reset();
        user.reset();
        car.reset();
        io.reset();
    }

    const std::string file = fresh_address(carrier::unix_file);
    std::unique_ptr<boost::asio::io_context> io = std::make_unique<boost::asio::io_context>();
    std::unique_ptr<cles::service> car;
    std::unique_ptr<cles::service> user = std::make_unique<cles::service>(*io, cles::service_options{.name = "user"});
    std::unique_ptr<feed_log> feed = std::make_unique<feed_log>();
    std::optional<cles::responder> held;
};

} // namespace

CLES_DATA_TEST_CASE(a_static_service_is_destroyed_at_exit, carriers, kind) {
    const auto status = status_of_child([kind = kind] {
        context_of_process.emplace();
        service_of_process.emplace(*context_of_process, listening("car1", kind));
        service_of_process->on_pull("speed", [] { return 27.5; });
        service_of_process->update("position", 3);
        std::exit(0); // NOLINT(concurrency-mt-unsafe)
    });
    BOOST_TEST(status == 0);
}

BOOST_FIXTURE_TEST_CASE(a_child_that_ends_leaves_what_its_parent_uses, parent) {
    for (const auto& url : car->endpoints()) {
        answer<> early;
        answer<> late;
        user->async_request("PULL car1:later", late.options().at(url).deadline(patience), late.take());
        feed = std::make_unique<feed_log>();
        feed->bind(*user, "car1:position", cles::bind_options{}.at(url));
        user->async_request("PULL car1:speed", early.options().at(url), early.take());
        run_until(*io, [&] { return early.done() && held && feed->bound; });

        BOOST_TEST(status_of_child([this] { end(); }) == 0);

        car->update("position", 2);
        held->done(8);
        held.reset();
        run_until(*io, [&] { return late.done() && feed->count(cles::feed_event::update) != 0; });
        BOOST_TEST(late.value.text == R"({"value":8})", late.words);
        BOOST_TEST(feed->count(cles::feed_event::lost) == 0U);

        BOOST_TEST(exists(path_of(file)));
        cles::service other{*io, {.name = "other"}};
        answer<> fresh;
        other.async_request("PULL car1:speed", fresh.options().at(url), fresh.take());
        run_until(*io, [&] { return fresh.done(); });
        BOOST_TEST(fresh.value.text == R"({"value":7})", fresh.words);
    }
}

BOOST_FIXTURE_TEST_CASE(a_child_that_goes_on_in_place_of_its_parent_ends_the_service, parent) {
    BOOST_TEST(exists(path_of(file)));
    io->notify_fork(boost::asio::io_context::fork_prepare);
    const auto status = status_of_child([this] {
        io->notify_fork(boost::asio::io_context::fork_child);
        end();
    });
    io->notify_fork(boost::asio::io_context::fork_parent);
    BOOST_TEST(status == 0);
    BOOST_TEST(!exists(path_of(file)));
}

#ifndef __SANITIZE_THREAD__ // which ends a child that starts threads if its parent had some
BOOST_FIXTURE_TEST_CASE(a_child_that_goes_on_looks_up_names_as_its_parent_did, parent) {
    const auto is_refused = [this](const std::string& where) {
        answer<> a;
        user->async_request("PULL far:speed", a.options().at(where).deadline(patience), a.take());
        run_until(*io, [&] { return a.done(); });
        return a.code.failed();
    };
    BOOST_TEST(is_refused("tcp://far.invalid:1"));
    io->notify_fork(boost::asio::io_context::fork_prepare);
    const auto status = status_of_child([&] {
        io->notify_fork(boost::asio::io_context::fork_child);
        const bool is_first = is_refused("tcp://far.invalid:1");
        const bool is_other = is_refused("tcp://other.invalid:1");
        end();
        ::_exit(is_first && is_other ? 0 : 2);
    });
    io->notify_fork(boost::asio::io_context::fork_parent);
    BOOST_TEST(status == 0);
    BOOST_TEST(is_refused("tcp://another.invalid:1"));
}
#endif

BOOST_AUTO_TEST_SUITE_END()
