// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_record.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <list>
#include <memory>
#include <set>
#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(job_record_pool)

using cles::identity;
using cles::runtime::job_record;

const identity somebody{
    .transport = "tcp", .address = "tcp://127.0.0.1:1", .name = "", .uid = std::nullopt, .local = true};

std::set<const job_record*> all_of(cles::runtime::job_record_pool& records) {
    std::set<const job_record*> all;
    records.for_each([&](const job_record& r) { all.insert(&r); });
    return all;
}

BOOST_AUTO_TEST_CASE(records_in_use_are_found_after_others_are_recycled) {
    cles::runtime::job_record_pool records;
    std::vector<job_record*> taken;
    taken.reserve(5);
    for (int i = 0; i < 5; ++i) {
        taken.push_back(&records.acquire({}));
    }
    records.recycle(*taken[1]);
    records.recycle(*taken[4]);
    records.recycle(*taken[0]);
    BOOST_TEST((all_of(records) == std::set<const job_record*>{taken[2], taken[3]}));
    records.recycle(*taken[2]);
    records.recycle(*taken[3]);
    BOOST_TEST(records.size() == 0U);
}

BOOST_AUTO_TEST_CASE(a_job_is_found_by_its_number_until_it_ends) {
    cles::runtime::job_record_pool records;
    auto& first = records.acquire({});
    const auto number = first.number;
    BOOST_TEST(records.find(number) == &first);
    records.recycle(first);
    BOOST_TEST(records.find(number) == nullptr);
    auto& second = records.acquire({});
    BOOST_TEST(&second == &first);
    BOOST_TEST(records.find(number) == nullptr);
    BOOST_TEST(records.find(second.number) == &second);
    BOOST_TEST(records.find(4711) == nullptr);
    records.recycle(second);
}

BOOST_AUTO_TEST_CASE(records_may_be_recycled_while_they_are_visited) {
    cles::runtime::job_record_pool records;
    for (int i = 0; i < 3; ++i) {
        records.acquire({});
    }
    int visited = 0;
    records.for_each([&](job_record& r) {
        ++visited;
        records.recycle(r);
    });
    BOOST_TEST(visited == 3);
    BOOST_TEST(records.size() == 0U);
}

BOOST_AUTO_TEST_CASE(a_recycled_record_is_cleared) {
    cles::runtime::job_record_pool records;
    auto& first = records.acquire({});
    cles::detail::request_data data;
    data.peer = &somebody;
    cles::registration task;
    task.plain = [](const cles::request&, cles::json_writer& w) { w.raw("7"); };
    first.assign(cles::request{data}, records.copy_of(somebody), std::make_shared<const cles::registration>(task));
    BOOST_TEST(first.start(cles::time_point::max()));
    BOOST_TEST(first.result() == "7");
    first.started = true;
    records.recycle(first);
    auto& second = records.acquire({});
    BOOST_TEST(&second == &first);
    BOOST_TEST(second.result().empty());
    BOOST_TEST(second.task() == nullptr);
    BOOST_TEST(!second.started);
    BOOST_TEST(!second.stopped());
    records.recycle(second);
}

BOOST_AUTO_TEST_CASE(spare_records_keep_little_memory) {
    constexpr std::size_t count = 64;
    cles::runtime::job_record_pool records;
    cles::detail::request_data data;
    data.peer = &somebody;
    cles::registration task;
    task.plain = [](const cles::request&, cles::json_writer& w) { w.value(std::string(60'000, 'x')); };
    const auto shared = std::make_shared<const cles::registration>(task);
    std::vector<job_record*> taken;
    for (std::size_t i = 0; i < count; ++i) {
        taken.push_back(&records.acquire({}));
        taken.back()->assign(cles::request{data}, records.copy_of(somebody), shared);
        BOOST_REQUIRE(taken.back()->start(cles::time_point::max()));
    }
    for (auto* const r : taken) {
        records.recycle(*r);
    }
    std::size_t kept = 0;
    for (auto*& r : taken) {
        r = &records.acquire({});
        kept += r->result().capacity();
    }
    BOOST_TEST(kept > 500'000U); // some are used again
    BOOST_TEST(kept < 1'048'576U);
    for (auto* const r : taken) {
        records.recycle(*r);
    }
}

BOOST_AUTO_TEST_CASE(all_jobs_of_a_link_share_one_copy_of_its_identity) {
    cles::runtime::job_record_pool peers;
    const auto first = peers.copy_of(somebody);
    BOOST_TEST(first.get() != &somebody);
    BOOST_TEST(first->address == somebody.address);
    BOOST_TEST(peers.copy_of(somebody) == first);
}

BOOST_AUTO_TEST_CASE(another_link_at_the_same_address_has_its_own_identity) {
    cles::runtime::job_record_pool peers;
    auto place = somebody;
    const auto first = peers.copy_of(place);
    place.address = "tcp://127.0.0.1:2";
    const auto second = peers.copy_of(place);
    BOOST_TEST(first->address == "tcp://127.0.0.1:1"); // its jobs may still run
    BOOST_TEST(second->address == "tcp://127.0.0.1:2");
    place.uid = 7;
    BOOST_TEST(peers.copy_of(place) != second);
}

BOOST_AUTO_TEST_CASE(memory_of_identities_is_bounded_with_many_links) {
    cles::runtime::job_record_pool peers;
    const std::weak_ptr<const identity> first = peers.copy_of(somebody);
    std::list<identity> others(2000, somebody);
    for (const auto& each : others) {
        BOOST_TEST_REQUIRE(peers.copy_of(each)->address == somebody.address);
    }
    BOOST_TEST(first.expired());
}

BOOST_AUTO_TEST_SUITE_END()
