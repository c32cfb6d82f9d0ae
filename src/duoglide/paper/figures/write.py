"""Write every figure: PDF and PNG, captions, and the interactive page."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from duoglide.errors import ConfigError
from duoglide.machine import Geometry
from duoglide.paper.figures.interactive import interactive_page
from duoglide.paper.figures.mechanism_plates import (
    figure_2,
    figure_4,
    figure_5,
    figure_6,
    figure_7,
)
from duoglide.paper.figures.plates import Plate, Solid
from duoglide.paper.figures.scene import draw, page_box
from duoglide.paper.figures.surface_plates import figure_8, figure_9, figure_10, figure_11

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURES: tuple[Callable[[Geometry], Plate], ...] = (
    figure_2, figure_4, figure_5, figure_6, figure_7, figure_8, figure_9, figure_10, figure_11,
)  # fmt: skip
_TITLE_PAD = 12.0  # [pt] over a scene, whose topmost joint has a name above it
_STYLE = {
    "font.family": "sans-serif",
    "font.size": 7.5,
    "axes.titlesize": 8.0,
    "axes.titlelocation": "left",
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "mathtext.fontset": "stixsans",
    "pdf.fonttype": 42,
    "savefig.dpi": 220,
}
Progress = Callable[[str, int, int], None]


def write_figures(
    directory: str | Path, geometry: Geometry, progress: Progress | None = None
) -> list[Path]:
    """Write figures 2, 4 to 11 of [Shen2021]_ for ``geometry``.

    Each becomes ``figure_NN.pdf`` and ``figure_NN.png``; ``captions.md`` says what each shows and
    what differs from the paper; ``figures.html`` turns the 3D ones with the mouse, without network.

    Args:
        directory: Where to; made if it is not there.
        geometry: Dimensions of the robot.
        progress: Called before each file with its name, how many are done, and how many there are.

    Returns:
        The files.

    Raises:
        ConfigError: The directory cannot be written to, or the geometry has no such pose.
    """
    target = Path(directory)
    total = len(FIGURES) + 1
    files: list[Path] = []
    plates: list[Plate] = []
    with _writing(target):
        target.mkdir(parents=True, exist_ok=True)
        for done, make in enumerate(FIGURES):
            if progress is not None:
                progress(make.__name__.replace("_", " "), done, total)
            plates.append(make(geometry))
            files += _write_plate(target, plates[-1])
        if progress is not None:
            progress("interactive page", total - 1, total)
        captions = target / "captions.md"
        captions.write_text(_captions(plates), encoding="utf-8")
        page = target / "figures.html"
        page.write_text(interactive_page(plates), encoding="utf-8")
    return [*files, captions, page]


@contextmanager
def _writing(target: Path) -> Iterator[None]:
    """Say in our own words that a directory cannot be written to."""
    try:
        yield
    except OSError as error:
        raise ConfigError(f"cannot write figures to {target}: {error}") from error


def _write_plate(target: Path, plate: Plate) -> list[Path]:
    """Draw a figure and write it twice."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=plate.size, layout="constrained")
        FigureCanvasAgg(figure)
        _fill(figure, plate)
        files = [target / f"figure_{plate.number:02d}{suffix}" for suffix in (".pdf", ".png")]
        for file in files:
            metadata = {"CreationDate": None} if file.suffix == ".pdf" else None
            buffer = BytesIO()  # matplotlib itself gets lost where a disk is full
            figure.savefig(buffer, format=file.suffix[1:], metadata=metadata)
            file.write_bytes(buffer.getvalue())
    return files


def _fill(figure: Figure, plate: Plate) -> None:
    """Draw the panels of a figure and its key."""
    rows = -(-len(plate.panels) // plate.columns)
    boxes = [page_box(p.scene, p.view) for p in plate.panels if isinstance(p, Solid)]
    half = 0.52 * np.max([high - low for low, high in boxes], axis=0)
    for i, panel in enumerate(plate.panels):
        axes = figure.add_subplot(rows, plate.columns, i + 1)
        if isinstance(panel, Solid):
            draw(axes, panel.scene, panel.view)
            low, high = page_box(panel.scene, panel.view)
            middle = 0.5 * (low + high)
            axes.set(
                xlim=(middle[0] - half[0], middle[0] + half[0]),
                ylim=(middle[1] - half[1], middle[1] + half[1]),
            )
        else:
            panel.paint(axes)
        axes.set_title(panel.title, pad=_TITLE_PAD if isinstance(panel, Solid) else None)
    if plate.key:
        from matplotlib.patches import Patch

        handles = [Patch(facecolor=colour, label=name) for name, colour in plate.key]
        figure.legend(
            handles=handles, loc="outside lower center", ncols=min(len(handles), 6),
            frameon=False, fontsize=6.5, handlelength=1.2, columnspacing=1.2,
        )  # fmt: skip


def _captions(plates: list[Plate]) -> str:
    """Return all captions as a page."""
    lines = ["# Figures of the paper, computed", ""]
    for plate in plates:
        lines += [f"**Figure {plate.number}. {plate.name}.**"]
        lines += [*textwrap.wrap(plate.caption, 100), ""]
    return "\n".join(lines)
