// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_jobs.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <functional>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace plugin_jobs {
namespace {

using cles::responder;
using cles::runtime::plugin_callback;

// The calls that a responder receives, and on which thread.
class recorder final : public cles::detail::call_control {
  public:
    explicit recorder(boost::asio::io_context& io) : io_(io) {}
    void done(std::string_view json) override { tell("done " + std::string{json}); }
    void fail(cles::errc code, std::string_view) override { tell("fail " + std::string{cles::wire_name(code)}); }
    bool progress(double, std::string_view) override { return true; }
    void on_stop(std::function<void()>) override {}
    [[nodiscard]] bool stopped() const noexcept override { return false; }
    void delegate(std::string_view, const cles::call_options&, cles::answer_callback) override {}
    void log(cles::log_level, std::string_view text) override { tell("log " + std::string{text}); }
    [[nodiscard]] boost::asio::any_io_executor executor() const override { return io_.get_executor(); }

    std::vector<std::string> told;

  private:
    void tell(std::string what) {
        if (std::this_thread::get_id() != home_) {
            what += " on another thread";
        }
        told.push_back(std::move(what));
    }
    boost::asio::io_context& io_;
    std::thread::id home_ = std::this_thread::get_id();
};

struct fixture {
    cles::runtime::plugin_jobs::id open() { return jobs.open(responder{record}); }
    static void elsewhere(const std::function<void()>& f) { std::thread{f}.join(); }
    static void done(const responder& to) { to.done(1); }

    boost::asio::io_context io;
    std::shared_ptr<recorder> record = std::make_shared<recorder>(io);
    cles::runtime::plugin_jobs jobs;
};

// A callback that counts.
struct counted {
    int calls = 0;
    int drops = 0;
    std::function<void()> callback() {
        return plugin_callback([](void* user) { ++static_cast<counted*>(user)->calls; },
                               [](void* user) { ++static_cast<counted*>(user)->drops; }, this);
    }
};

} // namespace
} // namespace plugin_jobs

BOOST_FIXTURE_TEST_SUITE(plugin_jobs, fixture)

BOOST_AUTO_TEST_CASE(handles_are_never_0_and_not_used_again) {
    std::set<std::uint64_t> seen;
    for (int i = 0; i < 1000; ++i) {
        const auto job = open();
        BOOST_TEST(job != 0U);
        BOOST_TEST(seen.insert(job).second);
        jobs.finish(job, done);
    }
    BOOST_TEST(jobs.size() == 0U);
}

BOOST_AUTO_TEST_CASE(while_it_starts_its_own_thread_answers_at_once) {
    BOOST_TEST(jobs.finish(open(), done));
    BOOST_TEST(record->told == (std::vector<std::string>{"done 1"}), boost::test_tools::per_element());
    BOOST_TEST(jobs.take_if_direct(open()).has_value());
}

BOOST_AUTO_TEST_CASE(from_elsewhere_or_later_the_answer_is_posted) {
    const auto first = open();
    elsewhere([&] {
        BOOST_TEST(!jobs.take_if_direct(first).has_value());
        BOOST_TEST(jobs.finish(first, done));
    });
    const auto second = open();
    jobs.started(second);
    BOOST_TEST(jobs.finish(second, done));
    BOOST_TEST(record->told.empty());
    cles::test::run_ready(io);
    BOOST_TEST(record->told == (std::vector<std::string>{"done 1", "done 1"}), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(duplicates_are_counted_and_dropped) {
    const auto job = open();
    BOOST_TEST(jobs.finish(job, done));
    BOOST_TEST(!jobs.finish(job, done));
    BOOST_TEST(!jobs.finish(0, done));
    BOOST_TEST(!jobs.finish(~std::uint64_t{0}, done));
    BOOST_TEST(!jobs.use(job, done));
    BOOST_TEST(jobs.unknown_answers() == 3U);
    BOOST_TEST(record->told.size() == 1U);
    BOOST_TEST(jobs.stopped(job));
}

BOOST_AUTO_TEST_CASE(a_job_is_stopped_once_and_notified) {
    counted c;
    const auto job = open();
    BOOST_TEST(!jobs.stopped(job));
    jobs.on_stop(job, c.callback());
    jobs.stop(job)();
    BOOST_TEST(!jobs.stop(job));
    BOOST_TEST(jobs.stopped(job));
    BOOST_TEST(c.calls == 1);
    BOOST_TEST(c.drops == 1);
    counted late;
    jobs.on_stop(job, late.callback());
    BOOST_TEST(late.calls == 1);
    BOOST_TEST(late.drops == 1);
    BOOST_TEST(jobs.finish(job, done)); // it may still reply
}

BOOST_AUTO_TEST_CASE(a_callback_is_dropped_uncalled_when_its_job_is_answered_or_gone_or_another_takes_its_place) {
    counted answered;
    counted replaced;
    counted gone;
    const auto job = open();
    jobs.on_stop(job, replaced.callback());
    jobs.on_stop(job, answered.callback());
    BOOST_TEST(replaced.drops == 1);
    jobs.finish(job, done);
    jobs.on_stop(job, gone.callback());
    for (const auto* c : {&answered, &replaced, &gone}) {
        BOOST_TEST(c->calls == 0);
        BOOST_TEST(c->drops == 1);
    }
}

// A job on a pool, whose responder may be used on any thread.
class pooled_recorder final : public cles::detail::call_control {
  public:
    void done(std::string_view) override { ++answers; }
    void fail(cles::errc, std::string_view) override { ++answers; }
    bool progress(double, std::string_view) override { return true; }
    void on_stop(std::function<void()> callback) override { wanted = std::move(callback); }
    [[nodiscard]] bool stopped() const noexcept override { return is_stopped; }
    void delegate(std::string_view, const cles::call_options&, cles::answer_callback) override {}
    void log(cles::log_level, std::string_view) override {}
    [[nodiscard]] boost::asio::any_io_executor executor() const override { return {}; }
    [[nodiscard]] bool is_thread_safe() const noexcept override { return true; }

    std::function<void()> wanted;
    bool is_stopped = false;
    int answers = 0;
};

BOOST_AUTO_TEST_CASE(a_job_on_a_pool_is_answered_where_it_answers_and_stops_when_the_pool_says_so) {
    const auto pooled = std::make_shared<pooled_recorder>();
    counted c;
    const auto job = jobs.open(responder{pooled});
    jobs.started(job);
    jobs.on_stop(job, c.callback());
    pooled->is_stopped = true;
    BOOST_TEST(jobs.stopped(job));
    // It replies before it is told to stop; it is told nevertheless, once, although the end would also tell it.
    elsewhere([&] { BOOST_TEST(jobs.finish(job, done)); });
    BOOST_TEST(pooled->answers == 1);
    BOOST_TEST(c.drops == 0);
    pooled->wanted();
    pooled->wanted();
    BOOST_TEST(c.calls == 1);
    pooled->wanted = nullptr;
    BOOST_TEST(c.drops == 1);
}

BOOST_AUTO_TEST_CASE(the_responder_of_a_job_on_a_pool_is_for_any_thread) {
    const auto job = jobs.open(responder{std::make_shared<pooled_recorder>()});
    BOOST_TEST(jobs.find_shared(job).has_value());
    BOOST_TEST(!jobs.find_shared(open()).has_value()); // it belongs to an executor
    jobs.finish(job, done);
    BOOST_TEST(!jobs.find_shared(job).has_value());
    BOOST_TEST(!jobs.find_shared(0).has_value());
}

BOOST_AUTO_TEST_CASE(there_are_so_many_jobs_and_no_more) {
    std::vector<std::uint64_t> all;
    for (std::size_t i = 0; i < jobs.max_open; ++i) {
        all.push_back(open());
    }
    BOOST_TEST(all.back() != 0U);
    BOOST_TEST(open() == 0U);
    jobs.finish(all.front(), done);
    BOOST_TEST(open() != 0U);
}

BOOST_AUTO_TEST_CASE(the_end_answers_all_hands_out_who_is_to_be_told_and_posts_no_more) {
    counted c;
    const auto job = open();
    jobs.on_stop(job, c.callback());
    open();
    auto told = jobs.close([](const responder& to) { to.fail(cles::errc::unavailable, "over"); });
    BOOST_TEST(record->told == (std::vector<std::string>{"fail unavailable", "fail unavailable"}),
               boost::test_tools::per_element());
    BOOST_TEST(c.calls == 0);
    for (auto& callback : told) {
        callback();
    }
    told.clear();
    BOOST_TEST(c.calls == 1);
    BOOST_TEST(c.drops == 1);
    BOOST_TEST(open() == 0U);
    BOOST_TEST(!jobs.finish(job, done));
    BOOST_TEST(jobs.stopped(job));
    BOOST_TEST(io.poll() == 0U);
}

BOOST_AUTO_TEST_CASE(a_turn_ends_even_if_the_job_asks_again_and_again) {
    using cles::runtime::plugin_turn;
    std::vector<std::function<void()>> passed_on;
    int calls = 0;
    std::function<void()> again = [&] {
        ++calls;
        BOOST_TEST(plugin_turn::current_job() == 7U);
        plugin_turn::call_at_end(again, [&](std::function<void()> rest) { passed_on.push_back(std::move(rest)); });
    };
    {
        plugin_turn other{8};
        {
            plugin_turn turn{7};
            again();
        }
        BOOST_TEST(plugin_turn::current_job() == 8U);
    }
    BOOST_TEST(calls == 1 + plugin_turn::most_rounds);
    BOOST_REQUIRE(passed_on.size() == 1U);
    const auto rest = passed_on.front();
    rest(); // another turn
    BOOST_TEST(calls == 1 + 2 * plugin_turn::most_rounds);
    BOOST_TEST(passed_on.size() == 2U);
    BOOST_TEST(plugin_turn::current_job() == 0U);
}

BOOST_AUTO_TEST_CASE(what_a_job_gets_after_its_turn_comes_at_the_end_of_it) {
    using cles::runtime::plugin_turn;
    const auto nowhere = [](const std::function<void()>&) { BOOST_ERROR("it stays here"); };
    std::string order;
    {
        plugin_turn turn{7};
        for (int i = 0; i < 2 * plugin_turn::most_rounds; ++i) { // at once, however many
            plugin_turn::call_at_end([&] { order += "b"; }, nowhere);
        }
        order += "a";
    }
    BOOST_TEST(order == "a" + std::string(2 * plugin_turn::most_rounds, 'b'));
}

BOOST_AUTO_TEST_SUITE_END()
