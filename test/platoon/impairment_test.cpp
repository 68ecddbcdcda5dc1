// SPDX-License-Identifier: BSL-1.0
#include "platoon/simulation/impairment.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

namespace impairment {
namespace {

struct statistics {
    double loss = 0;     ///< of all updates
    double repeated = 0; ///< of those after a loss
    double burst = 0;    ///< mean number of losses in a row
};

statistics measured(const platoon::gilbert_elliott& losses) {
    constexpr int updates = 1'000'000;
    platoon::impairment link{losses, 0, 7};
    double lost = 0;
    double repeated = 0;
    double bursts = 0;
    bool before = false;
    for (int i = 0; i < updates; ++i) {
        const bool now = !link.next();
        lost += now ? 1 : 0;
        repeated += now && before ? 1 : 0;
        bursts += now && !before ? 1 : 0;
        before = now;
    }
    return {lost / updates, repeated / lost, lost / bursts};
}

} // namespace
} // namespace impairment

BOOST_AUTO_TEST_SUITE(impairment)

BOOST_AUTO_TEST_CASE(independent_losses_have_no_memory) {
    const auto losses = platoon::gilbert_elliott::independent(0.2);
    const auto found = measured(losses);
    BOOST_TEST(losses.mean_loss() == 0.2);
    BOOST_TEST(std::abs(losses.repeated_loss() - 0.2) < 1e-12);
    BOOST_TEST(std::abs(found.loss - 0.2) < 0.003);
    BOOST_TEST(std::abs(found.repeated - 0.2) < 0.005);
}

BOOST_AUTO_TEST_CASE(bursts_have_the_length_and_the_share_that_are_asked_for) {
    for (const double loss : {0.05, 0.1, 0.3}) {
        for (const double length : {1.5, 3.0, 10.0}) {
            const auto losses = platoon::gilbert_elliott::bursts(loss, length);
            const auto found = measured(losses);
            BOOST_TEST(std::abs(losses.mean_loss() - loss) < 1e-12);
            BOOST_TEST(std::abs(found.loss / loss - 1) < 0.05, found.loss);
            BOOST_TEST(std::abs(found.burst / length - 1) < 0.05, found.burst);
        }
    }
}

BOOST_AUTO_TEST_CASE(both_states_may_lose_a_part) {
    const platoon::gilbert_elliott losses{.to_bad = 0.02, .to_good = 0.1, .good_loss = 0.01, .bad_loss = 0.7};
    // By hand: a sixth of the time is bad.
    BOOST_TEST(std::abs(losses.mean_loss() - (0.7 + 5 * 0.01) / 6) < 1e-12);
    const double after_bad = 0.9 * 0.7 + 0.1 * 0.01;
    const double after_good = 0.98 * 0.01 + 0.02 * 0.7;
    const double repeated = (0.7 * after_bad + 5 * 0.01 * after_good) / 6 / losses.mean_loss();
    BOOST_TEST(std::abs(losses.repeated_loss() - repeated) < 1e-12);
    const auto found = measured(losses);
    BOOST_TEST(std::abs(found.loss / losses.mean_loss() - 1) < 0.03, found.loss);
    BOOST_TEST(std::abs(found.repeated / losses.repeated_loss() - 1) < 0.03, found.repeated);
}

BOOST_AUTO_TEST_CASE(what_is_not_lost_is_late_by_half_of_the_delay_at_least) {
    platoon::impairment link{platoon::gilbert_elliott::independent(0), 0.1, 1};
    for (int i = 0; i < 1000; ++i) {
        const auto later = link.next();
        BOOST_TEST_REQUIRE(later.has_value());
        BOOST_TEST((*later >= 0.05 && *later <= 0.1));
    }
}

BOOST_AUTO_TEST_SUITE_END()
