// SPDX-License-Identifier: BSL-1.0
#include "dsgd/rounds/convergence.hpp"

#include <boost/test/unit_test.hpp>

namespace convergence {
namespace {

dsgd::convergence of(const std::vector<double>& accuracies) {
    dsgd::convergence out;
    for (const auto accuracy : accuracies) {
        out.add(accuracy);
    }
    return out;
}

// Rises, and stays there.
std::vector<double> settled_at(double accuracy) {
    std::vector<double> out{0.5, 0.7, 0.8, 0.9};
    out.resize(16, accuracy);
    return out;
}

} // namespace
} // namespace convergence

BOOST_AUTO_TEST_SUITE(convergence)

BOOST_AUTO_TEST_CASE(what_has_settled_near_the_best_is_good) {
    const auto found = convergence::of(convergence::settled_at(0.97));
    BOOST_TEST(found.last() == 0.97);
    BOOST_TEST(found.shortcoming(0.97).empty());
    BOOST_TEST(found.shortcoming(0.98).empty());
    BOOST_TEST(found.shortcoming({}).empty());
    BOOST_TEST(found.shortcoming(0.99) ==
               "the result is not good: its accuracy is 97.00 %, and 99.00 % is known to be possible");
}

BOOST_AUTO_TEST_CASE(what_still_rises_has_not_converged) {
    std::vector<double> rising;
    for (int i = 0; i < 20; ++i) {
        rising.push_back(0.9 + 0.002 * i);
    }
    BOOST_TEST(convergence::of(rising).shortcoming(0.9) ==
               "the training has not converged: in the last 5 measurements, the accuracy is 1.00 % higher than in as "
               "many before");
}

BOOST_AUTO_TEST_CASE(what_swings_has_not_converged) {
    auto swinging = convergence::settled_at(0.97);
    swinging[14] = 0.92;
    BOOST_TEST(convergence::of(swinging).shortcoming(0.97) ==
               "the training has not converged: in the last 4 measurements, the accuracy goes from 92.00 % to 97.00 %");
}

BOOST_AUTO_TEST_CASE(both_are_told) {
    auto swinging = convergence::settled_at(0.97);
    swinging[14] = 0.92;
    const auto told = convergence::of(swinging).shortcoming(0.99);
    BOOST_TEST(told.starts_with("the result is not good: "));
    BOOST_TEST(told.find("possible; the training has not converged: ") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_few_accuracies_are_not_enough) {
    BOOST_TEST(convergence::of({0.97, 0.97, 0.97, 0.97, 0.97})
                   .shortcoming(0.97)
                   .starts_with("it is not known whether the training has converged: "));
    BOOST_TEST(convergence::of({0.97, 0.97, 0.97, 0.97, 0.97, 0.97}).shortcoming(0.97).empty());
    BOOST_TEST(!convergence::of({}).shortcoming({}).empty());
    BOOST_TEST(convergence::of({}).last() == 0);
}

BOOST_AUTO_TEST_SUITE_END()
