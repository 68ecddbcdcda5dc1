# SPDX-License-Identifier: BSL-1.0
"""Medians, and how far they can be trusted."""

import math
import random
import statistics


def median_interval(values, resamples=2000, seed=1):
    """Within which the median lies with 95 % confidence: percentiles of the medians of resamples (bootstrap)."""
    chance = random.Random(seed)
    medians = sorted(statistics.median(chance.choices(values, k=len(values))) for _ in range(resamples))
    return medians[int(0.025 * resamples)], medians[int(0.975 * resamples) - 1]


def summary(values):
    low, high = median_interval(values)
    return {"median": statistics.median(values), "low": low, "high": high, "min": min(values), "max": max(values),
            "runs": len(values)}


def quantile(values, share):
    """The nearest rank: the smallest value that at least this share of all does not exceed."""
    return sorted(values)[max(0, math.ceil(share * len(values)) - 1)]


def interval_over(rounds, statistic, resamples=1000, seed=1):
    """Within which a statistic of whole rounds lies with 95 % confidence: percentiles over resampled rounds. What disturbs
    a round disturbs all that was measured in it, which stays together."""
    chance = random.Random(seed)
    found = sorted(statistic(chance.choices(rounds, k=len(rounds))) for _ in range(resamples))
    return found[int(0.025 * resamples)], found[int(0.975 * resamples) - 1]
