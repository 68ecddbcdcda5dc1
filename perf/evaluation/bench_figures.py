# SPDX-License-Identifier: BSL-1.0
"""Calculates figures, and the data of pictures, from reports of `cles bench`, one for each round."""

import math
import statistics

from interval import summary
from packet_values import ROUNDED, UNROUNDED

PULL_NAMES = {"tcp": "TCP", "udp": "UDP", "unix": "a Unix socket", "polling": "TCP, both ends polling for 50 us"}
PULL_RATIOS = {"tcp": 1.10, "udp": 0.95, "unix": 0.65, "polling": 0.55}
PAPER_OVERHEAD_MS = 1.5
PAPER_REPLY_BYTES = 132
PAPER_BYTES_RATIO = 3  # of the reply alone: the struct with its five doubles has 44 bytes
FRAME_BYTES = 1500
MULTICAST_RATIO, MULTICAST_BINDERS, MULTICAST_RATE = 1.2, 64, 0.8
MAX_GROWTH = 1.1  # of time by length, as an exponent: 1 is linear

PARSE_KINDS = ("typed", "reply_typed", "validated", "reply_validated", "head", "packed")


PULLS_RAN = "as fast as possible, one request after the other, far ends only answer, each end on a core of its own"
BY_HAND_RAN = "by hand a packed struct over TCP by blocking sockets"
CLES_RAN = {"tcp": "CLES over TCP, without polling", "udp": "CLES over UDP, without polling",
            "unix": "CLES over a Unix socket, without polling",
            "polling": "CLES over TCP, both ends poll for 50 us before they sleep"}


def figure(name, what, values, unit, paper=None, at_most=None, at_least=None, ran=None):
    values = list(values)
    found = summary(values)
    target = f"\u2264 {at_most:g}" if at_most is not None else f"\u2265 {at_least:g}" if at_least is not None else None
    reached = None
    if target:
        reached = found["median"] <= at_most if at_most is not None else found["median"] >= at_least
    return {"name": name, "what": what, "ran": ran, "value": found["median"], "low": found["low"], "high": found["high"],
            "runs": found["runs"], "unit": unit, "paper": paper, "target": target, "reached": reached}


def figures(reports):
    """Of the reports that exist."""
    return [*pull_figures(reports), *bytes_figures(reports.get("bytes")), *parse_figures(reports.get("parse")),
            *fan_out_figures(reports)]


def pull_figures(reports):
    tcp = reports.get("pull_tcp")
    if tcp:
        yield figure("pull_by_hand_p50", "the same by hand over TCP, round trip, p50",
                     (r["icd"]["p50_us"] for r in tcp), "us")
    for name, meaning in PULL_NAMES.items():
        rounds = reports.get(f"pull_{name}")
        if not rounds:
            continue
        yield figure(f"pull_{name}_p50", f"PULL over {meaning}, round trip, p50", (r["cles"]["p50_us"] for r in rounds), "us")
        yield figure(f"pull_{name}_p99", f"PULL over {meaning}, p99", (r["cles"]["p99_us"] for r in rounds), "us")
        yield figure(f"pull_{name}_ratio", f"PULL over {meaning}, p50, to the exchange by hand over TCP",
                     (r["cles"]["p50_us"] / r["icd"]["p50_us"] for r in rounds), "times", at_most=PULL_RATIOS[name],
                     ran=f"{BY_HAND_RAN}; {CLES_RAN[name]}; {PULLS_RAN}")
        bare = f"icd_{name}"  # by hand over the same kind of socket
        if rounds[0].get(bare):
            yield figure(f"pull_{name}_bare_ratio", f"the exchange by hand over {meaning}, p50, to that over TCP",
                         (r[bare]["p50_us"] / r["icd"]["p50_us"] for r in rounds), "times",
                         ran=f"both by hand, the same struct by blocking sockets; {PULLS_RAN}")
    if tcp:
        yield figure("pull_overhead", "extra time of a PULL over TCP, compared with the exchange by hand, p50",
                     ((r["cles"]["p50_us"] - r["icd"]["p50_us"]) / 1e3 for r in tcp), "ms", paper=PAPER_OVERHEAD_MS,
                     at_most=PAPER_OVERHEAD_MS)


def bytes_figures(reports):
    if not reports:
        return
    rows = {row["message"]: row for row in reports[0]["rows"]}
    reply, request = rows["PULL reply"], rows["PULL request"]
    both_by_hand = request["icd_tcp"]["bytes"] + reply["icd_tcp"]["bytes"]
    for suffix, way, values, wanted_bytes, wanted_ratio in (("", "tcp", ROUNDED, PAPER_REPLY_BYTES, PAPER_BYTES_RATIO),
                                                            ("_unrounded", "unrounded_tcp", UNROUNDED, None, None)):
        yield figure(f"pull_reply_bytes{suffix}", f"bytes of the localization in a reply to PULL, {values}",
                     [reply[way]["bytes"]], "bytes", paper=PAPER_REPLY_BYTES, at_most=wanted_bytes)
        ran = f"by hand structs with doubles; CLES text, {values}; both without the headers of TCP"
        yield figure(f"pull_reply_bytes_ratio{suffix}", f"bytes of that reply, to those of the struct, {values}",
                     [reply[way]["bytes"] / reply["icd_tcp"]["bytes"]], "times", paper=PAPER_BYTES_RATIO,
                     at_most=wanted_ratio, ran=ran)
        yield figure(f"pull_bytes_ratio{suffix}", f"bytes of request and reply of a PULL, to those of the structs, {values}",
                     [(request[way]["bytes"] + reply[way]["bytes"]) / both_by_hand], "times", ran=ran)
    headers = reports[0]["headers"]
    longest = max(row[f"{values}{way}"]["bytes"] + headers[way] for row in rows.values() for values in ("", "unrounded_")
                  for way in ("tcp", "udp"))
    yield figure("longest_packet", "the longest packet of any verb, unrounded, with the headers of IP and TCP or UDP",
                 [longest + headers["ipv4"]], "bytes", at_most=FRAME_BYTES)


def growth(row, longer, kind):
    """1 if the time grows linearly with the length, 2 if quadratically."""
    return math.log(longer[kind]["ns"] / row[kind]["ns"]) / math.log(longer["bytes"] / row["bytes"])


def parse_figures(reports):
    if not reports:
        return
    short, long = reports[0]["rows"][0]["bytes"], reports[0]["rows"][-1]["bytes"]
    yield figure("parse_short", f"a request of {short} bytes, from its line to its reply in memory",
                 (r["rows"][0]["validated"]["ns"] for r in reports), "ns", paper="constant")
    for kind, what in (("head", "a request that is all head"), ("validated", "a request whose body is checked"),
                       ("typed", "a request read into a C++ type"), ("reply_typed", "a reply read into a C++ type")):
        yield figure(f"parse_{kind}_per_byte", f"{what}, {long >> 10} KiB, for each byte",
                     (r["rows"][-1][kind]["ns"] / r["rows"][-1]["bytes"] for r in reports), "ns")
        yield figure(f"parse_{kind}_growth", f"{what}: power of the length with which time grows, "
                     f"from {reports[0]['rows'][-3]['bytes'] >> 10} to {long >> 10} KiB",
                     (growth(r["rows"][-3], r["rows"][-1], kind) for r in reports), "", paper="O(n)", at_most=MAX_GROWTH)


def fan_out_figures(reports):
    for transport in ("tcp", "unix", "multicast"):
        rounds = reports.get(f"fan_out_{transport}")
        for i, row in enumerate(rounds[0]["rows"] if rounds else []):
            rows = [r["rows"][i] for r in rounds]
            n, where = row["binders"], {"tcp": "TCP", "unix": "Unix sockets", "multicast": "multicast"}[transport]
            multicast = transport == "multicast"
            sockets = (f"by hand {n} sockets, CLES one that {n} services share" if multicast and n > 1
                       else f"{n} socket{'s' if n > 1 else ''} on both sides")
            pair = f"by hand a packed struct, CLES the same values as text; {sockets}, in one process, without polling"
            yield figure(f"update_{transport}_{n}_p50", f"UPDATE to {n} by {where} at 1 kHz, one way, p50",
                         (r["cles"]["paced"]["latency"]["p50_us"] for r in rows), "us")
            yield figure(f"update_{transport}_{n}_p50_ratio", f"UPDATE to {n} by {where} at 1 kHz, p50, to the same by hand",
                         (r["ratio"]["p50"] for r in rows), "times", ran=f"{pair}, every millisecond",
                         at_most=MULTICAST_RATIO if multicast and n == MULTICAST_BINDERS else None)
            yield figure(f"update_{transport}_{n}_rate", f"UPDATE to {n} by {where}, deliveries in a second",
                         (r["cles"]["flat_out"]["deliveries_per_s"] for r in rows), "/s")
            yield figure(f"update_{transport}_{n}_rate_ratio", f"UPDATE to {n} by {where}, deliveries, to the same by hand",
                         (r["ratio"]["deliveries_per_s"] for r in rows), "times", ran=f"{pair}, as fast as possible",
                         at_least=MULTICAST_RATE if multicast else None)


# --- The data of pictures ------------------------------------------------------------------------------------------------

QUANTILES = ("p50_us", "p99_us", "p999_us", "max_us")


def series(reports):
    return {name: points for name, points in (
        ("latency", latency_series(reports)), ("bytes", (reports.get("bytes") or [{}])[0].get("rows", [])),
        ("parse", parse_series(reports.get("parse"))), ("fan_out", fan_out_series(reports))) if points}


def quantiles(figures_of_rounds):
    return {name: summary([each[name] for each in figures_of_rounds]) for name in QUANTILES}


def latency_series(reports):
    """{exchange: {quantile: its median over the rounds and interval}}"""
    found = {}
    if reports.get("pull_tcp"):
        found["by_hand"] = quantiles([r["icd"] for r in reports["pull_tcp"]])
    for name in PULL_NAMES:
        if reports.get(f"pull_{name}"):
            found[name] = quantiles([r["cles"] for r in reports[f"pull_{name}"]])
    return found


def parse_series(reports):
    """[{bytes, kind: ns}], medians over the rounds"""
    if not reports:
        return []
    return [{"bytes": row["bytes"], **{kind: statistics.median(r["rows"][i][kind]["ns"] for r in reports)
                                       for kind in PARSE_KINDS}} for i, row in enumerate(reports[0]["rows"])]


def fan_out_series(reports):
    """[{transport, binders, and of each side p50_us and deliveries_per_s}], medians over the rounds"""
    points = []
    for transport in ("tcp", "unix", "multicast"):
        rounds = reports.get(f"fan_out_{transport}")
        for i, row in enumerate(rounds[0]["rows"] if rounds else []):
            point = {"transport": transport, "binders": row["binders"]}
            for side, name in (("icd", "by_hand"), ("cles", "cles")):
                point[name] = {
                    "p50_us": statistics.median(r["rows"][i][side]["paced"]["latency"]["p50_us"] for r in rounds),
                    "deliveries_per_s": statistics.median(
                        r["rows"][i][side]["flat_out"]["deliveries_per_s"] for r in rounds)}
            points.append(point)
    return points
