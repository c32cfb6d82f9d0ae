"""A figure in our style that needs no window and no global state, and its way into a file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from duoglide.errors import InputError
from duoglide.storage.atomic import appearing

COLOURS = ("#0072b2", "#d55e00", "#009e73")  # carriages 1 to 3 and nothing else, told apart by all
CURVE = "#5e3c99"  # what belongs to no carriage
LOST = "#cc0050"  # what fails, or is lost
WIDTHS = (2.6, 1.7, 0.9)  # so that carriages that move alike are all seen
LIMIT = "#7f7f7f"
SCREEN = 160  # dots per inch on a screen: twice what is shown, for fine ones
_STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.size": 8.5,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
    "savefig.dpi": 200,
    "figure.constrained_layout.use": True,
}


class Picture(Figure):
    """A figure that a notebook shows as it is, whether pyplot is loaded or not."""

    def _repr_png_(self) -> bytes:
        return png(self)


@contextmanager
def drawn(size: tuple[float, float]) -> Iterator[Picture]:
    """Give an empty figure to draw on; afterwards it is laid out and keeps our style.

    Args:
        size: Width and height [inch].
    """
    with mpl.rc_context(_STYLE):
        figure = Picture(figsize=size)
        FigureCanvasAgg(figure)
        yield figure
        figure.draw_without_rendering()  # ticks take their style when they are first needed


def save(figure: Figure, file: str | Path) -> None:
    """Write a figure to a file, whole or not at all; its suffix says how (png, pdf, svg).

    Raises:
        InputError: No such way to write a picture.
        LogError: The file cannot be written.
    """
    suffix = Path(file).suffix.removeprefix(".")
    known = figure.canvas.get_supported_filetypes()
    if suffix not in known:
        raise InputError(f"{file}: a picture must end in one of .{', .'.join(sorted(known))}")
    buffer = BytesIO()  # matplotlib itself gets lost where a disk is full
    with appearing(file) as temporary, mpl.rc_context(_STYLE):
        figure.savefig(buffer, format=suffix)
        temporary.write_bytes(buffer.getvalue())


def png(figure: Figure) -> bytes:
    """Return a figure as PNG, for a screen."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=SCREEN)
    return buffer.getvalue()
