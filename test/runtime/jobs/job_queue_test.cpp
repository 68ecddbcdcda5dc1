// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_queue.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <deque>
#include <map>
#include <random>
#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(job_queue)

using cles::runtime::job_queue;

struct named final : job_queue::item {
    named(std::string what, std::uint64_t from) : name(std::move(what)) { requester = from; }
    std::string name;
};

struct fixture {
    named& make(const std::string& name, std::uint64_t from) { return made.emplace_back(name, from); }
    bool push(const std::string& name, std::uint64_t from) { return queue.push(make(name, from)); }
    std::string pop() {
        const auto* next = static_cast<named*>(queue.pop());
        return next == nullptr ? "" : next->name;
    }
    std::string pop_all() {
        std::string order;
        for (auto next = pop(); !next.empty(); next = pop()) {
            order += order.empty() ? next : " " + next;
        }
        return order;
    }

    job_queue queue{8};
    std::deque<named> made;
};

BOOST_FIXTURE_TEST_CASE(an_empty_queue_has_no_next_job, fixture) {
    BOOST_TEST(queue.empty());
    BOOST_TEST(queue.pop() == nullptr);
}

BOOST_FIXTURE_TEST_CASE(the_jobs_of_one_requester_keep_their_order, fixture) {
    for (const auto* name : {"a1", "a2", "a3"}) {
        BOOST_TEST(push(name, 1));
    }
    BOOST_TEST(queue.size() == 3U);
    BOOST_TEST(pop_all() == "a1 a2 a3");
    BOOST_TEST(queue.empty());
}

BOOST_FIXTURE_TEST_CASE(jobs_are_visited_in_the_order_in_which_they_will_start, fixture) {
    for (const auto* name : {"a1", "a2", "a3"}) {
        push(name, 1);
    }
    push("b1", 2);
    push("c1", 3);
    push("c2", 3);
    std::string order;
    const auto see = [&](job_queue::item& job, std::size_t ahead) {
        order += (order.empty() ? "" : " ") + static_cast<named&>(job).name + std::to_string(ahead);
        return ahead != 4;
    };
    queue.visit(see);
    BOOST_TEST(order == "a10 b11 c12 a23 c24");
    BOOST_TEST(pop_all() == "a1 b1 c1 a2 c2 a3");
    queue.visit([](job_queue::item&, std::size_t) -> bool { throw 1; }); // none
}

BOOST_FIXTURE_TEST_CASE(a_job_that_is_put_back_has_its_old_place, fixture) {
    for (const auto* name : {"a1", "a2", "a3", "a4"}) {
        push(name, 1);
    }
    queue.remove(made[1]);
    queue.remove(made[2]);
    queue.put_back(made[2]);
    queue.put_back(made[1]);
    BOOST_TEST(queue.size() == 4U);
    BOOST_TEST(pop_all() == "a1 a2 a3 a4");
    queue.put_back(made[3]); // after its requester's other jobs have started
    push("a5", 1);
    queue.put_back(made[0]);
    BOOST_TEST(pop_all() == "a1 a4 a5");
}

BOOST_FIXTURE_TEST_CASE(the_only_job_of_a_requester_that_is_put_back_has_its_old_place, fixture) {
    for (std::uint64_t who = 0; who < 5; ++who) {
        push(std::string{"abcde"[who]} + "1", who);
    }
    push("b2", 1);
    for (const std::size_t moved : {0U, 2U, 3U}) {
        queue.remove(made[moved]);
    }
    BOOST_TEST(pop() == "b1");
    push("f1", 6);
    push("c2", 2); // its requester has another place meanwhile
    for (const std::size_t moved : {3U, 2U, 0U}) {
        queue.put_back(made[moved]);
    }
    BOOST_TEST(pop_all() == "a1 c1 d1 e1 b2 f1 c2");
}

BOOST_FIXTURE_TEST_CASE(movable_jobs_are_counted, fixture) {
    const auto add = [&](const std::string& name) -> named& {
        auto& job = make(name, 1);
        job.movable = true;
        BOOST_TEST(queue.push(job));
        return job;
    };
    auto& first = add("a1");
    auto& second = add("a2");
    push("a3", 1);
    BOOST_TEST(queue.movable() == 2U);
    queue.remove(second);
    BOOST_TEST(queue.movable() == 1U);
    queue.put_back(second);
    BOOST_TEST(queue.movable() == 2U);
    BOOST_TEST(queue.movable_queued() == 3U);
    BOOST_TEST(pop() == "a1");
    queue.push_resumed(first); // it has started
    BOOST_TEST(queue.movable() == 1U);
    BOOST_TEST(pop_all() == "a1 a2 a3");
    BOOST_TEST(queue.movable() == 0U);
}

BOOST_FIXTURE_TEST_CASE(a_job_is_put_back_behind_one_that_has_started, fixture) {
    push("a1", 1);
    push("a2", 1);
    queue.remove(made[0]);
    queue.remove(made[1]);
    queue.push_resumed(made[1]); // it continues
    queue.put_back(made[0]);
    BOOST_TEST(queue.size() == 2U);
    BOOST_TEST(pop_all() == "a1 a2");
}

BOOST_FIXTURE_TEST_CASE(requesters_take_turns, fixture) {
    for (const auto* name : {"a1", "a2", "a3", "a4"}) {
        push(name, 1);
    }
    push("b1", 2);
    push("b2", 2);
    push("c1", 3);
    BOOST_TEST(pop_all() == "a1 b1 c1 a2 b2 a3 a4");
}

BOOST_FIXTURE_TEST_CASE(a_later_requester_waits_for_one_turn_of_each, fixture) {
    for (const auto* name : {"a1", "a2", "a3"}) {
        push(name, 1);
    }
    BOOST_TEST(pop() == "a1");
    push("b1", 2);
    BOOST_TEST(pop_all() == "a2 b1 a3");
}

BOOST_FIXTURE_TEST_CASE(a_full_queue_refuses, fixture) {
    for (int i = 0; i < 8; ++i) {
        BOOST_TEST(push("a", 1));
    }
    BOOST_TEST(!push("late", 1));
    BOOST_TEST(!push("late", 2));
    BOOST_TEST(!made.back().queued());
    pop();
    BOOST_TEST(push("b", 2));
}

BOOST_FIXTURE_TEST_CASE(a_resumed_job_goes_first_and_ignores_the_capacity, fixture) {
    for (int i = 0; i < 8; ++i) {
        push("a" + std::to_string(i), 1);
    }
    queue.push_resumed(make("begun", 1));
    queue.push_resumed(make("other", 2));
    BOOST_TEST(queue.size() == 10U);
    BOOST_TEST(!push("late", 1));
    BOOST_TEST(pop() == "begun");
    BOOST_TEST(pop() == "other");
    BOOST_TEST(pop() == "a0");
}

BOOST_FIXTURE_TEST_CASE(a_removed_job_is_not_popped, fixture) {
    auto& first = make("a1", 1);
    auto& middle = make("a2", 1);
    auto& last = make("a3", 1);
    auto& only = make("b1", 2);
    for (auto* job : {&first, &middle, &last, &only}) {
        BOOST_TEST(queue.push(*job));
    }
    queue.remove(middle);
    queue.remove(only);
    queue.remove(only); // has been removed already
    BOOST_TEST(!middle.queued());
    BOOST_TEST(queue.size() == 2U);
    queue.remove(first);
    BOOST_TEST(pop_all() == "a3");
    BOOST_TEST(queue.push(middle));
    queue.remove(middle);
    BOOST_TEST(queue.empty());
    BOOST_TEST(queue.pop() == nullptr);
}

BOOST_FIXTURE_TEST_CASE(many_requesters_are_served_alike, fixture) {
    for (std::uint64_t who = 0; who < 10'000; ++who) {
        named job{"x", who};
        BOOST_TEST_REQUIRE(queue.push(job));
        BOOST_TEST_REQUIRE(pop() == "x");
    }
    push("a1", 1);
    push("a2", 1);
    push("b1", 2);
    BOOST_TEST(pop_all() == "a1 b1 a2");
}

// Compares it with a simple model: a list of requesters, each with a list of jobs.
BOOST_AUTO_TEST_CASE(it_behaves_like_a_simple_model) {
    std::mt19937 chance{7};
    for (int round = 0; round < 50; ++round) {
        constexpr std::size_t capacity = 20;
        job_queue queue{capacity};
        std::deque<named> jobs;
        std::deque<std::uint64_t> turns;
        std::map<std::uint64_t, std::deque<named*>> of;
        std::size_t size = 0;
        const auto leave = [&](named& job) {
            auto& own = of[job.requester];
            std::erase(own, &job);
            if (own.empty()) {
                std::erase(turns, job.requester);
            }
            --size;
        };
        for (int step = 0; step < 2000; ++step) {
            const auto what = chance() % 10;
            if (what < 5) {
                auto& job = jobs.emplace_back("x", chance() % (round % 2 == 0 ? 4 : 200));
                const bool begun = chance() % 8 == 0;
                if (!begun) {
                    BOOST_TEST_REQUIRE(queue.push(job) == (size < capacity));
                    if (size >= capacity) {
                        continue;
                    }
                } else {
                    queue.push_resumed(job);
                }
                auto& own = of[job.requester];
                if (own.empty()) {
                    turns.push_back(job.requester);
                }
                begun ? own.push_front(&job) : own.push_back(&job);
                ++size;
            } else if (what < 9) {
                const auto* next = static_cast<named*>(queue.pop());
                if (turns.empty()) {
                    BOOST_TEST_REQUIRE(next == nullptr);
                    continue;
                }
                const auto who = turns.front();
                auto* expected = of[who].front();
                BOOST_TEST_REQUIRE(next == expected);
                turns.pop_front();
                turns.push_back(who);
                leave(*expected);
            } else if (!jobs.empty()) {
                auto& job = jobs[chance() % jobs.size()];
                if (job.queued()) {
                    leave(job);
                }
                queue.remove(job);
                BOOST_TEST_REQUIRE(!job.queued());
            }
            BOOST_TEST_REQUIRE(queue.size() == size);
        }
    }
}

BOOST_AUTO_TEST_SUITE_END()
