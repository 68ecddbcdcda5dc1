// SPDX-License-Identifier: BSL-1.0
// Nodes that reach each other through others, in virtual time: the routes, and what happens when links are lost.
#include "simulation/mesh.hpp"
#include "simulation/seeds.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>

BOOST_AUTO_TEST_SUITE(mesh)

using namespace std::chrono_literals;
using namespace cles::simulation;

namespace {

void hold(std::uint64_t seed, const mesh_setup& setup) {
    const auto r = simulate_mesh(seed, setup);
    expect_none(r.violations, "seed " + std::to_string(seed));
    BOOST_TEST(r.requests.succeeded != 0U);
    BOOST_TEST_MESSAGE("seed " << seed << ": " << to_text(r));
}

/// A line with this fault violates that rule, perhaps others too.
void finds(planted fault, rule broken) {
    const auto found =
        simulate_mesh(1, {.form = mesh_form::line, .nodes = 4, .cuts = 0, .crashes = 0, .requests = 20}, fault)
            .violations;
    BOOST_TEST(std::ranges::any_of(found, [&](const violation& v) { return v.broken == broken; }),
               std::string{to_string(fault)} + " was not found");
}

} // namespace

BOOST_AUTO_TEST_CASE(a_line) { hold(1, {.form = mesh_form::line, .nodes = 6, .cuts = 0}); }
BOOST_AUTO_TEST_CASE(a_ring) { hold(2, {.form = mesh_form::ring, .nodes = 8, .cuts = 1}); }
BOOST_AUTO_TEST_CASE(a_star) { hold(3, {.form = mesh_form::star, .nodes = 8, .cuts = 0}); }
BOOST_AUTO_TEST_CASE(a_grid) { hold(4, {.form = mesh_form::grid, .nodes = 16}); }
// Requests over more links than they may be forwarded fail, and say how many it takes.
BOOST_AUTO_TEST_CASE(a_line_of_twelve) { hold(5, {.form = mesh_form::line, .nodes = 12, .cuts = 0}); }
BOOST_AUTO_TEST_CASE(a_line_that_takes_more_hops) {
    hold(6, {.form = mesh_form::line, .nodes = 16, .cuts = 0, .crashes = 0, .hops = 15});
}
BOOST_AUTO_TEST_CASE(random_meshes) {
    for (std::uint64_t seed = 1; seed <= mesh_seeds; ++seed) {
        hold(seed, {.nodes = 20});
    }
}
BOOST_AUTO_TEST_CASE(meshes_that_lose_many_links) {
    for (std::uint64_t seed = 1; seed <= cut_mesh_seeds; ++seed) {
        hold(seed, {.nodes = cut_mesh_nodes, .cuts = cut_mesh_cuts, .crashes = 1});
    }
}
BOOST_AUTO_TEST_CASE(links_that_cannot_be_opened_need_not_be_declared) {
    for (std::uint64_t seed = 1; seed <= undeclared_mesh_seeds; ++seed) {
        hold(seed, {.nodes = 12, .declared = false});
    }
}

#if CLES_SIMULATION_SECURED
BOOST_AUTO_TEST_CASE(a_line_with_security) {
    hold(1, {.form = mesh_form::line, .nodes = 6, .cuts = 0, .secured = true});
}
BOOST_AUTO_TEST_CASE(a_ring_with_security) {
    hold(2, {.form = mesh_form::ring, .nodes = 8, .cuts = 1, .secured = true});
}
BOOST_AUTO_TEST_CASE(random_meshes_with_security) {
    for (std::uint64_t seed = 1; seed <= secured_mesh_seeds; ++seed) {
        hold(seed, {.nodes = secured_mesh_nodes, .secured = true});
    }
}
#endif

BOOST_AUTO_TEST_CASE(a_link_that_must_not_be_is_found) { finds(planted::links_ignored, rule::links_kept); }
BOOST_AUTO_TEST_CASE(a_node_that_forwards_nothing_is_found) { finds(planted::route_withheld, rule::routes_found); }
BOOST_AUTO_TEST_CASE(two_hundred_nodes) { hold(1, {.nodes = mesh_nodes, .cuts = 1, .requests = 1000}); }

BOOST_AUTO_TEST_SUITE_END()
