// SPDX-License-Identifier: BSL-1.0
#include "score.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace jadc2 {

std::vector<std::optional<std::size_t>> score::add(const std::vector<visible_vehicle>& truth,
                                                   const std::vector<fmv::point>& tracks) {
    std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
    for (std::size_t i = 0; i < truth.size(); ++i) {
        for (std::size_t k = 0; k < tracks.size(); ++k) {
            const double d = std::hypot(truth[i].at.x - tracks[k].x, truth[i].at.y - tracks[k].y);
            if (d <= near) {
                pairs.emplace_back(d, i, k);
            }
        }
    }
    std::sort(pairs.begin(), pairs.end());
    std::vector<bool> found(truth.size());
    std::vector<std::optional<std::size_t>> vehicles(tracks.size());
    for (const auto& [d, i, k] : pairs) {
        if (!found[i] && !vehicles[k]) {
            found[i] = true;
            vehicles[k] = i;
        }
    }
    ++sums_.frames;
    for (std::size_t i = 0; i < truth.size(); ++i) {
        sums_.vehicles += truth[i].has_to_be_found ? 1U : 0U;
        sums_.found += truth[i].has_to_be_found && found[i] ? 1U : 0U;
    }
    sums_.false_tracks += static_cast<std::uint64_t>(std::count(vehicles.begin(), vehicles.end(), std::nullopt));
    return vehicles;
}

double score::recall() const noexcept {
    return sums_.vehicles == 0 ? 0 : static_cast<double>(sums_.found) / static_cast<double>(sums_.vehicles);
}

double score::false_per_frame() const noexcept {
    return sums_.frames == 0 ? 0 : static_cast<double>(sums_.false_tracks) / static_cast<double>(sums_.frames);
}

} // namespace jadc2
