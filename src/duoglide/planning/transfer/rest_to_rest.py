"""Ruckig from rest to rest in carriage space, taken apart into polynomials.

Ruckig is asked in units in which its numbers are near 1, because it wants limits below 1e9. Never
set its ``intermediate_positions``: they are sent to a cloud service.
"""

from __future__ import annotations

import numpy as np
import ruckig

from duoglide.arrays import FloatArray
from duoglide.errors import LimitError
from duoglide.machine import CarriageLimits
from duoglide.motion.profile import advance_state

_LARGEST = 1e7  # a limit this many times what the motion needs is none
_SAME_TIME = 1e-12  # Ends of phases that are nearer than this share of the duration are one.
_FACTORIALS = np.array([1.0, 1.0, 2.0, 6.0])


def plan_rest_to_rest(
    start: FloatArray, goal: FloatArray, limits: CarriageLimits, sync: ruckig.Synchronization
) -> tuple[FloatArray, FloatArray]:
    """Find the quickest motion of three carriages from rest to rest under their limits.

    Args:
        start: Carriages at the start [mm], shape (3,).
        goal: Carriages at the end [mm], shape (3,); not the same.
        limits: Of velocity, acceleration and jerk.
        sync: ``Phase`` goes straight in carriage space where the limits let it.

    Returns:
        Times of the pieces' ends, from 0 [s], shape (n + 1,); and their coefficients in rising
        powers of the time since their start [mm, mm/s, ...], shape (n, 4, 3).

    Raises:
        LimitError: Ruckig finds no motion.
    """
    way = np.abs(goal - start)
    length = float(way.max())
    longest = np.max([way / limits.velocity, (way / limits.acceleration) ** 0.5], axis=0)
    second = float(np.maximum(longest, np.cbrt(way / limits.jerk)).max())  # the unit of time
    question = ruckig.InputParameter(3)
    question.synchronization = sync
    question.current_position = [0.0, 0.0, 0.0]
    question.target_position = ((goal - start) / length).tolist()
    for order, name in enumerate(("velocity", "acceleration", "jerk"), start=1):
        scaled = getattr(limits, name) * (second**order / length)
        setattr(question, f"max_{name}", np.minimum(scaled, _LARGEST).tolist())
    solver, answer = ruckig.Ruckig(3), ruckig.Trajectory(3)
    try:
        solver.validate_input(question, True, True)
        result = solver.calculate(question, answer)
    except ruckig.RuckigError as error:
        raise LimitError(f"ruckig finds no transfer within the limits: {error}") from error
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise LimitError(f"ruckig finds no transfer within the limits: {result.name}")
    breaks, table = _read_pieces(answer)
    table *= length / second ** np.arange(4.0)[:, None]
    table[:, 0] += start
    return breaks * second, table


def _read_pieces(answer: ruckig.Trajectory) -> tuple[FloatArray, FloatArray]:
    """Read ruckig's phases of constant jerk, cut at the phases of all three carriages."""
    phases = [(np.array(p.t), np.array(p.j)) for p in answer.profiles[0]]
    ends = np.concatenate([np.cumsum(t) for t, _ in phases])
    ends = np.unique(ends[ends > 0.0])
    apart = np.diff(ends, prepend=0.0) > _SAME_TIME * answer.duration
    breaks = np.concatenate([[0.0], ends[apart]])
    table = np.zeros((breaks.size - 1, 4, 3))
    middles = 0.5 * (breaks[1:] + breaks[:-1])
    for carriage, (t, j) in enumerate(phases):
        state = (0.0, 0.0, 0.0)
        phase_ends = np.cumsum(t)
        for k, middle in enumerate(middles):
            phase = int(np.searchsorted(phase_ends, middle))
            jerk = float(j[phase]) if phase < j.size else 0.0
            h = float(breaks[k + 1] - breaks[k])
            table[k, :, carriage] = *state, jerk
            state = advance_state(state, jerk, h)
    return breaks, table / _FACTORIALS[:, None]
