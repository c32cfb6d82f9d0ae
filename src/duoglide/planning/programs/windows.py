"""One window of a program: planned to rest, and where the next window takes over from it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import LimitError
from duoglide.machine import Machine, Timing
from duoglide.motion.motion import Motion
from duoglide.motion.path.carriage import CarriagePath, map_to_carriages
from duoglide.motion.path.path import Path
from duoglide.motion.path.rounded import RoundedPath
from duoglide.motion.path.segments import COINCIDENT, Line, Point, as_point, distance
from duoglide.motion.profile import SIGMA, SPEED, TIME, Profile
from duoglide.motion.rounding.blend import Blend, Corner
from duoglide.planning.braking.make_safe import make_brake_safe
from duoglide.planning.check.check import check_path
from duoglide.planning.plan import plan
from duoglide.planning.stops.certificate import certify_stops, stop_bounds_until
from duoglide.planning.timing.lead import Lead
from duoglide.planning.timing.span import Effort
from duoglide.planning.timing.time_path import time_path, wished_timing
from duoglide.planning.timing.timed_curve import SigmaCap
from duoglide.planning.tolerances import NANOMETRE
from duoglide.planning.trajectory import Trajectory

STRAIGHT = 4.0  # mm that a straight piece has at least where a seam is
_APART = 1e-3  # mm; a seam that is nearer to a waypoint moves away from it
_SHARE = 0.3  # This share of a straight piece comes before the seam.


@dataclass(frozen=True, slots=True, eq=False)
class Seam:
    """Where one trajectory hands over to the next.

    Attributes:
        part: The trajectory up to there; its ``whole`` goes on to rest.
        segment: In which segment of the window's path that is.
        place: Where the tool's tip is there [mm].
        lead: How the next timing begins.
    """

    part: Trajectory
    segment: int
    place: Point
    lead: Lead


def plan_window(
    machine: Machine,
    path: Path,
    lead: Lead | None,
    brake_safe: bool,
    timing: Timing | None = None,
) -> Trajectory:
    """Plan a path to rest from the state in which the program has got there.

    Args:
        machine: The machine.
        path: With explicit blends, unless the program rests at both ends.
        lead: How it begins, and from where on it is only a way to rest; None: it is all there is,
            from rest to rest.
        brake_safe: See ``plan``.
        timing: See ``plan``.

    Raises:
        PathError: The machine cannot follow the path.
        LimitError: No motion was found that begins like ``lead``.
    """
    if lead is None:
        return plan(machine, path, brake_safe, timing=timing)
    carriages = map_to_carriages(check_path(machine, path))
    effort = Effort(timing=wished_timing(path, timing))
    motion = time_path(carriages, effort, lead=lead)
    if brake_safe:

        def retimed(sigma: FloatArray, speed: FloatArray) -> Motion:
            cap = lead.lift(SigmaCap(sigma, speed))
            return time_path(carriages, effort, sigma_cap=cap, lead=lead)

        motion = make_brake_safe(motion, retimed)
        if motion.profile.knots[0, SPEED] != lead.speed:
            raise LimitError(
                "the motion would have to be slower from its beginning to be brake-safe"
            )
    return Trajectory.of(motion, certify_stops(motion))


def cut_before_joint(path: Path, corner: Corner | None) -> tuple[Path, Path | None]:
    """Divide a path where a blend after it begins on its last line.

    There the motion can rest whatever the blend asks for; at the path's own end it would come too
    late for that.

    Returns:
        The path up to there, and what is left of it; None where nothing is.
    """
    line = path.segments[-1]
    if not (isinstance(corner, Blend) and isinstance(line, Line)):
        return path, None
    last = len(path.segments) - 1
    actions = tuple(entry for entry in path.actions if entry[0] <= last)
    others = tuple((1, action) for i, action in path.actions if i > last)
    share = 1.0 - corner.before / distance(line.start, line.end)
    end = np.add(line.start, share * np.subtract(line.end, line.start))
    place = as_point(end, "end")
    if distance(line.start, place) >= COINCIDENT:
        segments = (*path.segments[:-1], Line(line.start, place, line.speed))
        rest = replace(path, segments=(replace(line, start=place),), corners=(), actions=others)
        return replace(path, segments=segments, actions=actions), rest
    if last == 0:
        return path, None
    rest = replace(path, segments=(line,), corners=(), actions=others)
    return replace(
        path, segments=path.segments[:-1], corners=path.corners[:-1], actions=actions
    ), rest


def place_of_seam(rounded: RoundedPath, path: Path, low: float) -> float | None:
    """Return sigma of the first good place for a seam beyond ``low`` [mm]; None: there is none.

    On a straight line the speed and the acceleration along it are all that there is to hand over,
    whatever the blends beyond its ends become.
    """
    curve = rounded.curve
    straight = (curve.rates == 0.0) & (np.abs(curve.coefficients[:, 2:]).max(axis=(1, 2)) == 0.0)
    long = straight & (curve.breaks[:-1] >= low - NANOMETRE) & (curve.spans >= STRAIGHT - NANOMETRE)
    for piece in np.flatnonzero(long).tolist():
        sigma = float(curve.breaks[piece] + _SHARE * curve.spans[piece])
        sigma = _leave_waypoints(rounded.waypoints, sigma, float(curve.breaks[piece + 1]))
        if isinstance(path.segments[_find_segment(rounded.waypoints, sigma)], Line):
            return sigma
    return None


def _leave_waypoints(waypoints: FloatArray, sigma: float, end: float) -> float:
    """Move a seam off waypoints on a straight line, so that all there is clearly before or after.

    It goes half way to the next waypoint, or to the end of the line.
    """
    near = np.abs(waypoints - sigma) < _APART
    if not near.any():
        return sigma
    last = float(waypoints[near].max())
    after = waypoints[waypoints > last + _APART]
    following = float(after[0]) if after.size else end
    return 0.5 * (last + min(end, following))


def cut_at(trajectory: Trajectory, sigma: float) -> Seam | None:
    """Cut a window where its profile passes ``sigma`` [mm]; None: it has no knot there."""
    path, knots = trajectory.path, trajectory.profile.knots
    assert isinstance(path, CarriagePath)
    at = np.flatnonzero(knots[:, SIGMA] == sigma)
    if not at.size:
        return None
    knot = int(at[0])
    time = float(knots[knot, TIME])
    way = Profile(knots[knot:] - np.array([time, sigma, 0.0, 0.0]))
    part = trajectory.until(knot, stop_bounds_until(trajectory, time))
    machine, checked = path.machine, path.checked
    offset = np.subtract(machine.work_frame, machine.tool_offset)
    place = as_point(checked.curve.position(sigma) - offset, "seam")
    return Seam(part, _find_segment(np.array(checked.waypoints), sigma), place, Lead(way))


def take_rest(path: Path, segment: int, place: Point) -> Path:
    """Return a path from a place on one of its lines on."""
    line = path.segments[segment]
    return replace(
        path,
        segments=(Line(place, line.end, line.speed), *path.segments[segment + 1 :]),
        corners=path.corners[segment:],
        actions=tuple((i - segment, action) for i, action in path.actions if i > segment),
    )


def _find_segment(waypoints: FloatArray, sigma: float) -> int:
    """Return the index of the segment that holds sigma."""
    inside = int(np.searchsorted(waypoints, sigma, side="right")) - 1
    return min(max(inside, 0), waypoints.size - 2)
