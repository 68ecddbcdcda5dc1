// SPDX-License-Identifier: BSL-1.0
#include "local.hpp"

#include "sgd/training.hpp"

#include <chrono>
#include <cstddef>
#include <thread>

namespace dsgd {

std::vector<sgd::trained> train_here(const sgd::data_set& data, const std::vector<sgd::order>& orders) {
    using steady = std::chrono::steady_clock;
    using ms = std::chrono::duration<double, std::milli>;
    std::vector<sgd::trained> done(orders.size());
    const auto all_begun = steady::now();
    const auto train = [&](std::size_t i) {
        const auto begun = steady::now();
        const auto& what = orders[i];
        const sgd::schedule how{.steps = *what.epochs * what.count, .rate = *what.rate, .seed = *what.seed};
        sgd::training work{data, {.first = what.first, .count = what.count}, how};
        while (work.step()) {
        }
        const auto now = steady::now();
        done[i] = {.node = "here",
                   .result = work.result(),
                   .points = what.count,
                   .steps = how.steps,
                   .ms = ms{now - begun}.count(),
                   .after_ms = ms{now - all_begun}.count()};
    };
    std::vector<std::thread> threads;
    for (std::size_t i = 1; i < orders.size(); ++i) {
        threads.emplace_back(train, i);
    }
    train(0);
    for (auto& thread : threads) {
        thread.join();
    }
    return done;
}

} // namespace dsgd
