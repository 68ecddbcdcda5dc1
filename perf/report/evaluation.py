# SPDX-License-Identifier: BSL-1.0
"""The page of the paper's evaluation, docs/evaluation.md, from what its sections measured.

`record_of` takes from them what the page shows, and nothing else; `page_of` makes the page from that record alone. Both are
committed, so that a test can compare them: no figure of the page is written by hand.
"""

import json

from . import pictures
from .figures import Malformed, figures_of

SECTIONS = ("latency", "bench", "dsgd", "decision_latency")
DIGITS = "digits_speed"  # is on the page if it was measured: it needs a data set
PAGE, RECORD = "evaluation.md", "evaluation.json"
DECISION_PAGE = "jadc2.md"  # also shows the times of `decision_latency`
# Section, its picture, the file of the page, its words there.
PICTURES = (
    ("latency", "fig3", "evaluation_latency", "Round trips and ways over each link"),
    ("bench", "bytes", "evaluation_bytes", "Bytes of each message, by hand and by CLES"),
    ("dsgd", "dsgd", "evaluation_table2", "Table 2 as speed-ups over one thread of the first host"),
    ("dsgd", "data_set", "evaluation_fig5", "The data set with its classifier (Fig. 5)"),
    ("dsgd", "data_set_zoomed", "evaluation_fig6", "The same where the classes meet (Fig. 6)"),
    ("decision_latency", "jadc2_decision", "jadc2_decision", "Each step from data to decision, and to the answer"),
)
DIGITS_PICTURE = (DIGITS, "digits_speed_accuracy", "evaluation_digits", "Accuracy on digits that no node has, over time")
PAPER_THREADS = 4
# The rows of Table 2, as the paper names them.
TABLE2 = {"local_one_near": "1 Thread PC", "local_one_far": "1 Thread Laptop", "local_all_near": "4 Threads PC",
          "local_all_far": "4 Threads Laptop", "near_asked_by_near": "4 PC Threads, PC Request",
          "near_asked_by_far": "4 PC Threads, Laptop Request",
          "both_asked_by_far": "8 Threads Both Machines, Laptop Request"}
PAPER_MSE = {**dict.fromkeys(("local_one_near", "local_one_far"), 0.0198995), "both_asked_by_far": 0.0198978}
USUAL_PAPER_MSE = 0.0198977
LINKS = {"loopback": "one machine, as fast as possible", "lively": "one machine, 1000 a second",
         "paced": "one machine, 50 a second", "cable": "two hosts, a virtual cable", "wifi": "two hosts, a link like WiFi",
         "narrow": "two hosts, 64 kbit/s"}
DELEGATING = ("delegate_less_local", "delegate_less_local_share", "far_less_near", "far_less_near_wifi", "overhead",
              "gain_both_asked_by_far", "gain_both_resplit")
LATENCY_HEAD = ("", "by hand, p50", "PULL, p50", "CLES adds", "ratio", "p99", "UPDATE, one way, p50", "of a PULL",
                "by multicast, p50")
TIMES = ("icd_pull_p50", "pull_p50", "pull_overhead", "pull_ratio_p50", "icd_pull_p99", "pull_p99", "update_p50",
         "update_to_pull_p50", "update_multicast_p50")
LINES = ("cles_lines", "cles_lines_all", "icd_lines", "icd_lines_all", "lines_ratio", "lines_ratio_all")
BYTES = (("the reply, values rounded as a user would", "icd_reply_bytes", "reply_bytes", "reply_bytes_ratio"),
         ("the reply, with all digits of a double", "icd_reply_bytes", "unrounded_reply_bytes", "unrounded_reply_bytes_ratio"),
         ("request and reply, rounded", "icd_pull_bytes", "pull_bytes", "pull_bytes_ratio"),
         ("request and reply, all digits", "icd_pull_bytes", "unrounded_pull_bytes", "unrounded_pull_bytes_ratio"))


class Unfit(Exception):
    """Why there is no page."""


def record_of(raws, run):
    """What the page shows of {section: output of its script}, and of the run.
    \\throws Unfit if something is missing, or does not say how fast anything is"""
    measured = sections_of(raws)
    for name in measured:
        raw = raws.get(name)
        if not raw:
            raise Unfit(f"{name} has not been measured: scripts/evaluate --only {name}")
        if raw.get("quick") or raw.get("drawn"):
            raise Unfit(f"{name}: a quick run does not show how fast anything is")
        if pictures.busy_of(raw) > pictures.BUSY:
            raise Unfit(f"{name}: other work kept {pictures.busy_of(raw):g} cores busy when it began")
    if raws["dsgd"].get("threads") != PAPER_THREADS:
        raise Unfit(f"dsgd: {raws['dsgd'].get('threads')} threads a host, and not {PAPER_THREADS} as in the paper")
    skipped = [text for name in measured for text in _skipped(raws[name])]
    if skipped:
        raise Unfit("left out: " + "; ".join(skipped))
    try:
        figures = {name: {each.name: _kept(each) for each in figures_of(raws[name]) if _is_shown(name, each.name)}
                   for name in measured}
        rows = {row["name"]: row for row in raws["dsgd"]["rows"]}
        record = {
            "run": {key: run.get(key) for key in ("date", "commit", "compiler", "machine")},
            "sections": {name: _origin(raws[name], (run.get("sections") or {}).get(name) or {}) for name in measured},
            "figures": figures, "links": raws["latency"]["links"],
            "table2": {name: _table2_row(rows[name]) for name in (*TABLE2, *(each for each in rows if each not in TABLE2))},
            "dsgd": {key: raws["dsgd"][key] for key in ("threads", "epochs", "runs", "hosts")},
            "decision": {"links": raws["decision_latency"]["links"], "steps": raws["decision_latency"]["steps"],
                         "runs": {link: len(runs) for link, runs in raws["decision_latency"]["runs"].items()}}}
        if DIGITS in measured:
            record["digits"] = {key: raws[DIGITS][key] for key in ("seeds", "rounds", "hidden", "rates")}
        page_of(record)  # whatever it needs is there
    except (KeyError, TypeError, Malformed) as failure:
        raise Unfit(f"what was measured cannot be shown: {failure!r}") from failure
    return record


def sections_of(raws):
    return (*SECTIONS, DIGITS) if raws.get(DIGITS) else SECTIONS


def shown_pictures(sections):
    return (*PICTURES, DIGITS_PICTURE) if DIGITS in sections else PICTURES


def pictures_of(raws):
    """{file: SVG} of the page. \\throws Unfit if one cannot be drawn"""
    out = {}
    measured = sections_of(raws)
    drawn = {name: {each.name: each for each in pictures.pictures_of(name, raws[name])} for name in measured}
    for section, name, file, _ in shown_pictures(measured):
        found = drawn[section].get(name)
        if found is None or found.missing:
            raise Unfit(f"no picture {name}: {found.missing if found else 'there are no data for it'}")
        out[f"{file}.svg"] = found.svg
    return out


def recounted(record):
    """The record with the lines of code as they are now."""
    import dsgd_figures  # of perf/evaluation, which must be among the paths of modules
    import latency

    counted = latency.Figures()
    latency.add_lines(counted)
    now = {"latency": counted.found, "dsgd": list(dsgd_figures.lines())}
    figures = {name: {**record["figures"][name], **{each.name: _kept(each) for each in figures_of({"figures": now.get(name)})}}
               for name in record["figures"]}
    return {**record, "figures": figures}


def _skipped(raw):
    for each in raw.get("skipped") or []:
        yield f"{each.get('what', '')}: {each.get('reason', '')}" if isinstance(each, dict) else str(each)


def _is_shown(section, name):
    if section == "latency":
        link, _, kind = name.partition("_")
        return (link in LINKS and kind in TIMES) or any(name in row for row in BYTES) or name in LINES
    if section == "dsgd":
        return name in DELEGATING or name.startswith("lines")
    return section in ("decision_latency", DIGITS)  # of `bench`, its picture is shown


def _kept(figure):
    return {"value": figure.value, "low": figure.low, "high": figure.high, "runs": figure.runs, "unit": figure.unit,
            "what": figure.what, "paper": figure.paper}


def _origin(raw, told):
    return {"date": raw.get("date"), "command": raw.get("command"), "seconds": told.get("seconds") or None,
            "machine": raw.get("machine"), "notes": [str(text) for text in raw.get("notes") or []]}


def _table2_row(row):
    ms = row["elapsed_ms"]
    return {"meaning": row["meaning"], "paper_ms": row.get("paper_ms"), "median": ms["median"], "low": ms["low"],
            "high": ms["high"], "runs": ms["runs"], "mse": row["mse"], "least_mse": row["least_mse"]}


def files_of(record):
    """{file: text} of the record and its page."""
    return {RECORD: json.dumps(record, indent=1, ensure_ascii=False) + "\n", PAGE: page_of(record)}


# --- The page --------------------------------------------------------------------------------------------------------------


def number(value):
    """Three significant digits, and whole numbers from 100 on."""
    if value is None:
        return "–"
    if isinstance(value, int) or abs(value) >= 100:
        return f"{value:,.0f}".replace("-", "−")
    return f"{value:.3g}".replace("-", "−")


def with_interval(figure):
    def text(value):
        return f"{value:.2f}" if figure.get("unit") == "times" else number(value)

    value, low, high = (figure[key] for key in ("value", "low", "high"))
    return text(value) if low is None or low == high else f"{text(value)} ({text(low)} to {text(high)})"


def table(head, rows):
    return "\n".join(["| " + " | ".join(head) + " |", "| " + " | ".join("---" for _ in head) + " |",
                      *("| " + " | ".join(row) + " |" for row in rows)])


def picture(file):
    words = next(words for _, _, name, words in (*PICTURES, DIGITS_PICTURE) if name == file)
    return f"![{words}]({file}.svg)"


def page_of(record):
    parts = ["# Evaluation", _introduction(record), "## Conditions", _conditions(record), "## Latency (Fig. 3)",
             _latency(record), "## Bytes", _bytes(record), "## Lines of code", _lines(record),
             "## Distributed gradient descent (Table 2, Figs. 5 and 6)", _descent(record),
             *(["## Descent on digits", _digits(record)] if "digits" in record else []),
             "## From data to decision", _decision(record)]
    return "\n\n".join(parts) + "\n"


def _introduction(record):
    took = [each["seconds"] for each in record["sections"].values()]
    duration = f"It took {sum(took) / 60:.0f} minutes. " if all(took) else ""
    return f"""This page shows what section 4 of the [paper](paper.md) reports, measured here. One command, on a machine that does
nothing else, measures all of it, and writes this page, its pictures, and `{RECORD}`, from which a test makes the page
again:

```sh no-test: it takes long, and requires root
scripts/evaluate --docs docs
```

{duration}Values are medians; in brackets are 95 % intervals of these medians. The paper's times are those of other
machines, so they are not compared with times here: differences and ratios of the same quantities are."""


def _conditions(record):
    run, machine = record["run"], record["run"]["machine"] or {}
    hosts = record["dsgd"]["hosts"]
    quota = f" and {100 * hosts['far_quota']:.0f} % of its time" if hosts.get("far_quota") else ""
    cores = f"{machine.get('cores')} cores"
    refused = "".join(f"\n- The system did not allow {text}." for text in hosts.get("not_allowed", []))
    facts = [("date", str(run["date"])[:10]), ("commit", f"`{run['commit']}`" if run["commit"] else "–"),
             ("processor", f"{machine.get('processor')}, {cores}"), ("system", machine.get("system", "–")),
             ("compiler", run["compiler"] or "–"),
             *((f"`{name}`", _when(each)) for name, each in record["sections"].items())]
    return table(["", ""], [[what, str(value)] for what, value in facts]) + f"""

- **Both ends are on this machine.** On one host they speak over loopback; two hosts are two network namespaces.
- **Links** are a virtual cable; a link like WiFi (1.5 ms each way, a jitter of 1 ms on average, 1 % of the frames lost); and one
  of 64 kbit/s with 5 ms each way. The last two are simulated by a relay of frames.
- **By hand** is a packed struct over TCP with blocking sockets, the traditional way of the paper. CLES uses TCP, and for BIND
  multicast too; neither side polls, and each end has a core of its own.
- **The second host** of the descent has one core{quota}. Each host runs {record['dsgd']['threads']} threads, or as many
  workers, as in the paper; with fewer cores they take turns.{refused}"""


def _when(section):
    took = f", {section['seconds'] / 60:.0f} minutes" if section["seconds"] else ""
    return f"{str(section['date'])[:10]}{took}"


def _latency(record):
    found = record["figures"]["latency"]
    rows = []
    for link, meaning in LINKS.items():
        def cell(kind, link=link):
            return with_interval(found[f"{link}_{kind}"]) if f"{link}_{kind}" in found else "–"

        tail = " → ".join(number(found[f"{link}_{kind}"]["value"]) for kind in ("icd_pull_p99", "pull_p99"))
        rows.append([meaning, *map(cell, ("icd_pull_p50", "pull_p50", "pull_overhead", "pull_ratio_p50")), tail,
                     *map(cell, ("update_p50", "update_to_pull_p50", "update_multicast_p50"))])
    narrow = found["narrow_pull_overhead"]["value"]
    overhead = max(found[f"{link}_pull_overhead"]["value"] for link in LINKS if link != "narrow")
    paper = found["loopback_pull_overhead"]["paper"]
    return f"""A PULL of the localization (time, latitude, longitude, velocity, acceleration), and an update of it, in µs:

{table(LATENCY_HEAD, rows)}

CLES adds {number(overhead)} µs to a round trip at most; over 64 kbit/s, where each byte takes 125 µs, {number(narrow)}. In the paper it is
{number(paper)} µs. Platooning allows 100 ms. "Of a PULL" is the one-way time as a part of PULL's round trip; the paper expects half.

{picture("evaluation_latency")}"""


def _bytes(record):
    found = record["figures"]["latency"]
    rows = [[what, number(found[by_hand]["value"]), f"{found[ours]['value']:.1f}", with_interval(found[ratio]),
             number(found[ours]["paper"]), number(found[ratio]["paper"])] for what, by_hand, ours, ratio in BYTES]
    return f"""Of a PULL over TCP, without headers. The paper's 132 bytes are those of the reply: three times the 44 of a struct with the
same five values.

{table(["", "by hand", "CLES", "ratio", "the paper's CLES", "its ratio"], rows)}

{picture("evaluation_bytes")}"""


def _lines(record):
    latency, dsgd = record["figures"]["latency"], record["figures"]["dsgd"]
    ratio, ratio_all = latency["lines_ratio"]["value"], latency["lines_ratio_all"]["value"]
    rows = [[what, number(of[name]["value"]), number(of[f"{name}_all"]["value"]), paper] for what, of, name, paper in (
        ("client and server of the localization, CLES", latency, "cles_lines", "30"),
        ("the same by hand", latency, "icd_lines", "ten times as many"),
        ("the plugin of the descent, and a minimal manager", dsgd, "lines", "less than 300"),
        ("the same with the manager that was measured", dsgd, "lines_complete", "–"))]
    return f"""One rule for all (`perf/effort/count_lines.py`): a line counts unless it is empty or only a comment. The paper does not say
whether it counts `#include` lines, so both numbers are here:

{table(["", "lines", "with `#include`", "the paper"], rows)}

By hand it takes {ratio:.1f} times as many lines as by CLES, {ratio_all:.1f} with `#include` lines. The paper claims ten times."""


def _descent(record):
    dsgd = record["figures"]["dsgd"]
    rows = []
    for name, row in record["table2"].items():
        paper_mse = PAPER_MSE.get(name, USUAL_PAPER_MSE) if name in TABLE2 else None
        low, high = row["mse"]
        mse = f"{low:.7f}" if f"{low:.7f}" == f"{high:.7f}" else f"{low:.7f} to {high:.7f}"
        rows.append([TABLE2.get(name, "–"), row["meaning"], with_interval({"value": row["median"], **row}), mse,
                     number(row["paper_ms"]), f"{paper_mse:.7f}" if paper_mse else "–"])
    compared = [[dsgd[name]["what"], f"{with_interval(dsgd[name])} {dsgd[name]['unit']}".strip().replace("times", "×"),
                 number(dsgd[name]["paper"])] for name in DELEGATING if name in dsgd]
    least = record["table2"]["local_one_near"]["least_mse"]
    epochs, runs = record["dsgd"]["epochs"], record["dsgd"]["runs"]
    return f"""The rows of Table 2 first, with the paper's names; the others below them. {epochs:,} steps for each of 200,000 points,
{runs} runs of all rows in turn:

{table(["Table 2", "here", "ms", "mean-squared error", "the paper's ms", "its error"], rows)}

No line has a smaller error on this data than {least:.7f}. The paper's data are other ones, and their classes are closer
([why](dsgd.md#what-is-computed)). The same quantities, compared:

{table(["", "here", "the paper"], compared)}

{picture("evaluation_table2")}

{picture("evaluation_fig5")}

{picture("evaluation_fig6")}"""


def _digits(record):
    found, digits = record["figures"][DIGITS], record["digits"]
    sides = {"thread": "one thread, without CLES", "one": "one node", "two": "two nodes, a core each",
             "non_iid": "two nodes, each with few classes"}

    def shown(name, factor=1):
        if name not in found:
            return "–"
        return with_interval({**found[name], **{key: found[name][key] * factor for key in ("value", "low", "high")}})

    rows = [[what, f"{digits['rates'][side]:g}", shown(f"images_per_s_{side}"),
             f"{found[f'reached_{side}']['value']} of {digits['seeds']}", shown(f"time_{side}"), shown(f"accuracy_{side}", 100),
             shown(f"bytes_{side}")] for side, what in sides.items()]
    return f"""The paper has no figures for a problem that is worth distributing. [Rounds](dsgd.md#rounds) on 1797 handwritten digits, one pass
over its own files for each node in a round, {digits['rounds']} rounds, {digits['hidden']} values of the hidden layer,
{digits['seeds']} seeds; the size of a step is searched for each row in the same way:

{table(["", "step", "images per second", "seeds that reach 97 %", "ms to 97 %", "accuracy at the end, %", "bytes per round"], rows)}

Two nodes process {with_interval(found["speed_up_nodes"])} times as many images per second as one node.

{picture("evaluation_digits")}"""


def _decision(record):
    found, decision = record["figures"]["decision_latency"], record["decision"]
    sums = {"data_to_decision_ms": "data to decision", "data_to_answer_ms": "data to answer"}
    rows = []
    for step, what in sums.items():
        for suffix, of in (("", "median"), ("_late", "99 % within")):
            rows.append([f"{what}, {of}", *(with_interval(found[f"{link}_{step}{suffix}"]) for link in decision["links"])])
    rows += [[f"{what}, median", *(with_interval(found[f"{link}_{step}"]) for link in decision["links"])]
             for step, what in decision["steps"].items() if step not in sums]
    counts = " and ".join(str(count) for count in sorted(set(decision["runs"].values())))
    return f"""From a frame of the reconnaissance aircraft to the decision, and to the answer of the strike aircraft
([joint command](jadc2.md#data-to-decision)), in ms. {counts} strikes over each link; a script decides at once. The paper
reports no times.

{table(["", *decision["links"].values()], rows)}

{picture("jadc2_decision")}"""
