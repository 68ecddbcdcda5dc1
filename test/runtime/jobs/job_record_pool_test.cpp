// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_record_pool.hpp"

#include <boost/test/unit_test.hpp>

#include <set>
#include <vector>

BOOST_AUTO_TEST_SUITE(job_record_pool)

using cles::runtime::job_record;

std::set<const job_record*> all_of(const cles::runtime::job_record_pool& records) {
    std::set<const job_record*> all;
    for (std::size_t i = 0; i < records.size(); ++i) {
        all.insert(&records[i]);
    }
    return all;
}

BOOST_AUTO_TEST_CASE(records_in_use_are_found_after_others_are_recycled) {
    cles::runtime::job_record_pool records;
    std::vector<job_record*> taken;
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

BOOST_AUTO_TEST_CASE(a_recycled_record_is_cleared) {
    cles::runtime::job_record_pool records;
    auto& first = records.acquire({});
    first.result_buffer() = "left over";
    first.started = true;
    records.recycle(first);
    auto& second = records.acquire({});
    BOOST_TEST(&second == &first);
    BOOST_TEST(second.result_buffer().empty());
    BOOST_TEST(!second.started);
    BOOST_TEST(!second.stopped());
    records.recycle(second);
}

BOOST_AUTO_TEST_SUITE_END()
