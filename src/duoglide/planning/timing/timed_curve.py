"""A curve as the timing sees it: carriages, limits and caps along it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import BoolArray, FloatArray
from duoglide.errors import UnreachableError
from duoglide.kinematics.constants import PoseConstants, pose_constants
from duoglide.kinematics.dynamics.constants import MassConstants, mass_constants
from duoglide.kinematics.modes import WORKING
from duoglide.machine import Machine
from duoglide.motion.curve.curve import Curve
from duoglide.motion.path.carriage import CarriagePath
from duoglide.motion.path.rounded import SpeedCap
from duoglide.motion.profile import SIGMA, Profile
from duoglide.motion.rounding.round_segments import SMOOTH
from duoglide.planning.force_limits import LEFT, limits_force, square_of_stretch
from duoglide.planning.timing import motion_kernel
from duoglide.planning.tolerances import NANOMETRE, NO_CAP

_SIDES = 8  # pairs of opposite sides of the polygon that stands for a circle
_INNER = np.cos(np.pi / (2 * _SIDES))
_QUICKEST = 1e9  # 1/s: a jerk without a limit is at most this times the acceleration's limit
RESERVED = (1.01 ** np.arange(1.0, 4.0))[:, None]  # of velocity, acceleration and jerk


@dataclass(frozen=True, eq=False)
class SigmaCap:
    """A cap on d sigma/dt, linear between points and none beyond them.

    Attributes:
        sigma: Where, ascending [mm], (n,).
        speed: The cap there [mm/s], (n,).
    """

    sigma: FloatArray
    speed: FloatArray

    def at(self, sigma: FloatArray) -> FloatArray:
        """Return the cap at ``sigma`` [mm/s], same shape."""
        return np.interp(sigma, self.sigma, self.speed, left=NO_CAP, right=NO_CAP)


@dataclass(frozen=True, eq=False)
class TimedCurve:
    """What is to be timed; checked already, or one of many candidates for a check.

    Attributes:
        machine: Its limits hold.
        curve: Where the platform's centre goes.
        speed_caps: Caps on the tool's speed along parts of the curve.
        tool_acceleration: Cap on the tool's acceleration [mm/s^2].
        sigma_cap: A cap on d sigma/dt, so that drives may brake by themselves.
        rate: No acceleration counts above this times the velocity limit, and no jerk above this
            times the acceleration that is left [1/s].
        ahead: From which sigma on a share of every limit is kept in reserve [mm].
    """

    machine: Machine
    curve: Curve
    speed_caps: tuple[SpeedCap, ...] = ()
    tool_acceleration: float | None = None
    sigma_cap: SigmaCap | None = None
    rate: float = inf
    ahead: float = inf

    @classmethod
    def of(cls, path: CarriagePath) -> TimedCurve:
        """Return what is to be timed of a checked path."""
        checked = path.checked
        return cls(path.machine, path.curve, checked.speed_caps, checked.tool_acceleration)

    def limit_speed(self, cap: SigmaCap) -> TimedCurve:
        """Return this with a cap on d sigma/dt."""
        return replace(self, sigma_cap=cap)

    def at_share(self, share: float) -> TimedCurve:
        """Return this with a share of all accelerations, and jerks to fit."""
        limits = self.machine.limits
        lower = replace(
            limits,
            acceleration=limits.acceleration * share,
            jerk=limits.jerk * share**1.5,
        )
        return replace(self, machine=replace(self.machine, limits=lower))

    def soften_limits(self, rate: float) -> TimedCurve:
        """Return this with limits of acceleration and jerk that take at least 1 / ``rate`` [s]."""
        return replace(self, rate=rate)

    @property
    def has_caps(self) -> bool:
        """Whether anything but the carriages limits the motion."""
        caps = self.tool_acceleration, self.sigma_cap
        return bool(self.speed_caps) or any(cap is not None for cap in caps)

    @cached_property
    def limits(self) -> FloatArray:
        """Limits of the carriages: derivative, carriage, (3, 3)."""
        limits = self.machine.limits
        acceleration = np.minimum(limits.acceleration, self.rate * limits.velocity)
        jerk = np.where(np.isinf(limits.jerk), _QUICKEST * acceleration, limits.jerk)
        jerk = np.minimum(jerk, self.rate * acceleration)
        return np.stack([limits.velocity, acceleration, jerk])

    @cached_property
    def breaks(self) -> FloatArray:
        """Sigma where a derivative or a cap may jump [mm], ascending."""
        ends = [end for cap in self.speed_caps for end in (cap.start, cap.end)]
        ends += [self.ahead] if self.ahead < self.curve.end else []
        breaks = self._kinks
        others = np.setdiff1d(np.array(ends), breaks).clip(0.0, self.curve.end)
        after = np.searchsorted(breaks, others).clip(1, breaks.size - 1)
        gap = np.minimum(others - breaks[after - 1], breaks[after] - others)
        return np.union1d(breaks, others[gap > NANOMETRE])

    @cached_property
    def _kinks(self) -> FloatArray:
        """The curve's breaks without those at which one line goes on as another."""
        curve = self.curve
        line = (curve.rates == 0.0) & (np.abs(curve.coefficients[:, 2:]).max(axis=(1, 2)) == 0.0)
        turn = np.abs(np.diff(curve.coefficients[:, 1] / curve.spans[:, None], axis=0)).max(axis=1)
        goes_on = line[1:] & line[:-1] & (turn < SMOOTH)
        kinks: FloatArray = curve.breaks[np.concatenate([[True], ~goes_on, [True]])]
        return kinks

    @cached_property
    def _arrays(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        curve = self.curve
        return curve.breaks, curve.spans, curve.rates, curve.coefficients

    @cached_property
    def _masses(self) -> MassConstants:
        return mass_constants(self.machine)

    @cached_property
    def _constants(self) -> PoseConstants:
        return pose_constants(self.machine.geometry, WORKING)

    def cell_states(self, profile: Profile, points: int) -> tuple[FloatArray, NDArray[np.intp]]:
        """Evaluate a profile none of whose pieces crosses a break, at ``points`` times of each.

        Args:
            profile: The motion.
            points: Evenly spaced in each piece, both of its ends included; an odd number.

        Returns:
            Sigma and its three time derivatives, (n, points, 4), and the curve's pieces that they
            belong to, (n, points).
        """
        shape = len(profile.knots) - 1, points
        motion, piece = np.empty((*shape, 4)), np.empty(shape, dtype=np.intp)
        before = int(self.pieces_of(profile.knots[0, SIGMA]))
        breaks = self.curve.breaks[before:]
        motion_kernel.cell_states(profile.knots, profile.polynomials, breaks, motion, piece)
        return motion, piece + before

    def motion(self, motion: FloatArray, piece: Any) -> FloatArray:
        """Differentiate the carriages by time, as shares of their limits.

        Args:
            motion: Sigma and its three time derivatives, shape (..., 4).
            piece: Piece of the curve that each belongs to, shape (...).

        Returns:
            Velocity, acceleration and jerk over their limits, shape (..., 3, 3), carriages last.

        Raises:
            UnreachableError: The curve leaves reach, as only an unchecked one can.
        """
        shape = motion.shape[:-1]
        result = np.empty((*shape, 3, 3))
        rows = np.ascontiguousarray(motion).reshape(-1, 4)
        pieces = np.array(np.broadcast_to(piece, shape)).ravel()  # read-only compiles again
        lost = motion_kernel.carriage_motion(
            self._arrays, self._constants, rows, pieces, result.reshape(-1, 3, 3)
        )
        if lost >= 0:
            raise UnreachableError(f"the curve is out of reach at sigma = {rows[lost, 0]:.6g} mm")
        result /= self.limits
        if self.ahead < self.curve.end:
            result[motion[..., 0] > self.ahead] *= RESERVED
        return result

    def caps(self, motion: FloatArray, piece: Any, middle: FloatArray) -> CapUse:
        """Return what the motion asks of the caps.

        Args:
            motion: Sigma and its three time derivatives, shape (n, points, 4).
            piece: Piece of the curve that each belongs to, shape (n, points).
            middle: Sigma in the middle of each cell, which tells what cap it has, (n,).
        """
        p = self.curve.derivatives(motion[..., 0], piece)
        speed = np.linalg.norm(p[..., 1, :], axis=-1) * motion[..., 1]
        use = speed / self._tool_speed(middle)[:, None]
        if self.sigma_cap is not None:
            use = np.maximum(use, motion[..., 1] / self.sigma_cap.at(motion[..., 0]))
        if self.tool_acceleration is None:
            return CapUse(use, np.zeros(use.shape), np.zeros((*use.shape, 0, 2)))
        v, a = motion[..., 1, None], motion[..., 2, None]
        first = p[..., 1, :] * v / self.tool_acceleration
        second = (p[..., 1, :] * a + p[..., 2, :] * v * v) / self.tool_acceleration
        sides = _polygon(p[..., 1, :], p[..., 2, :])
        rows = np.einsum("...ij,...jk->...ik", sides, np.stack([first, second], axis=-1))
        return CapUse(use, np.linalg.norm(second, axis=-1), rows / _INNER)

    @property
    def limits_force(self) -> bool:
        """Whether the force of any carriage is limited."""
        return limits_force(self.machine)

    def force_parts(self, motion: FloatArray, piece: Any) -> FloatArray:
        """Return the parts of the forces: see ``motion_kernel.force_motion``.

        Args:
            motion: Sigma and its three time derivatives, shape (..., 4).
            piece: Piece of the curve that each belongs to, shape (...).

        Returns:
            Shape (..., 4, 3), carriages last.
        """
        shape = motion.shape[:-1]
        parts = np.empty((*shape, 4, 3))
        rows = np.ascontiguousarray(motion).reshape(-1, 4)
        pieces = np.array(np.broadcast_to(piece, shape)).ravel()
        masses = self._masses
        payload = np.full(len(rows), masses.payload)
        motion_kernel.force_motion(
            self._arrays,
            (self._constants, tuple(masses)[:-1], payload),
            rows,
            pieces,
            parts.reshape(-1, 4, 3),
        )
        return parts

    def forces(self, motion: FloatArray, piece: Any) -> ForceUse:
        """Return what the motion asks of the force limits.

        Args:
            motion: Sigma and its three time derivatives, shape (n, points, 4).
            piece: Piece of the curve that each belongs to, shape (n, points).
        """
        parts = self.force_parts(motion, piece)
        by_rate, by_square, held, speed = (parts[..., k, :] for k in range(4))
        m, limit = self._masses, self.machine.limits.force
        dry, viscous = np.array([m.c1, m.c2, m.c3]), speed * (m.d1, m.d2, m.d3)
        if self.ahead < self.curve.end:
            reserve = np.where(motion[..., 0] > self.ahead, RESERVED[1, 0], 1.0)[..., None]
            by_rate, by_square, viscous = by_rate * reserve, by_square * reserve, viscous * reserve
        uses, rows = [], []
        for sign in (1.0, -1.0):
            against = np.where(_reach_beside(sign * speed > 0.0), dry, -dry)
            room = np.maximum(limit - sign * held - against, LEFT * limit)
            uses.append(square_of_stretch(sign * by_square / room, sign * viscous / room))
            rows.append(sign * np.stack([by_rate, by_square, viscous], axis=-1) / room[..., None])
        return ForceUse(np.maximum(*uses), np.concatenate(rows, axis=2))

    def _tool_speed(self, sigma: FloatArray) -> FloatArray:
        result = np.full(sigma.shape, NO_CAP)
        for cap in self.speed_caps:  # in order, and sigma ascends
            first, last = np.searchsorted(sigma, [cap.start, cap.end])
            result[first:last] = np.minimum(result[first:last], cap.speed)
        return result

    def pieces_between(self, sigma: FloatArray) -> NDArray[np.intp]:
        """Do what ``pieces_of`` does for ascending sigma, the last of which ends its own piece."""
        pieces = self.pieces_of(sigma)
        last = np.searchsorted(self.curve.breaks, sigma[-1], side="left") - 1
        result: NDArray[np.intp] = np.minimum(pieces, max(int(pieces[0]), int(last)))
        return result

    def pieces_of(self, sigma: FloatArray) -> NDArray[np.intp]:
        """Return the index of the curve's piece that holds each sigma; at a break the later one."""
        inside = np.searchsorted(self.curve.breaks, sigma, side="right") - 1
        return np.clip(inside, 0, self.curve.count - 1)


def _reach_beside(there: BoolArray) -> BoolArray:
    """Whether something is so at each point or the one beside it: it may turn between two.

    Args:
        there: Of the points of cells, (n, points, ...); a cell begins where the one before ends.
    """
    result = there.copy()
    result[:, 1:] |= there[:, :-1]
    result[:, :-1] |= there[:, 1:]
    result[1:, 0] |= result[:-1, -1]
    return result


def _polygon(tangent: FloatArray, bend: FloatArray) -> FloatArray:
    """Return directions evenly about the plane in which a curve bends, (..., 8, 3)."""
    t = tangent / np.linalg.norm(tangent, axis=-1, keepdims=True)
    across = bend - t * np.sum(bend * t, axis=-1, keepdims=True)
    size = np.linalg.norm(across, axis=-1, keepdims=True)
    n = across / np.where(size > 0.0, size, 1.0)
    angle = np.arange(_SIDES)[:, None] * (np.pi / _SIDES)
    result: FloatArray = np.cos(angle) * t[..., None, :] + np.sin(angle) * n[..., None, :]
    return result


@dataclass(frozen=True, slots=True, eq=False)
class CapUse:
    """Use of the caps by a motion.

    Attributes:
        speed: Largest use of a cap on speed, (...).
        acceleration: Use of the cap on the tool's acceleration, (...).
        rows: Factors of beta and alpha in the tool's acceleration over its cap, along directions
            that make a polygon inside the circle, (..., 8 or none, 2).
    """

    speed: FloatArray
    acceleration: FloatArray
    rows: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ForceUse:
    """Use of the force limits by a motion; each over the force that weight and dry friction leave.

    Attributes:
        use: The larger one of both directions, as the square of the factor of all times with which
            the limit would just be kept, (n, points, 3).
        rows: Factors of beta, of alpha and of its root in the force of each carriage along +y, then
            along -y, (n, points, 6, 3): inertia, inertia and viscous friction.
    """

    use: FloatArray
    rows: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class CellMotion:
    """A profile at evenly spaced times of each of its pieces, none of which crosses a break.

    Attributes:
        carriages: Derivatives over their limits, (n, points, 3, 3), carriages last.
        caps: Use of the caps, where there are any.
        forces: Use of the force limits, where there are any.
    """

    carriages: FloatArray
    caps: CapUse | None
    forces: ForceUse | None

    @classmethod
    def of(cls, timed: TimedCurve, profile: Profile, points: int) -> CellMotion:
        """Evaluate ``profile`` at ``points`` times of each piece, both of its ends included."""
        motion, piece = timed.cell_states(profile, points)
        caps = timed.caps(motion, piece, motion[:, points // 2, 0]) if timed.has_caps else None
        carriages = timed.motion(motion, piece)
        return cls(carriages, caps, timed.forces(motion, piece) if timed.limits_force else None)

    def uses(self) -> FloatArray:
        """Return the use of every limit, (n, points, 3, rows): carriages, then the caps if any.

        Where forces are limited they follow jerk: (n, points, 4, rows).
        """
        uses = np.abs(self.carriages)
        if self.forces is not None:
            uses = np.concatenate([uses, self.forces.use[..., None, :]], axis=-2)
        if self.caps is None:
            return uses
        speed, acceleration = self.caps.speed, self.caps.acceleration
        column = np.zeros((*uses.shape[:-1], 1))
        column[..., 0, 0], column[..., 1, 0] = speed, acceleration
        return np.concatenate([uses, column], axis=-1)
