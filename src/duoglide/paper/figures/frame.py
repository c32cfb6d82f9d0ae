"""A box with scales around a scene."""

from __future__ import annotations

from itertools import product

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.paper.figures.scene import Label, Line, Scene, View

_GREY = "#8a8a8a"
_CORNER = 0.06  # of a scale's length: how near to the corner with another it has no number
_NAME, _NAME_WIDTH = 24.0, 14.0  # [pt] from the edge to a scale's name; more of it where it is wide


def frame(
    low: FloatArray, high: FloatArray, names: tuple[str, str, str], view: View, ticks: int = 5
) -> Scene:
    """Return the edges of a box, and scales with numbers along three of them.

    Args:
        low: Corner of the box with the smallest coordinates [mm], shape (3,).
        high: Corner with the largest.
        names: What stands along x, y and z.
        view: Where it is seen from; the scales stand where they do not hide anything.
        ticks: About how many numbers on a scale.
    """
    scene = Scene()
    toward = view.basis[2]
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        for ends in product((0, 1), repeat=2):
            corner = np.array(low, dtype=np.float64)
            for k, end in zip(others, ends, strict=True):
                corner[k] = (low, high)[end][k]
            start, stop = corner.copy(), corner.copy()
            start[axis], stop[axis] = low[axis], high[axis]
            near = sum((1 if end else -1) * toward[k] for k, end in zip(others, ends, strict=True))
            hidden = near == max(
                sum(s * toward[k] for k, s in zip(others, signs, strict=True))
                for signs in product((-1, 1), repeat=2)
            )
            if not hidden:  # the edge nearest to the eye would cross the picture
                scene.add(Line(np.stack([start, stop]), _GREY, 0.5))
    for axis in range(3):
        _scale(scene, axis, (low, high), names[axis], (view, ticks))
    return scene


def _scale(
    scene: Scene, axis: int, ends: tuple[FloatArray, FloatArray], name: str, look: tuple[View, int]
) -> None:
    """Put ticks, numbers and a name along one edge at the rim of the box."""
    (low, high), (view, ticks) = ends, look
    basis = view.basis
    edge = _rim_edge(axis, low, high, basis)
    centre = edge.copy()
    centre[axis] = 0.5 * (low[axis] + high[axis])
    outward = _away(basis[:2] @ (centre - 0.5 * (low + high)), basis[:2, axis])
    foot = (low, high)[bool(basis[1, axis] < 0.0)][axis]
    for value in _nice_ticks(low[axis], high[axis], ticks):
        if axis == 1 and abs(value - foot) < _CORNER * (high[axis] - low[axis]):
            continue  # the scale along x ends there too
        at = edge.copy()
        at[axis] = value
        scene.add(Label(at, f"{value:g}", _points(9.0 * outward), "#555555", 5.5))
    distance = _NAME + _NAME_WIDTH * abs(float(outward[0]))
    scene.add(Label(centre, name, _points(distance * outward), "#222222", 7.0))


def _away(outward: FloatArray, along: FloatArray) -> FloatArray:
    """Return the unit vector of the page across an edge, on its outer side."""
    across = outward - along * float(outward @ along) / max(float(along @ along), 1e-9)
    unit: FloatArray = across / max(float(np.linalg.norm(across)), 1e-9)
    return unit


def _points(offset: FloatArray) -> tuple[float, float]:
    return float(offset[0]), float(offset[1])


def _rim_edge(axis: int, low: FloatArray, high: FloatArray, basis: FloatArray) -> FloatArray:
    """Choose the edge along ``axis`` that is lowest on the page; for z the leftmost."""
    others = [k for k in range(3) if k != axis]
    candidates = []
    for ends in product((0, 1), repeat=2):
        corner = 0.5 * (low + high)
        for k, end in zip(others, ends, strict=True):
            corner[k] = (low, high)[end][k]
        x, y = basis[:2] @ corner
        candidates.append((float(x) if axis == 2 else float(y), corner))
    return min(candidates, key=lambda entry: entry[0])[1]


def _nice_ticks(low: float, high: float, count: int) -> list[float]:
    """Return round numbers inside an interval."""
    raw = (high - low) / count
    power = 10.0 ** np.floor(np.log10(raw))
    step = power * min((1.0, 2.0, 2.5, 5.0, 10.0), key=lambda m: abs(m * power - raw))
    values = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step
    return [float(value) for value in values]
