"""What a notebook shows of a value: a table with units and a small picture, in one piece."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape

from matplotlib.figure import Figure

from duoglide.drawing.picture import SCREEN, png

Rows = Sequence[Sequence[str]]
_CELL = "padding:1px 10px 1px 0;text-align:left;white-space:nowrap"


def notebook_html(title: str, tables: Sequence[Rows], figure: Figure | None = None) -> str:
    """Return HTML that needs nothing beside itself.

    Args:
        title: What it is.
        tables: Rows of cells; the first cell of a row is its name.
        figure: Shown beside them, at half its dots, so that fine screens show all of them.
    """
    words = f"<b>{escape(title)}</b>" + "".join(map(_table, tables))
    if figure is None:
        return f"<div>{words}</div>"
    width = round(figure.get_figwidth() * SCREEN / 2)
    picture = (
        f'<img alt="{escape(title)}" width="{width}"'
        f' src="data:image/png;base64,{b64encode(png(figure)).decode("ascii")}">'
    )
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:16px;align-items:flex-start">'
        f"<div>{words}</div>{picture}</div>"
    )


def _table(rows: Rows) -> str:
    """Return a table; names at the left are headings."""
    lines = (
        f'<th scope="row" style="{_CELL}">{escape(row[0])}</th>'
        + "".join(f'<td style="{_CELL}">{escape(cell)}</td>' for cell in row[1:])
        for row in rows
    )
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f'<table style="border-collapse:collapse;margin:4px 0 8px">{body}</table>'
