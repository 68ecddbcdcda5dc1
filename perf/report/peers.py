# SPDX-License-Identifier: BSL-1.0
"""What perf/evaluation/peers.py measured of other middleware, as a table and a picture."""

from .gnuplot import Missing, block, draw, quoted


def is_of_peers(raw):
    rows = raw.get("rows") or [{}]
    return isinstance(rows[0], dict) and "ratios" in rows[0]


def readable(rows):
    """For a table: ratios to the hand-written exchange over TCP, and sizes."""
    return [{"": row["name"], **{heading: _times(value) for heading, value in row["ratios"].items()},
             "memory, KiB": row.get("memory_kib"), "libraries, KiB": _kib(row.get("library_bytes")),
             "program, KiB": _kib(row.get("program_bytes")), "version": str(row.get("version") or ""),
             "ran": str(row.get("settings") or "")} for row in rows]


EXPLANATION = ("Ratios of medians to the hand-written exchange over TCP, which is the row of 1; times below 1 and rates above 1 are "
        "better. Each row ran the same packet between two processes, with the settings of its last column. A dash means that a peer does not offer it, or that it was not measured.")


def _times(value):
    return "\u2013" if value is None else round(float(value), 3)


def _kib(count):
    return None if count is None else round(count / 1024)


def kinds(raw, note):
    return [("peers", "Round trip of the localization by each, p50: medians of the rounds, with their 95 % intervals.",
             lambda: exchanges(raw["rows"], note))]


def exchanges(rows, note):
    measured = [(row["name"], row["measures"]["exchange"]["p50_us"]) for row in rows if "exchange" in row["measures"]]
    if not measured:
        raise Missing("no exchange was measured")
    bars = [(place, took["median"], took["low"], took["high"], f"{took['median']:.1f}", 1 if name.startswith("cles") else 0)
            for place, (name, took) in enumerate(reversed(measured))]
    ticks = ", ".join(f"{quoted(name)} {place}" for place, (name, _) in enumerate(reversed(measured)))
    most = max(bar[3] for bar in bars)
    return draw("peers", block("bars", bars) + f"""set yrange [-0.6:{len(bars) - 0.4}]
set xrange [0:{most * 1.15}]
set ytics ({ticks})
set grid noytics
set xlabel 'round trip, p50, \u00b5s'
set key off
plot $bars using (0):1:(0):2:($1-0.33):($1+0.33):($6 > 0.5 ? 0x0072b2 : 0xaaaaaa) with boxxyerror linecolor rgb variable, \\
     $bars using 2:1:3:4 with xerrorbars linecolor '#222222' pointtype 0 linewidth 1.5, \\
     $bars using 4:1:5 with labels left offset 0.7,0 font 'sans-serif,11'
""", 860, 100 + 26 * len(bars), note)
