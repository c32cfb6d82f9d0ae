"""Two runs side by side: where their setpoints differ, and how each was followed.

Runs of one path need not have one pace: an override, a hold or a slower replay streams the same
setpoints at other times. So each run's setpoints are held against the other's path at the same
place on it; runs of different paths are compared at equal path time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from duoglide.arrays import AXES, FloatArray
from duoglide.control.channel.scale import Scales
from duoglide.errors import LogError
from duoglide.motion.profile import Profile
from duoglide.planning.trajectory import Trajectory
from duoglide.playback.rebuild import first_part, plans_of
from duoglide.playback.run_data import SETPOINT_DELAY, IntArray, RunData, read_run
from duoglide.playback.summary import Lateness, summarise_run
from duoglide.storage import Log

_SAME = 1e-9  # [mm] between two paths that are one
_PLACES = 200  # where two paths are looked at
_AT_ONCE = 100_000  # cycles: derivatives of an hour's would fill the memory
_STEADY = 10  # cycles that a pace must last to be told
_DIGITS = 4  # of a pace
_FINE = 100_001  # places at which a profile is turned round
_AT_REST = 1e-3  # of its greatest speed: where a profile is slower, no pace can be told


@dataclass(frozen=True, slots=True, eq=False)
class Streamed:
    """A run and what it was to be.

    Attributes:
        plan: The trajectory of its log, or of a part of a program.
        data: Its cycles.
        part: Which part of a program; 0 of any other run.
    """

    plan: Trajectory
    data: RunData
    part: int = 0

    @classmethod
    def parts_of(cls, log: Log) -> dict[int, Streamed]:
        """Read a run, and the parts of a program one by one.

        Raises:
            LogError: Not a run, or it does not hold its plan or its machine.
        """
        data = read_run(log)
        passed = set(data.part[data.on_plan].tolist()) or {first_part(log)}
        plans = plans_of(log)
        return {part: cls(plans[part].whole or plans[part], data, part) for part in sorted(passed)}

    def rows(self) -> IntArray:
        """Return the cycles on the plan.

        Raises:
            LogError: There are none.
        """
        rows: IntArray = np.flatnonzero(self.data.on_plan & (self.data.part == self.part))
        if len(rows) == 0:
            raise LogError("a run without a cycle on its plan cannot be compared")
        return rows

    def numbers(self, rows: IntArray) -> IntArray:
        """Return the numbers of some cycles, counted from the first of them."""
        numbers: IntArray = self.data.cycle[rows] - self.data.cycle[rows[0]]
        return numbers

    def places(self, rows: IntArray) -> FloatArray:
        """Return where on the path some cycles were [path parameter]."""
        places: FloatArray = self.plan.profile.at(self.data.path_time[rows])[..., 0]
        return places


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSide:
    """One of two runs.

    Attributes:
        cycles: How many it has on its plan.
        planned: Duration of its plan [s].
        duration: From its first cycle on the plan to the last [s].
        path_time: How far along its plan it came [s].
        paces: Speeds along the path that lasted for ten cycles or more, in their order, as shares
            of the quicker plan's speed at the same place; 0 is a hold. Where there are two paths,
            each run's is a share of its own plan's.
        following_error: Worst of each carriage, over the whole run [mm].
        lateness: How late its cycles began.
    """

    cycles: int
    planned: float
    duration: float
    path_time: float
    paces: tuple[float, ...]
    following_error: tuple[float, ...]
    lateness: Lateness


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """How two runs differ.

    Attributes:
        runs: The two by themselves.
        same_path: Whether their carriages go along the same curve.
        setpoint: Worst difference of setpoints per carriage [increments]: at equal places of the
            path; where there are two paths, at equal path time.
        first: The first cycle on the plan of either whose setpoint differs, counted from 0; -1
            for none.
        actual: Worst difference of actual positions per carriage there [mm], where both answered.
        common: Cycles on the plan that both have, by their number.
        by_cycle: Worst difference of setpoints between those, per carriage [increments].
    """

    runs: tuple[RunSide, RunSide]
    same_path: bool
    setpoint: tuple[int, ...]
    first: int
    actual: tuple[float, ...]
    common: int
    by_cycle: tuple[int, ...]

    @property
    def same_setpoints(self) -> bool:
        """Whether every setpoint of each run is that of the other's path, bit for bit."""
        return not any(self.setpoint)

    @property
    def same_pace(self) -> bool:
        """Whether each cycle that both have has the same setpoint, bit for bit."""
        return not any(self.by_cycle)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "same_setpoints": self.same_setpoints,
            "same_pace": self.same_pace,
            **asdict(self),
            "cycles": [run.cycles for run in self.runs],
        }


def compare(one: Log, other: Log) -> Comparison:
    """Compare two runs: their setpoints, their pace, and what the carriages made of them.

    Raises:
        LogError: One is no run, holds no plan, or has no cycle on its plan.
    """
    ones, others = Streamed.parts_of(one), Streamed.parts_of(other)
    common = sorted(set(ones) & set(others))
    if not common:
        raise LogError(f"{one.path} and {other.path} have no part of a program in common")
    pairs = [(ones[part], others[part]) for part in common]
    return _put_together([compare_streamed(*pair) for pair in pairs], pairs)


def compare_streamed(one: Streamed, other: Streamed) -> Comparison:
    """Do what ``compare`` does, for runs that have been read."""
    a, b = one.rows(), other.rows()
    same_path = _same_path(one.plan, other.plan)
    back = _setpoint_difference(one, a, other.plan, same_path)
    there = _setpoint_difference(other, b, one.plan, same_path)
    numbers, its_numbers = one.numbers(a), other.numbers(b)
    common, in_one, in_other = np.intersect1d(numbers, its_numbers, return_indices=True)
    apart = np.abs(one.data.setpoint[a[in_one]] - other.data.setpoint[b[in_other]])
    differing = [*numbers[back.any(axis=1)], *its_numbers[there.any(axis=1)]]
    quicker = min(one.plan.profile, other.plan.profile, key=lambda profile: profile.duration)
    references = (quicker, quicker) if same_path else (one.plan.profile, other.plan.profile)
    return Comparison(
        runs=(_side(one, a, references[0]), _side(other, b, references[1])),
        same_path=same_path,
        setpoint=tuple(np.maximum(there.max(axis=0), back.max(axis=0)).tolist()),
        first=int(min(differing, default=-1)),
        actual=_actual_difference(one, a, other, b, same_path),
        common=len(common),
        by_cycle=tuple(apart.max(axis=0).tolist()),
    )


def _put_together(found: list[Comparison], pairs: list[tuple[Streamed, Streamed]]) -> Comparison:
    """Return the comparison of all parts of two programs from those of each of them."""
    if len(found) == 1:
        return found[0]
    begun = pairs[0][0].rows()[0]
    firsts = [
        comparison.first + int(one.data.cycle[one.rows()[0]] - one.data.cycle[begun])
        for comparison, (one, _) in zip(found, pairs, strict=True)
        if comparison.first >= 0
    ]
    setpoint, actual, by_cycle = (
        np.max([getattr(comparison, name) for comparison in found], axis=0).tolist()
        for name in ("setpoint", "actual", "by_cycle")
    )
    ones, others = zip(*(comparison.runs for comparison in found), strict=True)
    return Comparison(
        runs=(_put_sides_together(ones), _put_sides_together(others)),
        same_path=all(comparison.same_path for comparison in found),
        setpoint=tuple(setpoint),
        first=min(firsts, default=-1),
        actual=tuple(actual),
        common=sum(comparison.common for comparison in found),
        by_cycle=tuple(by_cycle),
    )


def _put_sides_together(sides: Sequence[RunSide]) -> RunSide:
    """Return one side of all parts; errors and lateness are those of the whole run anyway."""
    paces = (pace for side in sides for pace in side.paces)
    return replace(
        sides[0],
        cycles=sum(side.cycles for side in sides),
        planned=sum(side.planned for side in sides),
        duration=sum(side.duration for side in sides),
        path_time=sum(side.path_time for side in sides),
        paces=tuple(
            pace for pace, before in zip(paces, [None, *paces], strict=False) if pace != before
        ),
    )


def _side(run: Streamed, rows: IntArray, reference: Profile) -> RunSide:
    data, summary = run.data, summarise_run(run.data)
    return RunSide(
        cycles=len(rows),
        planned=run.plan.duration,
        duration=float(data.time[rows[-1]] - data.time[rows[0]]),
        path_time=float(data.path_time[rows].max()),
        paces=_paces(_pace(run, rows, reference)),
        following_error=summary.following_error,
        lateness=summary.lateness,
    )


def _pace(run: Streamed, rows: IntArray, reference: Profile) -> FloatArray:
    """Return the speed along the path as a share of a profile's at the same place, shape (n,).

    A plan that was slowed down, or made of a run that was, has its own pace within its profile: a
    rate of 1 says nothing about it. NaN where the profile is at rest.
    """
    data, own = run.data, run.plan.profile
    if own == reference:
        return data.rate[rows]
    sigma, way = np.moveaxis(own.at(data.path_time[rows])[..., :2], -1, 0)
    fine = np.linspace(0.0, reference.duration, _FINE)
    at = reference.at(fine)
    due = reference.at(np.interp(sigma, at[:, 0], fine))[..., 1]
    pace = np.full(len(rows), np.nan)
    moves = due > _AT_REST * at[:, 1].max()
    pace[moves] = data.rate[rows][moves] * way[moves] / due[moves]
    return pace


def _paces(pace: FloatArray) -> tuple[float, ...]:
    """Return the paces that lasted, in their order."""
    rounded = np.round(pace[np.isfinite(pace)], _DIGITS)
    if len(rounded) == 0:
        return ()
    ends = np.append(np.flatnonzero(np.diff(rounded)), len(rounded) - 1)
    lasted = np.diff(ends, prepend=-1) >= _STEADY
    return tuple(rounded[ends[lasted]].tolist())


def _same_path(one: Trajectory, other: Trajectory) -> bool:
    """Whether the carriages go along one curve, as far as both plans go."""
    places = np.linspace(0.0, min(one.profile.end, other.profile.end), _PLACES)
    apart = one.path.derivatives(places)[..., 0, :] - other.path.derivatives(places)[..., 0, :]
    return bool(np.abs(apart).max() < _SAME)


def _setpoint_difference(run: Streamed, rows: IntArray, plan: Trajectory, same: bool) -> IntArray:
    """Return how far the setpoints of a run are from another plan [increments], shape (n, 3)."""
    scales = Scales.of(run.data.machine.drives)
    differences = []
    for some in np.array_split(rows, len(rows) // _AT_ONCE + 1):
        if same:
            carriages = plan.path.derivatives(run.places(some))[..., 0, :]
        else:
            carriages = plan.at(run.data.path_time[some]).carriages
        differences.append(np.abs(scales.increments(carriages) - run.data.setpoint[some]))
    return np.concatenate(differences)


def _actual_difference(
    one: Streamed, a: IntArray, other: Streamed, b: IntArray, same: bool
) -> tuple[float, ...]:
    """Return the worst difference of each carriage where both runs have its answer [mm]."""
    (x, mine), (y, theirs) = _tracked(one, a, same), _tracked(other, b, same)
    inside = (x >= y[0]) & (x <= y[-1])
    worst = []
    for axis in range(AXES):
        apart = np.abs(mine[inside, axis] - np.interp(x[inside], y, theirs[:, axis]))
        worst.append(float(np.nanmax(apart, initial=0.0)))
    return tuple(worst)


def _tracked(run: Streamed, rows: IntArray, same: bool) -> tuple[FloatArray, FloatArray]:
    """Return where each setpoint was, and the carriages when they should have reached it [mm].

    On the same path the setpoint is taken off: both runs have it there. NaN where the drive did not
    answer. A setpoint that is repeated in a hold counts once.
    """
    data = run.data
    row = np.searchsorted(data.cycle, data.cycle[rows] + SETPOINT_DELAY)
    answered = np.minimum(row, len(data) - 1)
    carriages = data.following_error[answered]
    carriages[data.cycle[answered] != data.cycle[rows] + SETPOINT_DELAY] = np.nan
    way = run.places(rows)
    if not same:
        way, carriages = data.path_time[rows], carriages + data.setpoint_mm[rows]
    fresh = np.diff(way, prepend=-np.inf) > 0.0
    return way[fresh], carriages[fresh]
