# SPDX-License-Identifier: BSL-1.0
"""The picture of Table 2: how long each row took, beside the paper's."""

from .gnuplot import block, draw


def kinds(raw, note):
    return [("dsgd", "Distributed stochastic gradient descent, elapsed time of each row of Table 2: medians with their 95 % "
             "intervals, and what the paper's machines took. The paper does not say how many steps it counts: compare rows.", lambda: elapsed(raw, note))]


def elapsed(raw, note):
    rows = raw["rows"]
    ours, paper, ticks, most = [], [], [], 0.0
    for place, row in enumerate(reversed(rows)):
        took = row["elapsed_ms"]
        most = max(most, took["high"], row["paper_ms"] or 0)
        ours.append((place + 0.19, took["median"], took["low"], took["high"], f"{took['median']:,.0f} ms".replace(",", " ")))
        if row["paper_ms"]:
            paper.append((place - 0.19, row["paper_ms"], f"{row['paper_ms']:,} ms".replace(",", " ")))
        ticks.append(f"'{row['meaning']}' {place}")
    epochs = raw.get("epochs")
    return draw("dsgd", block("ours", ours) + block("paper", paper) + f"""set yrange [-0.6:{len(rows) - 0.4}]
set xrange [0:{most * 1.18}]
set ytics ({', '.join(ticks)})
set grid noytics
set xlabel 'elapsed, ms{f" ({epochs} epochs here)" if epochs else ""}'
set key outside top right horizontal
set boxwidth 0.36
bar(y) = 0.17
plot $ours using (0):1:(0):2:($1-bar(0)):($1+bar(0)) with boxxyerror linecolor '#0072b2' title 'here', \\
     $paper using (0):1:(0):2:($1-bar(0)):($1+bar(0)) with boxxyerror linecolor '#bbbbbb' title 'the paper', \\
     $ours using 2:1:3:4 with xerrorbars linecolor '#222222' pointtype 0 linewidth 1.5 notitle, \\
     $ours using 4:1:5 with labels left offset 0.7,0 font 'sans-serif,11' notitle, \\
     $paper using 2:1:3 with labels left offset 0.7,0 font 'sans-serif,11' textcolor '#555555' notitle
""", 860, 460, note)
