// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <algorithm>

namespace platoon {

/// The loss on a link after Gilbert (1960) and Elliott (1963): before each update, the link may change between a good
/// and a bad state, each of which loses its share of the updates.
struct gilbert_elliott {
    double to_bad = 0, to_good = 0;     ///< the probabilities of a change, for each update
    double good_loss = 0, bad_loss = 1; ///< the probabilities of a loss in either state

    static gilbert_elliott independent(double loss) { return {.good_loss = loss}; }
    /// Bursts in which everything is lost, and no loss between them.
    /// \param loss on average, below 1 \param length the mean number of updates of a burst, at least `shortest(loss)`
    static gilbert_elliott bursts(double loss, double length) {
        return {.to_bad = std::min(1.0, loss / (length * (1 - loss))), .to_good = 1 / length};
    }
    /// With shorter bursts, there are not enough gaps between them.
    static double shortest(double loss) { return std::max(1.0, loss / (1 - loss)); }

    /// The share of time in the bad state.
    [[nodiscard]] double bad_share() const { return to_bad > 0 ? to_bad / (to_bad + to_good) : 0; }
    /// The share of updates that is lost in the long run.
    [[nodiscard]] double mean_loss() const { return bad_share() * bad_loss + (1 - bad_share()) * good_loss; }
    /// The share of losses after which the next update is lost too.
    [[nodiscard]] double repeated_loss() const {
        const double after_bad = (1 - to_good) * bad_loss + to_good * good_loss;
        const double after_good = (1 - to_bad) * good_loss + to_bad * bad_loss;
        return (bad_share() * bad_loss * after_bad + (1 - bad_share()) * good_loss * after_good) / mean_loss();
    }
};

} // namespace platoon
