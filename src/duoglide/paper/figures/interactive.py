"""One self-contained page that turns the 3D figures with the mouse; it loads nothing."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from importlib import resources
from typing import Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.paper.figures.plates import Plate, Solid
from duoglide.paper.figures.scene import Scene, shaded

_SHADES = 6  # colours are rounded to steps of this, to keep the page small
_PLAIN = ((r"\^\{\\prime\}", "'"), (r"[${}_\\]", ""))


def interactive_page(plates: Sequence[Plate]) -> str:
    """Return the page as HTML, its script and its data inside."""
    solid = [plate for plate in plates if any(isinstance(p, Solid) for p in plate.panels)]
    data = json.dumps([_plate(plate) for plate in solid], separators=(",", ":"))
    template = resources.files("duoglide.paper.figures").joinpath("page.html")
    return template.read_text(encoding="utf-8").replace("/*DATA*/", data.replace("</", "<\\/"))


def _plate(plate: Plate) -> dict[str, Any]:
    """Return a figure as plain lists."""
    return {
        "title": f"Figure {plate.number}. {plate.name}",
        "caption": plate.caption,
        "key": list(plate.key),
        "panels": [
            {
                "title": _plain(panel.title.replace("\n", "  ")),
                "azimuth": panel.view.azimuth,
                "elevation": panel.view.elevation,
                **_scene(panel.scene),
            }
            for panel in plate.panels
            if isinstance(panel, Solid)
        ],
    }


def _scene(scene: Scene) -> dict[str, Any]:
    """Return a scene as plain lists of numbers, rounded to a tenth of a millimetre."""
    panels = []
    for group in scene.panels:
        colours = np.round(255.0 * shaded(group)[:, :3] / _SHADES).astype(int) * _SHADES
        names = ["#{:02x}{:02x}{:02x}".format(*np.minimum(row, 255)) for row in colours.tolist()]
        palette = sorted(set(names))
        panels.append(
            {
                "corners": np.round(group.corners.reshape(-1)).astype(int).tolist(),
                "palette": palette,
                "colours": [palette.index(name) for name in names],
                "opacity": group.opacity,
                "sunk": group.sunk,
            }
        )
    return {
        "panels": panels,
        "tubes": [[_numbers(t.start), _numbers(t.end), t.colour, t.width] for t in scene.tubes],
        "dots": [[_numbers(d.at), d.colour, d.size] for d in scene.dots],
        "lines": [
            [_numbers(line.points.reshape(-1)), line.colour, line.width, line.arrow]
            for line in scene.lines
        ],
        "labels": [
            [_numbers(label.at), _plain(label.text), list(label.offset), label.colour]
            for label in scene.labels
        ],
    }


def _numbers(values: FloatArray) -> list[float]:
    rounded: list[float] = np.round(values, 1).tolist()
    return rounded


def _plain(text: str) -> str:
    """Return a text without the marks of mathematical typesetting."""
    for pattern, replacement in _PLAIN:
        text = re.sub(pattern, replacement, text)
    return text
