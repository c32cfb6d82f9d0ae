"""Time a curve: one near-optimal motion between every two rests, dwells in between."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from duoglide.motion.motion import Motion
from duoglide.motion.path.actions import Dwell
from duoglide.motion.path.carriage import CarriagePath
from duoglide.motion.profile import Profile
from duoglide.motion.timing_report import TimingMethod, TimingReport
from duoglide.planning.timing.lead import Lead, lower_limits
from duoglide.planning.timing.moving import time_moving
from duoglide.planning.timing.span import Effort, Span, time_span
from duoglide.planning.timing.timed_curve import SigmaCap, TimedCurve

Progress = Callable[[float], None]  # told the share that is done, 0 to 1


def time_path(
    path: CarriagePath,
    effort: Effort | None = None,
    progress: Progress | None = None,
    sigma_cap: SigmaCap | None = None,
    lead: Lead | None = None,
) -> Motion:
    """Find the quickest motion along a curve that keeps every limit of the carriages.

    Args:
        path: The curve of the carriages.
        effort: How finely to look; default: within about 1 % of the optimum.
        progress: Called with the share of the curve that is timed.
        sigma_cap: A cap on the speed along the curve.
        lead: How the motion begins, in a program that goes on beyond it.

    Raises:
        LimitError: No motion was found that begins like ``lead``.
    """
    effort = effort or Effort()
    timed = TimedCurve.of(path)
    if lead is not None:
        timed = lower_limits(timed, lead.ahead)
    if sigma_cap is not None:
        timed = timed.limit_speed(sigma_cap)
    rests = [0.0, *path.curve.rests, path.curve.end]
    dwells = {
        rest: [a.seconds for s, a in path.checked.actions if s == rest and isinstance(a, Dwell)]
        for rest in rests
    }
    parts = [Profile.rest(0.0, seconds) for seconds in dwells[0.0]]
    flagged: list[Span] = []
    for start, rest in pairwise(rests):
        if start == 0.0 and lead is not None and lead.way is not None:
            span = time_moving(timed, lead, rest, effort)
        else:
            span = time_span(timed, start, rest, effort)
        parts.append(span.profile)
        parts += [Profile.rest(rest, seconds) for seconds in dwells[rest]]
        flagged += [span] if span.reason else []
        if progress is not None:
            progress(rest / path.curve.end)
    return Motion(path, Profile.join(parts), report=_report(flagged))


def _report(flagged: list[Span]) -> TimingReport:
    """Say how the spans were timed that are not near the optimum."""
    if not flagged:
        return TimingReport()
    slow = any(span.method is TimingMethod.CERTIFIED_SLOW for span in flagged)
    return TimingReport(
        method=TimingMethod.CERTIFIED_SLOW if slow else TimingMethod.IN_PART,
        reason="; ".join(dict.fromkeys(span.reason for span in flagged)),
    )
