"""A curve in space: a chain of analytic pieces under one regular parameter.

The parameter sigma runs from 0 to ``curve.end`` in mm. On lines, arcs and helices it is arc length;
on blends and splines it is a polynomial parameter with |p'| near 1. Position and its first two
derivatives by sigma are continuous everywhere except at the declared rests, so there is no
arc-length table, and no noise of one.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from duoglide.arrays import BoolArray, FloatArray, IndexArray, as_floats, read_only
from duoglide.errors import InputError
from duoglide.kinematics.kernels import in_numpy
from duoglide.motion.curve._pieces import DERIVATIVES, integrate_length, power_tables, raise_powers
from duoglide.motion.curve.jets import evaluate_arc, evaluate_polynomial

_PANELS = 64  # at most, where |p'| nearly vanishes
_LENGTH_ERROR = 1e-9  # [mm] of arc length, per piece
_arc_columns = in_numpy(evaluate_arc)


@dataclass(frozen=True, eq=False)
class Curve:
    """An immutable chain of polynomial and circular pieces.

    A piece with rate 0 is the polynomial sum of c_k u^k with u = s / span; a piece with rate w > 0
    is the arc or helix c_0 + c_1 (cos(w s) - 1) + c_2 sin(w s) + c_3 u, from its start c_0 because
    its centre may be too far away to compute with. In both, s = sigma minus the piece's first
    break. On an arc c_3 is 0; on a helix it is the advance along the axis, and the error of closing
    of an arc whose ends are rounded.

    Attributes:
        spans: Length of each piece in sigma [mm], shape (n,), all positive.
        rates: Angle per mm of arcs and helices [rad/mm], 0 for polynomials, shape (n,).
        coefficients: Shape (n, m + 1, 3) [mm]; m is the highest degree, at least 2.
        rests: Where a motion must come to rest, ends excluded, ascending [mm].

    Raises:
        InputError: Shapes that do not fit, or values that are not finite or not positive.
    """

    spans: FloatArray
    rates: FloatArray
    coefficients: FloatArray
    rests: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for name in ("spans", "rates", "coefficients"):
            values = as_floats(getattr(self, name), f"curve {name}")
            object.__setattr__(self, name, read_only(values))
        count = self.spans.size
        shapes_fit = self.spans.shape == self.rates.shape == (count,) and (
            self.coefficients.ndim == 3 and self.coefficients.shape[::2] == (count, 3)
        )
        if count == 0 or not shapes_fit or self.coefficients.shape[1] < 3:
            raise InputError(
                "a curve needs spans (n,), rates (n,) and coefficients (n, 3 or more, 3), got"
                f" {self.spans.shape}, {self.rates.shape} and {self.coefficients.shape}"
            )
        if self.spans.min() <= 0.0 or self.rates.min() < 0.0:
            raise InputError("curve spans must be above 0 mm and rates 0 or above")
        object.__setattr__(self, "rests", tuple(float(rest) for rest in self.rests))

    @cached_property
    def breaks(self) -> FloatArray:
        """Sigma of the piece boundaries [mm], shape (n + 1,); only the third derivative jumps."""
        return read_only(np.concatenate([[0.0], np.cumsum(self.spans)]))

    @property
    def end(self) -> float:
        """Sigma of the curve's last point [mm]."""
        return self._scalars[0][-1]

    @property
    def count(self) -> int:
        """Number of pieces."""
        return self.spans.size

    @cached_property
    def _scalars(self) -> tuple[list[float], list[float], list[float]]:
        return self.breaks.tolist(), self.spans.tolist(), self.rates.tolist()

    def piece_at(self, sigma: FloatArray) -> IndexArray:
        """Return the index of the piece that holds each sigma; at a break, the later one."""
        return self._inner.searchsorted(sigma, side="right")

    @cached_property
    def _inner(self) -> FloatArray:
        """Sigma where one piece ends and the next begins [mm]."""
        inner: FloatArray = self.breaks[1:-1]
        return inner

    def derivatives(
        self, sigma: float | FloatArray, piece: IndexArray | int | None = None
    ) -> FloatArray:
        """Evaluate p, p', p'' and p''' by sigma.

        Args:
            sigma: Parameter [mm], clamped to [0, end]; a scalar or any shape.
            piece: Index of the piece to use, which names the side at a break; shape of ``sigma``.

        Returns:
            Shape (..., 4, 3) [mm, 1, 1/mm, 1/mm^2].
        """
        if isinstance(sigma, float | int) and (piece is None or isinstance(piece, int)):
            return self._at(float(sigma), piece)
        values = np.minimum(np.maximum(np.asarray(sigma, dtype=np.float64), 0.0), self.end)
        index = self.piece_at(values) if piece is None else np.asarray(piece, dtype=np.intp)
        if index.shape != values.shape:
            values, index = np.broadcast_arrays(values, index)
        local = values - self.breaks[index]
        result = self._polynomials(local.ravel(), index.ravel()).reshape(*values.shape, 4, 3)
        if self._has_arcs:
            arcs = self.rates[index] > 0.0
            result[arcs] = self._arcs(local[arcs], index[arcs])
        return result

    def both_sides(
        self, before: float | FloatArray, after: float | FloatArray, left: IndexArray
    ) -> tuple[FloatArray, FloatArray]:
        """Evaluate position and three derivatives before and after joints of two pieces.

        Args:
            before: How far before each joint, on the piece there [mm], shape (n,) or a number.
            after: The same after it, on the next piece.
            left: Index of the piece before each joint, shape (n,).

        Returns:
            What ``derivatives`` gives on either side, each of shape (n, 4, 3).
        """
        sigma = np.empty((2, left.size))
        sigma[:] = self.breaks[left + 1]
        sigma[0] -= before
        sigma[1] += after
        states = self.derivatives(sigma, np.stack([left, left + 1]))
        return states[0], states[1]

    @cached_property
    def _has_arcs(self) -> bool:
        return bool(self.rates.any())

    def _polynomials(self, local: FloatArray, index: IndexArray) -> FloatArray:
        """Evaluate polynomials and three derivatives as one product of small matrices."""
        inverse = 1.0 / self.spans[index]
        c = self.coefficients[index]
        lowered, factors = power_tables(c.shape[1])
        powers = raise_powers(local * inverse, c.shape[1])
        result: FloatArray = (powers[:, lowered] * factors) @ c
        result *= raise_powers(inverse, DERIVATIVES)[..., None]
        return result

    def _arcs(self, local: FloatArray, index: IndexArray) -> FloatArray:
        """Evaluate arcs and three derivatives."""
        c = self.coefficients[index].swapaxes(0, 1)
        span, rate = self.spans[index][:, None], self.rates[index][:, None]
        return np.stack(_arc_columns(c, local[:, None], span, rate), axis=-2)

    def _at(self, sigma: float, piece: int | None) -> FloatArray:
        """Evaluate one point in plain floats: several times quicker than arrays of one row."""
        breaks, spans, rates = self._scalars
        sigma = min(max(sigma, 0.0), breaks[-1])
        index = min(bisect_right(breaks, sigma) - 1, len(spans) - 1) if piece is None else piece
        local, span, rate = sigma - breaks[index], spans[index], rates[index]
        axes = self.coefficients[index].T.tolist()
        if rate > 0.0:
            return np.array([evaluate_arc(c, local, span, rate) for c in axes]).T
        return np.array([evaluate_polynomial(c, local, span) for c in axes]).T

    def position(self, sigma: float | FloatArray) -> FloatArray:
        """Return the position at ``sigma`` [mm], shape (..., 3)."""
        if isinstance(sigma, float | int) or self._has_arcs:
            return self.derivatives(sigma)[..., 0, :]
        values = np.minimum(np.maximum(np.asarray(sigma, dtype=np.float64), 0.0), self.end)
        index = self.piece_at(values)
        c = self.coefficients[index]
        powers = raise_powers((values - self.breaks[index]) / self.spans[index], c.shape[-2])
        found: FloatArray = (powers[..., None, :] @ c)[..., 0, :]
        return found

    @cached_property
    def _lengths(self) -> FloatArray:
        """Arc length at the breaks [mm], shape (n + 1,)."""
        every = np.arange(self.count)
        lengths = np.where(self._is_unit, self.spans, 0.0)
        others = every[~self._is_unit]
        lengths[others] = self._quadrature(self.spans[others], others)
        return read_only(np.concatenate([[0.0], np.cumsum(lengths)]))

    @cached_property
    def _is_unit(self) -> BoolArray:
        """Whether sigma is arc length on the piece: lines, arcs and helices that close."""
        bend = np.abs(self.coefficients[:, 2:]).max(axis=(1, 2))
        unit: BoolArray = (self.rates > 0.0) | (bend == 0.0)
        if self._has_arcs and self.coefficients.shape[1] > 3:
            c = self.coefficients
            size = np.maximum(np.linalg.norm(c[:, 1], axis=1), 1e-300)
            aside = np.maximum(*(np.abs(np.sum(c[:, 3] * c[:, k], axis=1)) / size for k in (1, 2)))
            unit &= (self.rates == 0.0) | (aside <= _LENGTH_ERROR)
        return unit

    def _quadrature(self, local: FloatArray, index: IndexArray) -> FloatArray:
        """Integrate |p'| over the first ``local`` mm of sigma of pieces."""
        span, rate, rows = self.spans[index], self.rates[index], self.coefficients[index]
        panels, going = 2, np.arange(local.size)
        total = integrate_length(rows, span, rate, local, panels)
        while going.size and panels < _PANELS:
            panels *= 2
            finer = integrate_length(rows[going], span[going], rate[going], local[going], panels)
            change = np.abs(finer - total[going])
            total[going] = finer
            going = going[change > _LENGTH_ERROR]
        return total

    def arc_length(self, sigma: float | FloatArray) -> FloatArray:
        """Return the distance along the curve from its start to ``sigma`` [mm], same shape."""
        values = np.minimum(np.maximum(np.asarray(sigma, dtype=np.float64), 0.0), self.end)
        index = self.piece_at(values)
        local = np.array(values - self.breaks[index])
        bent = ~self._is_unit[index] & (local > 0.0)
        if bent.any():
            local[bent] = self._quadrature(local[bent], index[bent])
        total: FloatArray = self._lengths[index] + local
        return total

    @property
    def length(self) -> float:
        """Length of the whole curve [mm]."""
        return float(self._lengths[-1])

    def moved(self, offset: FloatArray) -> Curve:
        """Return this curve, every point moved by ``offset`` [mm]."""
        if not np.any(offset):
            return self
        coefficients = self.coefficients.copy()
        coefficients[:, 0, :] += offset
        return Curve(self.spans, self.rates, coefficients, self.rests)

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists of floats, from which ``from_dict`` builds this very curve."""
        return {
            "spans": self.spans.tolist(),
            "rates": self.rates.tolist(),
            "coefficients": self.coefficients.tolist(),
            "rests": list(self.rests),
        }

    @classmethod
    def from_dict(cls, table: Mapping[str, Any]) -> Curve:
        """Build a curve from what ``to_dict`` gave.

        Raises:
            InputError: A key is missing, or the numbers make no curve.
        """
        try:
            spans, rates, coefficients = table["spans"], table["rates"], table["coefficients"]
            return cls(spans, rates, coefficients, tuple(table["rests"]))
        except (KeyError, TypeError) as error:
            raise InputError(f"not a curve: {error!r}") from error

    def __repr__(self) -> str:
        return f"Curve({self.length:.6g} mm, {self.count} pieces, {len(self.rests)} rests)"
