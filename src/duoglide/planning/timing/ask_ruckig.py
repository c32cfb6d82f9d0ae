"""Ask ruckig for a motion along a line, in units in which the line is 1 long and takes about 1."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import ruckig
from numpy.typing import NDArray

from duoglide.arrays import FloatArray
from duoglide.motion.profile import SIGMA, TIME, Profile

_LOOKS = 401
_SHORT = 1e-4  # of the duration; knots nearer together than that are one


class Start(NamedTuple):
    """Sigma and two derivatives [mm, mm/s, mm/s^2]."""

    sigma: float
    speed: float = 0.0
    rate: float = 0.0


class End(NamedTuple):
    """Sigma and its derivative [mm, mm/s]; the second derivative is 0."""

    sigma: float
    speed: float = 0.0


def ask_ruckig(start: Start, end: End, bounds: tuple[float, float, float]) -> Profile | None:
    """Return the quickest motion from one state to another that never stands or goes back.

    Args:
        start: Where it begins.
        end: Where it ends, further on.
        bounds: Of the three derivatives of sigma [mm/s, mm/s^2, mm/s^3].

    Returns:
        The motion; None: ruckig finds none, or one that stands or goes back on its way.
    """
    length = end.sigma - start.sigma
    second = length / bounds[0]
    question = ruckig.InputParameter(1)
    question.current_position, question.target_position = [0.0], [1.0]
    question.current_velocity = [start.speed * second / length]
    question.current_acceleration = [start.rate * second**2 / length]
    question.target_velocity = [end.speed * second / length]
    names = "max_velocity", "max_acceleration", "max_jerk"
    for order, (name, bound) in enumerate(zip(names, bounds, strict=True), start=1):
        setattr(question, name, [bound * second**order / length])
    answer = ruckig.Trajectory(1)
    try:
        result = ruckig.Ruckig(1).calculate(question, answer)
    except ruckig.RuckigError:
        return None
    (profile,) = answer.profiles[0]
    if result not in (ruckig.Result.Working, ruckig.Result.Finished) or any(profile.brake.t):
        return None
    clock = np.concatenate([[0.0], np.cumsum(profile.t)])
    states = np.column_stack([clock, profile.p, profile.v, profile.a])
    knots = states * (second, length, length / second, length / second**2)
    knots[:, SIGMA] += start.sigma
    knots[0, SIGMA:], knots[-1, SIGMA:] = start, (*end, 0.0)
    knots = knots[_apart(knots[:, TIME])]
    if np.any(np.diff(knots[:, SIGMA]) <= 0.0):
        return None
    found = Profile(knots)
    looks = found.at(np.linspace(0.0, found.duration, _LOOKS)[1:-1])
    return found if bool(np.all(looks[:, 1] > 0.0)) else None


def _apart(times: FloatArray) -> NDArray[np.bool_]:
    """Tell which knots are far enough from their neighbours; both ends always are.

    Between the states that remain, a phase that short changes the polynomial next to nothing.
    """
    least = _SHORT * times[-1]
    kept = np.zeros(times.size, dtype=np.bool_)
    last = -np.inf
    for k, at in enumerate(times.tolist()):
        kept[k] = at - last > least and times[-1] - at > least
        last = at if kept[k] else last
    kept[0] = kept[-1] = True
    return kept
