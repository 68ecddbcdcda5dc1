// SPDX-License-Identifier: BSL-1.0
#include "score.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace jadc2 {

void score::add(const std::vector<fmv::point>& truth, const std::vector<fmv::point>& tracks) {
    std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
    for (std::size_t i = 0; i < truth.size(); ++i) {
        for (std::size_t k = 0; k < tracks.size(); ++k) {
            if (const auto d = std::hypot(truth[i].x - tracks[k].x, truth[i].y - tracks[k].y); d <= near) {
                pairs.emplace_back(d, i, k);
            }
        }
    }
    std::sort(pairs.begin(), pairs.end());
    std::vector<bool> found(truth.size());
    std::vector<bool> used(tracks.size());
    for (const auto& [d, i, k] : pairs) {
        if (!found[i] && !used[k]) {
            found[i] = used[k] = true;
            ++sums_.found;
        }
    }
    ++sums_.frames;
    sums_.vehicles += truth.size();
    sums_.false_tracks += static_cast<std::uint64_t>(std::count(used.begin(), used.end(), false));
}

double score::recall() const noexcept {
    return sums_.vehicles == 0 ? 0 : static_cast<double>(sums_.found) / static_cast<double>(sums_.vehicles);
}

double score::false_per_frame() const noexcept {
    return sums_.frames == 0 ? 0 : static_cast<double>(sums_.false_tracks) / static_cast<double>(sums_.frames);
}

} // namespace jadc2
