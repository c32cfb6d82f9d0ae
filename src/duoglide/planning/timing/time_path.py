"""Time a curve: one motion between every two rests by the method asked for, dwells in between."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from duoglide.machine import Machine, Timing
from duoglide.motion.motion import Motion
from duoglide.motion.path.actions import Dwell
from duoglide.motion.path.carriage import CarriagePath
from duoglide.motion.path.path import Path, as_timing
from duoglide.motion.profile import Profile
from duoglide.motion.timing_report import TimingMethod, TimingReport
from duoglide.planning.force_limits import keep_rms, require_hold
from duoglide.planning.timing.lead import Lead, lower_limits
from duoglide.planning.timing.moving import time_moving
from duoglide.planning.timing.span import Effort, Span, time_span
from duoglide.planning.timing.timed_curve import SigmaCap, TimedCurve
from duoglide.planning.timing.worst_case import time_span_ruckig

Progress = Callable[[float], None]  # told the share that is done, 0 to 1


def time_path(
    path: CarriagePath,
    effort: Effort | None = None,
    progress: Progress | None = None,
    sigma_cap: SigmaCap | None = None,
    lead: Lead | None = None,
) -> Motion:
    """Find a quick motion along a curve that keeps every limit of the carriages.

    Args:
        path: The curve of the carriages.
        effort: How to look for it; default: within about 1 % of the optimum.
        progress: Called with the share of the curve that is timed.
        sigma_cap: A cap on the speed along the curve.
        lead: How the motion begins, in a program that goes on beyond it.

    Raises:
        LimitError: No motion was found, or none that begins like ``lead``.
        PathError: There is a pose that cannot be held within the force limits.
    """
    effort = effort or Effort()
    require_hold(path)
    timed = TimedCurve.of(path)
    if lead is not None:
        timed = lower_limits(timed, lead.ahead)
    if sigma_cap is not None:
        timed = timed.limit_speed(sigma_cap)
    motion = _time_curve(path, timed, effort, progress, lead)
    if lead is not None:  # it is part of a longer one
        return motion

    def retime(share: float) -> Motion:
        return _time_curve(path, timed.at_share(share), effort, None, None)

    return keep_rms(motion, retime)


def _time_curve(
    path: CarriagePath,
    timed: TimedCurve,
    effort: Effort,
    progress: Progress | None,
    lead: Lead | None,
) -> Motion:
    """Time a curve from rest to rest, with its dwells."""
    rests = [0.0, *path.curve.rests, path.curve.end]
    dwells = {
        rest: [a.seconds for s, a in path.checked.actions if s == rest and isinstance(a, Dwell)]
        for rest in rests
    }
    parts = [Profile.rest(0.0, seconds) for seconds in dwells[0.0]]
    method = choose_timing(path.machine, effort.timing)
    spans: list[Span] = []
    for start, rest in pairwise(rests):
        first = lead if start == 0.0 and lead is not None and lead.way is not None else None
        span = _time_span(method, timed, (start, rest), effort, first)
        parts.append(span.profile)
        parts += [Profile.rest(rest, seconds) for seconds in dwells[rest]]
        spans.append(span)
        if progress is not None:
            progress(rest / path.curve.end)
    return Motion(path, Profile.join(parts), report=_report(spans))


def wished_timing(path: Path, timing: Timing | str | None) -> Timing | None:
    """Return the method that an argument names, or that a path asks for; None: neither does.

    Raises:
        InputError: There is no such method.
    """
    if timing is None:
        return path.timing
    return as_timing(timing)


def choose_timing(machine: Machine, timing: Timing | None = None) -> Timing:
    """Return the method asked for, else the machine's, else toppra if no carriage has a jerk limit.

    With a jerk limit it is near-optimal.
    """
    wished = timing or machine.timing
    free = bool(np.isinf(machine.limits.jerk).all())
    return wished or (Timing.TOPPRA if free else Timing.NEAR_OPTIMAL)


def _time_span(
    method: Timing, timed: TimedCurve, ends: tuple[float, float], effort: Effort, lead: Lead | None
) -> Span:
    """Time a curve from a rest, or from the state of a lead, to the next rest.

    Raises:
        LimitError: None was found.
    """
    start, rest = ends
    if method is Timing.RUCKIG:
        return time_span_ruckig(timed, start, rest, lead)
    if method is Timing.TOPPRA:
        from duoglide.planning.timing import topp_ra  # toppra takes a second to import

        if np.isinf(timed.machine.limits.jerk).all():
            return topp_ra.time_span_topp_ra(timed, start, rest, lead)
        if lead is None:
            return topp_ra.time_from_topp_ra(timed, start, rest, effort)
    if lead is not None:
        return time_moving(timed, lead, rest, effort)
    return time_span(timed, start, rest, effort)


def _report(spans: list[Span]) -> TimingReport:
    """Say how the spans were timed, and why some are not as was asked for."""
    flagged = [span for span in spans if span.reason]
    if not flagged:
        return TimingReport(method=spans[0].method)
    slow = any(span.method is TimingMethod.CERTIFIED_SLOW for span in flagged)
    return TimingReport(
        method=TimingMethod.CERTIFIED_SLOW if slow else TimingMethod.IN_PART,
        reason="; ".join(dict.fromkeys(span.reason for span in flagged)),
    )
