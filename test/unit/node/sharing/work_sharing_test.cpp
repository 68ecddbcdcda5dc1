// SPDX-License-Identifier: BSL-1.0
#include "node/sharing/work_sharing.hpp"
#include "support/reply_text.hpp"
#include "unit/node/sharing/sharing_fixture.hpp"

#include <boost/system/errc.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>

namespace work_sharing {
namespace {

struct fixture : cles::test::sharing_fixture {
    void submit_jobs(int count) {
        for (int i = 1; i <= count; ++i) {
            submit("DELEGATE car1:work/" + std::to_string(i) + " id=" + std::to_string(i) +
                   " {\"n\":" + std::to_string(i) + "}");
        }
    }
    /// car1 has a free worker and has granted it to car2, which has jobs. Returns the number of the grant.
    std::string give_grant() {
        queue.figures.idle = 1;
        link.ask(R"(PUSH self:cles/slots id=901 {"node":"car2","waiting":3})");
        return granted_to("car2");
    }
    /// The code of a failure; empty for a result.
    static std::string code_of(std::string_view reply) {
        return cles::test::read_reply(reply.substr(0, reply.find('\n'))).error;
    }
    std::string forwarded_job(const std::string& grant, const std::string& by = "car2", int id = 30) {
        return link.ask("DELEGATE car1:work id=" + std::to_string(id) + " hops=0 via=" + by + " grant=" + grant);
    }
};

} // namespace
} // namespace work_sharing

BOOST_FIXTURE_TEST_SUITE(work_sharing, fixture)

using namespace std::chrono_literals;
using cles::errc;
using cles::verb;

// -- the node with the queue ---------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(jobs_are_forwarded_on_a_grant) {
    submit_jobs(3);
    BOOST_TEST(grant(2) == "id=900 {\"taken\":2,\"waiting\":1}\n");
    BOOST_TEST(sent().text == "DELEGATE car2:work/2 hops=0 via=car1 grant=00000000000000aa {\"n\":2}");
    BOOST_TEST(queue.waiting.at(0).body == "{\"n\":3}");
    BOOST_TEST(counts().jobs_moved_out == 2U);
    BOOST_TEST(counts().grants_received == 1U);
    sent().answers("{\"x\":1}");
    BOOST_TEST(link.take() == "id=2 {\"x\":1}\n");
    BOOST_TEST(queue.ended == 1);
}

BOOST_AUTO_TEST_CASE(the_failure_of_the_other_node_is_the_reply) {
    submit_jobs(1);
    grant(1);
    sent().refuses(R"({"error":"failed","message":"car2: no","detail":7})");
    BOOST_TEST(link.take() == "id=1 {\"error\":\"failed\",\"message\":\"car2: no\",\"detail\":7}\n");
    BOOST_TEST(queue.ended == 1);
    BOOST_TEST(queue.waiting.empty());
    BOOST_TEST(counts().jobs_moved_out == 1U);
}

BOOST_AUTO_TEST_CASE(a_job_refused_before_it_began_returns_to_the_queue) {
    const std::string refusals[] = {R"({"error":"busy","message":"full"})", R"({"error":"no_task","message":"gone"})",
                                    R"({"error":"denied","message":"no"})", R"({"error":"no_target","message":"no"})"};
    submit_jobs(1);
    for (const auto& refusal : refusals) {
        grant(1);
        sent().refuses(refusal);
        BOOST_TEST(link.take().empty());
        BOOST_TEST(queue.waiting.size() == 1U);
        BOOST_TEST(queue.ended == 0);
        BOOST_TEST(counts().jobs_moved_out == 0U);
    }
    grant(1);
    sent().fails(make_error_code(boost::system::errc::connection_refused), "not reached");
    BOOST_TEST(queue.waiting.size() == 1U);
    BOOST_TEST(counts().routed == 0U);
}

BOOST_AUTO_TEST_CASE(the_rest_of_a_grant_is_not_used_after_a_refusal) {
    submit_jobs(1);
    grant(3);
    sent().refuses(R"({"error":"busy","message":"full"})");
    submit("DELEGATE car1:work id=2");
    sharing->on_change();
    BOOST_TEST(queue.moved.empty());
    BOOST_TEST(queue.waiting.size() == 2U);
}

BOOST_AUTO_TEST_CASE(a_job_that_has_been_cancelled_stays) {
    submit_jobs(1);
    link.ask("PUSH self:cles/cancel/1 id=2");
    grant(1);
    BOOST_TEST(queue.moved.empty());
}

BOOST_AUTO_TEST_CASE(a_refusal_after_it_began_is_the_reply) {
    submit_jobs(1);
    grant(1);
    sent().refuses(R"({"error":"busy","message":"no memory","ran":true})");
    BOOST_TEST(link.take() == "id=1 {\"error\":\"busy\",\"message\":\"no memory\",\"ran\":true}\n");
    BOOST_TEST(queue.waiting.empty());
}

BOOST_AUTO_TEST_CASE(a_job_whose_node_is_lost_is_unavailable_and_not_run_again) {
    submit_jobs(1);
    grant(1);
    sent().fails(errc::unavailable, "car2 was lost");
    BOOST_TEST(code_of(link.take()) == "unavailable");
    BOOST_TEST(queue.waiting.empty());
    BOOST_TEST(queue.ended == 1);
}

BOOST_AUTO_TEST_CASE(a_withdrawn_job_is_cancelled_at_the_other_node) {
    submit_jobs(1);
    grant(1);
    auto& job = sent();
    sharing->withdraw(queue.moved.at(0).ticket);
    BOOST_TEST(job.cancelled);
    BOOST_TEST(queue.ended == 0);
    sharing->withdraw(queue.moved.at(0).ticket); // again
    sharing->withdraw(4711);                     // unknown
}

BOOST_AUTO_TEST_CASE(progress_and_urgency_are_forwarded) {
    submit("DELEGATE car1:work id=1 progress=yes urgent=yes deadline=700");
    grant(1);
    BOOST_TEST(sent().carried.urgent);
    BOOST_TEST((sent().deadline == node.clock.now() + 700ms));
    sent().progress(0.5, "{\"at\":1}");
    BOOST_TEST(link.take() == "id=1 progress=0.5 {\"at\":1}\n");
}

BOOST_AUTO_TEST_CASE(unknown_adverbs_and_the_path_so_far_are_forwarded) {
    submit("DELEGATE car1:work/a%20b id=1 via=car7 colour=red");
    grant(1);
    BOOST_TEST(sent().text == "DELEGATE car2:work/a%20b hops=0 via=car7,car1 colour=red grant=00000000000000aa {}");
}

BOOST_AUTO_TEST_CASE(what_stays) {
    node.host->tasks.add(verb::delegate, "here",
                         {.info = {.local = true}, .start = [this](const cles::request&, const auto& call) {
                              node.started.push_back(std::make_shared<cles::test::test_node::running>());
                              node.started.back()->call = call;
                          }});
    node.on_later(verb::push, "set");
    node.on_later(verb::delegate, "other");
    submit("DELEGATE car1:here id=1");
    submit("DELEGATE car1:work id=2 hops=0");
    submit("PUSH car1:set id=3 {}");
    submit("DELEGATE car1:other id=4"); // car2 does not offer it
    submit("DELEGATE car1:work id=5 via=car2");
    BOOST_TEST(queue.waiting.size() == 5U);
    BOOST_TEST(grant(5) == "id=900 {\"taken\":0,\"waiting\":5}\n");
}

BOOST_AUTO_TEST_CASE(a_job_moves_if_the_wait_that_it_saves_is_worth_the_transfer) {
    queue.figures.service_time = 1ms; // the first transfer is assumed to take as long
    submit_jobs(5);
    grant(5);
    BOOST_TEST(queue.moved.size() == 3U); // waits of 2.5, 3.5 and 4.5 ms exceed 1.5 ms; 0.5 and 1.5 do not
    BOOST_TEST(queue.moved.at(0).body == "{\"n\":3}");
}

BOOST_AUTO_TEST_CASE(a_slower_node_gets_a_job_only_if_it_ends_sooner_there) {
    submit_jobs(5); // of 10 ms each
    link.ask(R"(PUSH self:cles/slots id=900 grant=00000000000000aa {"node":"car2","free":5,"service_us":40000})");
    BOOST_TEST(queue.moved.size() == 2U); // those that wait for 35 and 45 ms: 30 ms longer, and 1.5 ms
    BOOST_TEST(queue.moved.at(0).body == "{\"n\":4}");
}

BOOST_AUTO_TEST_CASE(the_transfer_is_measured) {
    submit_jobs(1);
    link.ask(R"(PUSH self:cles/slots id=900 grant=00000000000000aa {"node":"car2","free":1,"service_us":10000})");
    node.pass(60ms);
    sent().answers("{}"); // 50 ms more than its work
    submit("DELEGATE car1:work id=50");
    submit("DELEGATE car1:work id=51");
    BOOST_TEST(grant(2, "00000000000000ab").find("\"taken\":0") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(jobs_that_come_later_use_the_rest_of_a_grant) {
    BOOST_TEST(grant(2) == "id=900 {\"taken\":0,\"waiting\":0}\n");
    submit_jobs(1);
    sharing->on_change();
    BOOST_TEST(sent().text == "DELEGATE car2:work/1 hops=0 via=car1 grant=00000000000000aa {\"n\":1}");
    node.pass(49ms);
    submit("DELEGATE car1:work id=2");
    sharing->on_change();
    BOOST_TEST(queue.moved.size() == 2U);
    submit("DELEGATE car1:work id=3");
    sharing->on_change();
    BOOST_TEST(queue.moved.size() == 2U);
}

BOOST_AUTO_TEST_CASE(a_slot_that_comes_with_a_reply_is_used_for_the_next_job) {
    submit_jobs(2);
    grant(1);
    auto& first = sent();
    first.reply.release()->offer_granted("{}", 0xbb);
    BOOST_TEST(sent().text == "DELEGATE car2:work/2 hops=0 via=car1 grant=00000000000000bb {\"n\":2}");
    BOOST_TEST(link.take() == "id=1 {}\n");
    BOOST_TEST(counts().grants_received == 2U);
}

BOOST_AUTO_TEST_CASE(a_grant_is_not_used_after_50_ms) {
    grant(2);
    node.pass(50ms);
    submit_jobs(1);
    sharing->on_change();
    BOOST_TEST(queue.moved.empty());
}

BOOST_AUTO_TEST_CASE(jobs_stay_for_which_there_is_a_worker) {
    queue.figures.idle = 2;
    submit_jobs(3);
    BOOST_TEST(grant(3) == "id=900 {\"taken\":1,\"waiting\":0}\n"); // the test's queue starts none
    BOOST_TEST(queue.moved.at(0).body == "{\"n\":3}");
}

BOOST_AUTO_TEST_CASE(waiting_jobs_are_reported_every_50_ms) {
    submit_jobs(2);
    sharing->on_change();
    BOOST_TEST(sent().text == "PUSH car2:cles/slots {\"node\":\"car1\",\"waiting\":2}");
    const auto count = ways.count();
    sharing->on_change();
    BOOST_TEST(ways.count() == count);
    node.pass(50ms);
    BOOST_TEST(ways.count() == count + 1);
    queue.waiting.clear();
    node.pass(50ms);
    BOOST_TEST(ways.count() == count + 1);
}

BOOST_AUTO_TEST_CASE(free_nodes_are_told_first_and_eight_at_most) {
    for (int i = 3; i <= 20; ++i) {
        offer("car" + std::to_string(i), task("DELEGATE", "work"), {.running = 4, .workers = 1});
    }
    offer("car30", task("DELEGATE", "work"), {.workers = 0}); // has no workers
    submit_jobs(1);
    const auto before = ways.count();
    sharing->on_change();
    BOOST_TEST(ways.count() == before + 8);
    BOOST_TEST(sent().text.starts_with("PUSH car2:cles/slots"));
    BOOST_TEST(!ways.to("car30").text.starts_with("PUSH"));
}

// -- the node with free workers ------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(grants_slots_to_a_node_that_reports_jobs) {
    queue.figures.idle = 4;
    BOOST_TEST(link.ask(R"(PUSH self:cles/slots id=901 {"node":"car2","waiting":3})") == "id=901 {}\n");
    BOOST_TEST(sent().text ==
               "PUSH car2:cles/slots grant=" + granted_to("car2") + R"( {"node":"car1","free":3,"service_us":10000})");
    BOOST_TEST(counts().grants_sent == 1U);
}

BOOST_AUTO_TEST_CASE(grants_nothing_while_its_own_jobs_wait) {
    queue.figures.idle = 1;
    submit_jobs(1);
    link.ask(R"(PUSH self:cles/slots id=901 {"node":"car2","waiting":3})");
    BOOST_TEST(granted_to("car2").empty());
    // Once they are done, it remembers.
    queue.waiting.clear();
    sharing->on_change();
    BOOST_TEST(!granted_to("car2").empty());
}

BOOST_AUTO_TEST_CASE(grants_slots_to_a_node_whose_load_says_so) {
    queue.figures.idle = 1;
    node.pass(1s); // the node has started a while ago
    hear("car2", "of car2", {.queued = 7, .running = 1, .workers = 1});
    sharing->on_change();
    BOOST_TEST(!granted_to("car2").empty());
}

BOOST_AUTO_TEST_CASE(the_most_loaded_node_first) {
    offer("car3", task("DELEGATE", "work"), {.workers = 1});
    link.ask(R"(PUSH self:cles/slots id=901 {"node":"car2","waiting":3})");
    link.ask(R"(PUSH self:cles/slots id=902 {"node":"car3","waiting":4})");
    queue.figures.idle = 5;
    sharing->on_change();
    BOOST_TEST(ways.to("car3").text.find("\"free\":4") != std::string::npos);
    BOOST_TEST(ways.to("car2").text.find("\"free\":1") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(grants_again_when_a_job_has_ended) {
    forwarded_job(give_grant());
    queue.figures.idle = 0;
    sent().answers(R"({"taken":1,"waiting":2})");
    BOOST_TEST(counts().grants_sent == 1U);
    queue.figures.idle = 1;
    sharing->on_change();
    BOOST_TEST(counts().grants_sent == 2U);
}

BOOST_AUTO_TEST_CASE(asks_no_more_a_node_that_gives_nothing) {
    give_grant();
    sent().answers(R"({"taken":0,"waiting":9})");
    sharing->on_change();
    BOOST_TEST(counts().grants_sent == 1U);
    link.ask(R"(PUSH self:cles/slots id=902 {"node":"car2","waiting":1})"); // until it reports jobs again
    BOOST_TEST(counts().grants_sent == 2U);
}

BOOST_AUTO_TEST_CASE(a_grant_without_reply_is_not_reserved) {
    give_grant();
    sent().fails(errc::deadline, "no reply");
    sharing->on_change();
    BOOST_TEST(counts().grants_sent == 1U);
    link.ask(R"(PUSH self:cles/slots id=902 {"node":"car2","waiting":1})");
    BOOST_TEST(counts().grants_sent == 2U);
}

BOOST_AUTO_TEST_CASE(the_reply_to_a_job_grants_another_slot) {
    forwarded_job(give_grant());
    queue.figures.idle = 0; // its worker is about to become free
    node.started.at(0)->call->done("{}");
    const auto reply = link.take();
    BOOST_TEST_REQUIRE(reply.starts_with("id=30 grant="));
    const auto second = reply.substr(12, 16);
    BOOST_TEST(reply == "id=30 grant=" + second + " {}\n");
    queue.figures.idle = 1;
    BOOST_TEST(forwarded_job(second, "car2", 31).empty());
    submit_jobs(1); // its own jobs go first
    node.started.at(1)->call->done("{}");
    BOOST_TEST(link.take() == "id=31 {}\n");
}

BOOST_AUTO_TEST_CASE(slots_that_are_not_reserved_are_granted_to_others_too) {
    offer("car3", task("DELEGATE", "work"), {.workers = 1});
    const auto first = give_grant();
    sent().answers(R"({"taken":0,"waiting":0})");
    link.ask(R"(PUSH self:cles/slots id=902 {"node":"car3","waiting":1})");
    const auto other = granted_to("car3");
    BOOST_TEST(!other.empty());
    BOOST_TEST(forwarded_job(first).empty());
    queue.figures.idle = 0;
    BOOST_TEST(code_of(forwarded_job(other, "car3", 31)) == "busy");
}

BOOST_AUTO_TEST_CASE(a_job_on_a_grant_runs) {
    const auto number = give_grant();
    BOOST_TEST(forwarded_job(number).empty());
    BOOST_TEST(node.started.size() == 1U);
    BOOST_TEST(node.started.at(0)->call->movable() == nullptr); // it moves once
    node.started.at(0)->call->done("{\"x\":1}");
    BOOST_TEST(link.take().ends_with(" {\"x\":1}\n"));
    BOOST_TEST(counts().jobs_moved_in == 1U);
}

BOOST_AUTO_TEST_CASE(a_job_without_a_valid_grant_is_refused) {
    const auto number = give_grant();
    BOOST_TEST(code_of(forwarded_job("00000000000000ff")) == "denied"); // never granted
    BOOST_TEST(code_of(forwarded_job(number, "car3")) == "denied");     // to another node
    BOOST_TEST(forwarded_job(number).empty());
    BOOST_TEST(code_of(forwarded_job(number, "car2", 31)) == "busy"); // twice
    const auto second = [&] {
        sent().answers(R"({"taken":1,"waiting":2})");
        sharing->on_change();
        return granted_to("car2");
    }();
    node.pass(50ms);
    BOOST_TEST(code_of(forwarded_job(second, "car2", 32)) == "busy"); // late
    BOOST_TEST(counts().grants_refused == 4U);
    BOOST_TEST(counts().jobs_moved_in == 1U);
    BOOST_TEST(node.started.size() == 1U);
}

BOOST_AUTO_TEST_CASE(its_own_jobs_go_first) {
    const auto number = give_grant();
    queue.figures.idle = 0; // a job of its own has come
    BOOST_TEST(code_of(forwarded_job(number)) == "busy");
    BOOST_TEST(node.started.empty());
    queue.figures.idle = 1; // it has ended
    BOOST_TEST(forwarded_job(number).empty());
}

BOOST_AUTO_TEST_CASE(a_failure_of_a_job_that_has_begun_says_so) {
    int id = 30;
    for (const auto code : {errc::denied, errc::no_target, errc::no_task, errc::bad_request, errc::too_large}) {
        queue.figures.idle = 1;
        link.ask(R"(PUSH self:cles/slots id=901 {"node":"car2","waiting":3})");
        const auto number = granted_to("car2");
        sent().answers(R"({"taken":1,"waiting":0})");
        forwarded_job(number, "car2", id++);
        node.started.back()->call->fail({.code = code, .message = "no"});
        BOOST_TEST(link.take().find("\"ran\":true") != std::string::npos, cles::wire_name(code));
    }
    BOOST_TEST(counts().jobs_moved_in == 5U);
}

BOOST_AUTO_TEST_CASE(a_job_that_the_pool_refuses_is_not_counted) {
    const auto number = give_grant();
    forwarded_job(number);
    node.started.at(0)->call->fail({.code = errc::busy, .message = "full"});
    BOOST_TEST(counts().jobs_moved_in == 0U);
}

// -- bad input -----------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(malformed_messages_are_refused) {
    submit_jobs(1);
    const std::string bodies[] = {"",
                                  "[]",
                                  "{}",
                                  R"({"node":7})",
                                  R"({"node":"car2","free":-1})",
                                  R"({"node":"car2","free":0})",
                                  R"({"node":"car2","free":1025})",
                                  R"({"node":"car9","free":1})",
                                  R"({"node":"car1","free":1})"};
    for (const auto& body : bodies) {
        BOOST_TEST(code_of(link.ask("PUSH self:cles/slots id=901 grant=00000000000000aa " + body)) == "bad_request",
                   body);
    }
    for (const std::string number : {"xyz", "0000000000000000", "00000000000000AA"}) {
        const auto line = "PUSH self:cles/slots id=901 grant=" + number + R"( {"node":"car2","free":1})";
        BOOST_TEST(code_of(link.ask(line)) == "bad_request", line);
    }
    BOOST_TEST(code_of(link.ask("PULL self:cles/slots id=901")) == "no_task");
    BOOST_TEST(queue.waiting.size() == 1U);
    BOOST_TEST(counts().grants_received == 0U);
}

BOOST_AUTO_TEST_CASE(a_node_that_does_not_share_takes_no_part) {
    sharing->withdraw_all();
    sharing.reset();
    BOOST_TEST(code_of(link.ask(R"(PUSH self:cles/slots id=901 {"node":"car2","waiting":3})")) == "no_task");
    BOOST_TEST(code_of(forwarded_job("00000000000000aa")) == "denied");
}

BOOST_AUTO_TEST_CASE(nothing_is_reported_after_its_end) {
    submit_jobs(1);
    grant(1);
    auto& job = sent();
    sharing->withdraw_all();
    BOOST_TEST(job.cancelled);
    BOOST_TEST(queue.ended == 0);
}

BOOST_AUTO_TEST_SUITE_END()
