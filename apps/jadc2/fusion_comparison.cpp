// SPDX-License-Identifier: BSL-1.0
#include "fusion_comparison.hpp"

#include <cles/convert.hpp>

#include "fmv/plot_fusion.hpp"
#include "fmv/stream.hpp"
#include "scene.hpp"
#include "track_evaluation.hpp"

#include <cmath>
#include <cstdio>
#include <vector>

namespace jadc2 {
namespace {

constexpr double frames_per_second = 25;
constexpr double compared_s = 1; // at the end of a film
// Films begin 1000 s apart; further ones repeat these times, because larger ones are less exact.
constexpr std::uint64_t different_times = 100'000;

/// Sums of squares.
class place_sums {
  public:
    void expect(const std::vector<fmv::track>& tracks) {
        for (const auto& each : tracks) {
            expected_ += each.sigma * each.sigma;
            ++tracks_;
        }
    }
    // The error of a scene is nearly the same in all its frames: each scene counts once.
    void observe(double error) {
        observed_ += error * error;
        ++scenes_;
    }
    [[nodiscard]] place_record record() const {
        const auto root = [](double sum, std::uint64_t count) {
            return count == 0 ? 0.0 : std::sqrt(sum / static_cast<double>(count));
        };
        return {.expected_sigma = root(expected_, tracks_), .observed_sigma = root(observed_, scenes_)};
    }

  private:
    double expected_ = 0, observed_ = 0;
    std::uint64_t tracks_ = 0, scenes_ = 0;
};

class comparison {
  public:
    void film(std::uint64_t seed, double seconds) {
        const scene ground{seed};
        const double begin = static_cast<double>(seed % different_times) * 1000;
        track_evaluation one{ground};
        track_evaluation two{ground};
        one.begin(0, begin);
        two.begin(0, begin);
        fmv::stream video{scene::size};
        fmv::plot_fusion fusion{seed};
        bool is_fused = false;
        const auto count = static_cast<std::uint64_t>(seconds * frames_per_second);
        const auto first_compared = static_cast<std::uint64_t>((seconds - compared_s) * frames_per_second);
        for (std::uint64_t i = 0; i < count; ++i) {
            const double utc = begin + static_cast<double>(i) / frames_per_second;
            video.take(ground.frame(i, utc), ground.reported(utc), utc);
            const auto tracks = video.tracks();
            auto fused = tracks;
            const auto by = fusion.correct(fused, video.error_of_places().value(), utc);
            if (i < first_compared) {
                continue;
            }
            one.add(utc, tracks, video.ready());
            two.add(utc, fused, video.ready(), by.value_or(fmv::place_shift{}));
            one_.expect(tracks);
            two_.expect(fused);
            is_fused = by.has_value();
        }
        if (one.place_error() == 0) { // nothing was found
            return;
        }
        one_.observe(one.place_error());
        two_.observe(two.place_error());
        ++scenes_;
        fused_ += is_fused ? 1U : 0U;
    }
    [[nodiscard]] comparison_result result() const {
        return {.scenes = scenes_, .fused = fused_, .camera_alone = one_.record(), .with_plots = two_.record()};
    }

  private:
    place_sums one_, two_;
    std::uint64_t scenes_ = 0, fused_ = 0;
};

} // namespace

comparison_result compare_sources(const comparison_options& args) {
    comparison all;
    for (std::uint64_t i = 0; i < args.scenes; ++i) {
        all.film(args.seed + i, args.seconds);
    }
    return all.result();
}

int print_comparison(const comparison_options& args) {
    std::puts(cles::to_json(compare_sources(args)).c_str());
    return 0;
}

} // namespace jadc2
