# SPDX-License-Identifier: BSL-1.0
"""Draws with gnuplot, as SVG that can be combined with others in one page."""

import re
import shutil
import subprocess

# Each has its own point, so that they differ without colour too.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#333333", "#56b4e9", "#8a6d00")
POINTS = (7, 5, 9, 13, 11, 3, 2)

STYLE = """set encoding utf8
set border 3 linecolor '#444444'
set tics nomirror out textcolor '#222222'
set grid linecolor '#dddddd' linetype 1 linewidth 0.7
set key textcolor '#222222'
set style fill solid 0.85 noborder
"""


# The key is beside the plot. Its automatic size is larger than its text.
KEY_BESIDE = "set rmargin at screen 0.67\nset key at screen 0.685,0.95 left top Left reverse samplen 3\n"


class Missing(Exception):
    """Why there is no picture."""


def quoted(text):
    """Quoted as a string of gnuplot."""
    return "'" + str(text).replace("'", "''").replace("\n", " ") + "'"


def block(name, rows):
    """A named data block; missing values in a row are not drawn."""
    lines = ["\t".join("NaN" if cell is None else f'"{cell}"' if isinstance(cell, str) else repr(cell) for cell in row)
             for row in rows]
    return "\n".join([f"${name} << EOD", *lines, "EOD", ""])


def line_style(index, dashed=False):
    """For `plot ... with linespoints`."""
    i = index % len(COLOURS)
    return (f"linecolor '{COLOURS[i]}' pointtype {POINTS[i]} linewidth 2 pointsize 0.6 "
            f"dashtype {'(6,4)' if dashed else 1}")


def curve_style(index):
    """For `plot ... with lines`. Dashes make them differ without colour too."""
    dashes = ("1", "(10,4)", "(3,3)", "(10,3,3,3)", "(16,6)")
    return f"linecolor '{COLOURS[index % len(COLOURS)]}' linewidth 1.8 dashtype {dashes[index % len(dashes)]}"


def draw(name, script, width=760, height=400, note=""):
    """The SVG of a gnuplot script. Its identifiers begin with `name`, so that they are unique in a page."""
    program = shutil.which("gnuplot")
    if not program:
        raise Missing("there is no gnuplot: scripts/setup --evaluate installs it")
    terminal = f"set terminal svg size {width},{height} dynamic noenhanced font 'sans-serif,13' background '#ffffff'\n"
    foot = (f"set label {quoted(note)} at screen 0.99,0.025 right font 'sans-serif,10' textcolor '#555555'\nset bmargin 5\n"
            if note else "")
    done = subprocess.run([program, "-"], input=terminal + STYLE + foot + script, capture_output=True, text=True, timeout=60,
                          check=False)
    if done.returncode != 0 or "</svg>" not in done.stdout:
        raise Missing(f"gnuplot could not draw it: {(done.stderr.strip().splitlines() or ['no reason'])[-1]}")
    return tidied(done.stdout, name)


def tidied(svg, name):
    name = re.sub(r"\W+", "_", name)
    svg = svg[svg.index("<svg"):]
    svg = re.sub(r"<title>Gnuplot</title>|<desc>.*?</desc>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"\bid=(['\"])([^'\"]+)\1", rf"id=\1{name}-\2\1", svg)
    svg = re.sub(r"(href=['\"]#|url\(['\"]?#)", rf"\1{name}-", svg)
    svg = svg.replace("\t", " ")
    return "\n".join(line.rstrip() for line in svg.splitlines() if line.strip()) + "\n"
