// SPDX-License-Identifier: BSL-1.0
// Jobs that bind nouns of other nodes while they serve a request.

#include <cles/job_feed.hpp>
#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/metric.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace job_feeds {
namespace {

using namespace cles::test;
using cles::errc;
using cles::feed_event;

// What a job has received, as text.
struct log_of_events {
    cles::event_callback taker() {
        return [this](boost::system::error_code code, const cles::job_event& event) {
            ended += code ? 1 : 0;
            last_code = code;
            all.push_back(code                                ? "ended: " + std::string{event.text}
                          : event.kind == feed_event::gap     ? "gap " + std::to_string(event.missed)
                          : event.kind == feed_event::current ? "current " + std::string{event.json}
                          : event.kind == feed_event::update
                              ? std::to_string(event.seq) + " " + std::string{event.publisher} + " " +
                                    std::to_string(event.as<int>())
                          : event.kind == feed_event::lost ? "lost"
                                                           : "rebound");
        };
    }

    std::vector<std::string> all;
    int ended = 0;
    boost::system::error_code last_code;
};

// The user sends a request to the car, whose job binds what the tower publishes.
struct nodes {
    nodes() {
        tower->on_bind("wind");
        tower->on_bind("secret", [](const cles::request&) { throw cles::error(errc::denied, "not for you"); });
        car->on_delegate("job", [this](const cles::request&, const cles::responder& answer) { begin(answer); });
    }
    void ask() { user->async_request("DELEGATE car:job", user_answer.options(), user_answer.take()); }
    template <class F>
    void until(F f) {
        run_until(io, std::move(f));
    }
    /// Has the job bind, and waits for its first event, which is the current value.
    void bind(const cles::bind_options& options = {}) {
        tower->update("wind", 0);
        begin = [this, options](const cles::responder& answer) {
            job = std::make_unique<cles::responder>(answer);
            feed = answer.bind("tower:wind", options);
            feed.next(log.taker());
        };
        ask();
        until([&] { return log.all.size() == 1; });
        BOOST_TEST(log.all.front() == R"(current {"value":0})");
    }
    /// How many updates the tower sends to its subscribers if it publishes one.
    std::uint64_t delivered() {
        run_ready(io);
        const auto before = metric(*tower, "updates_delivered");
        tower->update("wind", -1);
        run_ready(io);
        return metric(*tower, "updates_delivered") - before;
    }

    boost::asio::io_context io;
    std::unique_ptr<cles::service> tower = std::make_unique<cles::service>(io, listening("tower"));
    std::unique_ptr<cles::service> car = std::make_unique<cles::service>(io, [this] {
        auto options = listening("car");
        options.peers.emplace("tower", tower->endpoints().front());
        return options;
    }());
    std::unique_ptr<cles::service> user = std::make_unique<cles::service>(io, knowing("user", *car));

    std::function<void(const cles::responder&)> begin = [](const cles::responder&) {};
    std::unique_ptr<cles::responder> job;
    cles::job_feed feed;
    log_of_events log;
    answer<> user_answer;
};

// Adds up to three updates, and replies with the sum.
void add_up(const cles::responder& job, const cles::job_feed& from, int sum, int left) {
    from.next([job, from, sum, left](boost::system::error_code code, const cles::job_event& event) {
        BOOST_TEST(!code);
        const int next = sum + event.as<int>();
        if (left == 1) {
            job.done(next);
        } else {
            add_up(job, from, next, left - 1);
        }
    });
}

} // namespace
} // namespace job_feeds

BOOST_FIXTURE_TEST_SUITE(job_feeds, nodes)

BOOST_AUTO_TEST_CASE(a_job_follows_what_another_node_publishes) {
    begin = [](const cles::responder& answer) { add_up(answer, answer.bind("tower:wind"), 0, 3); };
    ask();
    until([&] { // it is bound after some time
        if (!user_answer.done()) {
            tower->update("wind", 7);
        }
        return user_answer.done();
    });
    BOOST_TEST(user_answer.value.text == R"({"value":21})");
    BOOST_TEST(delivered() == 0U); // the binding has ended with the job
}

BOOST_AUTO_TEST_CASE(a_job_binds_nouns_of_its_own_node_too) {
    car->update("heading", 90);
    begin = [this](const cles::responder& answer) {
        const auto own = answer.bind("self:heading");
        own.next([this, answer, own](boost::system::error_code code, const cles::job_event& event) {
            log.taker()(code, event);
            answer.done();
        });
    };
    ask();
    until([&] { return user_answer.done(); });
    BOOST_TEST(log.all == (std::vector<std::string>{R"(current {"value":90})"}), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(nothing_comes_unasked_and_what_is_too_much_is_a_gap) {
    bind(cles::bind_options{}.keep(2));
    for (int i = 1; i <= 10; ++i) {
        tower->update("wind", i);
        run_ready(io);
    }
    BOOST_TEST(log.all.size() == 1U);
    for (std::size_t i = 0; i < 3; ++i) {
        feed.next(log.taker());
        BOOST_TEST(log.all.size() == 1 + i); // never inside the call
        until([&] { return log.all.size() == 2 + i; });
    }
    log.all.erase(log.all.begin());
    BOOST_TEST(log.all == (std::vector<std::string>{"gap 8", "10 tower 9", "11 tower 10"}),
               boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(without_a_number_64_updates_wait) {
    bind();
    for (int i = 1; i <= 100; ++i) {
        tower->update("wind", i);
        run_ready(io);
    }
    feed.next(log.taker());
    until([&] { return log.all.size() == 2; });
    BOOST_TEST(log.all.back() == "gap 36");
}

BOOST_AUTO_TEST_CASE(a_publisher_that_is_lost_and_comes_back_is_told) {
    bind();
    const auto where = tower->endpoints().front();
    tower.reset();
    feed.next(log.taker());
    until([&] { return log.all.size() == 2; });
    BOOST_TEST(log.all.back() == "lost");
    tower = std::make_unique<cles::service>(io, cles::service_options{.name = "tower", .listen = {where}});
    tower->on_bind("wind");
    feed.next(log.taker());
    until([&] { return log.all.size() == 3; });
    BOOST_TEST(log.all.back() == "rebound");
}

BOOST_AUTO_TEST_CASE(a_feed_ends_with_the_answer_of_its_job) {
    bind();
    feed.next(log.taker());
    job->done();
    until([&] { return log.ended == 1 && user_answer.done(); });
    BOOST_TEST(log.last_code == cles::make_error_code(errc::cancelled));
    BOOST_TEST(delivered() == 0U);
    feed.next(log.taker());
    BOOST_TEST(log.ended == 1); // never inside the call
    until([&] { return log.ended == 2; });
    BOOST_TEST(log.last_code == cles::make_error_code(errc::cancelled));
}

BOOST_AUTO_TEST_CASE(a_feed_ends_when_its_job_is_withdrawn) {
    tower->update("wind", 0);
    int stopped = 0;
    begin = [&](const cles::responder& answer) {
        job = std::make_unique<cles::responder>(answer);
        feed = answer.bind("tower:wind");
        feed.next(log.taker());
        answer.on_stop([&] { ++stopped; });
    };
    boost::asio::cancellation_signal withdraw;
    user->async_request("DELEGATE car:job", user_answer.options(),
                        boost::asio::bind_cancellation_slot(withdraw.slot(), user_answer.take()));
    until([&] { return log.all.size() == 1; });
    feed.next(log.taker());
    withdraw.emit(boost::asio::cancellation_type::terminal);
    until([&] { return log.ended == 1 && stopped == 1; });
    BOOST_TEST(log.last_code == cles::make_error_code(errc::cancelled));
    BOOST_TEST(delivered() == 0U);
    feed = job->bind("tower:wind");
    feed.next(log.taker());
    until([&] { return log.ended == 2; });
    BOOST_TEST(log.all.back() == "ended: the job has already ended");
}

BOOST_AUTO_TEST_CASE(it_ends_where_it_is_closed_or_the_last_copy_is_gone) {
    bind();
    feed.next(log.taker());
    feed.close();
    BOOST_TEST(log.ended == 0);
    until([&] { return log.ended == 1; });
    BOOST_TEST(delivered() == 0U);
    feed = job->bind("tower:wind");
    feed.next(log.taker());
    until([&] { return log.all.back() == R"(current {"value":-1})"; });
    BOOST_TEST(delivered() == 1U);
    feed = {};
    BOOST_TEST(!feed.is_open());
    BOOST_CHECK_THROW(feed.next(log.taker()), cles::error);
    run_ready(io);
    BOOST_TEST(delivered() == 0U);
    job->done();
}

BOOST_AUTO_TEST_CASE(why_it_cannot_be_bound_is_told_by_the_first_event) {
    std::vector<cles::job_feed> all;
    begin = [&](const cles::responder& answer) {
        for (const auto* noun : {"tower:secret", "nobody:wind", "tower", "tower:wind"}) {
            all.push_back(answer.bind(noun, cles::bind_options{}.multicast(std::string{noun} == "tower:wind")));
            all.back().next(log.taker());
        }
        job = std::make_unique<cles::responder>(answer);
    };
    ask();
    until([&] { return log.ended == 4; });
    const auto one_says = [&](const std::string& part) {
        return std::any_of(log.all.begin(), log.all.end(), [&](const auto& s) { return s.find(part) != s.npos; });
    };
    BOOST_TEST(one_says("tower: not for you"));
    BOOST_TEST(one_says("nobody"));
    BOOST_TEST(one_says("bind_options::multicast is not for the feed of a job"));
    const auto before = log.all.size();
    all.front().next(log.taker()); // the reason stays
    until([&] { return log.all.size() == before + 1; });
    BOOST_TEST(log.all.back() == "ended: tower: not for you");
    BOOST_TEST(log.last_code == cles::make_error_code(errc::denied));
}

BOOST_AUTO_TEST_CASE(one_event_is_awaited_at_a_time) {
    bind();
    feed.next(log.taker());
    feed.next([this](boost::system::error_code code, const cles::job_event& event) {
        BOOST_TEST(code == cles::make_error_code(errc::busy));
        log.taker()({}, {.kind = feed_event::gap, .missed = event.missed});
    });
    until([&] { return log.all.size() == 2; });
    tower->update("wind", 1);
    until([&] { return log.all.size() == 3; });
    BOOST_TEST(log.all.back() == "2 tower 1");
}

BOOST_AUTO_TEST_CASE(a_job_has_so_many_feeds_and_no_more) {
    std::vector<cles::job_feed> all;
    begin = [&](const cles::responder& answer) {
        job = std::make_unique<cles::responder>(answer);
        for (int i = 0; i < 65; ++i) {
            all.push_back(answer.bind("tower:wind/" + std::to_string(i)));
        }
        all.back().next(log.taker());
    };
    ask();
    until([&] { return log.ended == 1; });
    BOOST_TEST(log.last_code == cles::make_error_code(errc::busy));
    all.clear();
    run_ready(io);
    tower->update("wind", 1);
    feed = job->bind("tower:wind"); // there is place again
    feed.next(log.taker());
    until([&] { return log.all.size() == 2; });
    BOOST_TEST(log.all.back() == R"(current {"value":1})");
}

BOOST_AUTO_TEST_CASE(what_its_callback_throws_is_the_answer) {
    tower->update("wind", 0);
    begin = [this](const cles::responder& answer) {
        feed = answer.bind("tower:wind");
        job = std::make_unique<cles::responder>(answer);
        feed.next([](boost::system::error_code, const cles::job_event& event) {
            static_cast<void>(event.as<std::vector<int>>());
        });
    };
    ask();
    until([&] { return user_answer.done(); });
    BOOST_TEST(user_answer.code == cles::make_error_code(errc::failed));
    BOOST_TEST(user_answer.words.starts_with("car: the update is invalid: "));
}

BOOST_AUTO_TEST_CASE(destroying_a_service_ends_the_feeds_of_its_jobs) {
    bind();
    feed.next(log.taker());
    car.reset();
    until([&] { return log.ended == 1; });
    BOOST_TEST(log.last_code == cles::make_error_code(errc::stopped));
    feed = job->bind("tower:wind");
    feed.next(log.taker());
    until([&] { return log.ended == 2; });
    BOOST_TEST(log.all.back() == "ended: the service has been stopped");
    job.reset();
    feed = {};
}

// As in add_up, the callback owns the feed and the job.
BOOST_AUTO_TEST_CASE(what_a_callback_owns_goes_with_the_loop_that_no_longer_runs) {
    answer<> never;
    const auto owned = std::make_shared<int>(0);
    auto loop = std::make_unique<boost::asio::io_context>();
    {
        cles::service there{*loop, listening("there")};
        there.on_bind("wind");
        bool has_begun = false;
        there.on_delegate("job", [&has_begun, owned](const cles::request&, const cles::responder& answer) {
            const auto from = answer.bind("there:wind");
            from.next([from, answer, owned](boost::system::error_code, const cles::job_event&) {});
            has_begun = true;
        });
        there.async_request("DELEGATE there:job", never.options(), never.take());
        run_until(*loop, [&] { return has_begun; });
        run_ready(*loop); // it is bound
    }
    loop.reset();
    BOOST_TEST(owned.use_count() == 1);
}

BOOST_AUTO_TEST_SUITE_END()
