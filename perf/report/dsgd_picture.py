# SPDX-License-Identifier: BSL-1.0
"""The pictures of distributed stochastic gradient descent: Table 2, how long each row took, with the paper's; the data
set with its classifier, and a detail of it at the boundary between the classes (Figs. 5 and 6)."""

from .gnuplot import block, draw


def kinds(raw, note):
    shown = [("dsgd", "Distributed stochastic gradient descent, elapsed time of each row of Table 2: medians with their 95 % "
             "intervals, and what the paper's machines took for another amount of work: the paper does not say how many steps. "
             "Compare the rows of one colour with each other, not the two colours.", lambda: elapsed(raw, note))]
    if "pictured" in raw:
        data = raw["pictured"]
        shown += [
            ("data_set", f"Data set with classifier (the paper's Fig. 5): {len(data['some'])} of {data['of']} points, evenly "
             "drawn, and the line by which the averaged classifier separates them.",
             lambda: data_set("data_set", data, data["some"], None, note)),
            ("data_set_zoomed", "The same where the classes meet (the paper's Fig. 6), with every point there.",
             lambda: data_set("data_set_zoomed", data, data["near"], data["box"], note))]
    return shown


def data_set(name, data, points, half_a_side, note):
    (a, b), bias = data["classifier"]["weights"], data["classifier"]["bias"]
    wrong = sum((a * x + b * y + bias > 0.5) != bool(of_class) for x, y, of_class in points)
    within = f"[{-half_a_side}:{half_a_side}]" if half_a_side else "[-7:7]"
    return draw(name, "".join(block(f"class{k}", [(x, y) for x, y, of_class in points if of_class == k]) for k in (0, 1))
                + f"""set xrange {within}
set yrange {within}
set size ratio 1
set xlabel 'x'
set ylabel 'y'
set key outside right top Left reverse samplen 2
set title '{len(points)} points, {wrong} of them on the wrong side' font 'sans-serif,12'
plot $class0 using 1:2 with points pointtype 7 pointsize {0.35 if half_a_side else 0.22} linecolor '#0072b2' title 'class 0', \\
     $class1 using 1:2 with points pointtype 9 pointsize {0.4 if half_a_side else 0.26} linecolor '#d55e00' title 'class 1', \\
     (0.5 - {bias!r} - {a!r} * x) / {b!r} with lines linewidth 2 linecolor '#222222' title 'classifier'
""", 620, 480, note)


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
     $paper using (0):1:(0):2:($1-bar(0)):($1+bar(0)) with boxxyerror linecolor '#bbbbbb' title 'the paper, another amount of work', \\
     $ours using 2:1:3:4 with xerrorbars linecolor '#222222' pointtype 0 linewidth 1.5 notitle, \\
     $ours using 4:1:5 with labels left offset 0.7,0 font 'sans-serif,11' notitle, \\
     $paper using 2:1:3 with labels left offset 0.7,0 font 'sans-serif,11' textcolor '#555555' notitle
""", 860, 460, note)
