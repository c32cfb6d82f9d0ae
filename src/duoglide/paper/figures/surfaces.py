"""Singular surfaces and the workspace as panels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.constants import Plane
from duoglide.kinematics.kernels import case2_point, in_numpy
from duoglide.kinematics.workspace import Constraints, Curve, CurveKind, columns, section
from duoglide.machine import Geometry
from duoglide.paper.figures.scene import Panels

COLOURS = {  # none that is a carriage's
    "legs vertical": "#e3c000",
    "strut": "#a6761d",
    "arm flat": "#5e3c99",
    "legs parallel": "#999999",
    "legs flat": "#5b2c1a",
    "arm in line with strut (case 2)": "#cc0050",
}
WORKSPACE = "#8fa3b0"
SERIAL = ("legs vertical", "strut", "arm flat")
PARALLEL = ("legs flat", "arm in line with strut (case 2)")
_POINTS = 121
BESIDE = 0.1  # [mm], more than a chord of a sampled circle is off it

_case2_columns = in_numpy(case2_point)


@dataclass(frozen=True, slots=True)
class PlaneCurve:
    """A polyline of the xz plane, shape (n, 2) [mm], and the family that it belongs to."""

    family: str
    points: FloatArray


def workspace_curves(geometry: Geometry, v: int | None = None) -> list[PlaneCurve]:
    """Return the curves of the xz plane along which the singular surfaces stand.

    Args:
        geometry: Dimensions of the robot.
        v: Sign of sin(beta), for the halves of one branch; None: both, the whole algebraic curves.
    """
    g, plane = geometry, Plane.of(geometry)
    half_circle = 2.0 * np.pi if v is None else v * np.pi
    curves = [
        PlaneCurve(family, _arc(Curve(g, CurveKind.LEGS, rise), half_circle))
        for family, rise in (
            ("legs vertical", -g.leg_length),
            ("legs vertical", g.leg_length),
            ("legs flat", 0.0),
        )
    ]
    strut = Curve(g, CurveKind.STRUT_TOP, g.strut_length)
    curves.append(PlaneCurve("strut", _arc(strut, 2.0 * np.pi)))
    z = np.array([plane.zb - g.strut_length, plane.zb + g.strut_length])
    curves += [
        PlaneCurve("arm flat", np.stack([np.full(2, plane.cx + side * g.arm_length), z], -1))
        for side in (-1.0, 1.0)
    ]
    return curves + [
        PlaneCurve("arm in line with strut (case 2)", line)
        for sign in ((1, -1) if v is None else (v,))
        for line in _case_2(g, sign)
    ]


def _arc(curve: Curve, end: float) -> FloatArray:
    """Return the points of an arc's circle from the angle 0 to ``end`` [rad], shape (n, 2)."""
    angle = np.linspace(0.0, end, _POINTS)
    return curve.centre + curve.radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _case_2(g: Geometry, v: int) -> list[FloatArray]:
    """Return the two arms of the quartic, left and right of its pole at delta = 0."""
    plane = Plane.of(g)
    lines = []
    quarter = np.linspace(0.5 * np.pi, 0.0, 30 * _POINTS)[:-1]
    for delta in (quarter, -quarter):
        X, Z, *_ = _case2_columns(delta, plane.F1, g.arm_length, v)
        near = np.abs(Z) <= g.strut_length
        line = np.stack([X + plane.xb, Z + plane.zb], axis=-1)[near]
        if len(line) > 1:
            lines.append(line[np.linspace(0, len(line) - 1, min(len(line), 120)).astype(int)])
    return lines


def within_reach(geometry: Geometry, curve: PlaneCurve, v: int = 1) -> list[FloatArray]:
    """Cut a curve to what borders on the reach of one branch."""
    from duoglide.kinematics.model import reachable
    from duoglide.kinematics.modes import WorkingMode

    fine = _resampled(curve.points, 1500)
    normal = np.gradient(fine, axis=0)[:, ::-1] * np.array([-1.0, 1.0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    inside = np.zeros(len(fine), dtype=bool)
    for side in (-BESIDE, BESIDE):
        moved = fine + side * normal
        poses = np.stack([moved[:, 0], np.zeros(len(moved)), moved[:, 1]], axis=-1)
        inside |= reachable(geometry, poses, WorkingMode(v=v))
    cuts = np.flatnonzero(np.diff(inside.astype(int))) + 1
    parts = np.split(np.arange(len(fine)), cuts)
    return [fine[part] for part in parts if inside[part[0]] and len(part) > 1]


def _resampled(points: FloatArray, count: int) -> FloatArray:
    """Return points at even distances along a polyline."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], count)
    return np.stack([np.interp(at, length, points[:, i]) for i in range(2)], axis=-1)


def extruded(line: FloatArray, y: tuple[float, float], slices: int = 5) -> FloatArray:
    """Return panels of a cylinder along y over a polyline of the xz plane, shape (n, 4, 3)."""
    along = np.linspace(*y, slices + 1)
    grid = np.empty((len(line), len(along), 3))
    grid[..., 0], grid[..., 2] = line[:, :1], line[:, 1:]
    grid[..., 1] = along
    return quads(grid)


def quads(grid: FloatArray) -> FloatArray:
    """Return the cells of a grid of points of shape (m, n, 3) as panels (k, 4, 3)."""
    cells = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2)
    return cells.reshape(-1, 4, 3)


def workspace_panels(geometry: Geometry, colour: str = WORKSPACE) -> Panels:
    """Return the surface of the workspace on finite rails: two ends along y, and its walls."""
    limits = Constraints(travel=geometry.rail_half_length)
    faces: list[FloatArray] = []
    for piece in section(geometry).pieces:
        x = piece.start + (piece.end - piece.start) * _dense_at_ends(37)
        x[0], x[-1] = piece.start + 1e-6, piece.end - 1e-6
        low, high = piece.low.z(x), piece.high.z(x)
        z = low[:, None] + (high - low)[:, None] * np.clip(_dense_at_ends(17), 1e-6, 1 - 1e-6)
        lines = columns(geometry, np.broadcast_to(x[:, None], z.shape), z, limits)
        ends = [_sheet(x, y, z) for y in (lines.low, lines.high)]
        faces += [quads(end) for end in ends]
        for edge in (0, -1):
            faces.append(quads(_between(ends[0][:, edge], ends[1][:, edge])))
        for edge in (0, -1):
            faces.append(quads(_between(ends[0][edge], ends[1][edge])))
    corners = np.concatenate(faces)
    return Panels(corners[np.isfinite(corners).all(axis=(1, 2))], colour, 1.0, sunk=2.0)


def _dense_at_ends(count: int) -> FloatArray:
    """Return numbers from 0 to 1, denser at both ends, where a boundary is steep."""
    spread: FloatArray = 0.5 * (1.0 - np.cos(np.pi * np.linspace(0.0, 1.0, count)))
    return spread


def _sheet(x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    """Return points of shape (m, n, 3)."""
    return np.stack([np.broadcast_to(x[:, None], z.shape), y, z], axis=-1)


def _between(low: FloatArray, high: FloatArray, slices: int = 5) -> FloatArray:
    """Return points between two lines of points, shape (n, slices + 1, 3)."""
    way = np.linspace(0.0, 1.0, slices + 1)[:, None]
    with np.errstate(invalid="ignore"):  # infinite where nothing is admissible
        points: FloatArray = low[:, None] + way * (high - low)[:, None]
    return points
