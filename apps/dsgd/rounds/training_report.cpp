// SPDX-License-Identifier: BSL-1.0
#include "training_report.hpp"

#include <cles/convert.hpp>

#include "dsgd/failure.hpp"
#include "dsgd/verdict.hpp"

#include <algorithm>
#include <cstdio>

namespace dsgd {

training_report::training_report(const digits::image_set& test, std::uint64_t rounds, std::uint64_t every,
                                 std::optional<double> best, bool json)
    : test_(test), rounds_(rounds), every_(every), json_(json) {
    found_.best_accuracy = best ? best : test.header().best_accuracy;
}

void training_report::add(const round_result& ended, const digits::network& n) {
    found_.course.push_back(ended);
    found_.rounds = ended.round;
    found_.images += ended.images;
    found_.elapsed_ms = ended.ended_ms;
    const bool last = ended.round == rounds_;
    if (!last && (every_ == 0 || ended.round % every_ != 0)) {
        return;
    }
    const auto accuracy = digits::accuracy(n, test_);
    accuracies_.add(accuracy);
    found_.accuracies.push_back({.round = ended.round, .accuracy = accuracy, .after_ms = ended.ended_ms});
    if (!json_) {
        std::printf("round %5ju  %2zu nodes  loss %8.5f  accuracy %6.2f %%  after %10.3f ms\n",
                    std::uintmax_t{ended.round}, ended.nodes.size(), ended.loss, accuracy * 100, ended.ended_ms);
        std::fflush(stdout);
    }
}

int training_report::finish(const std::optional<cles::error>& failure, std::uint64_t bytes) {
    found_.accuracy = accuracies_.last();
    if (found_.elapsed_ms > 0) {
        found_.images_per_s = static_cast<double>(found_.images) / found_.elapsed_ms * 1000;
    }
    found_.bytes_per_round =
        static_cast<double>(bytes) / static_cast<double>(std::max<std::uint64_t>(1, found_.rounds));
    if (failure) {
        found_.error = failure->message();
    } else {
        found_.shortcoming = accuracies_.shortcoming(found_.best_accuracy);
    }
    if (json_) {
        std::puts(cles::to_json(found_).c_str());
    } else if (!failure) {
        std::printf("elapsed   %.3f ms: %.0f images per second", found_.elapsed_ms, found_.images_per_s);
        if (bytes > 0) {
            std::printf(", %.0f bytes per round", found_.bytes_per_round);
        }
        std::printf("\naccuracy  %.2f %%", found_.accuracy * 100);
        if (found_.best_accuracy) {
            std::printf("; best known %.2f %%", *found_.best_accuracy * 100);
        }
        std::printf("\n");
    }
    if (failure) {
        return report_failure(*failure);
    }
    if (!found_.best_accuracy) {
        std::fputs("cles-dsgd: no best accuracy is known for these images (--best): only convergence is judged\n",
                   stderr);
    }
    return report_shortcoming(found_.shortcoming);
}

} // namespace dsgd
