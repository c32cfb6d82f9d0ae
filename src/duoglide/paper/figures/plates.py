"""Each figure of the paper as panels: a scene with a view, or a drawing in a plane."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from duoglide.paper.figures.scene import Scene, View

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, slots=True)
class Solid:
    """A panel in space.

    Attributes:
        title: What stands over it.
        scene: What it shows.
        view: Where it is seen from.
        room: Share of the panel's size to leave free around the scene.
    """

    title: str
    scene: Scene
    view: View


@dataclass(frozen=True, slots=True)
class Flat:
    """A panel in a plane, drawn by ``paint`` on its axes."""

    title: str
    paint: Callable[[Axes], None]


@dataclass(frozen=True, slots=True)
class Plate:
    """A figure.

    Attributes:
        number: Its number in the paper.
        name: What it shows, in one line.
        caption: What it shows, and what differs from the paper and why.
        panels: Its parts, row by row.
        columns: How many stand beside each other.
        size: Of the whole [inch].
        key: Colours and what they mean.
    """

    number: int
    name: str
    caption: str
    panels: Sequence[Solid | Flat]
    columns: int
    size: tuple[float, float]
    key: Sequence[tuple[str, str]] = ()
