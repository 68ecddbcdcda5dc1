# SPDX-License-Identifier: BSL-1.0
"""Which pictures belong to what was measured."""

import re
from dataclasses import dataclass
from xml.etree import ElementTree

from . import bench_pictures, dsgd_picture, latency_pictures, peers, series_pictures, strike_picture
from .gnuplot import Missing

BUSY = 0.2  # cores that others use; past it figures are not to be trusted


@dataclass(frozen=True)
class Picture:
    name: str
    caption: str
    svg: str = ""
    missing: str = ""  # why there is none


def pictures_of(section, raw):
    return [_drawn(re.sub(r"\W+", "_", name), caption, draw) for name, caption, draw in _kinds(section, raw)]


def _kinds(section, raw):
    """(name, caption, function that draws or raises Missing)"""
    note = note_of(raw)
    if section == "bench":
        return bench_pictures.kinds(raw.get("series") or {}, note)
    if section == "dsgd":
        return dsgd_picture.kinds(raw, note)
    if section == "latency" and "links" in raw:
        return latency_pictures.kinds(raw, note)
    if section == "strike_latency" and "rounds" in raw:
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
        return Picture(name, caption, missing=f"it is no XML: {failure}")
    if not root.tag.endswith("svg"):
        return Picture(name, caption, missing="it is no SVG")
    return Picture(name, caption, svg)


def note_of(raw):
    """Where and when, to stand in the picture."""
    machine = raw.get("machine")
    where = f"{machine.get('cores', '?')} cores of {machine.get('processor', '?')}" if isinstance(machine, dict) else machine
    busy = f" beside other work ({busy_of(raw):g} cores busy)" if busy_of(raw) > BUSY else ""
    quick = "; a quick run: that it works, not how fast" if raw.get("quick") else ""
    return f"{where}, {str(raw.get('date', ''))[:10]}{busy}{quick}"


def busy_of(raw):
    """How many cores others kept busy when the measurement began, as far as it is known."""
    machine = raw.get("machine")
    return (machine.get("busy_cores") if isinstance(machine, dict) else None) or 0
