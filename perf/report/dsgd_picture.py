# SPDX-License-Identifier: BSL-1.0
"""The pictures of distributed stochastic gradient descent: Table 2 as speed-ups, what DELEGATE costs and what a second host
gains as ratios, also by the size of the shards or of the work; the data set with its classifier, and a detail of it at the
boundary between the classes (Figs. 5 and 6)."""

import statistics

from .gnuplot import Missing, block, draw, line_style, quoted


def kinds(raw, note):
    shown = [
        ("dsgd", "Table 2 as speed-ups over one thread on the first host, drawn as a share of the sum of the speeds of the "
         "row's cores, each measured with one thread. The paper's machines ran 4 threads each.", lambda: speed_ups(raw, note)),
        ("dsgd_cost", "What DELEGATE costs: elapsed time to that of threads on the same cores without CLES; for both hosts, to "
         "threads on both without any loss. 1 means no cost; less is chance, except with re-splitting, where the reason is not known. The trial before "
         "shards by speed is a part of its bar.", lambda: costs(raw, note))]
    if raw.get("sizes"):
        shown.append(("dsgd_sizes", "Left: what DELEGATE adds on the same host, by the time of a shard without CLES (values of "
                      "zero or less are not drawn). Right: how many times faster both hosts are than the first alone, by the "
                      "amount of work, which is divided into more shards there. Medians, with their 95 % intervals.",
                      lambda: sizes(raw, note)))
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


def speed_ups(raw, note):
    def part(value, predicted):
        return f"{value:.3g} of {predicted:.3g}"

    found = []
    for meaning, each, _ in _ratios(raw, "speed_up_"):
        if "predicted" in each:
            scaled = tuple(each[end] / each["predicted"] for end in ("value", "low", "high"))
            paper = each["paper"] and (each["paper"] / each["paper_predicted"], part(each["paper"], each["paper_predicted"]))
            found.append((meaning, scaled, part(each["value"], each["predicted"]), paper, 0))
    return bars("dsgd", found, "speed-up, as a share of the sum of the speeds of its cores", note)


def costs(raw, note):
    found = []
    for meaning, each, row in _ratios(raw, "cost_"):
        trial = statistics.median(row["trial_all_ms"]) / row["elapsed_ms"]["median"] if "trial_all_ms" in row else 0
        paper = each["paper"] and (each["paper"], f"{each['paper']:.4g}")
        found.append((meaning, tuple(each[end] for end in ("value", "low", "high")), f"{each['value']:.4g}", paper, trial))
    return bars("dsgd_cost", found, "times as long as threads", note)


def _ratios(raw, prefix):
    figures = {each["name"]: each for each in raw["figures"]}
    return [(row["meaning"], figures[prefix + row["name"]], row) for row in raw["rows"] if prefix + row["name"] in figures]


def bars(name, rows, label, note):
    """Rows: what it is; value, low, high; its text; the paper's value and text, or None; the share of the trial."""
    if not rows:
        raise Missing("there are no ratios")
    ours, paper, trial, ticks = [], [], [], []
    for place, (meaning, (value, low, high), text, papers, share) in enumerate(reversed(rows)):
        ours.append((place + 0.19, value, low, high, text))
        if papers:
            paper.append((place - 0.19, *papers))
        if share:
            trial.append((place + 0.19, value * (1 - share), value))
        ticks.append(f"{quoted(meaning)} {place}")
    most = max([each[3] for each in ours] + [each[1] for each in paper])
    small = "font 'sans-serif,11'"
    parts = ["$ours using (0):1:(0):2:($1-0.17):($1+0.17) with boxxyerror linecolor '#0072b2' title 'here'"]
    if trial:
        parts.append("$trial using 2:1:2:3:($1-0.17):($1+0.17) with boxxyerror linecolor '#56b4e9' title 'of it the trial'")
    if paper:
        parts += ["$paper using (0):1:(0):2:($1-0.17):($1+0.17) with boxxyerror linecolor '#bbbbbb' title 'the paper'",
                  f"$paper using 2:1:3 with labels left offset 0.7,0 {small} textcolor '#555555' notitle"]
    parts += ["$ours using 2:1:3:4 with xerrorbars linecolor '#222222' pointtype 0 linewidth 1.5 notitle",
              f"$ours using 4:1:5 with labels left offset 0.7,0 {small} notitle"]
    data = [block(key, found) for key, found in (("ours", ours), ("paper", paper), ("trial", trial)) if found]
    return draw(name, "".join(data) + f"""set yrange [-0.6:{len(rows) - 0.4}]
set xrange [0:{most * 1.25}]
set ytics ({', '.join(ticks)}) {small}
set grid noytics
set xlabel '{label}'
set key outside top right horizontal
set arrow from 1,-0.6 to 1,{len(rows) - 0.4} nohead linecolor '#888888' dashtype (4,3)
plot {', '.join(parts)}
""", 860, 120 + 40 * len(rows), note)


def sizes(raw, note):
    def column(key, of):
        return [(each[of]["median"], *(each[key][end] for end in ("median", "low", "high"))) for each in raw["sizes"]]

    def positive(key):
        return [(x, *(value if value > 0 else None for value in values)) for x, *values in column(key, "shard_ms")]

    def ends(line):
        found = [row[0] for row in lines[line]]
        return f"[{min(found) / 1.5}:{max(found) * 1.5}]"

    lines = {"paper": positive("share"), "strict": positive("strict_share"), "even": column("gain_even", "work_ms"),
             "resplit": column("gain_resplit", "work_ms")}
    titles = {"paper": "DELEGATE less local threads (the paper''s)", "strict": "elapsed less the longest shard''s own time",
              "even": "even shards", "resplit": "re-split"}

    def plot(*names):
        return ", ".join(f"${name} using 1:2:3:4 with yerrorlines {line_style(list(lines).index(name))} title '{titles[name]}'"
                         for name in names)

    predicted = "".join(f"{each['value']!r} with lines linecolor '#999999' dashtype (2,4) linewidth 1.5 title "
                        "'as each host alone predicts', " for each in raw["figures"] if each["name"] == "gain_predicted")
    return draw("dsgd_sizes", "".join(block(name, rows) for name, rows in lines.items()) + f"""set logscale x
set xrange {ends("paper")}
set xlabel 'time of a shard, ms'
set tmargin at screen 0.7
set bmargin at screen 0.2
set multiplot
set lmargin at screen 0.08
set rmargin at screen 0.46
set key at screen 0.08,0.97 left top Left reverse samplen 3
set title 'overhead, % of the time without CLES' offset 0,-0.5
set logscale y
set format y '%g'
plot {plot("paper", "strict")}
unset label
unset logscale y
set xrange {ends("even")}
set yrange [0:*]
set xlabel 'the work: time of all threads of the first host, ms'
set lmargin at screen 0.56
set rmargin at screen 0.97
set key at screen 0.56,0.97 left top Left reverse samplen 3
set title 'both hosts: times faster than the first alone' offset 0,-0.5
plot {plot("even", "resplit")}, {predicted}\\
     1 with lines linecolor '#cccccc' notitle
unset multiplot
""", 860, 460, note)
