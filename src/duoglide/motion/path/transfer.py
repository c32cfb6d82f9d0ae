"""A motion made in carriage space: cubic polynomials of the time, one row of them a piece."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, IndexArray, as_floats, as_number, read_only
from duoglide.errors import InputError
from duoglide.kinematics.carriage_margin import least_margin
from duoglide.kinematics.model import forward
from duoglide.machine import Machine

_MARGIN_SAMPLES = 4001  # for the least carriage margin: steps of a few hundredths of a mm


@dataclass(frozen=True, slots=True, eq=False)
class TransferPath:
    """The carriages' own motion from pose to pose, checked as the path it really is.

    It takes the place of a ``CarriagePath`` whose sigma is the time: the platform's path follows
    from it by forward kinematics, and not the other way round.

    Attributes:
        machine: The machine that it was checked for.
        breaks: Times of the piece boundaries, from 0 [s], shape (n + 1,).
        polynomials: Carriages in each piece [mm], in rising powers of the time since its start,
            shape (n, 4, 3). Position, velocity and acceleration go on from piece to piece.
        least_clearance: Least distance to a singular surface or edge of reach on the way [mm].

    Raises:
        InputError: Shapes that do not fit, times that do not increase.
    """

    machine: Machine
    breaks: FloatArray
    polynomials: FloatArray
    least_clearance: float

    def __post_init__(self) -> None:
        breaks = read_only(as_floats(self.breaks, "breaks"))
        table = read_only(as_floats(self.polynomials, "polynomials"))
        if breaks.ndim != 1 or table.shape != (breaks.size - 1, 4, 3) or not table.size:
            raise InputError(
                f"polynomials must have shape (n, 4, 3) with n + 1 breaks, got {table.shape} and"
                f" {breaks.size} breaks"
            )
        if breaks[0] != 0.0 or np.any(np.diff(breaks) <= 0.0):
            raise InputError("breaks must begin at 0 and increase")
        object.__setattr__(self, "breaks", breaks)
        object.__setattr__(self, "polynomials", table)
        least = as_number(self.least_clearance, "least_clearance")
        object.__setattr__(self, "least_clearance", least)

    def __repr__(self) -> str:
        return f"TransferPath({self.duration:.4f} s, {self.length:.4g} mm)"

    @property
    def duration(self) -> float:
        """How long the motion takes at full rate [s]."""
        return float(self.breaks[-1])

    @property
    def length(self) -> float:
        """How long the platform's path is, to about 1 % [mm]."""
        points = self.position(np.linspace(0.0, self.duration, 65))
        return float(np.linalg.norm(np.diff(points, axis=0), axis=-1).sum())

    @property
    def carriage_margin(self) -> float:
        """Least error of all carriages with which links may part or a surface is met [mm].

        A lower bound: it changes by no more than half of what the distance of two carriages does.
        """
        carriages = self.derivatives(np.linspace(0.0, self.duration, _MARGIN_SAMPLES))[:, 0]
        apart = carriages - np.roll(carriages, 1, axis=-1)
        steps = 0.5 * np.abs(np.diff(apart, axis=0)).max(axis=-1)
        loss = 0.5 * np.maximum(np.append(steps, 0.0), np.insert(steps, 0, 0.0))
        least, _ = least_margin(
            self.machine.geometry, forward(self.machine.geometry, carriages), loss
        )
        return least

    def derivatives(self, sigma: ArrayLike, piece: IndexArray | None = None) -> FloatArray:
        """Return the carriages and their first three derivatives by sigma, the time.

        Args:
            sigma: Time [s], shape (...); clamped to both ends.
            piece: Which piece to use, where a boundary belongs to two; left out, the later one.

        Returns:
            Shape (..., 4, 3) [mm, mm/s, mm/s^2, mm/s^3].
        """
        time = np.clip(np.asarray(sigma, dtype=np.float64), 0.0, self.breaks[-1])
        if piece is None:
            piece = np.searchsorted(self.breaks[1:-1], time, side="right")
        t = (time - self.breaks[piece])[..., None]
        c0, c1, c2, c3 = np.moveaxis(self.polynomials[piece], -2, 0)
        result = np.empty((*time.shape, 4, 3))
        result[..., 0, :] = c0 + t * (c1 + t * (c2 + t * c3))
        result[..., 1, :] = c1 + t * (2.0 * c2 + t * (3.0 * c3))
        result[..., 2, :] = 2.0 * c2 + t * (6.0 * c3)
        result[..., 3, :] = 6.0 * c3
        return result

    def position(self, sigma: ArrayLike) -> FloatArray:
        """Return the platform centre O' in the base frame [mm], shape (..., 3)."""
        return forward(self.machine.geometry, self.derivatives(sigma)[..., 0, :])

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers, text and lists that ``from_dict`` reads back exactly."""
        return {
            "machine": self.machine.to_dict(),
            "breaks": self.breaks.tolist(),
            "polynomials": self.polynomials.tolist(),
            "least_clearance": self.least_clearance,
        }

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> TransferPath:
        """Build the path that ``to_dict`` described.

        Raises:
            InputError: A key is missing or a value is impossible.
            ConfigError: The machine breaks a rule.
        """
        try:
            return cls(
                Machine.from_dict(document["machine"]),
                document["breaks"],
                document["polynomials"],
                document["least_clearance"],
            )
        except KeyError as error:
            raise InputError(f"transfer path lacks the key {error}") from error
