# SPDX-License-Identifier: BSL-1.0
"""The picture of orders to strike, while a node is idle and while video frames saturate it: of the node that is configured
for urgent work, and of the one with the defaults."""

from .gnuplot import KEY_BESIDE, block, draw, line_style, quoted

SERIES = (("urgent", "idle", "strike_", "idle node"), ("urgent", "loaded", "strike_", "saturated node"),
          ("default", "idle", "strike_default_", "idle node, defaults"),
          ("default", "loaded", "strike_default_", "saturated node, defaults"))
QUANTILES = ("p50", "p99")


def kinds(raw, note):
    setups = raw["setups"]
    return [("strike", "How long an order to strike takes: medians of the rounds, with their 95 % intervals, and each round. "
             f"The node has {setups['urgent']}; with the defaults, {setups['default']}.", lambda: latencies(raw, note))]


def latencies(raw, note):
    figures = {each["name"]: each for each in raw["figures"]}
    blocks, plots = [], []
    for n, (setup, state, prefix, title) in enumerate(SERIES):
        name = f"{setup}_{state}"
        places = [i + 0.12 * (n - (len(SERIES) - 1) / 2) for i in range(len(QUANTILES))]
        medians = [figures[f"{prefix}{state}_{q}"] for q in QUANTILES]
        blocks.append(block(name, [(at, each["value"], each["low"], each["high"]) for at, each in zip(places, medians)]))
        blocks.append(block(name + "_rounds", [(at + 0.04, each[q + "_us"]) for at, q in zip(places, QUANTILES)
                                               for each in raw["rounds"][setup][state]]))
        style = line_style(n)
        plots += [f"${name} using 1:2:3:4 with yerrorbars {style} title {quoted(title)}",
                  f"${name}_rounds using 1:2 with points {style.split(' linewidth')[0]} pointsize 0.25 notitle"]
    ticks = ", ".join(f"{quoted(label)} {i}" for i, label in enumerate(QUANTILES))
    return draw("strike", "".join(blocks) + f"""set logscale y
set xrange [-0.5:{len(QUANTILES) - 0.5}]
set xtics ({ticks})
set ylabel 'order to answer, \u00b5s'
{KEY_BESIDE}plot {', '.join(plots)}
""", 860, 400, note)
