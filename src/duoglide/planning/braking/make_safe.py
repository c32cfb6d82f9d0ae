"""Slow a plan down where drives that stop by themselves would break reach or clearance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import sqrt

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import PathError
from duoglide.motion.motion import Motion
from duoglide.planning.braking.blocks import Blocks
from duoglide.planning.braking.carriage_bounds import CarriageBounds
from duoglide.planning.braking.certificate import BrakeReport, brake_report, is_safe
from duoglide.planning.compare import whole
from duoglide.planning.tolerances import NO_CAP

Retime = Callable[[FloatArray, FloatArray], Motion]
"""Time the same curve again under a cap on d sigma/dt: sigma (n,) and the cap there (n,), linear in
between, ``NO_CAP`` where there is none."""

Replan = Callable[[float], Motion]
"""Plan the same motion again at a share of its speeds, with the accelerations that it has; raises a
PathError where its way is another one then, and leads where it must not."""

_SAMPLE = 0.001  # [s] of the plan lie between two caps.
_FEWEST_SAMPLES, _MOST_SAMPLES = 400, 40_000
_ROUNDS = 5
_TIGHTER = 0.97  # what a cap loses each round that it did not suffice
_SLOWEST = 0.002  # A share of the speed below which no cap is looked for.
_HALVINGS = 7  # of the ratio of speeds, in the search for a cap
_LEAST_SPEED = 10.0  # [mm/s] of the platform on average: a plan that must be slower is refused
_LONGEST = 20.0  # times the duration of the draft, which it may take however short its way is
_SLOWER = 1.1
_MOST_STRETCHES = 8  # by 1.1, 1.1^2, 1.1^4: 1.1^255 in all
_BISECTIONS = 1
_REPLANS = 2


def make_brake_safe(
    draft: Motion, retime: Retime | None = None, replan: Replan | None = None
) -> Motion:
    """Return ``draft``, or the same curve timed slower where braking alone would not be safe.

    Only the parts that are not certain to be safe are slowed, if the curve can be timed again.

    Args:
        draft: What was planned without regard to braking.
        retime: How to time the curve again under caps; left out, the whole of it is slowed.
        replan: How to slow the whole of it down; left out, it is stretched, and accelerates less.

    Returns:
        A motion whose report says what the safety has cost and the least clearance while
        braking, for certain.

    Raises:
        PathError: No speed is certain to be safe that is worth having.
    """
    motion, report = draft, brake_report(draft)
    longest = max(_LONGEST * draft.duration, _way_of(draft) / _LEAST_SPEED)
    sigma, cap = np.zeros(1), np.full(1, NO_CAP)
    slowest = _SLOWEST * draft.path.length / max(draft.duration, 1e-9)
    for round_ in range(_ROUNDS):
        if report.safe or retime is None:
            break
        where, fresh = brake_caps(motion, report.unsafe, _TIGHTER**round_, slowest)
        grid = np.union1d(sigma, where)
        sigma, cap = grid, np.minimum(np.interp(grid, sigma, cap), np.interp(grid, where, fresh))
        motion = retime(sigma, cap)
        report = brake_report(motion)
        if motion.duration > longest:
            break
    if not report.safe:
        found = _replan_slower(motion, report, replan) if replan is not None else None
        motion, report = found or _slow_down(motion, report, longest)
    cost = draft.duration if motion is not draft else 0.0
    told = replace(
        motion.report,
        brake_safe=True,
        duration_before_braking=cost,
        braking_clearance=report.clearance,
    )
    return Motion(motion.path, motion.profile, report=told)


def brake_caps(
    motion: Motion, unsafe: FloatArray, share: float = 1.0, slowest: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Find how fast a motion may be in the parts of it that are not safe as they are.

    Args:
        motion: The motion.
        unsafe: Parts of its path time [s], shape (m, 2).
        share: Of the caps found, what to take.
        slowest: The least cap [mm/s].

    Returns:
        Places on the curve [mm] and the cap on d sigma/dt there [mm/s], (n,) each; ``NO_CAP`` where
        it is safe. Whoever uses them looks at the result with ``brake_report``.
    """
    sigma, speed, times = _choose_samples(motion)
    rates = share * safe_rates(motion, unsafe)
    cap = np.full(sigma.size, NO_CAP)
    for (start, end), rate in zip(unsafe.tolist(), rates.tolist(), strict=True):
        first = max(int(np.searchsorted(times, start, side="right")) - 2, 0)
        last = min(int(np.searchsorted(times, end, side="left")) + 2, sigma.size)
        part = slice(first, last)
        cap[part] = np.minimum(cap[part], np.maximum(rate * speed[part], slowest))
    return sigma, cap


def safe_rates(motion: Motion, unsafe: FloatArray) -> FloatArray:
    """Find at which share of its speed each part of a motion would be safe, shape (m,).

    Args:
        motion: The motion.
        unsafe: Parts of its path time [s], shape (m, 2).
    """
    blocks = Blocks.within(CarriageBounds.of(motion), unsafe)
    low, high = np.full(len(blocks), _SLOWEST), np.ones(len(blocks))
    for _ in range(_HALVINGS):
        middle = np.sqrt(low * high)
        safe = is_safe(blocks.at_rate(middle))
        low, high = np.where(safe, middle, low), np.where(safe, high, middle)
    return low


def _replan_slower(
    motion: Motion, report: BrakeReport, replan: Replan
) -> tuple[Motion, BrakeReport] | None:
    """Plan at the speed that seems to be safe, or at a little less; None if neither is."""
    share = float(safe_rates(motion, report.unsafe).min())
    for _ in range(_REPLANS):
        try:
            slow = replan(share)
        except PathError:
            return None
        told = brake_report(slow)
        if told.safe:
            return slow, told
        share /= _SLOWER
    return None


def _slow_down(motion: Motion, report: BrakeReport, longest: float) -> tuple[Motion, BrakeReport]:
    """Stretch the whole of a motion in time until it is brake-safe, or takes ``longest`` [s].

    Raises:
        PathError: It never is: its path leaves hardly more than what must be kept.
    """
    rates = safe_rates(motion, report.unsafe) if len(report.unsafe) else np.ones(1)
    good = 1.0 / float(rates.min())
    slow, report = _stretch(motion, good)
    bad = good
    for k in range(_MOST_STRETCHES):
        if report.safe:
            break
        bad, good = good, good * _SLOWER ** (2**k)
        if good * motion.duration > longest:
            break
        slow, report = _stretch(motion, good)
    if report.safe:
        for _ in range(_BISECTIONS if good > _SLOWER**2 * bad else 0):
            middle = sqrt(bad * good)
            less, told = _stretch(motion, middle)
            bad, good = (bad, middle) if told.safe else (middle, good)
            slow, report = (less, told) if told.safe else (slow, report)
        return slow, report
    raise PathError(
        f"no speed above {_LEAST_SPEED:g} mm/s was found at which the drives may brake by"
        f" themselves, each within {motion.machine.reaction_cycles} cycles of the first:"
        f" {_lacking(report)}",
        position=report.position,
        quantity=report.quantity,
        amount=-report.room,
    )


def _way_of(motion: Motion) -> float:
    """Return how far the platform goes [mm], about."""
    places = motion.position_at(np.linspace(0.0, motion.duration, 257))
    return float(np.linalg.norm(np.diff(places, axis=0), axis=-1).sum())


def _lacking(report: BrakeReport) -> str:
    """Say what would be too small."""
    if report.room == -np.inf:
        return "the links might come apart"
    return f"{report.quantity} would be {-report.room:.6g} mm too small"


def _stretch(motion: Motion, factor: float) -> tuple[Motion, BrakeReport]:
    """Return a motion that takes ``factor`` times as long, and its report."""
    slow = Motion(motion.path, motion.profile.stretch(factor), report=motion.report)
    return slow, brake_report(slow)


def _choose_samples(motion: Motion) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return where on the curve to look, both ends included, at which speed it is passed, and when.

    The speeds are the largest ones near by: a cap must hold between two samples, and none is zero.
    """
    count = int(np.clip(whole(motion.duration / _SAMPLE), _FEWEST_SAMPLES, _MOST_SAMPLES))
    times = np.linspace(0.0, motion.duration, count + 1)
    along = motion.profile.at(times)
    sigma, first = np.unique(along[:, 0], return_index=True)
    speed = np.pad(along[first, 1], 2, mode="edge")
    highest = np.lib.stride_tricks.sliding_window_view(speed, 5).max(axis=-1)
    return sigma, highest, times[first]
