# SPDX-License-Identifier: BSL-1.0
"""Pictures of what `cles bench` measured: latency, parsing, fan-out, bytes."""

import math

from .gnuplot import KEY_BESIDE, block, draw, line_style, quoted

EXCHANGES = (("by_hand", "by hand over TCP"), ("tcp", "CLES over TCP"), ("udp", "CLES over UDP"),
             ("unix", "CLES over a Unix socket"), ("polling", "CLES over TCP, polling"))
# On a logarithmic scale of microseconds.
TIMES = "'1 \u00b5s' 1, '10 \u00b5s' 10, '100 \u00b5s' 100, '1 ms' 1e3, '10 ms' 1e4, '100 ms' 1e5, '1 s' 1e6"
QUANTILES = (("p50_us", "p50"), ("p99_us", "p99"), ("p999_us", "p99.9"), ("max_us", "max"))
PAPER_OVERHEAD_US = 1500
PARSE_KINDS = (("typed", "request, read into a C++ type"), ("reply_typed", "reply, read into a C++ type"),
               ("validated", "request, body checked"), ("reply_validated", "reply, checked, as text"),
               ("head", "request, all head"), ("packed", "packed struct, same numbers"))
TRANSPORTS = (("tcp", "TCP"), ("unix", "Unix sockets"), ("multicast", "multicast"))


def kinds(series, note):
    found = []
    if series.get("latency"):
        found.append(("latency", "Round trip of a PULL of the localization, and of the same by hand: quantiles, medians of the "
                      "rounds with their 95 % intervals. The dotted line is how much longer the paper's PULL takes "
                      "than its traditional packet.", lambda: latency(series["latency"], note)))
    if series.get("parse"):
        found.append(("parse", "What a message costs by its length, without sockets: medians, both scales logarithmic. A line "
                      "parallel to the dotted one is linear in the length.", lambda: parse(series["parse"], note)))
    if series.get("fan_out"):
        found.append(("fan_out", "UPDATE of the localization to many binders in one process: the way of one at 1 kHz, and "
                      "deliveries as fast as possible. Dashed: by hand.", lambda: fan_out(series["fan_out"], note)))
    if series.get("bytes"):
        found.append(("bytes", "Bytes of the localization packet over TCP, message for message, without headers; with values "
                      "rounded as a user would, and with all digits of a double.",
                      lambda: sizes(series["bytes"], note)))
    return found


def decades(values):
    """The range of whole powers of ten that holds them, for gnuplot."""
    values = list(values)
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    return f"[{0.999 * 10.0 ** low:g}:{1.001 * 10.0 ** high:g}]"  # a little more, or the marks at its ends are left out


def latency(exchanges, note):
    there = [(key, title) for key, title in EXCHANGES if key in exchanges]
    blocks = [block(key, [(i + 0.06 * (n - (len(there) - 1) / 2), each[q]["median"], each[q]["low"], each[q]["high"])
                          for i, (q, _) in enumerate(QUANTILES) for each in [exchanges[key]]])
              for n, (key, _) in enumerate(there)]
    ticks = ", ".join(f"{quoted(label)} {i}" for i, (_, label) in enumerate(QUANTILES))
    last = len(QUANTILES) - 1
    plots = [f"${key} using 1:2:3:4 with yerrorlines {line_style(n + 4 if key == 'by_hand' else n - 1, key == 'by_hand')} "
             f"title {quoted(title)}" for n, (key, title) in enumerate(there)]
    plots.append(f"{PAPER_OVERHEAD_US} with lines linecolor '#999999' dashtype (2,4) linewidth 1.5 "
                 "title 'the paper''s overhead, 1.5 ms'")
    return draw("latency", "".join(blocks) + f"""set logscale y
set xrange [-0.3:{last + 0.3}]
set xtics ({ticks})
set ylabel 'round trip'
set yrange {decades(exchanges[key][q][end] for key, _ in there for q, _ in QUANTILES for end in ("low", "high"))}
set ytics ({TIMES})
{KEY_BESIDE}plot {', '.join(plots)}
""", 860, 400, note)


def length_text(count):
    return f"{count >> 20} MiB" if count >= 1 << 20 else f"{count >> 10} KiB" if count >= 1 << 10 else str(count)


def parse(rows, note):
    data = block("rows", [(row["bytes"], *(row[kind] for kind, _ in PARSE_KINDS)) for row in rows])
    ticks = ", ".join(f"{quoted(length_text(row['bytes']))} {row['bytes']}" for row in rows)
    plots = [f"$rows using 1:{n + 2} with linespoints {line_style(n)} title {quoted(title)}"
             for n, (_, title) in enumerate(PARSE_KINDS)]
    plots.append("x with lines linecolor '#999999' dashtype (2,4) linewidth 1.5 title '1 ns for each byte'")
    return draw("parse", data + f"""set logscale xy
set xrange [{rows[0]['bytes'] * 0.8}:{rows[-1]['bytes'] * 1.25}]
set xtics ({ticks})
set xlabel 'bytes of the message'
set yrange {decades(row[kind] for row in rows for kind, _ in PARSE_KINDS)}
set ytics ('10 ns' 10, '100 ns' 100, '1 \u00b5s' 1e3, '10 \u00b5s' 1e4, '100 \u00b5s' 1e5, '1 ms' 1e6, '10 ms' 1e7, '100 ms' 1e8)
{KEY_BESIDE}plot {', '.join(plots)}
""", 860, 420, note)


def fan_out(points, note):
    there = [(key, title) for key, title in TRANSPORTS if any(point["transport"] == key for point in points)]
    blocks, left, right = [], [], []
    for n, (key, title) in enumerate(there):
        rows = [point for point in points if point["transport"] == key]
        blocks.append(block(key, [(p["binders"], p["cles"]["p50_us"], p["by_hand"]["p50_us"],
                                   p["cles"]["deliveries_per_s"], p["by_hand"]["deliveries_per_s"]) for p in rows]))
        for plots, column in ((left, 2), (right, 4)):
            plots += [f"${key} using 1:{column} with linespoints {line_style(n)} title {quoted('CLES, ' + title)}",
                      f"${key} using 1:{column + 1} with linespoints {line_style(n, True)} "
                      f"title {quoted('by hand, ' + title)}"]
    binders = sorted({point["binders"] for point in points})
    ticks = ", ".join(f"'{n}' {n}" for n in binders)
    return draw("fan_out", "".join(blocks) + f"""set logscale xy
set xrange [{binders[0] * 0.8}:{binders[-1] * 1.25}]
set xtics ({ticks})
set xlabel 'binders'
set key off
set tmargin at screen 0.88
set bmargin at screen 0.2
set multiplot
set lmargin at screen 0.08
set rmargin at screen 0.36
set title 'one way at 1 kHz, p50, \u00b5s'
set format y '%g'
plot {', '.join(left)}
unset label
set lmargin at screen 0.43
set rmargin at screen 0.71
set key at screen 0.735,0.88 left top Left reverse samplen 4
set title 'deliveries in a second'
set format y '%.0s%c'
plot {', '.join(right)}
unset multiplot
""", 860, 440, note)


def sizes(rows, note):
    data = block("rows", [(row["message"], row["icd_tcp"]["bytes"], row["tcp"]["bytes"], row["unrounded_tcp"]["bytes"])
                          for row in rows])
    most = max(row["unrounded_tcp"]["bytes"] for row in rows)
    return draw("bytes", data + f"""set style data histograms
set style histogram clustered gap 1
set boxwidth 0.9
set yrange [0:{max(most, 132) * 1.1}]
set ylabel 'bytes'
set xtics rotate by -35
set bmargin 8
set rmargin at screen 0.76
set key at screen 0.775,0.95 left top Left reverse samplen 2
plot $rows using 2:xtic(1) linecolor '#999999' title 'struct by hand', '' using 3 linecolor '#0072b2' title 'CLES, rounded', \\
     '' using 4 linecolor '#56b4e9' title 'CLES, unrounded', \\
     132 with lines linecolor '#d55e00' dashtype (6,4) linewidth 1.5 title 'paper''s reply'
""", 860, 400, note)
