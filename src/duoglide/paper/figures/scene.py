"""A small 3D scene: tubes, dots, labels and panels, projected without perspective.

The same scene is drawn on a matplotlib page, sorted from back to front, and handed to the
interactive page as plain lists.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.paper.figures.raster import paint_panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Colour: TypeAlias = str

INK = "#222222"
IMAGE = 1000  # [pixels], greater side of the image of the panels
OVERLAP = 0.06  # of the length of a piece
_PIECE = 45.0  # [mm], length of the pieces into which tubes are cut for sorting
_LIGHT = np.array([-0.35, -0.55, 0.76])


@dataclass(frozen=True, slots=True, eq=False)
class Tube:
    """A straight bar from ``start`` to ``end`` [mm], ``width`` points thick on paper."""

    start: FloatArray
    end: FloatArray
    colour: Colour
    width: float


@dataclass(frozen=True, slots=True, eq=False)
class Dot:
    """A joint at ``at`` [mm], ``size`` points across."""

    at: FloatArray
    colour: Colour
    size: float


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """A text beside ``at`` [mm], moved by ``offset`` points on the page."""

    at: FloatArray
    text: str
    offset: tuple[float, float] = (0.0, 0.0)
    colour: Colour = INK
    size: float = 7.0


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A thin polyline of shape (n, 3) [mm]; an arrow if ``arrow``."""

    points: FloatArray
    colour: Colour = INK
    width: float = 0.6
    dashed: bool = False
    arrow: bool = False
    on_top: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Panels:
    """Quadrilaterals of shape (n, 4, 3) [mm] of one colour and opacity.

    ``sunk`` moves them away from the eye [mm], to let what coincides with them be seen.
    """

    corners: FloatArray
    colour: Colour
    opacity: float = 1.0
    sunk: float = 0.0


@dataclass(frozen=True, slots=True)
class View:
    """Direction to look from: angles about z and over the xy plane [degrees]."""

    azimuth: float = -52.0
    elevation: float = 22.0

    @property
    def basis(self) -> FloatArray:
        """Rows: right, up, towards the eye; shape (3, 3)."""
        a, e = np.radians([self.azimuth, self.elevation])
        toward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return np.stack([right, np.cross(toward, right), toward])


@dataclass(slots=True)
class Scene:
    """What to draw."""

    tubes: list[Tube] = field(default_factory=list)
    dots: list[Dot] = field(default_factory=list)
    labels: list[Label] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    panels: list[Panels] = field(default_factory=list)

    def add(self, *items: Tube | Dot | Label | Line | Panels) -> None:
        """Add primitives."""
        homes: dict[type, list[object]] = {
            Tube: self.tubes,  # type: ignore[dict-item]
            Dot: self.dots,  # type: ignore[dict-item]
            Label: self.labels,  # type: ignore[dict-item]
            Line: self.lines,  # type: ignore[dict-item]
            Panels: self.panels,  # type: ignore[dict-item]
        }
        for item in items:
            homes[type(item)].append(item)

    def merge(self, other: Scene) -> None:
        """Add everything of another scene."""
        self.add(*other.tubes, *other.dots, *other.labels, *other.lines, *other.panels)


def draw(axes: Axes, scene: Scene, view: View) -> None:
    """Draw a scene on empty axes of equal scale."""
    from matplotlib.patheffects import withStroke

    basis = view.basis
    _draw_panels(axes, scene.panels, basis)
    jobs: list[tuple[float, Tube | Dot | Line]] = [
        (float(np.mean([piece.start, piece.end], axis=0) @ basis[2]), piece)
        for tube in scene.tubes
        for piece in _cut(tube)
    ]
    jobs += [(float(dot.at @ basis[2]) + 0.6 * _PIECE, dot) for dot in scene.dots]
    jobs += [
        (float("inf") if line.on_top else float((line.points @ basis[2]).mean()), line)
        for line in scene.lines
    ]
    for order, (_, item) in enumerate(sorted(jobs, key=lambda job: job[0])):
        _draw_one(axes, item, basis, 10.0 + 1e-3 * order)
    for label in scene.labels:
        x, y = basis[:2] @ label.at
        text = axes.annotate(
            label.text, (x, y), label.offset, textcoords="offset points", fontsize=label.size,
            color=label.colour, ha="center", va="center", zorder=30.0, annotation_clip=False,
        )  # fmt: skip
        text.set_path_effects([withStroke(linewidth=1.8, foreground="#ffffff")])
    axes.set_aspect("equal")
    axes.set_axis_off()


def _draw_one(axes: Axes, item: Tube | Dot | Line, basis: FloatArray, zorder: float) -> None:
    """Draw one sorted primitive."""
    if isinstance(item, Dot):
        x, y = basis[:2] @ item.at
        axes.plot(
            [x], [y], "o", markersize=item.size, markerfacecolor=item.colour,
            markeredgecolor=INK, markeredgewidth=0.5, zorder=zorder,
        )  # fmt: skip
        return
    if isinstance(item, Line):
        x, y = basis[:2] @ item.points.T
        style = (0, (3.0, 2.0)) if item.dashed else "-"
        axes.plot(
            x, y, color=item.colour, linewidth=item.width, linestyle=style, zorder=zorder,
            solid_capstyle="round",
        )  # fmt: skip
        if item.arrow:
            axes.annotate(
                "", (x[-1], y[-1]), (x[-2], y[-2]), zorder=zorder,
                arrowprops={"arrowstyle": "-|>", "color": item.colour, "linewidth": item.width,
                            "shrinkA": 0, "shrinkB": 0, "mutation_scale": 8.0},
            )  # fmt: skip
        return
    overlap = OVERLAP * (item.end - item.start)
    ends = np.stack([item.start, item.end], axis=-1)
    longer = np.stack([item.start - overlap, item.end + overlap], axis=-1)
    for points, width, colour in (
        (ends, item.width + 1.0, INK),
        (longer, item.width, item.colour),  # over the outline of the piece before it
        (longer, item.width * 0.3, mix(item.colour, "#ffffff", 0.45)),
    ):
        x, y = basis[:2] @ points
        axes.plot(x, y, color=colour, linewidth=width, solid_capstyle="butt", zorder=zorder)


def _cut(tube: Tube) -> list[Tube]:
    """Cut a tube into short pieces, so that it can pass before one thing and behind another."""
    count = max(int(np.linalg.norm(tube.end - tube.start) // _PIECE), 1)
    ends = np.linspace(tube.start, tube.end, count + 1)
    return [Tube(a, b, tube.colour, tube.width) for a, b in pairwise(ends)]


def page_box(scene: Scene, view: View) -> tuple[FloatArray, FloatArray]:
    """Return the corners of a scene on the page, each of shape (2,)."""
    points = [p for tube in scene.tubes for p in (tube.start, tube.end)]
    points += [p for line in scene.lines for p in line.points]
    points += [label.at for label in scene.labels]
    corners = [group.corners.reshape(-1, 3) for group in scene.panels]
    page = np.concatenate([np.array(points).reshape(-1, 3), *corners]) @ view.basis[:2].T
    return page.min(axis=0), page.max(axis=0)


def _draw_panels(axes: Axes, panels: list[Panels], basis: FloatArray) -> None:
    """Draw all panels as one image, shaded by their slope."""
    if not panels:
        return
    corners = np.concatenate([group.corners for group in panels])
    colours = np.concatenate([shaded(group) for group in panels])
    page = corners @ basis.T
    page[..., 2] -= np.repeat([group.sunk for group in panels], [len(g.corners) for g in panels])[
        :, None
    ]
    (left, bottom), (right, top) = page[..., :2].min(axis=(0, 1)), page[..., :2].max(axis=(0, 1))
    extent = (float(left), float(right), float(bottom), float(top))
    image = paint_panels(page, colours, extent, IMAGE)
    axes.imshow(image, extent=extent, interpolation="antialiased", zorder=2.0)


def shaded(group: Panels) -> FloatArray:
    """Return a colour with opacity for each quadrilateral, shape (n, 4)."""
    normals = np.cross(
        group.corners[:, 2] - group.corners[:, 0], group.corners[:, 3] - group.corners[:, 1]
    )
    length = np.linalg.norm(normals, axis=1)
    facing = np.abs(normals @ _LIGHT) / np.where(length > 0.0, length, 1.0)
    base = np.array(_channels(group.colour)) / 255.0
    lit = base * (0.62 + 0.38 * facing[:, None]) + 0.10 * facing[:, None] ** 4
    return np.concatenate([np.clip(lit, 0, 1), np.full((len(lit), 1), group.opacity)], axis=1)


def mix(first: Colour, second: Colour, share: float) -> Colour:
    """Mix two colours; ``share`` of the second."""
    pairs = zip(_channels(first), _channels(second), strict=True)
    return "#" + "".join(f"{round(a + share * (b - a)):02x}" for a, b in pairs)


def _channels(colour: Colour) -> tuple[int, int, int]:
    """Return red, green and blue from 0 to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
