# SPDX-License-Identifier: BSL-1.0
"""The picture of orders to strike, while the node is idle and while video frames saturate it."""

from .gnuplot import KEY_BESIDE, block, draw, line_style, quoted

STATES = (("idle", "idle node"), ("loaded", "saturated node"))
QUANTILES = ("p50", "p99")


def kinds(raw, note):
    return [("strike", "How long an order to strike takes: medians of the rounds, with their 95 % intervals, and each round.",
             lambda: latencies(raw, note))]


def latencies(raw, note):
    figures = {each["name"]: each for each in raw["figures"]}
    blocks, plots = [], []
    for n, (state, title) in enumerate(STATES):
        places = [i + 0.12 * (2 * n - 1) for i in range(len(QUANTILES))]
        medians = [figures[f"strike_{state}_{q}"] for q in QUANTILES]
        blocks.append(block(state, [(at, each["value"], each["low"], each["high"]) for at, each in zip(places, medians)]))
        blocks.append(block(state + "_rounds", [(at + 0.05, each[q + "_us"]) for at, q in zip(places, QUANTILES)
                                                for each in raw["rounds"][state]]))
        style = line_style(n)
        plots += [f"${state} using 1:2:3:4 with yerrorbars {style} title {quoted(title)}",
                  f"${state}_rounds using 1:2 with points {style.split(' linewidth')[0]} pointsize 0.25 notitle"]
    ticks = ", ".join(f"{quoted(label)} {i}" for i, label in enumerate(QUANTILES))
    return draw("strike", "".join(blocks) + f"""set logscale y
set xrange [-0.5:{len(QUANTILES) - 0.5}]
set xtics ({ticks})
set ylabel 'order to answer, \u00b5s'
{KEY_BESIDE}plot {', '.join(plots)}
""", 860, 400, note)
