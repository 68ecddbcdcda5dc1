// SPDX-License-Identifier: BSL-1.0
#include "node/sharing/work_sharing.hpp"
#include "support/reply_text.hpp"
#include "support/scripted_security.hpp"
#include "unit/node/sharing/sharing_fixture.hpp"

#include <boost/system/errc.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <memory>
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
    BOOST_TEST(counts().jobs_moved_out == 0U); // until it is known that they do not return
    BOOST_TEST(counts().grants_received == 1U);
    sent().answers("{\"x\":1}");
    BOOST_TEST(counts().jobs_moved_out == 1U);
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
                                    R"({"error":"denied","message":"no"})", R"({"error":"no_target","message":"no"})",
                                    R"({"error":"too_large","message":"a line has at most 9 bytes"})"};
    submit_jobs(1);
    for (const auto& refusal : refusals) {
        node.pass(1s);
        BOOST_TEST(grant(1) == "id=900 {\"taken\":1,\"waiting\":0}\n");
        sent().refuses(refusal);
        BOOST_TEST(link.take().empty());
        BOOST_TEST(queue.waiting.size() == 1U);
        BOOST_TEST(queue.ended == 0);
        BOOST_TEST(counts().jobs_moved_out == 0U);
    }
    queue.waiting.clear();
    submit("DELEGATE car1:work id=9"); // shorter than the one that was too large
    node.pass(1s);
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

// Only that slot was refused: its worker was not free yet.
BOOST_AUTO_TEST_CASE(a_node_without_a_free_worker_gets_the_job_with_its_next_grant) {
    submit_jobs(1);
    grant(1);
    sent().refuses(R"({"error":"busy","message":"car2 has no free worker any more","retry_ms":1})");
    BOOST_TEST(queue.waiting.size() == 1U);
    BOOST_TEST(grant(1) == "id=900 {\"taken\":1,\"waiting\":0}\n");
}

BOOST_AUTO_TEST_CASE(a_node_that_refuses_a_task_for_a_while_is_told_of_jobs_after_that) {
    submit_jobs(1);
    sharing->on_change();
    grant(1);
    sent().refuses(R"({"error":"busy","message":"the dock is full","retry_ms":120})");
    grant(1);
    const auto before = ways.count();
    node.pass(100ms);
    BOOST_TEST(ways.count() == before);
    node.pass(50ms);
    BOOST_TEST(ways.count() == before + 1);
    BOOST_TEST(sent().text == "PUSH car2:cles/slots {\"node\":\"car1\",\"waiting\":1}");
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

// Few jobs move.
BOOST_AUTO_TEST_CASE(adverbs_are_only_kept_of_jobs_that_have_some_of_their_own) {
    submit("DELEGATE car1:work id=1 deadline=700 progress=yes urgent=yes");
    submit("DELEGATE car1:work id=2 via=car7");
    submit("DELEGATE car1:work id=3 colour=red");
    submit("DELEGATE car1:work id=4 sig=s");
    BOOST_TEST(queue.waiting.at(0).call->movable()->adverbs().empty());
    for (std::size_t i = 1; i < 4; ++i) {
        BOOST_TEST(!queue.waiting.at(i).call->movable()->adverbs().empty());
    }
    grant(4);
    BOOST_TEST(sent().text == "DELEGATE car2:work hops=0 via=car1 sig=s grant=00000000000000aa {}");
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
    BOOST_TEST(grant(5) == "id=900 {\"taken\":0,\"waiting\":0}\n");
}

BOOST_AUTO_TEST_CASE(a_request_without_room_for_another_adverb_stays) {
    const auto adverbs = [](int count) {
        std::string all;
        for (int i = 0; i < count; ++i) {
            all += std::string{" x"} + static_cast<char>('a' + i) + "=1";
        }
        return all;
    };
    submit("DELEGATE car1:work/1 id=1" + adverbs(10));
    BOOST_TEST(grant(1).find("\"taken\":0") != std::string::npos);
    submit("DELEGATE car1:work/2 id=2" + adverbs(9));
    BOOST_TEST(grant(1).find("\"taken\":1") != std::string::npos);
    BOOST_TEST(sent().text == "DELEGATE car2:work/2 hops=0 via=car1" + adverbs(9) + " grant=00000000000000aa {}");
}

// The other node would refuse it.
BOOST_AUTO_TEST_CASE(a_job_never_has_too_many_adverbs) {
    std::string unknown;
    for (char c = 'a'; c < 'a' + 9; ++c) {
        unknown += std::string{" x"} + c + "=1";
        submit("DELEGATE car1:work id=" + std::to_string(c) +
               " progress=yes urgent=yes trace=00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01" + unknown);
    }
    grant(9);
    BOOST_TEST(queue.moved.size() == 8U);
    cles::protocol::request_line r;
    cles::protocol::malformed_request wrong;
    const auto line = std::string_view{sent().line}.substr(0, sent().line.size() - 1);
    BOOST_TEST(cles::protocol::parse_request(line, r, wrong), wrong.why << " in " << line);
}

BOOST_AUTO_TEST_CASE(a_long_request_stays) {
    submit("DELEGATE car1:work id=1 {\"x\":\"" + std::string(1'000'000, 'x') + "\"}");
    BOOST_TEST(queue.waiting.at(0).call->movable() == nullptr);
}

BOOST_AUTO_TEST_CASE(what_was_too_large_for_a_node_is_not_sent_there_again) {
    submit("DELEGATE car1:work id=1 {\"x\":\"" + std::string(5'000, 'x') + "\"}");
    submit("DELEGATE car1:work id=2 {\"x\":\"short\"}");
    grant(1);
    sent().refuses(R"({"error":"too_large","message":"a line has at most 4096 bytes"})");
    BOOST_TEST(queue.waiting.size() == 2U);
    node.pass(10s);
    BOOST_TEST(grant(2).find("\"taken\":1") != std::string::npos);
    BOOST_TEST(sent().text.ends_with("{\"x\":\"short\"}"));
}

BOOST_AUTO_TEST_CASE(a_result_that_is_too_large_is_the_reply) {
    submit_jobs(1);
    grant(1);
    sent().refuses(R"({"error":"too_large","message":"the answer","ran":true})");
    BOOST_TEST(code_of(link.take()) == "too_large");
    BOOST_TEST(queue.waiting.empty());
}

BOOST_AUTO_TEST_CASE(tasks_that_stay_at_the_other_node_are_not_sent_there) {
    node.on_later(verb::delegate, "own");
    node.on_later(verb::delegate, "safe");
    offer("car3", R"({"verb":"DELEGATE","task":"own","local":true},{"verb":"DELEGATE","task":"safe","signed":true})",
          {.workers = 1});
    submit("DELEGATE car1:own id=1");
    submit("DELEGATE car1:safe id=2");
    BOOST_TEST(grant(2, "00000000000000aa", "car3").find("\"taken\":0") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_task_that_a_node_refuses_is_not_sent_there_at_once) {
    node.on_later(verb::delegate, "other");
    hear("car2", "new digest", {.workers = 1});
    sent().answers(description("car2", task("DELEGATE", "work") + "," + task("DELEGATE", "other")));
    submit_jobs(1);
    grant(1);
    sent().refuses(R"({"error":"denied","message":"no"})");
    BOOST_TEST(grant(1).find("\"taken\":0") != std::string::npos);
    submit("DELEGATE car1:other id=7");
    BOOST_TEST(grant(2).find("\"taken\":1") != std::string::npos); // other tasks are not concerned
    BOOST_TEST(sent().text.starts_with("DELEGATE car2:other"));
    node.pass(999ms);
    BOOST_TEST(grant(1).find("\"taken\":0") != std::string::npos);
    node.pass(1ms);
    BOOST_TEST(grant(1).find("\"taken\":1") != std::string::npos);
    sent().refuses(R"({"error":"busy","message":"the dock is full","retry_ms":250})");
    node.pass(249ms);
    BOOST_TEST(grant(1).find("\"taken\":0") != std::string::npos);
    node.pass(1ms);
    BOOST_TEST(grant(1).find("\"taken\":1") != std::string::npos);
}

// Without security, everybody can send a grant in the name of another node.
constexpr std::string_view not_granted =
    R"({"error":"denied","message":"car2 has not granted 0000000000000001 to car1","retry_ms":1})";

BOOST_AUTO_TEST_CASE(a_forged_grant_keeps_no_later_grant_out) {
    submit_jobs(1);
    for (int i = 0; i < 3; ++i) {
        BOOST_TEST(grant(1, "0000000000000001").find("\"taken\":1") != std::string::npos);
        sent().refuses(not_granted);
        BOOST_TEST(queue.moved.empty());
    }
    BOOST_TEST(grant(1).find("\"taken\":1") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_forged_grant_replaces_no_other) {
    grant(2);
    for (int i = 0; i < 5; ++i) {
        grant(1024, "000000000000000" + std::to_string(1 + i));
    }
    submit_jobs(1);
    sharing->on_change();
    for (int i = 0; i < 5; ++i) {
        BOOST_REQUIRE(sent().text.find(" grant=000000000000000" + std::to_string(1 + i)) != std::string::npos);
        sent().refuses(not_granted);
    }
    BOOST_TEST(sent().text.find(" grant=00000000000000aa") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(grants_of_a_node_are_bounded) {
    for (int i = 10; i < 40; ++i) {
        grant(1, "00000000000000" + std::to_string(i));
        node.pass(1ms);
    }
    submit_jobs(20);
    sharing->on_change();
    BOOST_TEST(queue.moved.size() == cles::core::work_sharing::max_held);
}

BOOST_AUTO_TEST_CASE(a_part_of_a_request_for_all_stays) {
    submit("DELEGATE car1:work id=5 via=all,car3");
    submit("DELEGATE car1:work id=6 via=car3,all");
    BOOST_TEST(queue.waiting.size() == 2U);
    BOOST_TEST(queue.waiting.at(0).call->movable() == nullptr);
    BOOST_TEST(queue.waiting.at(1).call->movable() == nullptr);
    link.ask("DELEGATE all:work id=7");
    BOOST_REQUIRE(node.started.size() == 3U);
    BOOST_TEST(node.started.back()->call->movable() == nullptr); // the own part
    BOOST_TEST(sent().text.find(" via=all,car1") != std::string::npos, sent().text);
}

BOOST_AUTO_TEST_CASE(the_queue_is_searched_once_for_each_grant_without_a_job) {
    node.on_later(verb::delegate, "other"); // car2 does not offer it
    submit("DELEGATE car1:other id=1");
    grant(1);
    const auto offered = queue.offered;
    BOOST_TEST(offered == 1);
    queue.waiting.clear();
    submit("DELEGATE car1:work id=2");
    queue.figures.service_time = 1us;
    grant(1); // not worth it
    BOOST_TEST(queue.offered == 2);
    for (int i = 0; i < 10; ++i) {
        sharing->on_change();
    }
    BOOST_TEST(queue.offered == 2);
    queue.figures.service_time = 10ms;
    submit("DELEGATE car1:work id=3");
    sharing->on_change();
    BOOST_TEST(queue.moved.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_job_moves_if_the_wait_that_it_saves_is_worth_the_transfer) {
    queue.figures.service_time = 1ms; // the first transfer is assumed to take as long
    submit_jobs(5);
    grant(5);
    BOOST_TEST(queue.moved.size() == 3U); // waits of 2.5, 3.5 and 4.5 ms exceed 1.5 ms; 0.5 and 1.5 do not
    BOOST_TEST(queue.moved.at(0).body == "{\"n\":3}");
}

BOOST_AUTO_TEST_CASE(a_slower_node_gets_a_job_only_if_it_ends_sooner_there) {
    submit_jobs(1);
    grant(1);
    node.pass(40ms); // here it takes 10 ms
    sent().answers("{}");
    submit_jobs(5);
    grant(5, "00000000000000ab");
    BOOST_TEST(queue.moved.size() == 2U); // those that wait for 35 and 45 ms: 29 ms longer, and 1.5 ms
    BOOST_TEST(queue.moved.at(0).body == "{\"n\":4}");
}

// Its average over all tasks says nothing about this one, and it does not learn while it is idle.
BOOST_AUTO_TEST_CASE(the_service_time_that_a_node_states_does_not_matter) {
    submit_jobs(2);
    link.ask(R"(PUSH self:cles/slots id=900 grant=00000000000000aa {"node":"car2","free":2,"service_us":40000000})");
    BOOST_TEST(queue.moved.size() == 2U);
}

BOOST_AUTO_TEST_CASE(tasks_are_measured_separately) {
    node.on_later(verb::delegate, "other");
    hear("car2", "new digest", {.workers = 1});
    sent().answers(description("car2", task("DELEGATE", "work") + "," + task("DELEGATE", "other")));
    queue.by_task["other"] = 900ms;
    submit("DELEGATE car1:other id=1");
    grant(1);
    node.pass(900ms);
    sent().answers("{}");
    submit("DELEGATE car1:work id=2");
    BOOST_TEST(grant(1, "00000000000000ab").find("\"taken\":1") != std::string::npos);
    node.pass(100ms);
    sent().answers("{}"); // 90 ms more than here
    submit("DELEGATE car1:work id=3");
    submit("DELEGATE car1:other id=4");
    BOOST_TEST(grant(2, "00000000000000ac").find("\"taken\":1") != std::string::npos);
    BOOST_TEST(sent().text.starts_with("DELEGATE car2:other"));
}

BOOST_AUTO_TEST_CASE(what_moved_jobs_take_counts_for_a_second) {
    submit_jobs(1);
    grant(1);
    node.pass(60ms);
    sent().answers("{}"); // 50 ms more than its work
    submit("DELEGATE car1:work id=50");
    submit("DELEGATE car1:work id=51");
    BOOST_TEST(grant(2, "00000000000000ab").find("\"taken\":0") != std::string::npos);
    node.pass(1s); // it may have been a long job
    BOOST_TEST(grant(2, "00000000000000ac").find("\"taken\":2") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_node_is_not_slower_if_it_is_not_known_how_long_a_job_takes_here) {
    queue.by_task["work"] = 0us;
    submit_jobs(1);
    grant(1);
    node.pass(60ms);
    sent().answers("{}");
    submit("DELEGATE car1:work id=50");
    BOOST_TEST(grant(1, "00000000000000ab").find("\"taken\":1") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_slot_that_comes_with_a_result_is_used_for_jobs_that_end_sooner_there) {
    submit_jobs(1);
    grant(1);
    node.pass(40ms);
    static_cast<void>(sent().reply.release()->offer_granted("{}", 0xbb));
    submit("DELEGATE car1:work id=50"); // it waits for 5 ms
    sharing->on_change();
    BOOST_TEST(queue.moved.empty());
    for (int id = 51; id <= 54; ++id) {
        submit("DELEGATE car1:work id=" + std::to_string(id));
    }
    sharing->on_change();
    BOOST_TEST(queue.moved.size() == 1U); // one that waits for 35 ms: the node is slower by 29 ms, and 1.5 ms
}

BOOST_AUTO_TEST_CASE(a_grant_is_used_for_50_ms_less_a_round_trip) {
    const auto told = [&](int id) -> cles::test::recorded_next_hop::sent& {
        submit("DELEGATE car1:work id=" + std::to_string(id));
        sharing->on_change();
        queue.waiting.clear();
        BOOST_TEST_REQUIRE(sent().text.starts_with("PUSH car2:cles/slots"));
        return sent();
    };
    auto& first = told(1);
    node.pass(20ms);
    first.answers("{}");
    grant(1);
    node.pass(30ms);
    submit("DELEGATE car1:work id=2");
    sharing->on_change();
    BOOST_TEST(queue.moved.empty());
    grant(1);
    BOOST_TEST(queue.moved.empty()); // 10 ms of work, and a trip of 20
    queue.figures.service_time = 100ms;
    node.pass(29ms);
    BOOST_TEST(grant(1).find("\"taken\":1") != std::string::npos);
    queue.waiting.clear();
    // None arrives in time.
    node.pass(1s);
    told(3).fails(errc::deadline, "no reply");
    grant(1);
    submit("DELEGATE car1:work id=4");
    sharing->on_change();
    BOOST_TEST(queue.moved.size() == 1U);
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
    static_cast<void>(first.reply.release()->offer_granted("{}", 0xbb));
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

BOOST_AUTO_TEST_CASE(jobs_that_come_meanwhile_neither_delay_the_next_report_nor_bring_it_forward) {
    submit_jobs(1);
    sharing->on_change();
    const auto count = ways.count();
    for (int i = 0; i < 4; ++i) {
        node.pass(10ms);
        submit("DELEGATE car1:work id=" + std::to_string(10 + i));
        sharing->on_change();
    }
    BOOST_TEST(ways.count() == count);
    node.pass(10ms);
    BOOST_TEST(ways.count() == count + 1);
    BOOST_TEST(sent().text == "PUSH car2:cles/slots {\"node\":\"car1\",\"waiting\":5}");
}

// The timer is then set for the loads of the others, which are looked at less often.
BOOST_AUTO_TEST_CASE(the_first_job_that_waits_sets_the_timer_for_an_earlier_time) {
    queue.figures.idle = 1;
    sharing->on_change();
    queue.figures.idle = 0;
    submit_jobs(1);
    sharing->on_change();
    const auto count = ways.count();
    node.pass(50ms);
    BOOST_TEST(ways.count() == count + 1);
}

BOOST_AUTO_TEST_CASE(jobs_that_cannot_move_are_not_reported) {
    submit("DELEGATE car1:work id=1 hops=0");
    const auto before = ways.count();
    sharing->on_change();
    BOOST_TEST(ways.count() == before);
    submit("DELEGATE car1:work id=2");
    sharing->on_change();
    BOOST_TEST(sent().text == "PUSH car2:cles/slots {\"node\":\"car1\",\"waiting\":1}");
}

BOOST_AUTO_TEST_CASE(a_node_for_which_no_job_is_is_told_again_when_more_have_come) {
    node.on_later(verb::delegate, "other"); // car2 does not offer it
    submit("DELEGATE car1:other id=1");
    sharing->on_change();
    BOOST_TEST(sent().text.starts_with("PUSH car2:cles/slots"));
    grant(1);
    const auto before = ways.count();
    node.pass(50ms);
    node.pass(50ms);
    BOOST_TEST(ways.count() == before);
    submit("DELEGATE car1:work id=2");
    node.pass(50ms);
    BOOST_TEST(ways.count() == before + 1);
    // Or after a while: rights and tasks change.
    queue.waiting.pop_back();
    grant(1);
    node.pass(450ms);
    BOOST_TEST(ways.count() == before + 1);
    node.pass(50ms);
    BOOST_TEST(ways.count() == before + 2);
}

BOOST_AUTO_TEST_CASE(a_node_that_does_not_share_is_left_alone) {
    submit_jobs(1);
    sharing->on_change();
    sent().refuses(R"({"error":"no_task","message":"car2 has no PUSH 'cles/slots'"})");
    const auto before = ways.count();
    node.pass(10s);
    submit("DELEGATE car1:work id=2");
    sharing->on_change();
    BOOST_TEST(ways.count() == before);
    queue.waiting.clear();
    queue.figures.idle = 1;
    hear("car2", "of car2", {.queued = 7, .workers = 1});
    node.pass(1s);
    sharing->on_change();
    BOOST_TEST(counts().grants_sent == 0U);
    link.ask(R"(PUSH self:cles/slots id=901 {"node":"car2","waiting":3})"); // it does now
    BOOST_TEST(counts().grants_sent == 1U);
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

BOOST_AUTO_TEST_CASE(the_next_slot_is_for_the_node_with_the_most_jobs) {
    offer("car3", task("DELEGATE", "work"), {.workers = 1});
    forwarded_job(give_grant());
    queue.figures.idle = 0;
    sent().answers(R"({"taken":1,"waiting":2})");
    link.ask(R"(PUSH self:cles/slots id=902 {"node":"car3","waiting":3})");
    node.started.at(0)->call->done("{}");
    BOOST_TEST(link.take() == "id=30 {}\n");
    queue.figures.idle = 1;
    sharing->on_change();
    BOOST_TEST(!granted_to("car3").empty());
}

BOOST_AUTO_TEST_CASE(a_node_that_stops_grants_nothing) {
    const auto number = give_grant();
    forwarded_job(number);
    queue.figures.draining = true;
    node.started.at(0)->call->done("{}");
    BOOST_TEST(link.take() == "id=30 {}\n");
    link.ask(R"(PUSH self:cles/slots id=902 {"node":"car2","waiting":3})");
    BOOST_TEST(counts().grants_sent == 1U);
}

BOOST_AUTO_TEST_CASE(each_grant_is_settled_by_its_own_reply) {
    queue.figures.idle = 1;
    link.ask(R"(PUSH self:cles/slots id=901 {"node":"car2","waiting":1})");
    auto& first = sent();
    const auto number = granted_to("car2");
    forwarded_job(number);
    link.ask(R"(PUSH self:cles/slots id=902 {"node":"car2","waiting":1})");
    BOOST_TEST(granted_to("car2") == number); // one more slot
    auto& second = sent();
    BOOST_TEST((&second != &first));
    first.answers(R"({"taken":1,"waiting":0})");
    BOOST_TEST(counts().grants_sent == 2U);
    link.ask(R"(PUSH self:cles/slots id=903 {"node":"car2","waiting":1})");
    BOOST_TEST(counts().grants_sent == 2U); // the second is still reserved
    second.answers(R"({"taken":0,"waiting":0})");
    link.ask(R"(PUSH self:cles/slots id=904 {"node":"car2","waiting":1})");
    BOOST_TEST(counts().grants_sent == 3U);
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
    BOOST_TEST(counts().jobs_moved_in == 0U);                   // until it has ended
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
    BOOST_TEST(counts().granted_jobs_refused == 4U);
    BOOST_TEST(node.started.size() == 1U);
}

BOOST_AUTO_TEST_CASE(why_a_job_is_refused_is_said) {
    const auto number = give_grant();
    BOOST_TEST(link.ask("DELEGATE car1:work id=30 via=recon grant=00000000000000ff") ==
               R"(id=30 {"error":"denied","message":"car1 has not granted 00000000000000ff to recon","retry_ms":1})"
               "\n");
    queue.figures.idle = 0;
    BOOST_TEST(forwarded_job(number) ==
               R"(id=30 {"error":"busy","message":"car1 has no free worker any more","retry_ms":1})"
               "\n");
}

BOOST_AUTO_TEST_CASE(a_job_that_has_moved_does_not_move_again) {
    const auto number = give_grant();
    link.ask("DELEGATE car1:work id=30 via=car2 grant=" + number); // without hops=0
    BOOST_TEST(node.started.at(0)->call->movable() == nullptr);
}

BOOST_AUTO_TEST_CASE(jobs_of_tasks_that_stay_are_refused) {
    int began = 0;
    const auto start = [&](const cles::request&, const auto&) { ++began; };
    node.host->tasks.add(verb::delegate, "own", {.info = {.local = true}, .start = start});
    node.host->tasks.add(verb::delegate, "safe", {.info = {.must_be_signed = true}, .start = start});
    const auto number = give_grant();
    BOOST_TEST(link.ask("DELEGATE car1:own id=30 hops=0 via=car2 grant=" + number) ==
               R"(id=30 {"error":"no_task","message":"car1 takes no jobs of 'own' from other nodes"})"
               "\n");
    BOOST_TEST(code_of(link.ask("DELEGATE car1:safe id=31 hops=0 via=car2 grant=" + number)) == "denied");
    BOOST_TEST(began == 0);
    BOOST_TEST(forwarded_job(number, "car2", 32).empty()); // the slot has not been used
}

BOOST_AUTO_TEST_CASE(only_a_job_on_a_valid_grant_gets_another) {
    node.on_later(verb::push, "set");
    link.ask("PUSH car1:set id=5 via=car9 grant=00000000000000aa {}");
    node.started.back()->call->done("{}");
    BOOST_TEST(link.take() == "id=5 {}\n");
    link.ask("PUSH car1:set id=6 via=car9 grant=00000000000000aa {}");
    node.started.back()->call->fail({.code = errc::busy, .message = "full"});
    link.ask("DELEGATE car2:work id=7 via=car9 grant=00000000000000aa");
    sent().answers("{}");
    BOOST_TEST(link.take().ends_with("id=7 {}\n"));
    link.ask("DELEGATE car2:work id=8 via=car9 grant=00000000000000aa");
    sent().refuses(R"({"error":"busy","message":"full"})");
    BOOST_TEST(counts().grants_sent == 0U);
    BOOST_TEST(counts().jobs_moved_in == 0U);
}

BOOST_AUTO_TEST_CASE(messages_are_not_counted_as_requests_of_programs) {
    link.ask(R"(PUSH self:cles/slots id=901 {"node":"car2","waiting":0})");
    link.ask(R"(PUSH self:cles/slots id=902 {"node":"nobody","waiting":0})");
    BOOST_TEST(counts().requests[static_cast<std::size_t>(verb::push)] == 0U);
    BOOST_TEST(counts().housekeeping == 2U);
    BOOST_TEST(counts().errors == 0U);
}

// It is not kept for a job that does not come again, however often the grant is renewed.
BOOST_AUTO_TEST_CASE(the_slot_of_a_refused_job_is_granted_again) {
    queue.figures.workers = 2;
    queue.figures.idle = 2;
    link.ask(R"(PUSH self:cles/slots id=901 {"node":"car2","waiting":9})");
    const auto number = granted_to("car2");
    BOOST_TEST(forwarded_job(number, "car2", 30).empty());
    BOOST_TEST(forwarded_job(number, "car2", 31).empty());
    queue.figures.idle = 0;
    sent().answers(R"({"taken":2,"waiting":7})");
    node.started.at(0)->call->done("{}"); // the reply renews the grant by one slot, and its worker is not free yet
    link.take();
    BOOST_TEST(code_of(forwarded_job(number, "car2", 32)) == "busy");
    queue.figures.idle = 1;
    sharing->on_change();
    BOOST_TEST(counts().grants_sent == 3U);
    BOOST_TEST(granted_to("car2") == number);
    BOOST_TEST(ways.to("car2").text.find("\"free\":1") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_slot_that_comes_with_a_result_is_reserved_for_two_round_trips) {
    const auto number = give_grant();
    node.pass(5ms);
    forwarded_job(number);
    queue.figures.idle = 0;
    sent().answers(R"({"taken":1,"waiting":5})");
    node.started.at(0)->call->done("{}"); // car2 does not use the slot
    queue.figures.idle = 1;
    sharing->on_change();
    BOOST_TEST(counts().grants_sent == 2U);
    node.pass(11ms);
    BOOST_TEST(counts().grants_sent == 2U);
    node.pass(1ms);
    BOOST_TEST(counts().grants_sent == 3U);
}

BOOST_AUTO_TEST_CASE(slots_are_granted_while_a_job_on_another_one_is_on_its_way) {
    queue.figures.workers = 3;
    queue.figures.idle = 1;
    link.ask(R"(PUSH self:cles/slots id=901 {"node":"car2","waiting":9})");
    queue.figures.idle = 2; // another worker becomes free
    sharing->on_change();
    BOOST_TEST(counts().grants_sent == 2U);
    BOOST_TEST(ways.to("car2").text.find("\"free\":1") != std::string::npos);
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

BOOST_AUTO_TEST_CASE(only_neighbours_take_part) {
    far.insert("car2");
    submit_jobs(1);
    BOOST_TEST(code_of(grant(1)) == "bad_request");
    BOOST_TEST(code_of(link.ask(R"(PUSH self:cles/slots id=901 {"node":"car2","waiting":3})")) == "bad_request");
    const auto before = ways.count();
    sharing->on_change();
    BOOST_TEST(ways.count() == before);
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

// -- a secured fleet -------------------------------------------------------------------------------------------------

namespace work_sharing_secured {
namespace {

struct security_of_fixture {
    std::shared_ptr<cles::test::scripted_security> security = std::make_shared<cles::test::scripted_security>();
};

/// sat1 submits jobs to car1, which may forward for all.
struct fixture : security_of_fixture, cles::test::sharing_fixture {
    fixture() : sharing_fixture(security, "sat1") {}

    std::string granted(unsigned slots) {
        return car2.ask(R"(PUSH self:cles/slots id=900 grant=00000000000000aa {"node":"car2","free":)" +
                        std::to_string(slots) + "}");
    }
    /// car1 has granted car2 a slot. Returns the number of the grant.
    std::string give_grant() {
        queue.figures.idle = 1;
        car2.ask(R"(PUSH self:cles/slots id=901 {"node":"car2","waiting":3})");
        return granted_to("car2");
    }

    cles::test::test_link car2{node, "car2"};
    cles::test::test_link car3{node, "car3"};
};

} // namespace
} // namespace work_sharing_secured

BOOST_FIXTURE_TEST_SUITE(work_sharing_secured, fixture)

BOOST_AUTO_TEST_CASE(a_job_moves_with_the_name_of_its_requester) {
    submit("DELEGATE car1:work/1 id=1");
    BOOST_TEST(granted(1) == "id=900 {\"taken\":1,\"waiting\":0}\n");
    BOOST_TEST(sent().text == "DELEGATE car2:work/1 hops=0 via=car1 from=sat1 grant=00000000000000aa {}");
    submit("DELEGATE car1:work/2 id=2 sig=s");
    granted(1);
    BOOST_TEST(sent().text == "DELEGATE car2:work/2 hops=0 via=car1 from=sat1 sig=s grant=00000000000000aa {}");
}

BOOST_AUTO_TEST_CASE(jobs_stay_if_the_node_may_not_forward_for_their_requester) {
    security->forwarders = {};
    submit("DELEGATE car1:work/1 id=1");
    cles::test::test_link own{node, "car1"};
    own.ask("DELEGATE car1:work/2 id=2");
    queue.waiting.push_back({node.started.back()->call, "{}", 0});
    BOOST_TEST(granted(2) == "id=900 {\"taken\":1,\"waiting\":0}\n");
    BOOST_TEST(sent().text == "DELEGATE car2:work/2 hops=0 via=car1 grant=00000000000000aa {}"); // its own
}

BOOST_AUTO_TEST_CASE(jobs_stay_that_their_requester_may_not_send_to_the_other_node) {
    security->denied = {"sat1 DELEGATE car2:work/1"};
    submit("DELEGATE car1:work/1 id=1");
    submit("DELEGATE car1:work/2 id=2");
    BOOST_TEST(granted(2).starts_with("id=900 {\"taken\":1"));
    BOOST_TEST(sent().text.starts_with("DELEGATE car2:work/2"));
}

BOOST_AUTO_TEST_CASE(a_node_grants_in_its_own_name_only) {
    submit("DELEGATE car1:work id=1");
    BOOST_TEST(car3.kind(R"(PUSH self:cles/slots id=900 grant=00000000000000aa {"node":"car2","free":1})") ==
               "id=900 denied");
    BOOST_TEST(car3.kind(R"(PUSH self:cles/slots id=901 {"node":"car2","waiting":1})") == "id=901 denied");
    BOOST_TEST(queue.moved.empty());
}

BOOST_AUTO_TEST_CASE(a_grant_is_only_for_the_peer) {
    const auto number = give_grant();
    BOOST_TEST(car3.kind("DELEGATE car1:work id=30 hops=0 via=car2 grant=" + number) == "id=30 denied");
    BOOST_TEST(car2.kind("DELEGATE car1:work id=31 hops=0 via=car3 grant=" + number) == "id=31 denied");
    BOOST_TEST(node.started.empty());
    BOOST_TEST(counts().granted_jobs_refused == 2U);
    BOOST_TEST(car2.kind("DELEGATE car1:work id=32 hops=0 via=car2 grant=" + number).empty());
    BOOST_TEST(node.started.size() == 1U);
}

BOOST_AUTO_TEST_CASE(the_rights_of_the_requester_apply_where_the_job_runs) {
    security->forwarders = {"car1", "car2"};
    security->denied = {"sat1 DELEGATE car1:work"};
    const auto number = give_grant();
    BOOST_TEST(car2.kind("DELEGATE car1:work id=30 hops=0 via=car2 from=sat1 grant=" + number) == "id=30 denied");
    BOOST_TEST(node.started.empty());
    BOOST_TEST(car2.kind("DELEGATE car1:work id=31 hops=0 via=car2 from=car3 grant=" + number).empty());
    BOOST_TEST(node.started.size() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
