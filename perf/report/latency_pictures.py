# SPDX-License-Identifier: BSL-1.0
"""Pictures of what perf/evaluation/latency.py timed across links: latency by the share that took longer."""

from .series_pictures import quantiles

EXCHANGES = (("icd-pull", "round trip by hand"), ("pull", "PULL"), ("icd-update", "one way by hand"),
             ("update", "UPDATE, one way"), ("update-multicast", "UPDATE by multicast, one way"))


def kinds(raw, note):
    return [(f"link_{name}", f"Round trips and ways of the localization, {meaning}: all that were timed.",
             _drawer(name, raw["series"], note)) for name, meaning in raw["links"].items()]


def _drawer(name, series, note):
    def drawn():
        labelled = {label: [us for a_round in series[name][kind] for us in a_round] for kind, label in EXCHANGES
                    if kind in series[name]}
        return quantiles(f"link_{name}", labelled, note, "\u00b5s")

    return drawn
