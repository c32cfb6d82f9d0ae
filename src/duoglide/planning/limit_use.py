"""How much of its carriages' limits a motion uses: at every instant of it, not only at samples.

The planner looks at its own profiles at nine points a piece, and knows what they are like. This
takes any profile, of a file perhaps, and leaves nothing out. Time is cut where the profile or the
curve begins another piece, so that each carriage is smooth in every cell, and a derivative f of it
stays below the larger of its two ends + h^2/8 max |f''|. The bound on f'' follows from the
polynomials of the profile and of the curve, and through the closed form by Leibniz' rule with the
absolute value of each term. Cells are cut until that is sharp enough.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from duoglide.arrays import FloatArray, IndexArray
from duoglide.errors import LimitError, PathError
from duoglide.kinematics.constants import pose_constants
from duoglide.kinematics.derivatives import ArrayJet, root_jet_bounds
from duoglide.kinematics.modes import WORKING
from duoglide.machine import CarriageLimits, Machine
from duoglide.motion.curve.bounds import bound_derivatives
from duoglide.motion.motion import Motion
from duoglide.motion.path.transfer import TransferPath
from duoglide.motion.profile import SIGMA, TIME, Profile, evaluate
from duoglide.planning.tolerances import CHUNK, PICOMETRE

ALLOWED = 1.001  # use of a limit, as audits allow it
NAMES = ("velocity", "acceleration", "jerk")
UNITS = ("mm/s", "mm/s^2", "mm/s^3")


class _Cutting(NamedTuple):
    """How cells of time are cut, and what rounding may leave of a sound motion.

    Attributes:
        sharp: Times the largest use that was seen, or a limit: a cell below that is closed.
        order: Of the highest derivative that is bounded.
        parts: Into which a cell is cut at once, at most.
        cells: At once, at most, to bound the memory.
        hopeless: From such a use on, how much it is exactly does not matter.
        finest: No cell is shorter [s].
        backwards: Speed that rounding may leave of a profile that must not go backwards
            [mm/s].
        torn: What may jump where pieces meet: position [mm], and shares of the limits of
            velocity and acceleration.
    """

    sharp: float = 1.0009
    order: int = 5
    parts: int = 64
    cells: int = 4_000_000
    hopeless: float = 1e3
    finest: float = 1e-10
    backwards: float = 1e-3
    torn: tuple[float, float, float] = (1e-9, 1e-9, 1e-6)


_CUT = _Cutting()


class Worst(NamedTuple):
    """The largest use of a limit.

    Attributes:
        use: 1.0 = at the limit, certain to about 0.09 %.
        time: When [s].
        order: 0 velocity, 1 acceleration, 2 jerk.
        carriage: 0 to 2.
    """

    use: float
    time: float
    order: int
    carriage: int


@dataclass(frozen=True, slots=True, eq=False)
class Uses:
    """Use of each limit of each carriage, derivatives first, (3, 3); 1.0 = at the limit.

    Attributes:
        seen: The largest of many samples.
        sure: What it is certain not to exceed.
        times: When the largest one was seen [s].
    """

    seen: FloatArray
    sure: FloatArray
    times: FloatArray

    def worst(self) -> Worst:
        """Return the largest use that was seen, or, where all seem well, that is not excluded."""
        table = self.seen if self.seen.max() > ALLOWED else self.sure
        order, carriage = np.unravel_index(int(np.argmax(table)), table.shape)
        use, time = table[order, carriage], self.times[order, carriage]
        return Worst(float(use), float(time), int(order), int(carriage))


def require_limits(motion: Motion, limits: CarriageLimits) -> Uses:
    """Require that a motion keeps limits at every instant, and return how much of them it uses.

    Raises:
        LimitError: Which carriage would need more of what, when, and how much there is.
        PathError: The motion jumps, runs backwards, or leaves its curve.
    """
    uses = measure_uses(motion, limits)
    worst = uses.worst()
    if worst.use > ALLOWED:
        name, unit = NAMES[worst.order], UNITS[worst.order]
        limit = getattr(limits, name)[worst.carriage]
        raise LimitError(
            f"carriage {worst.carriage + 1} would need {worst.use * limit:.6g} {unit} at"
            f" {worst.time:.6f} s; limits.{name} of this machine is {limit:.6g} {unit}: plan it"
            " again, or lower the override"
        )
    return uses


def measure_uses(motion: Motion, limits: CarriageLimits) -> Uses:
    """Return how much of some limits a motion uses.

    Raises:
        PathError: The motion jumps, runs backwards, or leaves its curve.
    """
    profile = motion.profile
    _require_forward(profile)
    _require_on_curve(motion)
    edges = _cut_at_breaks(motion)
    table = np.stack([getattr(limits, name) for name in NAMES])
    search = _Search(motion, table)
    for begin in range(0, len(edges) - 1, CHUNK):
        part = edges[begin : begin + CHUNK + 1]
        search.look(part[:-1], part[1:])
    return Uses(search.seen, np.maximum(search.sure, search.seen), search.times)


def uses_at_cycles(motion: Motion, machine: Machine) -> FloatArray:
    """Return the use of ``machine.stop_limits`` by the positions that the cycles will send.

    Measured by their differences; from and to rest. Shape (3, 3): velocity, acceleration and jerk
    of each carriage.
    """
    cycle, limits = machine.drives.cycle, machine.stop_limits
    steps = motion.at(np.arange(-3, np.ceil(motion.duration / cycle) + 4) * cycle).carriages
    uses = []
    for limit in (limits.velocity, limits.acceleration, limits.jerk):
        steps = np.diff(steps, axis=0) / cycle
        uses.append(np.abs(steps).max(axis=0) / limit)
    return np.array(uses)


def _require_forward(profile: Profile) -> None:
    """Refuse a profile that goes backwards within a piece."""
    spans = np.diff(profile.knots[:, TIME])
    c = profile.polynomials
    low, high, rows = np.zeros_like(spans), spans, np.arange(spans.size)
    while rows.size:
        h, middle = high - low, 0.5 * (low + high)
        here, first, last = (evaluate(c[rows], u) for u in (middle, low, high))
        speeds = np.minimum(np.minimum(first[:, 1], last[:, 1]), here[:, 1])
        if (speeds < -_CUT.backwards).any():
            k = int(np.argmin(speeds))
            raise PathError(
                f"the profile goes backwards, at {-speeds[k]:.4g} mm/s along its curve, at"
                f" {profile.knots[rows[k], TIME] + middle[k]:.6f} s",
                quantity="continuity",
                amount=float(-speeds[k]),
            )
        third = np.maximum(np.abs(first[:, 3]), np.abs(last[:, 3]))
        third = third + h * h / 8.0 * np.abs(120.0 * c[rows, 5])
        ends = np.minimum(first[:, 1], last[:, 1])
        open_ = (ends - h * h / 8.0 * third < -_CUT.backwards) & (h > _CUT.finest)
        low, middle, high, rows = low[open_], middle[open_], high[open_], rows[open_]
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        rows = np.concatenate([rows, rows])


def _require_on_curve(motion: Motion) -> None:
    """Refuse a profile that begins before its curve or ends after it, and is held back there."""
    start, end = motion.profile.knots[0, SIGMA], motion.profile.end
    beyond = max(-start, end - float(_breaks(motion)[-1]))
    if beyond > PICOMETRE:
        raise PathError(
            f"the profile leaves its curve by {beyond:.4g} mm",
            quantity="continuity",
            amount=float(beyond),
        )


def _breaks(motion: Motion) -> FloatArray:
    """Return where the curve of a motion begins another piece, by its own parameter."""
    path = motion.path
    return path.breaks if isinstance(path, TransferPath) else path.curve.breaks


def _cut_at_breaks(motion: Motion) -> FloatArray:
    """Return when the profile or the curve begins another piece [s]; the curve may not jump there.

    Raises:
        PathError: Position, velocity or acceleration of a carriage jumps.
    """
    profile, limits = motion.profile, motion.machine.limits
    breaks = _breaks(motion)[1:-1]
    inside = (breaks > profile.knots[0, SIGMA]) & (breaks < profile.end)
    left = np.flatnonzero(inside)
    times = np.array([_time_at(profile, sigma) for sigma in breaks[left].tolist()])
    if left.size:
        speed, rate = profile.at(times)[:, 1:3, None].swapaxes(0, 1)
        before, after = (motion.path.derivatives(breaks[left], k) for k in (left, left + 1))
        jump = after - before
        jumps = [
            np.abs(jump[:, 0]) / _CUT.torn[0],
            np.abs(jump[:, 1] * speed) / (_CUT.torn[1] * limits.velocity),
            np.abs(jump[:, 1] * rate + jump[:, 2] * speed**2)
            / (_CUT.torn[2] * limits.acceleration),
        ]
        worst = np.max(jumps, axis=(0, 2))
        if worst.max() > 1.0:
            k = int(np.argmax(worst))
            raise PathError(
                f"the carriages jump at {times[k]:.6f} s, where two pieces of the curve meet: in"
                f" velocity by {np.abs(jump[k, 1] * speed[k]).max():.4g} mm/s; a motion must rest"
                " at a corner",
                quantity="continuity",
                amount=float(np.abs(jump[k, 1] * speed[k]).max()),
            )
    edges: FloatArray = np.union1d(profile.knots[:, TIME], times)
    return edges


def _time_at(profile: Profile, sigma: float) -> float:
    """Return when ``sigma`` [mm] is reached [s]: at a knot, if rounding alone lies between them."""
    column = profile.knots[:, SIGMA]
    near = int(np.searchsorted(column, sigma - PICOMETRE))
    if abs(column[near] - sigma) <= PICOMETRE:
        return float(profile.knots[near, TIME])
    return profile.time_at(sigma)


class _Search:
    """Cuts cells of time until the use of each limit is certain.

    Args:
        motion: Whose use.
        limits: Velocity, acceleration and jerk of each carriage, (3, 3).
    """

    def __init__(self, motion: Motion, limits: FloatArray) -> None:
        self._motion, self._limits = motion, limits
        self._curve = _curve_bounds(motion)
        self._breaks = _breaks(motion)
        self.seen, self.sure, self.times = (np.zeros((3, 3)) for _ in range(3))

    def look(self, low: FloatArray, high: FloatArray) -> None:
        """Cut cells until none can hide more than a little beyond what was seen."""
        profile = self._motion.profile
        # Not by the middle: between two knots one rounding apart it is one of them.
        row = np.searchsorted(profile.knots[1:-1, TIME], low, side="right")
        begin = profile.knots[row, TIME]
        low, high = low - begin, high - begin
        middle = evaluate(profile.polynomials[row], 0.5 * (low + high))[:, 0]
        piece = np.searchsorted(self._breaks[1:-1], middle, side="right")
        while row.size:
            ends, bow = self._bound(row, piece, low, high)
            enough = _CUT.sharp * np.maximum(self.seen, 1.0)
            open_ = (ends + bow > enough).any(axis=(1, 2)) & (high - low > _CUT.finest)
            open_ &= self.seen.max() < _CUT.hopeless
            self.sure = np.maximum(self.sure, (ends + bow)[~open_].max(axis=0, initial=0.0))
            room = np.maximum(enough - ends[open_], 1.0 - 1.0 / _CUT.sharp)
            parts = np.clip(np.sqrt(bow[open_] / room).max(axis=(1, 2), initial=0.0), 1, _CUT.parts)
            parts = np.ceil(parts).astype(np.intp) + 1
            if parts.sum() > _CUT.cells:
                raise LimitError(
                    "the motion is too rough for its use of the limits to be certified"
                )
            row, piece, low, high = _divide(
                row[open_], piece[open_], low[open_], high[open_], parts
            )

    def _bound(
        self, row: IndexArray, piece: IndexArray, low: FloatArray, high: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the use of every limit at the ends of cells, and how much it may be more between.

        Each has shape (n, 3, 3).
        """
        c, h = self._motion.profile.polynomials[row], high - low
        along = [evaluate(c, u) for u in (low, 0.5 * (low + high), high)]
        ends = np.maximum(
            *(self._uses(state, piece, row, u) for state, u in ((along[0], low), (along[2], high)))
        )
        rates = _profile_bounds(c, low, high, along[0], along[2])
        most = self._carriage_bounds(along[1][:, 0], piece, rates, 0.5 * h)
        with np.errstate(invalid="ignore"):  # no limit is no limit, whatever the bound
            bow = (h * h / 8.0)[:, None, None] * most[:, 2:] / self._limits
        return ends, np.where(np.isinf(self._limits), 0.0, bow)

    def _uses(
        self, along: FloatArray, piece: IndexArray, row: IndexArray, u: FloatArray
    ) -> FloatArray:
        """Measure the use of every limit at instants, (n, 3, 3)."""
        q = self._motion.path.derivatives(along[:, 0], piece)
        v, a, j = (along[:, k, None] for k in (1, 2, 3))
        q1, q2, q3 = q[:, 1], q[:, 2], q[:, 3]
        rates = [q1 * v, q1 * a + q2 * v**2, q1 * j + 3.0 * q2 * v * a + q3 * v**3]
        uses: FloatArray = np.abs(np.stack(rates, axis=1)) / self._limits
        best = np.argmax(uses, axis=0)
        most = np.take_along_axis(uses, best[None], axis=0)[0]
        times = self._motion.profile.knots[row, TIME] + u
        self.times = np.where(most > self.seen, times[best], self.times)
        self.seen = np.maximum(self.seen, most)
        return uses

    def _carriage_bounds(
        self, sigma: FloatArray, piece: IndexArray, rates: ArrayJet, half: FloatArray
    ) -> FloatArray:
        """Bound the derivatives 1 to 5 of the carriages by time in cells, (n, 5, 3)."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            jets = _chain([bound[piece] for bound in self._curve], rates)
            path = self._motion.path
            if isinstance(path, TransferPath):
                return np.stack(jets, axis=1)
            found = _through_links(path.machine, path.position(sigma), jets, half)
            return np.where(np.isnan(found), np.inf, found)


def _curve_bounds(motion: Motion) -> list[FloatArray]:
    """Bound the derivatives of the curve by sigma in each of its pieces, (n, 3) each."""
    path = motion.path
    if not isinstance(path, TransferPath):
        return bound_derivatives(path.curve, _CUT.order)
    _, one, two, three = np.moveaxis(path.polynomials, 1, 0)
    span = np.diff(path.breaks)[:, None]
    third = 6.0 * np.abs(three)
    second = np.maximum(np.abs(2.0 * two), np.abs(2.0 * two + 6.0 * three * span))
    first = np.maximum(np.abs(one), np.abs(one + span * (2.0 * two + span * 3.0 * three)))
    none = np.zeros_like(third)
    return [first + span**2 / 8.0 * third, second, third, none, none]


def _profile_bounds(
    c: FloatArray, low: FloatArray, high: FloatArray, first: FloatArray, last: FloatArray
) -> ArrayJet:
    """Bound the derivatives 1 to 5 of sigma by time in cells, each (n, 1)."""
    fifth = np.abs(120.0 * c[:, 5])
    fourth = np.maximum(*(np.abs(24.0 * c[:, 4] + 120.0 * c[:, 5] * u) for u in (low, high)))
    bow = (high - low) ** 2 / 8.0
    bounds = [fifth, fourth]
    for order in (3, 2, 1):
        ends = np.maximum(np.abs(first[:, order]), np.abs(last[:, order]))
        bounds.append(ends + bow * bounds[-2])
    return [bound[:, None] for bound in reversed(bounds)]


def _chain(p: ArrayJet, s: ArrayJet) -> ArrayJet:
    """Bound the derivatives 1 to 5 of p(s(t)) by theirs: Faa di Bruno, every term +."""
    p1, p2, p3, p4, p5 = p
    s1, s2, s3, s4, s5 = s
    return [
        p1 * s1,
        p2 * s1**2 + p1 * s2,
        p3 * s1**3 + 3.0 * p2 * s1 * s2 + p1 * s3,
        p4 * s1**4 + 6.0 * p3 * s1**2 * s2 + p2 * (3.0 * s2**2 + 4.0 * s1 * s3) + p1 * s4,
        p5 * s1**5
        + 10.0 * p4 * s1**3 * s2
        + p3 * (15.0 * s1 * s2**2 + 10.0 * s1**2 * s3)
        + p2 * (10.0 * s2 * s3 + 5.0 * s1 * s4)
        + p1 * s5,
    ]


def _through_links(
    machine: Machine, position: FloatArray, jets: ArrayJet, half: FloatArray
) -> FloatArray:
    """Carry bounds on the platform's derivatives through the closed form, (n, 5, 3).

    Args:
        machine: Whose links.
        position: Platform in the middle of each cell, (n, 3).
        jets: Bounds on its derivatives by time in the whole cell, (n, 3) each.
        half: Half of each cell's length [s], (n,).
    """
    cx, base, l6, l2, _half, xb, zb, l9, v, _w1, _w2, _w3 = pose_constants(
        machine.geometry, WORKING
    )
    x, z = position[:, 0], position[:, 2]
    by_x, by_y, by_z = ([jet[:, axis] for jet in jets] for axis in range(3))
    rise = z - base - v * np.sqrt((l6 - (x - cx)) * (l6 + (x - cx)))
    u, X, Z = (np.abs(a) + b[0] * half for a, b in ((x - cx, by_x), (x - xb, by_x), (z - zb, by_z)))
    A = root_jet_bounds(np.sqrt((l6 - u) * (l6 + u)), [u, *by_x])
    up = [b + a for b, a in zip(by_z, A[1:], strict=True)]
    h = np.abs(rise) + up[0] * half
    p = root_jet_bounds(np.sqrt((l2 - h) * (l2 + h)), [h, *up])
    q = root_jet_bounds(np.sqrt(l9 * l9 - X * X - Z * Z), [X, *by_x], [Z, *by_z])
    legs = np.stack([y + r for y, r in zip(by_y, p[1:], strict=True)], axis=1)
    strut = np.stack([y + r for y, r in zip(by_y, q[1:], strict=True)], axis=1)
    return np.stack([legs, legs, strut], axis=-1)


def _divide(
    row: IndexArray, piece: IndexArray, low: FloatArray, high: FloatArray, parts: IndexArray
) -> tuple[IndexArray, IndexArray, FloatArray, FloatArray]:
    """Cut cells into so many equal parts each."""
    first, step = np.repeat(low, parts), np.repeat((high - low) / parts, parts)
    k = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    rows, pieces = np.repeat(row, parts), np.repeat(piece, parts)
    return rows, pieces, first + k * step, first + (k + 1) * step
