// SPDX-License-Identifier: BSL-1.0
#include "simulation/seeds.hpp"
#include "simulation/world/simulate.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace sim = cles::simulation;

namespace seeds {
namespace {

void check_seeds(std::uint64_t first, std::uint64_t count, unsigned steps) {
    constexpr std::uint64_t twice_every = 8;
    std::uint64_t requests = 0;
    std::uint64_t updates = 0;
    for (auto seed = first; seed < first + count; ++seed) {
        const auto p = sim::make_plan(seed, steps);
        const auto r = seed % twice_every == 0 ? sim::simulate_twice(p) : sim::simulate(p);
        expect_none(r.violations,
                    "cles_simulation --seed " + std::to_string(seed) + " --steps " + std::to_string(steps));
        requests += r.requests;
        updates += r.updates;
    }
    BOOST_TEST(requests > count * 50); // there was activity
    BOOST_TEST(updates > count);
}

} // namespace
} // namespace seeds

BOOST_AUTO_TEST_SUITE(seeds)

BOOST_AUTO_TEST_CASE(many_short_lives) { check_seeds(1, sim::seeds, sim::steps_of_a_seed); }

BOOST_AUTO_TEST_CASE(some_long_lives) { check_seeds(1'000'000, sim::long_seeds, sim::steps_of_a_long_seed); }

BOOST_AUTO_TEST_CASE(what_once_failed) {
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator{"test/simulation/seeds"}) {
        files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
    BOOST_TEST(!files.empty());
    for (const auto& path : files) {
        const auto p = sim::plan_in_file(path.string());
        if (sim::has_security || !p.secured) {
            expect_none(sim::simulate_twice(p).violations, path.string());
        }
    }
}

BOOST_AUTO_TEST_SUITE_END()
