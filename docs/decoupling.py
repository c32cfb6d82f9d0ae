"""Draw what one carriage alone does to the platform: ``docs/images/decoupling.png``.

    python docs/decoupling.py

Around home, with the other two carriages held, by the closed form of ``dg.forward``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import duoglide as dg
from duoglide.drawing.picture import COLOURS, LIMIT, WIDTHS, drawn, save

HOME = np.array([-41.0, 0.0, 302.0])
ASIDE = np.linspace(-20.0, 20.0, 161)  # [mm], of one carriage


def main() -> None:
    """Draw the three coordinates over the three carriages."""
    geometry = dg.Geometry()
    start = dg.inverse(geometry, HOME)
    with drawn((7.4, 2.7)) as figure:
        panels = figure.subplots(1, 3, sharex=True)
        for axis in range(3):
            carriages = np.tile(start, (ASIDE.size, 1))
            carriages[:, axis] += ASIDE
            moved = dg.forward(geometry, carriages) - HOME
            for panel, values in zip(panels, moved.T, strict=True):
                panel.plot(
                    ASIDE, values, color=COLOURS[axis], linewidth=WIDTHS[axis],
                    label=f"carriage {axis + 1}",
                )  # fmt: skip
        for panel, name in zip(panels, "xyz", strict=True):
            panel.set(title=f"{name} of the platform [mm]", xlabel="one carriage alone [mm]")
            panel.axhline(0.0, color=LIMIT, linewidth=0.6)
        panels[1].legend(loc="upper left")
    save(figure, Path(__file__).parent / "images" / "decoupling.png")


if __name__ == "__main__":
    main()
