"""Slow a plan down where drives that stop by themselves would break reach or clearance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import sqrt

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.errors import PathError
from duoglide.kinematics.headroom.room import room
from duoglide.machine import Machine
from duoglide.motion.motion import Motion
from duoglide.motion.path.carriage import CarriagePath
from duoglide.motion.path.transfer import TransferPath
from duoglide.planning.braking.certificate import ALLOWED, BrakeReport, DriveStops, brake_report
from duoglide.planning.compare import whole
from duoglide.planning.timing.use import estimate_peaks
from duoglide.planning.tolerances import CHUNK, NO_CAP

Retime = Callable[[FloatArray, FloatArray], Motion]
"""Time the same curve again under a cap on d sigma/dt: sigma (n,) and the cap there (n,), linear in
between, ``NO_CAP`` where there is none."""


_MARGIN = 1.0 / 320.0  # Caps keep this share of the leg's length beyond each bound.
_SHARE = 0.5  # They keep at most this share of the room that the path itself has.
_SPENT = 0.6  # Samples may take this share of ``ALLOWED``; what lies between them has the rest.
_HARMLESS = 2e-4  # [mm]; a stop that is over within this way needs no cap.
_HALVINGS = 10
_FRACTIONS = np.linspace(0.0, 1.0, 17)[1:]  # A stop is looked at after these shares of its time.
_SAMPLE = 0.001  # [s] of the plan lie between two caps.
_FEWEST_SAMPLES, _MOST_SAMPLES = 400, 40_000
_NONE = -1e3  # [mm]; stands for the room where the links come apart.
_ROUNDS = 2
_TIGHTER = 0.97  # what a cap loses each round that it did not suffice
_WIDER = 4.0  # times the margin each round: close to a bound, little is certain
_SLOWER = 1.1
_MOST_STRETCHES = 8  # by 1.1, 1.1^2, 1.1^4: 1.1^255 in all, and it stands nearly still
_BISECTIONS = 1


def make_brake_safe(draft: Motion, retime: Retime | None = None) -> Motion:
    """Return ``draft``, or the same curve timed slower where braking alone would not be safe.

    Args:
        draft: What was planned without regard to braking.
        retime: How to time the curve again under caps; left out, the whole of it is slowed.

    Returns:
        A motion whose report says what the safety has cost and the least clearance while
        braking, for certain.

    Raises:
        PathError: No speed is certain to be safe.
    """
    motion, report = draft, brake_report(draft)
    sigma, cap = np.zeros(1), np.full(1, NO_CAP)
    for round_ in range(_ROUNDS if retime is not None else 0):
        if report.safe or retime is None:
            break
        where, speed = _choose_samples(motion)
        caps = brake_caps(motion.path, where, speed, _WIDER**round_)
        fresh = _widen(caps, speed) * _TIGHTER**round_
        if (fresh == NO_CAP).all():
            break  # samples are safe already: all of it has to be slower
        grid = np.union1d(sigma, where)
        sigma, cap = grid, np.minimum(np.interp(grid, sigma, cap), np.interp(grid, where, fresh))
        motion = retime(sigma, cap)
        report = brake_report(motion)
    if not report.safe:
        motion, report = _slow_down(motion)
    cost = draft.duration if motion is not draft else 0.0
    told = replace(
        motion.report,
        brake_safe=True,
        duration_before_braking=cost,
        braking_clearance=report.clearance,
    )
    return Motion(motion.path, motion.profile, report=told)


def _slow_down(motion: Motion) -> tuple[Motion, BrakeReport]:
    """Stretch the whole of a motion in time until it is brake-safe.

    Raises:
        PathError: It never is: its path leaves less than bounds can tell from nothing.
    """
    sigma, speed = _choose_samples(motion)
    good = float((speed / brake_caps(motion.path, sigma, speed)).max(initial=1.0))
    slow, report = _stretch(motion, good)
    bad = good
    for k in range(_MOST_STRETCHES):
        if report.safe:
            break
        bad, good = good, good * _SLOWER ** (2**k)
        slow, report = _stretch(motion, good)
    if report.safe:
        for _ in range(_BISECTIONS if good > _SLOWER**2 * bad else 0):
            middle = sqrt(bad * good)
            less, told = _stretch(motion, middle)
            bad, good = (bad, middle) if told.safe else (middle, good)
            slow, report = (less, told) if told.safe else (slow, report)
        return slow, report
    raise PathError(
        f"no speed was found at which the drives may brake by themselves: {report.quantity} would"
        f" be {-report.room:.6g} mm too small",
        position=report.position,
        quantity=report.quantity,
        amount=-report.room,
    )


def _stretch(motion: Motion, factor: float) -> tuple[Motion, BrakeReport]:
    """Return a motion that takes ``factor`` times as long, and its report."""
    slow = Motion(motion.path, motion.profile.stretch(factor), report=motion.report)
    return slow, brake_report(slow)


def _widen(caps: FloatArray, speed: FloatArray) -> FloatArray:
    """Return the caps that count: those below the speed, and those beside them."""
    lower = np.pad(caps < speed, 1, mode="edge")
    counts = lower[:-2] | lower[1:-1] | lower[2:]
    return np.where(counts, caps, NO_CAP)


def _choose_samples(motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return where on the curve to look, both ends included, and the speeds to ask for there.

    These are the largest ones near by: a cap must hold between two samples, and none is zero.
    """
    count = int(np.clip(whole(motion.duration / _SAMPLE), _FEWEST_SAMPLES, _MOST_SAMPLES))
    along = motion.profile.at(np.linspace(0.0, motion.duration, count + 1))
    sigma, first = np.unique(along[:, 0], return_index=True)
    speed = np.pad(along[first, 1], 2, mode="edge")
    return sigma, np.lib.stride_tricks.sliding_window_view(speed, 5).max(axis=-1)


def brake_caps(
    path: CarriagePath | TransferPath,
    sigma: FloatArray,
    speed: FloatArray,
    wider: float = 1.0,
) -> FloatArray:
    """Find the largest path speeds from which every drive may brake by itself.

    Args:
        path: The curve of the carriages.
        sigma: Where on it [mm], shape (n,).
        speed: Largest d sigma/dt to consider there [mm/s], shape (n,), above 0.
        wider: How many times the usual margin to keep, where the path itself has so much.

    Returns:
        Safe d sigma/dt, at most ``speed``, shape (n,), found by halving: whoever uses them looks
        at the result with ``brake_report``.
    """
    parts = [
        _find_caps(path, sigma[begin : begin + CHUNK], speed[begin : begin + CHUNK], wider)
        for begin in range(0, sigma.size, CHUNK)
    ]
    return np.concatenate(parts) if parts else np.zeros(0)


def _find_caps(
    path: CarriagePath | TransferPath, sigma: FloatArray, speed: FloatArray, wider: float
) -> FloatArray:
    states = path.derivatives(sigma)
    q, slope = states[:, 0], states[:, 1] * speed[:, None]
    machine = path.machine
    margin = wider * _MARGIN * machine.geometry.leg_length
    wanted = np.clip(_SHARE * room(machine, q).least(), 0.0, margin) - _SPENT * ALLOWED
    deceleration = np.array(machine.drives.quick_stop_deceleration)
    distance = (slope**2 / (2.0 * deceleration)).max(axis=-1)
    low = np.sqrt(_HARMLESS / np.maximum(distance, _HARMLESS))
    safe = _keeps_room(machine, q, slope, wanted)
    low[safe] = 1.0
    rows = np.flatnonzero(low < 1.0)
    high = np.ones(sigma.size)
    for _ in range(_HALVINGS):  # of the ratio: the speed to begin with may be any times too high
        middle = np.sqrt(low[rows] * high[rows])
        safe = _keeps_room(machine, q[rows], middle[:, None] * slope[rows], wanted[rows])
        low[rows] = np.where(safe, middle, low[rows])
        high[rows] = np.where(safe, high[rows], middle)
    caps: FloatArray = speed * low
    return caps


def _keeps_room(machine: Machine, q: FloatArray, v: FloatArray, wanted: FloatArray) -> BoolArray:
    """Tell which drive stops keep the room that is wanted, at 16 instants each, shape (n,)."""
    if not q.size:
        return np.zeros(0, dtype=bool)
    least = np.full(len(q), np.inf)
    for coast in (0.0, machine.drives.cycle):
        stops = DriveStops(machine, q, v, np.full(len(q), coast))
        places = np.stack([stops.at(np.full(len(q), f)) for f in _FRACTIONS], axis=1)
        here = np.maximum(room(machine, places).least(), _NONE)
        least = np.minimum(least, -estimate_peaks(-here))
    safe: BoolArray = least > wanted
    return safe
