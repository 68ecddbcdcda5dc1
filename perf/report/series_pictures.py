# SPDX-License-Identifier: BSL-1.0
"""Pictures of what a script wrote for that purpose: its "pictures", drawn by itself, and its "series":

    "pictures": [{"name", "title", "svg"}]
    "series": {name: {"title", "x", "y", "log": "" or "x" or "y" or "xy", "lines": {label: [[x, y], ...]}}}
              {name: {label: [value, ...]}}    a distribution for each label, drawn as its quantiles
              {name: [value, ...]}             one of them
              {name: [[x, y], ...]}            one line
"""

from .gnuplot import KEY_BESIDE, Missing, block, curve_style, draw, line_style, quoted

MAX_POINTS = 2000  # of a line; more cannot be distinguished


def kinds(section, raw, note):
    found = []
    for i, each in enumerate(raw.get("pictures") or []):
        found.append((f"{section}_{each.get('name', i)}", each.get("title") or "", _given(each)))
    for name, form in (raw.get("series") or {}).items():
        title = form.get("title") if isinstance(form, dict) else None
        found.append((f"{section}_{name}", title or name.replace("_", " "), _drawer(section, name, form, note)))
    return found


def _given(each):
    def svg():
        text = each.get("svg") or ""
        if "<svg" not in text:
            raise Missing("its script did not write SVG")
        return text[text.index("<svg"):]

    return svg


def _drawer(section, label, form, note):
    return lambda: draw_series(f"{section}_{label}", label, form, note)


def draw_series(name, label, form, note):
    if isinstance(form, dict) and "lines" in form:
        return lines(name, form["lines"], form.get("x", ""), form.get("y", ""), form.get("log", ""), note)
    if isinstance(form, list) and form and isinstance(form[0], (list, tuple)):
        return lines(name, {label: form}, "", "", "", note)
    if isinstance(form, list):
        return quantiles(name, {label: form}, note)
    if isinstance(form, dict) and form and all(isinstance(values, list) for values in form.values()):
        if all(values and isinstance(values[0], (list, tuple)) for values in form.values()):
            return lines(name, form, "", "", "", note)
        return quantiles(name, form, note)
    raise Missing("its series does not have a form that can be drawn")


def thinned(points):
    step = -(-len(points) // MAX_POINTS)
    return points[::step] if step > 1 else points


def lines(name, labelled, x, y, log, note):
    blocks, plots = [], []
    for n, (label, points) in enumerate(labelled.items()):
        few = thinned([(float(px), None if py is None else float(py)) for px, py in points])
        if not few:
            continue
        blocks.append(block(f"line{n}", few))
        drawn = "linespoints" if len(few) <= 30 else "lines"
        style = line_style(n) if drawn == "linespoints" else curve_style(n)
        plots.append(f"$line{n} using 1:2 with {drawn} {style} title {quoted(label)}")
    if not plots:
        raise Missing("its series is empty")
    scale = f"set logscale {log}\n" if log else ""
    return draw(name, "".join(blocks) + scale + f"""set xlabel {quoted(x)}
set ylabel {quoted(y)}
{KEY_BESIDE}plot {', '.join(plots)}
""", 860, 400, note)


def quantiles(name, labelled, note, y=""):
    """Value by the share that is greater, so that the tail is visible."""
    blocks, plots, most = [], [], 1
    for n, (label, values) in enumerate(labelled.items()):
        found = sorted(float(value) for value in values)
        if not found:
            continue
        most = max(most, len(found))
        tail = [((len(found) - i) / len(found), value) for i, value in enumerate(found)]
        ends = len(tail) - 200  # the complete tail, and a sample of the rest
        blocks.append(block(f"line{n}", thinned(tail[:ends]) + tail[ends:] if ends > 0 else tail))
        plots.append(f"$line{n} using 1:2 with lines {curve_style(n)} title {quoted(label)}")
    if not plots:
        raise Missing("its series is empty")
    ticks = ["'all' 1", "'half' 0.5"]
    share, text = 0.1, "10 %%"
    while share >= 1 / most and share > 1e-7:
        ticks.append(f"'{text}' {share:g}")
        share /= 10
        text = f"{share * 100:.6g} %%"  # twice, because it is a format
    return draw(name, "".join(blocks) + f"""set logscale xy
set xrange [1:{1 / most / 1.2}] reverse
set xtics ({', '.join(ticks)})
set xlabel 'share that is greater'
set ylabel {quoted(y)}
{KEY_BESIDE}plot {', '.join(plots)}
""", 860, 400, note)
