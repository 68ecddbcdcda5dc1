# SPDX-License-Identifier: BSL-1.0
"""Calculates rows from the runs of all peers: medians, ratios to the hand-written exchange; and prints their table."""

from interval import summary

BASELINE = ("by_hand", "tcp")

# Each peer with each carrier, and what to install if its program is missing.
PEERS = [
    ("by_hand", ["tcp", "unix", "multicast"]),
    ("cles", ["tcp", "unix", "udp", "multicast"]),
    ("zeromq", ["tcp", "unix"]),
    ("nng", ["tcp", "unix"]),
    ("grpc", ["tcp", "unix"]),
    ("cyclone", ["udp"]),
    ("coap", ["udp"]),
    ("mqtt", ["tcp"]),
    ("redis", ["unix", "tcp"]),
    ("nats", ["tcp"]),
]

# name -> the arguments that measure it, without the carrier; (count, count with --quick)
MEASURES = {
    "exchange": (["--mode", "exchange"], (5_000, 100)),
    "exchange_64": (["--mode", "exchange", "--in-flight", "64"], (50_000, 1_000)),
    "task": (["--mode", "task"], (5_000, 100)),
    "task_64": (["--mode", "task", "--in-flight", "64"], (50_000, 1_000)),
    "fan_out_1": (["--mode", "fanout", "--subscribers", "1"], (1_000, 50)),
    "fan_out_8": (["--mode", "fanout", "--subscribers", "8"], (1_000, 50)),
    "fan_out_64": (["--mode", "fanout", "--subscribers", "64"], (1_000, 50)),
}
FIGURES = ["p50_us", "p99_us", "per_s", "cpu_us", "lost"]

# heading, measure, figure: what the table shows as a ratio to the hand-written exchange over TCP
RATIOS = [
    ("p50", "exchange", "p50_us"),
    ("p99", "exchange", "p99_us"),
    ("64 in flight", "exchange_64", "per_s"),
    ("task p50", "task", "p50_us"),
    ("64 tasks", "task_64", "per_s"),
    ("to 1", "fan_out_1", "p50_us"),
    ("to 8", "fan_out_8", "p50_us"),
    ("to 64", "fan_out_64", "p50_us"),
    ("CPU", "exchange", "cpu_us"),
]


def rows_of(runs, about):
    """A row for each peer and carrier with at least one run.

    runs: (peer, over, measure) -> a list of what its program said, or the reason why it does not offer that.
    about: peer -> what its program says of itself.
    """
    rows = {}
    for (peer, over, measure), said in runs.items():
        row = rows.setdefault((peer, over), {"name": f"{peer} {over}", "peer": peer, "over": over,
                                             "version": about[peer]["version"], "settings": about[peer]["settings"],
                                             "measures": {}, "not_offered": {}, "ratios": {}})
        if isinstance(said, str):
            row["not_offered"][measure] = said
            continue
        row["measures"][measure] = {figure: summary([run[figure] for run in said])
                                    for figure in FIGURES if figure in said[0]}
        row["measures"][measure]["memory_kib"] = {
            role: summary([run["memory_kib"][role] for run in said])["median"] for role in said[0]["memory_kib"]}
        row["libraries"] = said[0]["libraries"]
        row["library_bytes"] = sum(said[0]["libraries"].values())
        row["program_bytes"] = said[0]["program_bytes"]
    rows = [row for row in rows.values() if row["measures"]]
    baseline = next((row for row in rows if (row["peer"], row["over"]) == BASELINE), None)
    for row in rows:
        memory = row["measures"].get("exchange", {}).get("memory_kib", {})
        row["memory_kib"] = sum(memory.values()) if memory else None
        for heading, measure, figure in RATIOS:
            row["ratios"][heading] = ratio(row, baseline, measure, figure)
    return rows


def ratio(row, baseline, measure, figure):
    """Of the medians; None if one of the two was not measured."""
    if baseline is None or measure not in row["measures"] or measure not in baseline["measures"]:
        return None
    by_hand = baseline["measures"][measure][figure]["median"]
    return row["measures"][measure][figure]["median"] / by_hand if by_hand > 0 else None


def table_of(rows):
    """Lines of text: ratios to the hand-written exchange over TCP, its own figures in their units, sizes as they are."""
    heads = ["", *[heading for heading, _, _ in RATIOS], "memory KiB", "libraries", "program"]
    lines = [heads]
    for row in rows:
        if (row["peer"], row["over"]) == BASELINE:
            lines.append([row["name"], *[own(row, measure, figure) for _, measure, figure in RATIOS], *sizes(row)])
    for row in rows:
        lines.append([row["name"], *["-" if row["ratios"][heading] is None else f"{row['ratios'][heading]:.2f}"
                                     for heading, _, _ in RATIOS], *sizes(row)])
    widths = [max(len(line[i]) for line in lines) for i in range(len(heads))]
    return ["  ".join([line[0].ljust(widths[0]), *[cell.rjust(width) for cell, width in zip(line[1:], widths[1:])]])
            .rstrip() for line in lines]


def own(row, measure, figure):
    if measure not in row["measures"]:
        return "-"
    value = row["measures"][measure][figure]["median"]
    return f"{value:.0f}/s" if figure == "per_s" else f"{value:.1f} us"


def sizes(row):
    memory = "-" if row["memory_kib"] is None else f"{row['memory_kib']:.0f}"
    return [memory, str(row["library_bytes"]), str(row["program_bytes"])]
