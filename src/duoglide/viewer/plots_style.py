"""How our pictures look, and how one is made: no window, no global state."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from duoglide.errors import LogError
from duoglide.storage.atomic import appearing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = ("#0072b2", "#d55e00", "#009e73")  # carriages 1 to 3, told apart by everybody
WIDTHS = (2.6, 1.7, 0.9)  # so that carriages that move alike are all seen
LIMIT = "#7f7f7f"
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


@contextmanager
def figure_file(size: tuple[float, float], file: str | Path) -> Iterator[Figure]:
    """Give an empty figure, and save it when it is drawn; no window, no global state."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=size)
        FigureCanvasAgg(figure)
        yield figure
        suffix = Path(file).suffix.removeprefix(".")
        known = figure.canvas.get_supported_filetypes()
        if suffix not in known:
            raise LogError(f"{file}: a picture must end in one of .{', .'.join(sorted(known))}")
        with appearing(file) as temporary:
            figure.savefig(temporary)
