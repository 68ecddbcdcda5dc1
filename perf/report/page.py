# SPDX-License-Identifier: BSL-1.0
"""The report as one self-contained page of HTML, which is well-formed XML."""

import os
from dataclasses import replace
from html import escape

from . import peers
from .figures import Malformed, figures_of, text_of, verdict, with_unit
from .pictures import BUSY, busy_of, pictures_of
from .rows import table_of_rows
from .running import FAILED, KEPT, RAN


def page_of(sections, outcomes, raws, run):
    """Arguments: the sections in order, {name: Outcome}, {name: output of its script}, and data about the run."""
    parts = [_section(section, outcomes[section.name], raws.get(section.name)) for section in sections]
    with open(os.path.join(os.path.dirname(__file__), "style.css"), encoding="utf-8") as file:
        style = file.read()
    return "\n".join([
        "<!DOCTYPE html>",
        '<html xmlns="http://www.w3.org/1999/xhtml" lang="en"><head><meta charset="utf-8"/>',
        '<meta name="viewport" content="width=device-width, initial-scale=1"/><title>CLES: evaluation</title>',
        f"<style>\n{style}</style></head><body>",
        "<h1>CLES: evaluation</h1>",
        "<p>What section 4 of the paper reports, measured again. Values are medians; the interval beside a value is the one in "
        "which the median lies with 95 % confidence, of so many runs as the table says.</p>",
        _run(run), _absent(sections, outcomes), _glance(sections, raws), *parts, "</body></html>", ""])


def _run(run):
    machine = run.get("machine") or {}
    facts = [("date", run.get("date")), ("commit", run.get("commit")),
             ("processor", f"{machine.get('processor')}, {machine.get('cores')} cores"
              + (f" ({machine['usable_cores']} usable)" if machine.get("usable_cores") not in (None, machine.get("cores"))
                 else "") if machine else None),
             ("kernel", machine.get("kernel")),
             ("memory", f"{machine['memory_mib'] / 1024:.1f} GiB" if machine.get("memory_mib") else None),
             ("compiler", run.get("compiler")),
             ("busy before", f"{text_of(machine['busy_cores'])} cores" if machine.get("busy_cores") is not None else None),
             ("repeat it with", run.get("command"))]
    remark = ('<p class="remark">A quick run: it shows that everything works. Its figures say nothing of how fast anything '
              "is.</p>" if run.get("quick") else "")
    return _facts(facts) + remark


def _facts(facts):
    rows = "".join(f"<dt>{escape(name)}</dt><dd>{_code(value) if name == 'repeat it with' else escape(str(value))}</dd>"
                   for name, value in facts if value)
    return f'<dl class="facts">{rows}</dl>'


def _code(text):
    return f"<code>{escape(str(text))}</code>"


def _absent(sections, outcomes):
    lines = [f'<p class="absent"><strong>{escape(section.title)}</strong> ({escape(section.name)}) '
             f"{'failed' if outcomes[section.name].state == FAILED else 'is not here'}: "
             f"{escape(outcomes[section.name].reason)}</p>"
             for section in sections if outcomes[section.name].state not in (RAN, KEPT)]
    return "\n".join(lines)


def _glance(sections, raws):
    rows, reached, aims = [], 0, 0
    for section in sections:
        for figure in _figures(raws.get(section.name))[0]:
            if figure.target is None and figure.paper is None:
                continue
            aims += figure.reached is not None
            reached += figure.reached is True
            rows.append(_figure_row(figure, section.name))
    if not rows:
        return ""
    score = f"{reached} of {aims} targets are reached. " if aims else ""
    return (f'<h2 id="glance">At a glance</h2>\n<p>{score}Here is what has a target, or a counterpart in the paper; the '
            "sections below have all figures.</p>\n" + _figure_table(rows, True))


def _figures(raw):
    """The figures that can be read, and why others cannot. Those of a quick run are not compared with targets."""
    try:
        found = figures_of(raw or {})
    except Malformed as failure:
        return [], str(failure)
    return [replace(figure, reached=None) for figure in found] if raw and raw.get("quick") else found, ""


def _figure_table(rows, with_section):
    section = "<th>section</th>" if with_section else ""
    return (f'<table><thead><tr>{section}<th>figure</th><th class="number">here</th><th>interval</th><th class="number">n</th>'
            '<th class="number">the paper</th><th class="number">target</th><th></th></tr></thead>\n<tbody>'
            + "\n".join(rows) + "</tbody></table>")


def _figure_row(figure, section=""):
    spread = ""
    if figure.low is not None and figure.high is not None and figure.low != figure.high:
        spread = f"{text_of(figure.low)} \u2013 {text_of(figure.high)}"
    first = f'<td><a href="#{escape(section)}">{escape(section)}</a></td>' if section else ""
    kind = {True: " reached", False: " missed"}.get(figure.reached, "")
    ran = f'<div class="ran">{escape(figure.ran)}</div>' if figure.ran else ""
    return (f'<tr>{first}<td title="{escape(figure.name)}">{escape(figure.what)}{ran}</td>'
            f'<td class="number">{escape(with_unit(figure.value, figure.unit))}</td><td class="spread">{escape(spread)}</td>'
            f'<td class="number">{escape(text_of(figure.runs)) if figure.runs else ""}</td>'
            f'<td class="number">{escape(with_unit(figure.paper, figure.unit))}</td>'
            f'<td class="number">{escape(with_unit(figure.target, figure.unit))}</td>'
            f'<td class="verdict{kind}">{escape(verdict(figure))}</td></tr>')


def _section(section, outcome, raw):
    parts = [f'<h2 id="{escape(section.name)}">{escape(section.title)}</h2>']
    if section.paper:
        parts.append(f'<p class="paper">{escape(section.paper)}</p>')
    if outcome.state not in (RAN, KEPT):
        word = "It failed" if outcome.state == FAILED else "Not here"
        parts.append(f'<p class="absent">{word}: {escape(outcome.reason)}</p>')
    if raw is None:
        return "\n".join(parts)
    figures, unreadable = _figures(raw)
    parts += [f'<p class="remark">{escape(text)}</p>' for text in _remarks(outcome, raw, unreadable)]
    parts += [_figure(picture) for picture in pictures_of(section.name, raw)]
    if figures:
        parts.append(_figure_table([_figure_row(figure) for figure in figures], False))
    if peers.is_of_peers(raw):
        parts.append(f"<p>{escape(peers.EXPLANATION)}</p>" + table_of_rows(peers.readable(raw["rows"])))
    elif raw.get("rows") and not any("elapsed_ms" in row for row in raw["rows"] if isinstance(row, dict)):
        parts.append(table_of_rows(raw["rows"]))
    machine = raw.get("machine")
    parts.append(_facts([
        ("repeat it with", raw.get("command")), ("measured", raw.get("date")),
        ("took", f"{outcome.seconds:.0f} s" if outcome.seconds else None),
        ("on", f"{machine.get('cores')} cores of {machine.get('processor')}, {machine.get('system')}"
         if isinstance(machine, dict) else machine),
        ("raw data", f"raw/{section.name}.json")]))
    return "\n".join(parts)


def _remarks(outcome, raw, unreadable):
    if outcome.state == KEPT:
        yield "Not measured in this run: these are the figures of an earlier one."
    if raw.get("quick"):
        yield "A quick run: that it works, not how fast. No figure is compared with its target."
    if unreadable:
        yield unreadable
    if busy_of(raw) > BUSY:
        yield f"Other work kept {busy_of(raw):g} cores busy when this began: the times are too long."
    for each in raw.get("skipped") or []:
        yield f"Left out: {each.get('what', each.get('name', ''))}: {each.get('reason', '')}" if isinstance(each, dict) \
            else f"Left out: {each}"
    for text in (raw.get("hosts") or {}).get("not_allowed", []):
        yield f"The system did not allow {text}."
    for text in raw.get("notes") or []:
        yield str(text)


def _figure(picture):
    shown = picture.svg if picture.svg else f'<p class="absent">No picture: {escape(picture.missing)}</p>'
    return f'<figure id="picture-{escape(picture.name)}">{shown}<figcaption>{escape(picture.caption)}</figcaption></figure>'
