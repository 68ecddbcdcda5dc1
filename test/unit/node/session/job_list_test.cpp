// SPDX-License-Identifier: BSL-1.0
#include "node/session/job_table.hpp"
#include "support/scripted_security.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace job_list {
namespace {

using namespace std::chrono_literals;

struct fixture {
    explicit fixture(const cles::limits& bounds = {}, std::shared_ptr<cles::core::node_security> security = {})
        : node{bounds, {}, {}, {}, std::move(security), nullptr, nullptr, cles::jobs()} {
        node.on(cles::verb::pull, "speed", "{\"v\":3}");
        node.on_later(cles::verb::delegate, "work");
    }
    std::string jobs() { return asking.reply("PULL self:cles/jobs id=1").body; }
    [[nodiscard]] bool lists(std::string_view part) { return jobs().find(part) != std::string::npos; }
    bool stopped(std::size_t i) { return node.started.at(i)->stopped; }

    cles::test::test_node node;
    cles::test::test_link link{node};
    cles::test::test_link asking{node};
};

struct fleet : fixture {
    explicit fleet(
        const std::shared_ptr<cles::test::scripted_security>& by = std::make_shared<cles::test::scripted_security>())
        : fixture({}, by), security(by) {}

    std::shared_ptr<cles::test::scripted_security> security;
    cles::test::test_link car2{node, "car2"};
    cles::test::test_link far{node, 0, "car3", "tls", false};
};

struct without_jobs {
    cles::test::test_node node;
    cles::test::test_link link{node};
};

} // namespace
} // namespace job_list

BOOST_FIXTURE_TEST_SUITE(job_list, fixture)

BOOST_AUTO_TEST_CASE(a_job_is_listed_until_it_is_answered) {
    BOOST_TEST(jobs() == R"({"jobs":[]})");
    link.ask("DELEGATE car1:work id=7");
    node.pass(812ms);
    BOOST_TEST(jobs() == R"({"jobs":[{"job":1,"verb":"DELEGATE","task":"work","requester":"tcp://127.0.0.1:1",)"
                         R"("state":"running","age_ms":812,"deadline_ms":29188}]})");
    node.started.at(0)->call->done("[1]");
    BOOST_TEST(jobs() == R"({"jobs":[]})");
}

BOOST_AUTO_TEST_CASE(progress_is_listed_whether_or_not_the_requester_wants_it) {
    link.ask("DELEGATE car1:work id=7");
    BOOST_TEST(!node.started.at(0)->call->progress(0.4, "{}"));
    BOOST_TEST(lists(R"("progress":0.4)"));
}

BOOST_AUTO_TEST_CASE(a_pool_of_workers_says_more) {
    link.ask("DELEGATE car1:work id=7");
    node.host->jobs->set_status(1, [] { return cles::job_status{.waiting = true, .progress = 0.5}; });
    BOOST_TEST(lists(R"("state":"queued")"));
    BOOST_TEST(lists(R"("progress":0.5)"));
    node.host->jobs->set_status(2, [] { return cles::job_status{}; }); // there is none
    node.started.at(0)->call->leave_to_others();
    BOOST_TEST(lists(R"("state":"moved")"));
    node.started.at(0)->call->take_back();
}

BOOST_AUTO_TEST_CASE(what_does_not_stop_stays_listed) {
    link.ask("DELEGATE car1:work id=7");
    BOOST_TEST(link.kind("PUSH self:cles/cancel/7 id=8") == "id=7 cancelled, id=8 ok");
    BOOST_TEST(lists(R"("state":"stopping","age_ms":0}])"));
    node.started.clear();
    BOOST_TEST(jobs() == R"({"jobs":[]})");
}

BOOST_AUTO_TEST_CASE(a_job_is_cancelled_from_another_link) {
    link.ask("DELEGATE car1:work id=7");
    link.ask("DELEGATE car1:work id=8");
    BOOST_TEST(asking.kind("PUSH self:cles/jobs/1/cancel id=2") == "id=2 ok");
    BOOST_TEST(link.sent() == "id=7 cancelled");
    BOOST_TEST(stopped(0));
    BOOST_TEST(!stopped(1));
    BOOST_TEST(asking.kind("PUSH self:cles/jobs/1/cancel id=3") == "id=3 no_task"); // it has ended
    BOOST_TEST(asking.kind("PUSH self:cles/jobs/9/cancel id=4") == "id=4 no_task");
    BOOST_TEST(asking.kind("PUSH self:cles/jobs/x/cancel id=5") == "id=5 bad_request");
    BOOST_TEST(asking.kind("PUSH self:cles/jobs/2/stop id=6") == "id=6 no_task");
}

BOOST_AUTO_TEST_CASE(a_job_of_the_same_link_is_cancelled) {
    link.ask("DELEGATE car1:work id=7");
    BOOST_TEST(link.kind("PUSH self:cles/jobs/1/cancel id=8") == "id=7 cancelled, id=8 ok");
}

BOOST_AUTO_TEST_CASE(without_security_it_is_cancelled_on_its_host_only) {
    link.ask("DELEGATE car1:work id=7");
    cles::test::test_link far{node, 0, "", "tcp", false};
    BOOST_TEST(far.kind("PULL self:cles/jobs id=1") == "id=1 ok");
    BOOST_TEST(far.kind("PUSH self:cles/jobs/1/cancel id=2") == "id=2 denied");
    BOOST_TEST(!stopped(0));
}

BOOST_FIXTURE_TEST_CASE(with_security_a_right_decides, fleet) {
    car2.ask("DELEGATE car1:work id=7");
    BOOST_TEST(far.reply("PULL self:cles/jobs id=1").body.find(R"("requester":"car2")") != std::string::npos);
    security->denied.insert("car3 PUSH car1:cles/jobs/1/cancel");
    BOOST_TEST(far.kind("PUSH self:cles/jobs/1/cancel id=2") == "id=2 denied");
    BOOST_TEST(!stopped(0));
    security->denied.clear();
    BOOST_TEST(far.kind("PUSH self:cles/jobs/1/cancel id=3") == "id=3 ok");
    BOOST_TEST(stopped(0));
    BOOST_TEST(car2.sent() == "id=7 cancelled");
}

BOOST_AUTO_TEST_CASE(what_does_not_fit_into_a_line_is_left_out) {
    fixture small{cles::limits{.line = 1024}};
    for (int i = 1; i <= 20; ++i) {
        small.link.ask("DELEGATE car1:work id=" + std::to_string(i));
    }
    const auto listed = small.jobs();
    BOOST_TEST(listed.size() <= 1024U);
    BOOST_TEST(listed.ends_with(R"(],"more":true})"));
    BOOST_TEST(listed.find(R"("job":2,)") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(the_metrics_contain_how_long_each_task_takes) {
    link.ask("PULL car1:speed id=6");
    link.ask("DELEGATE car1:work id=7");
    node.pass(10ms);
    node.started.at(0)->call->done("[1]");
    const auto metrics = asking.reply("PULL self:cles/metrics id=1").body;
    BOOST_TEST(metrics.find(R"("tasks_us":{"speed":{"PULL":{"samples":1,"p50":0,"p99":0}},"work":{"DELEGATE":)"
                            R"({"samples":1,"p50":1)") != std::string::npos);
}

BOOST_FIXTURE_TEST_CASE(a_node_that_does_not_list_its_jobs_says_so, without_jobs) {
    BOOST_TEST(link.kind("PULL self:cles/jobs id=1") == "id=1 no_task");
    BOOST_TEST(link.kind("PUSH self:cles/jobs/1/cancel id=2") == "id=2 no_task");
    BOOST_TEST(link.reply("PULL self:cles/metrics id=3").body.find("tasks_us") == std::string::npos);
}

BOOST_AUTO_TEST_SUITE_END()
