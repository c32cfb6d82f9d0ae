"""A picture of a trajectory: the carriages and their derivatives, with the limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from duoglide.motion.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SAMPLES = 4000


def plot(trajectory: Trajectory) -> Figure:
    """Draw ``trajectory``: see ``Trajectory.plot``."""
    from matplotlib.figure import Figure

    times = np.linspace(0.0, trajectory.duration, _SAMPLES)
    state = trajectory.at(times)
    limits = trajectory.machine.limits
    rows = (
        ("position [mm]", state.carriages, None),
        ("velocity [m/s]", state.velocity / 1e3, limits.velocity / 1e3),
        ("acceleration [m/s²]", state.acceleration / 1e3, limits.acceleration / 1e3),
        ("jerk [km/s³]", state.jerk / 1e6, limits.jerk / 1e6),
    )
    figure = Figure(figsize=(8.0, 9.0), layout="constrained")
    for axes, (label, values, bounds) in zip(figure.subplots(4, 1, sharex=True), rows, strict=True):
        for carriage in range(3):
            colour = f"C{carriage}"
            axes.plot(
                times, values[:, carriage], color=colour, lw=1.2, label=f"carriage {carriage + 1}"
            )
            if bounds is not None:
                for sign in (-1.0, 1.0):
                    axes.axhline(sign * bounds[carriage], color=colour, lw=0.6, ls="--")
        axes.set_ylabel(label)
        axes.grid(visible=True, alpha=0.3)
    figure.axes[0].legend(loc="upper right", ncols=3)
    figure.axes[0].set_title(repr(trajectory))
    figure.axes[-1].set_xlabel("time [s]")
    return figure
