// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/support/clock.hpp"
#include "perf/support/latency_recorder.hpp"
#include "perf/support/localization.hpp"

#include <boost/describe/class.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>

/// One publisher and many binders: what the exchanges by hand and by the library have in common.
namespace cles::perf {

/// The localization packet with the time of its publication. Both ends read the same monotonic clock, so that the time
/// of one way is exact.
struct publication : localization {
    std::int64_t published_ns = 0;
};
BOOST_DESCRIBE_STRUCT(publication, (localization), (published_ns))

/// The nth sample, published now.
inline publication publish_sample(std::uint64_t n) noexcept {
    publication value;
    static_cast<localization&>(value) = sample(n);
    value.published_ns = monotonic_ns();
    return value;
}

/// What is published in a pass.
struct fan_out_order {
    std::uint64_t binders = 1;
    std::uint64_t updates = 0;
    std::uint64_t interval_ns = 0; ///< from one publication to the next; 0: as fast as the binders accept them
};
BOOST_DESCRIBE_STRUCT(fan_out_order, (), (binders, updates, interval_ns))

struct fan_out_tally {
    std::uint64_t delivered = 0;     ///< to the code of all binders together
    std::chrono::nanoseconds took{}; ///< from the first publication to the last delivery
};

/// A pass ends when every binder has received the last update, or, since datagrams may be lost, when all has been
/// published and nothing has arrived for this long.
inline constexpr std::chrono::milliseconds silence{100};

/// Counts what the code of all binders receives in a pass.
class arrivals {
  public:
    /// Latencies are recorded if there is a recorder, which must have capacity for all.
    explicit arrivals(latency_recorder* record) : record_(record) {
        if (record_ != nullptr) {
            record_->clear();
        }
    }

    /// \throws std::runtime_error if the values are not those that were published
    void take(const publication& value);

    [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
    [[nodiscard]] fan_out_tally tally() const noexcept {
        return {.delivered = count_, .took = std::chrono::nanoseconds{last_ - first_published_}};
    }

  private:
    latency_recorder* record_;
    std::uint64_t count_ = 0;
    std::int64_t first_published_ = 0;
    std::int64_t last_ = 0;
};

} // namespace cles::perf
