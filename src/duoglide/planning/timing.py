"""Time a curve: one near-optimal motion between every two rests, dwells in between."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from duoglide.motion.actions import Action, Dwell
from duoglide.motion.carriage_path import CarriagePath
from duoglide.motion.profile import Profile
from duoglide.motion.stopping import StopBounds
from duoglide.motion.timing_report import TimingMethod, TimingReport
from duoglide.motion.trajectory import Trajectory
from duoglide.planning.stopping import stop_bounds
from duoglide.planning.timed_curve import SigmaCap, TimedCurve
from duoglide.planning.timing_lead import Lead, lowered
from duoglide.planning.timing_moving import time_moving
from duoglide.planning.timing_span import Effort, Span, time_span

Progress = Callable[[float], None]  # told the share that is done, 0 to 1


def time_path(
    path: CarriagePath,
    effort: Effort | None = None,
    progress: Progress | None = None,
    sigma_cap: SigmaCap | None = None,
    lead: Lead | None = None,
) -> Trajectory:
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
        timed = lowered(timed, lead.ahead)
    if sigma_cap is not None:
        timed = timed.capped(sigma_cap)
    rests = [0.0, *path.curve.rests, path.curve.end]
    parts: list[Profile] = []
    flagged: list[Span] = []
    actions: list[tuple[float, Action]] = []
    waiting = list(path.checked.actions)
    clock = 0.0
    for k, rest in enumerate(rests):
        if k > 0:
            if k == 1 and lead is not None and lead.way is not None:
                span = time_moving(timed, lead, rest, effort)
            else:
                span = time_span(timed, rests[k - 1], rest, effort)
            passed = [entry for entry in waiting if entry[0] < rest]
            actions += [(clock + span.profile.time_at(s), action) for s, action in passed]
            waiting = waiting[len(passed) :]
            parts.append(span.profile)
            flagged += [span] if span.reason else []
            clock += span.profile.duration
        while waiting and waiting[0][0] <= rest:
            action = waiting.pop(0)[1]
            actions.append((clock, action))
            if isinstance(action, Dwell):
                parts.append(Profile.rest(rest, action.seconds))
                clock += action.seconds
        if progress is not None:
            progress(rest / path.curve.end)
    profile = Profile.joined(parts)
    return _finished(path, profile, tuple(actions), flagged)


def _finished(
    path: CarriagePath,
    profile: Profile,
    actions: tuple[tuple[float, Action], ...],
    flagged: list[Span],
) -> Trajectory:
    report = TimingReport()
    if flagged:
        slow = any(span.method is TimingMethod.CERTIFIED_SLOW for span in flagged)
        report = TimingReport(
            method=TimingMethod.CERTIFIED_SLOW if slow else TimingMethod.IN_PART,
            reason="; ".join(dict.fromkeys(span.reason for span in flagged)),
        )
    draft = Trajectory(
        path, profile, StopBounds.constant(profile.duration, 1.0, 1.0), actions, report
    )
    return replace(draft, stops=stop_bounds(draft))
