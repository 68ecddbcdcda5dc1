# SPDX-License-Identifier: BSL-1.0
"""The picture of the steps from data to decision, and to the answer: over each link the median of each step, and each run."""

from .gnuplot import block, draw, line_style, quoted


def kinds(raw, note):
    return [("jadc2_decision", "How long each step takes from a frame to the decision, and to the answer of the strike aircraft: "
             "medians over the runs, with their 95 % intervals, and each run.", lambda: steps(raw, note))]


def steps(raw, note):
    figures = {each["name"]: each for each in raw["figures"]}
    names, blocks, plots = list(raw["steps"]), [], []
    for n, (link, title) in enumerate(raw["links"].items()):
        places = [i + 0.3 * (n - (len(raw["links"]) - 1) / 2) for i in range(len(names))]
        medians = [figures[f"{link}_{name}"] for name in names]
        blocks.append(block(link, [(at, *(positive(each[end]) for end in ("value", "low", "high")))
                                   for at, each in zip(places, medians)]))
        blocks.append(block(link + "_runs", [(at + 0.08, positive(each[name])) for at, name in zip(places, names)
                                             for each in raw["runs"][link]]))
        style = line_style(n)
        plots += [f"${link} using 1:2:3:4 with yerrorbars {style} title {quoted(title)}",
                  f"${link}_runs using 1:2 with points {style.split(' linewidth')[0]} pointsize 0.2 notitle"]
    ticks = ", ".join(f"{quoted(label)} {i}" for i, label in enumerate(raw["steps"].values()))
    return draw("jadc2_decision", "".join(blocks) + f"""set logscale y
set format y '%g'
set xrange [-0.5:{len(names) - 0.5}]
set xtics ({ticks}) rotate by -25 font 'sans-serif,11'
set bmargin 9
set rmargin 8
set ylabel 'ms'
set key outside top right horizontal
plot {', '.join(plots)}
""", 860, 460, note)


def positive(value):
    """What a logarithmic axis can show."""
    return value if value > 0 else None
