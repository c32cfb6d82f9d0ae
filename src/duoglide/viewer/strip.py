"""One strip of curves over time in the page, with a legend, a time and a cursor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.drawing.picture import COLOURS, LIMIT

_LEGEND = {"show": True, "live": True}


class Strip:
    """Curves over time; ``draw`` changes what they show.

    Args:
        gui: Where it goes, in viser's words.
        title: What is drawn, and its unit.
        carriages: Whether it has a curve for each carriage; one otherwise.
        bounds: Lines at these values.
        least: What is shown at least of the values' range, so that nothing looks like much.
        data: Times (n,) and values (n, k) to begin with.
        sync: Strips of one name share their cursor.
    """

    def __init__(
        self,
        gui: Any,
        title: str,
        *,
        carriages: bool = False,
        bounds: Sequence[float] = (),
        least: tuple[float, float] = (0.0, 0.0),
        data: tuple[FloatArray, FloatArray] | None = None,
        sync: str = "live",
    ) -> None:
        self._bounds = tuple(bounds)
        curves = len(COLOURS) if carriages else 1
        times, values = data or (np.array([0.0, 1.0]), np.full((2, curves), np.nan))
        names = ("1", "2", "3") if carriages else ("worst",)
        series: list[dict[str, Any]] = [{"label": "time [s]"}]
        for name, colour in zip(names, COLOURS if carriages else ("#7048e8",), strict=True):
            series.append({"label": name, "stroke": colour, "width": 2})
        series.extend([{"label": "limit", "stroke": LIMIT, "dash": [6, 4]}] * len(self._bounds))
        self._plot = gui.add_uplot(
            data=self._columns(times, values),
            series=tuple(series),
            title=title,
            scales={"x": {"time": False}, "y": {"range": _range(*least)}},
            axes=({"size": 30}, {"size": 52}),
            legend=_LEGEND,
            cursor={"sync": {"key": sync}},
            padding=(8, 10, 0, 0),
            height=150,
        )

    def draw(self, times: FloatArray, values: FloatArray) -> None:
        """Show other values.

        Args:
            times: [s], shape (n,).
            values: A column for each curve, shape (n, k).
        """
        self._plot.data = self._columns(times, values)

    def remove(self) -> None:
        """Take it off the page."""
        self._plot.remove()

    def _columns(self, times: FloatArray, values: FloatArray) -> tuple[FloatArray, ...]:
        lines = (np.full(len(times), bound) for bound in self._bounds)
        return (times, *values.T, *lines)


def _range(low: float, high: float) -> dict[str, Any]:
    """Return how uPlot chooses what it shows: all values, and all between two of them."""
    return {
        "min": {"pad": 0.1, "soft": low, "mode": 1},
        "max": {"pad": 0.1, "soft": high, "mode": 1},
    }
