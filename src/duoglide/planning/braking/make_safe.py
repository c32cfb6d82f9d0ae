"""Slow a plan down where drives that stop by themselves would break reach or clearance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import sqrt
from typing import NamedTuple

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import PathError
from duoglide.motion.motion import Motion
from duoglide.planning.braking.blocks import Blocks
from duoglide.planning.braking.carriage_bounds import CarriageBounds
from duoglide.planning.braking.certificate import BrakeReport, brake_report, is_safe
from duoglide.planning.compare import whole
from duoglide.planning.force_limits import require_brakes
from duoglide.planning.tolerances import NO_CAP

Retime = Callable[[FloatArray, FloatArray], Motion]
"""Time the same curve again under a cap on d sigma/dt: sigma (n,) and the cap there (n,), linear in
between, ``NO_CAP`` where there is none."""

Replan = Callable[[float], Motion]
"""Plan the same motion again at a share of its speeds, with the accelerations that it has; raises a
PathError where its way is another one then, and leads where it must not."""


class _Caps(NamedTuple):
    """How caps on the speed are found where a plan is not brake-safe.

    Attributes:
        sample: Of the plan, between two caps [s].
        samples: Least and largest number of them.
        rounds: Times that the curve is timed under caps, before the whole is slowed.
        tighter: Share of a cap that each round keeps which did not suffice.
        slowest: Share of the speed below which no cap is looked for.
        halvings: Of the ratio of speeds in the search for a cap: to 5 % of it.
        least_speed: Of the platform on average [mm/s]: a plan that must be slower is refused.
        longest: Times the duration of the draft, which it may take however short its way is.
        slower: First factor by which the whole is stretched; each next one is its square.
        stretches: At most: by 1.1, 1.1^2, 1.1^4 and so on, 1.1^255 in all.
        replans: At other speeds, before the whole is stretched.
    """

    sample: float = 0.001
    samples: tuple[int, int] = (400, 40_000)
    rounds: int = 5
    tighter: float = 0.97
    slowest: float = 0.002
    halvings: int = 7
    least_speed: float = 10.0
    longest: float = 20.0
    slower: float = 1.1
    stretches: int = 8
    replans: int = 2


_CAPS = _Caps()


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
        LimitError: The drives have not the force to brake as quickly as they are told to.
    """
    motion, report = draft, brake_report(draft)
    longest = max(_CAPS.longest * draft.duration, _way_of(draft) / _CAPS.least_speed)
    sigma, cap = np.zeros(1), np.full(1, NO_CAP)
    slowest = _CAPS.slowest * draft.path.length / max(draft.duration, 1e-9)
    for round_ in range(_CAPS.rounds):
        if report.safe or retime is None:
            break
        where, fresh = brake_caps(motion, report.unsafe, _CAPS.tighter**round_, slowest)
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
        braking_carriage_margin=report.carriage_margin,
    )
    safe = Motion(motion.path, motion.profile, report=told)
    require_brakes(safe)
    return safe


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
    low, high = np.full(len(blocks), _CAPS.slowest), np.ones(len(blocks))
    for _ in range(_CAPS.halvings):
        middle = np.sqrt(low * high)
        safe = is_safe(blocks.at_rate(middle))
        low, high = np.where(safe, middle, low), np.where(safe, high, middle)
    return low


def _replan_slower(
    motion: Motion, report: BrakeReport, replan: Replan
) -> tuple[Motion, BrakeReport] | None:
    """Plan at the speed that seems to be safe, or at a little less; None if neither is."""
    share = float(safe_rates(motion, report.unsafe).min())
    for _ in range(_CAPS.replans):
        try:
            slow = replan(share)
        except PathError:
            return None
        told = brake_report(slow)
        if told.safe:
            return slow, told
        share /= _CAPS.slower
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
    for k in range(_CAPS.stretches):
        if report.safe:
            break
        bad, good = good, good * _CAPS.slower ** (2**k)
        if good * motion.duration > longest:
            break
        slow, report = _stretch(motion, good)
    if report.safe:
        if good > _CAPS.slower**2 * bad:
            less, told = _stretch(motion, sqrt(bad * good))
            slow, report = (less, told) if told.safe else (slow, report)
        return slow, report
    raise PathError(
        f"no speed above {_CAPS.least_speed:g} mm/s was found at which the drives may brake by"
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
    count = int(np.clip(whole(motion.duration / _CAPS.sample), *_CAPS.samples))
    times = np.linspace(0.0, motion.duration, count + 1)
    along = motion.profile.at(times)
    sigma, first = np.unique(along[:, 0], return_index=True)
    speed = np.pad(along[first, 1], 2, mode="edge")
    highest = np.lib.stride_tricks.sliding_window_view(speed, 5).max(axis=-1)
    return sigma, highest, times[first]
