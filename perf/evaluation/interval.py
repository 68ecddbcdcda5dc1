# SPDX-License-Identifier: BSL-1.0
"""Medians and their confidence intervals."""

import math
import random
import statistics


def median_interval(values, resamples=2000, seed=1):
    """The 95 % interval of the median: percentiles of the medians of resamples (bootstrap)."""
    chance = random.Random(seed)
    medians = sorted(statistics.median(chance.choices(values, k=len(values))) for _ in range(resamples))
    return medians[int(0.025 * resamples)], medians[int(0.975 * resamples) - 1]


def summary(values):
    low, high = median_interval(values)
    return {"median": statistics.median(values), "low": low, "high": high, "min": min(values), "max": max(values),
            "runs": len(values)}


def quantile(values, share):
    """The nearest rank: the smallest value that this share of all does not exceed."""
    return sorted(values)[max(0, math.ceil(share * len(values)) - 1)]


def interval_over(rounds, statistic, resamples=1000, seed=1):
    """The 95 % interval of a statistic of whole rounds: percentiles over resampled rounds. Values of one round stay
    together, because a disturbance affects all of them."""
    chance = random.Random(seed)
    found = sorted(statistic(chance.choices(rounds, k=len(rounds))) for _ in range(resamples))
    return found[int(0.025 * resamples)], found[int(0.975 * resamples) - 1]
