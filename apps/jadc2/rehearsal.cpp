// SPDX-License-Identifier: BSL-1.0
#include "rehearsal.hpp"

#include <cles/convert.hpp>

#include "commander.hpp"
#include "fmv/frame_codec.hpp"
#include "fmv/stream.hpp"
#include "picture.hpp"
#include "scene.hpp"
#include "strike/engagement.hpp"
#include "track_evaluation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace jadc2 {
namespace {

constexpr double fps = 25;
constexpr std::uint64_t frames = fmv::background::learning + 40;
constexpr std::size_t per_scene = 3;
constexpr double least_age = 0.6;           // s
constexpr std::uint64_t scenes_at_most = 3; // for each strike
// Scenes begin 1000 s apart; further ones repeat these times, because larger ones are less exact.
constexpr std::uint64_t distinct_times = 100'000;

struct rehearsed_target {
    fmv::track track{};
    std::size_t vehicle = 0;
};

// Films a scene, and returns targets that are not false tracks.
std::vector<rehearsed_target> film(const scene& ground, double begin_utc, double& last_utc) {
    fmv::stream video{scene::size};
    track_evaluation evaluation{ground};
    evaluation.begin(0, begin_utc);
    for (std::uint64_t i = 0; i < frames; ++i) {
        last_utc = begin_utc + static_cast<double>(i) / fps;
        const auto sent = fmv::encode(ground.frame(i, last_utc), scene::size, fmv::default_format());
        video.take(fmv::decode(sent, scene::size, fmv::default_format()).value(), ground.reported(last_utc), last_utc);
        evaluation.add(last_utc, video.tracks(), video.ready());
    }
    std::vector<rehearsed_target> out;
    for (const auto& t : video.tracks()) {
        const auto vehicle = evaluation.vehicle_of(t.id);
        if (t.age >= least_age && t.missed == 0 && vehicle && out.size() < per_scene) {
            out.push_back({.track = t, .vehicle = *vehicle});
        }
    }
    return out;
}

// How far a weapon misses, and how far it is expected to, m.
struct miss {
    double by = 0;
    double sigma = 0;
};

// Nothing, if there is no aim.
std::optional<miss> released(const scene& ground, std::uint64_t seed, const rehearsed_target& target, double utc,
                             double delay_s, std::uint64_t scans) {
    const auto own = strike::default_state(scans);
    strike::own_sensor sensor{seed, own.at};
    const double now = utc + delay_s;
    const auto aimed = strike::engage(order_against(target.track, utc, "rehearsal"), now, own, sensor);
    if (!aimed) {
        return std::nullopt;
    }
    const auto truth = ground.truth(now + aimed->after_s)[target.vehicle].at;
    const auto place = scene::plane().to_plane(aimed->at);
    return miss{.by = std::hypot(truth.east - place.east, truth.north - place.north), .sigma = aimed->sigma};
}

double quantile(const std::vector<double>& sorted, double part) {
    return sorted.empty() ? 0
                          : sorted[std::min(sorted.size() - 1,
                                            static_cast<std::size_t>(part * static_cast<double>(sorted.size())))];
}

class tally {
  public:
    void add(const std::optional<miss>& one) {
        ++strikes_;
        if (one) {
            missed_.push_back(one->by);
            expected_ += one->sigma * one->sigma;
            observed_ += one->by * one->by / 2;
        }
    }
    [[nodiscard]] std::uint64_t strikes() const noexcept { return strikes_; }
    [[nodiscard]] strike_record record() const {
        auto sorted = missed_;
        std::sort(sorted.begin(), sorted.end());
        const auto hits = std::upper_bound(sorted.begin(), sorted.end(), effective_radius) - sorted.begin();
        const auto count = std::max(1.0, static_cast<double>(sorted.size()));
        return {.strikes = strikes_,
                .not_aimed = strikes_ - sorted.size(),
                .hits = static_cast<std::uint64_t>(hits),
                .median_missed_by = quantile(sorted, 0.5),
                .p95_missed_by = quantile(sorted, 0.95),
                .expected_sigma = std::sqrt(expected_ / count),
                .observed_sigma = std::sqrt(observed_ / count)};
    }

  private:
    std::uint64_t strikes_ = 0;
    std::vector<double> missed_;
    double expected_ = 0, observed_ = 0; ///< sums of squares
};

} // namespace

rehearsal_result rehearse(const rehearsal_options& args) {
    tally fused;
    tally alone;
    for (std::uint64_t seed = args.seed; fused.strikes() < args.strikes; ++seed) {
        if (seed - args.seed > args.strikes * scenes_at_most) {
            throw std::runtime_error("there are too few targets in the scenes");
        }
        const scene ground{seed};
        double utc = 0;
        const auto targets = film(ground, static_cast<double>(seed % distinct_times) * 1000, utc);
        for (const auto& each : targets) {
            if (fused.strikes() < args.strikes) {
                fused.add(released(ground, seed, each, utc, args.delay_s, args.scans));
                alone.add(released(ground, seed, each, utc, args.delay_s, 0));
            }
        }
    }
    return {.fused = fused.record(), .track_alone = alone.record()};
}

int print_rehearsal(const rehearsal_options& args) {
    std::puts(cles::to_json(rehearse(args)).c_str());
    return 0;
}

} // namespace jadc2
