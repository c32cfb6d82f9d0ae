"""A profile run at another pace: through given path times at given instants."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.motion.profile import ACCELERATION, TIME, Profile
from duoglide.motion.trajectory import Trajectory
from duoglide.planning.stops.certificate import stop_bounds

_PARTS = 4  # knots a cycle
_APART = 2e-5  # [s] at least between two knots


def slowed(trajectory: Trajectory, override: float) -> Trajectory:
    """Return a trajectory at a share of its speed, 0 to 1, as a trajectory of its own.

    Unlike an override of the stream it stays within slower limits whatever the operator does.
    """
    if override == 1.0:
        return trajectory
    times = tuple((t / override, action) for t, action in trajectory.actions)
    draft = replace(trajectory, profile=trajectory.profile.stretch(1.0 / override), actions=times)
    return replace(draft, stops=stop_bounds(draft))


def repaced_profile(plan: Profile, times: FloatArray, u: FloatArray, rate: FloatArray) -> Profile:
    """Return the profile that has the plan's path parameter at ``u`` at each of ``times``, exactly.

    In between, the path time is a smooth function of time, and the plan is followed at that path
    time: where the rate is 1 throughout, the profile is the plan's own.

    Args:
        plan: Whose curve it is.
        times: When, from 0 on, increasing [s], shape (n,).
        u: The path time reached then [s], shape (n,).
        rate: Path time per time then, shape (n,).
    """
    clock = np.column_stack([times, u, rate, np.zeros_like(u)])
    if len(clock) > 2:
        clock[1:-1, ACCELERATION] = _accelerations(clock)
    pace = Profile(clock)
    fine = _fine_times(plan, pace)
    at, speed, slope, _ = np.moveaxis(pace.at(fine), -1, 0)
    given = np.searchsorted(fine, times)
    at[given], speed[given] = u, rate
    sigma, way, bend, _ = np.moveaxis(plan.at(at), -1, 0)
    return Profile(
        np.column_stack(
            [fine, np.maximum.accumulate(sigma), way * speed, bend * speed**2 + way * slope]
        )
    )


def _fine_times(plan: Profile, pace: Profile) -> FloatArray:
    """Return the cycles' times, some in between, and where the plan begins another piece."""
    times = pace.knots[:, TIME]
    between = times[:-1, None] + np.diff(times)[:, None] * np.arange(1, _PARTS) / _PARTS
    inner = [pace.time_at(knot) for knot in plan.knots[1:-1, TIME].tolist()]
    wished = np.unique(np.concatenate([between.ravel(), inner]))
    near = np.searchsorted(times, wished).clip(1, len(times) - 1)
    apart = np.minimum(wished - times[near - 1], times[near] - wished) > _APART
    kept = wished[apart]
    kept = kept[np.concatenate([[True], np.diff(kept) > _APART])] if len(kept) else kept
    fine: FloatArray = np.sort(np.concatenate([times, kept]))
    return fine


def _accelerations(knots: FloatArray) -> FloatArray:
    """Solve for inner accelerations that make the third derivative continuous, shape (n - 2,)."""
    from scipy.linalg import solve_banded

    times, sigma, v, a = knots.T
    h, way = np.diff(times), np.diff(sigma)
    at_start = 60.0 * way / h**3 - (36.0 * v[:-1] + 24.0 * v[1:]) / h**2
    at_end = 60.0 * way / h**3 - (24.0 * v[:-1] + 36.0 * v[1:]) / h**2
    right = at_start[1:] - at_end[:-1]
    right[0] += 3.0 / h[0] * a[0]
    right[-1] += 3.0 / h[-1] * a[-1]
    band = np.zeros((3, len(right)))
    band[0, 1:] = -3.0 / h[1:-1]
    band[1] = 9.0 / h[:-1] + 9.0 / h[1:]
    band[2, :-1] = -3.0 / h[1:-1]
    inner: FloatArray = solve_banded((1, 1), band, right)
    return inner
