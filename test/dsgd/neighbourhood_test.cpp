// SPDX-License-Identifier: BSL-1.0
#include "digits/descent.hpp"
#include "dsgd/neighbours/neighbourhood.hpp"
#include "images.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cmath>

namespace neighbourhood {
namespace {

using names = std::vector<std::string>;

const digits::shape form{.inputs = 1, .hidden = 1, .classes = 2};

digits::network of(float value) { return {.form = form, .weights = std::vector<float>(form.weights(), value)}; }
float value_of(const digits::network& n) { return n.weights.front(); }

// A node with two neighbours that has ended rounds of 100 ms each.
dsgd::neighbourhood after_rounds(std::uint64_t rounds) {
    dsgd::neighbourhood out{{"b", "c"}, 10'000};
    for (std::uint64_t round = 1; round <= rounds; ++round) {
        const auto now = 100.0 * static_cast<double>(round);
        out.trained(round, of(1), now - 50);
        out.hear("b", round, 2, of(1));
        out.hear("c", round, 2, of(1));
        out.ready(now);
        out.mix(now);
    }
    return out;
}

} // namespace
} // namespace neighbourhood

BOOST_AUTO_TEST_SUITE(neighbourhood)

BOOST_AUTO_TEST_CASE(it_waits_for_its_neighbours) {
    dsgd::neighbourhood all{{"b", "c"}, 10'000};
    BOOST_TEST(all.degree() == 2U);
    all.hear("b", 0, 2, of(9)); // the start
    all.trained(1, of(1), 50);
    BOOST_TEST(!all.ready(50));
    all.hear("b", 1, 2, of(4));
    BOOST_TEST(!all.ready(60));
    all.hear("x", 1, 2, of(100)); // no neighbour
    BOOST_TEST(!all.ready(60));
    all.hear("c", 1, 2, of(7));
    BOOST_TEST(all.ready(60));
    BOOST_TEST(all.last_round("c") == 1U);
    BOOST_TEST(all.last_round("x") == 0U);
    BOOST_TEST(value_of(all.mix(60)) == 4.0F); // a third of each
    BOOST_TEST((all.mixed() == names{"b", "c"}));
    all.trained(2, of(1), 100);
    BOOST_TEST(!all.ready(100)); // what they have told is of the round before
}

BOOST_AUTO_TEST_CASE(neighbours_count_by_the_larger_degree) {
    dsgd::neighbourhood all{{"b", "c"}, 10'000};
    all.trained(1, of(0), 50);
    all.hear("b", 1, 1, of(12)); // as this node has two: a third
    all.hear("c", 1, 5, of(12)); // a sixth
    BOOST_TEST(all.ready(60));
    BOOST_TEST(std::abs(value_of(all.mix(60)) - 6) < 1e-5F);
}

BOOST_AUTO_TEST_CASE(a_neighbour_may_be_ahead) {
    dsgd::neighbourhood all{{"b"}, 10'000};
    all.trained(1, of(0), 50);
    all.hear("b", 1, 1, of(2));
    all.mix(60);
    all.hear("b", 2, 1, of(4)); // while this node trains
    all.trained(2, of(0), 100);
    BOOST_TEST(all.ready(100));
    BOOST_TEST(value_of(all.mix(100)) == 2.0F);
    BOOST_TEST(all.next_round() == 3U);
    all.trained(3, of(1), 150);
    all.hear("b", 3, 1, of(1));
    all.hear("b", 4, 1, of(100));
    BOOST_TEST(value_of(all.mix(150)) == 1.0F); // of the same round
    BOOST_TEST(all.next_round() == 4U);
}

BOOST_AUTO_TEST_CASE(a_node_that_was_left_behind_goes_on_with_the_others) {
    dsgd::neighbourhood all{{"b"}, 10'000};
    all.hear("b", 5, 1, of(9));
    all.hear("b", 6, 1, of(10));
    all.hear("b", 7, 1, of(11));
    all.trained(1, of(1), 50);
    BOOST_TEST(all.ready(50));
    BOOST_TEST(value_of(all.mix(50)) == 6.0F); // with the newest one
    BOOST_TEST((all.mixed() == names{"b"}));
    BOOST_TEST(all.next_round() == 8U);
}

BOOST_AUTO_TEST_CASE(a_late_neighbour_is_left_out_until_it_is_heard) {
    auto all = after_rounds(5);
    all.trained(6, of(1), 550);
    all.hear("b", 6, 2, of(1));
    const auto limit = 100 * dsgd::neighbourhood::late_factor + dsgd::neighbourhood::late_more_ms;
    BOOST_TEST(!all.ready(550 + limit));
    BOOST_TEST(all.absent().empty());
    BOOST_TEST(all.ready(550 + limit + 1));
    BOOST_TEST((all.absent() == std::set<std::string>{"c"}));
    all.mix(2'000);
    BOOST_TEST((all.mixed() == names{"b"}));
    all.trained(7, of(1), 2'050);
    all.hear("b", 7, 2, of(1));
    BOOST_TEST(all.ready(2'050)); // it is not waited for any more
    all.hear("c", 5, 2, of(1));   // an old round
    BOOST_TEST((all.absent() == std::set<std::string>{"c"}));
    all.hear("c", 7, 2, of(1));
    BOOST_TEST(all.absent().empty());
    all.mix(2'060);
    BOOST_TEST((all.mixed() == names{"b", "c"}));
}

BOOST_AUTO_TEST_CASE(a_lost_neighbour_is_not_waited_for) {
    auto all = after_rounds(2);
    all.trained(3, of(1), 250);
    all.hear("b", 3, 2, of(1));
    BOOST_TEST(!all.ready(251));
    all.lose("c");
    BOOST_TEST(all.ready(251));
}

BOOST_AUTO_TEST_CASE(one_that_was_never_there_is_waited_for_with_patience) {
    dsgd::neighbourhood all{{"b"}, 10'000};
    all.trained(1, of(1), 50);
    BOOST_TEST(!all.ready(10'050));
    BOOST_TEST(all.ready(10'051));
    BOOST_TEST(value_of(all.mix(10'051)) == 1.0F);
}

BOOST_AUTO_TEST_CASE(a_network_of_another_shape_is_not_mixed) {
    dsgd::neighbourhood all{{"b"}, 10'000};
    all.hear("b", 1, 1, digits::made({.inputs = 2, .hidden = 1, .classes = 2}, 1)); // before this node has one
    all.trained(1, of(1), 50);
    BOOST_TEST(all.ready(50));
    BOOST_TEST(value_of(all.mix(50)) == 1.0F);
    all.trained(2, of(1), 100);
    all.hear("b", 2, 1, digits::made({.inputs = 2, .hidden = 1, .classes = 2}, 1));
    BOOST_TEST(!all.ready(100));
}

// A ring of four, each of which has images of one class.
BOOST_AUTO_TEST_CASE(a_ring_learns_what_no_node_has_seen) {
    const auto test = dsgd_test::rows_of_pixels(200, 9);
    std::vector<digits::image_set> images;
    std::vector<dsgd::neighbourhood> nodes;
    const digits::shape shape{.inputs = 9, .hidden = 8, .classes = 3};
    std::vector<digits::network> now(4, digits::made(shape, 5));
    for (std::size_t k = 0; k < 4; ++k) {
        digits::image_set own{{.pixels = 9, .brightest = 100, .classes = 3}};
        const auto all = dsgd_test::rows_of_pixels(600, k + 1);
        for (std::size_t i = 0; i < all.size(); ++i) {
            if (all.class_of(i) != k % 3) {
                continue;
            }
            std::string line;
            for (const auto pixel : all.image(i)) {
                line += std::to_string(std::lround(pixel * 100)) + ",";
            }
            own.add_line(line + std::to_string(all.class_of(i)));
        }
        images.push_back(own);
        nodes.emplace_back(names{std::to_string((k + 3) % 4), std::to_string((k + 1) % 4)}, 10'000);
    }
    for (std::uint64_t round = 1; round <= 60; ++round) {
        std::vector<digits::network> trained;
        for (std::size_t k = 0; k < 4; ++k) {
            digits::descent work{images[k], now[k], {.passes = 1, .rate = 0.01, .seed = round}};
            while (work.step()) {
            }
            trained.push_back(work.result());
            nodes[k].trained(round, work.result(), 0);
        }
        for (std::size_t k = 0; k < 4; ++k) {
            for (const auto other : {(k + 1) % 4, (k + 3) % 4}) {
                nodes[k].hear(std::to_string(other), round, 2, trained[other]);
            }
            BOOST_TEST(nodes[k].ready(0));
            now[k] = nodes[k].mix(0);
        }
    }
    for (const auto& each : now) {
        BOOST_TEST(accuracy(each, test) > 0.9);
    }
}

BOOST_AUTO_TEST_SUITE_END()
