# SPDX-License-Identifier: BSL-1.0
"""Pictures of what perf/evaluation/latency.py timed: medians over all links (the paper's Fig. 3), and for each link latency by the
share that took longer."""

from .bench_pictures import TIMES, decades
from .gnuplot import KEY_BESIDE, block, draw, line_style, quoted
from .series_pictures import quantiles

EXCHANGES = (("icd-pull", "round trip by hand"), ("pull", "PULL"), ("icd-update", "one way by hand"),
             ("update", "UPDATE, one way"), ("update-multicast", "UPDATE by multicast, one way"))
PLACES = (("loopback", "one machine"), ("lively", "1000 a second"), ("paced", "50 a second"), ("cable", "cable"),
          ("wifi", "like WiFi"), ("narrow", "64 kbit/s"))


def kinds(raw, note):
    figures = {each["name"]: each for each in raw["figures"]}
    places = [(link, title) for link, title in PLACES if f"{link}_pull_p50" in figures]
    found = [(f"link_{name}", f"Round trips and ways of the localization, {meaning}: all that were timed.",
              _drawer(name, raw["series"], note)) for name, meaning in raw["links"].items()]
    if places:
        found.insert(0, ("fig3", "Round trips and ways of the localization, by hand and by CLES, over each link (the paper's "
                         "Fig. 3): medians with their 95 % intervals.", lambda: medians(figures, places, note)))
    return found


def _drawer(name, series, note):
    def drawn():
        labelled = {label: [us for a_round in series[name][kind] for us in a_round] for kind, label in EXCHANGES
                    if kind in series[name]}
        return quantiles(f"link_{name}", labelled, note, "\u00b5s")

    return drawn


def medians(figures, places, note):
    blocks, plots, shown = [], [], []
    for n, (kind, label) in enumerate(EXCHANGES):
        rows = [(i + 0.1 * (n - (len(EXCHANGES) - 1) / 2), *(figures[name][end] for end in ("value", "low", "high")))
                for i, (link, _) in enumerate(places) for name in [f"{link}_{kind.replace('-', '_')}_p50"]]
        shown += [us for row in rows for us in row[1:]]
        blocks.append(block(f"kind{n}", rows))
        plots.append(f"$kind{n} using 1:2:3:4 with yerrorbars {line_style(n)} title {quoted(label)}")
    ticks = ", ".join(f"{quoted(title)} {i}" for i, (_, title) in enumerate(places))
    return draw("fig3", "".join(blocks) + f"""set logscale y
set xrange [-0.5:{len(places) - 0.5}]
set xtics ({ticks}) font 'sans-serif,11'
set ylabel 'p50'
set yrange {decades(shown)}
set ytics ({TIMES})
{KEY_BESIDE}plot {', '.join(plots)}
""", 860, 400, note)
