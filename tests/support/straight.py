"""A motion of three carriages side by side, without a platform: quick to make for the stream."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

import duoglide as dg
from duoglide.motion.path.actions import Action
from duoglide.motion.stop_bounds import StopBounds


@dataclass
class Straight:
    """A trajectory of three carriages side by side: a cosine ramp, 200 mm in a second."""

    machine: dg.Machine
    start: np.ndarray
    length: float = 200.0
    duration: float = 1.0
    actions: tuple[tuple[float, Action], ...] = ()

    @property
    def stops(self) -> StopBounds:
        return StopBounds.constant(self.duration, 20.0, 2000.0)

    def at(self, t: Any) -> Any:
        u = np.clip(np.asarray(t, dtype=float) / self.duration, 0.0, 1.0)
        way = self.length * (u - np.sin(2.0 * np.pi * u) / (2.0 * np.pi))
        return SimpleNamespace(carriages=self.start + way[..., None])
