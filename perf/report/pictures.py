# SPDX-License-Identifier: BSL-1.0
"""The pictures of each section."""

import re
from dataclasses import dataclass
from xml.etree import ElementTree

from . import bench_pictures, decision_picture, dsgd_picture, latency_pictures, peers, series_pictures, strike_picture
from .gnuplot import Missing

BUSY = 0.2  # cores that other processes use; above this, figures are not reliable


@dataclass(frozen=True)
class Picture:
    name: str
    caption: str
    svg: str = ""
    missing: str = ""  # why there is no picture


def pictures_of(section, raw):
    return [_drawn(re.sub(r"\W+", "_", name), caption, draw) for name, caption, draw in _kinds(section, raw)]


def _kinds(section, raw):
    """(name, caption, function that draws it or raises Missing)"""
    note = note_of(raw)
    if section == "bench":
        return bench_pictures.kinds(raw.get("series") or {}, note)
    if section == "decision_latency" and "steps" in raw:
        return decision_picture.kinds(raw, note)
    if section == "dsgd":
        return dsgd_picture.kinds(raw, note)
    if section == "latency" and "links" in raw:
        return latency_pictures.kinds(raw, note)
    if section == "strike_latency" and "setups" in raw:
        return strike_picture.kinds(raw, note)
    if peers.is_of_peers(raw):
        return peers.kinds(raw, note)
    return series_pictures.kinds(section, raw, note)


def _drawn(name, caption, draw):
    try:
        svg = draw()
        root = ElementTree.fromstring(svg)
    except Missing as failure:
        return Picture(name, caption, missing=str(failure))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as failure:
        return Picture(name, caption, missing=f"what was measured cannot be drawn: {failure!r}")
    except ElementTree.ParseError as failure:
        return Picture(name, caption, missing=f"it is not XML: {failure}")
    if not root.tag.endswith("svg"):
        return Picture(name, caption, missing="it is not SVG")
    return Picture(name, caption, svg)


def note_of(raw):
    """The note in the picture: where and when it was measured."""
    machine = raw.get("machine")
    where = f"{machine.get('cores', '?')} cores of {machine.get('processor', '?')}" if isinstance(machine, dict) else machine
    busy = f" beside other work ({busy_of(raw):g} cores busy)" if busy_of(raw) > BUSY else ""
    quick = "; a quick run: that it works, not how fast" if raw.get("quick") else ""
    return f"{where}, {str(raw.get('date', ''))[:10]}{busy}{quick}"


def busy_of(raw):
    """How many cores other processes kept busy when the measurement began; 0 if unknown."""
    machine = raw.get("machine")
    return (machine.get("busy_cores") if isinstance(machine, dict) else None) or 0
