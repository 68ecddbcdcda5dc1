# SPDX-License-Identifier: BSL-1.0
"""A table of rows with a column for each key."""

from html import escape

from .figures import text_of


def table_of_rows(rows):
    rows = [row if isinstance(row, dict) else {"": row} for row in rows]
    columns = list(dict.fromkeys(key for row in rows for key in row))
    numeric = {key for key in columns if any(_is_number(row.get(key)) for row in rows)}
    head = "".join(f'<th{_kind(key in numeric)}>{escape(key.replace("_", " "))}</th>' for key in columns)
    body = "\n".join("<tr>" + "".join(f"<td{_kind(key in numeric)}>{escape(cell_of(row.get(key)))}</td>" for key in columns)
                     + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table>"


def cell_of(value):
    if value is None:
        return ""
    if isinstance(value, dict):
        if "median" in value:
            return f"{text_of(value['median'])} ({text_of(value.get('low'))} \u2013 {text_of(value.get('high'))})"
        return ", ".join(f"{key} {cell_of(each)}" for key, each in value.items())
    if isinstance(value, list):
        return ", ".join(map(cell_of, value))
    return text_of(value)


def _is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool) or isinstance(value, dict) and "median" in value


def _kind(numeric):
    return ' class="number"' if numeric else ""
