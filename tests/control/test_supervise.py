from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from duoglide.control.channel.events import Condition, Reaction, Trip
from duoglide.control.channel.orders import Policy, TrailRule
from duoglide.control.streamer.supervise import DueSetpoints, Observation, Watch, assess
from duoglide.control.streamer.tracks import AxisTrack, AxisView
from duoglide.drives import pdo
from duoglide.drives.cia402 import State
from duoglide.drives.pdo import NmtState

POLICY = Policy(heartbeat=100, host=500, silence=40)
WELL = AxisView(state=State.OPERATION_ENABLED, statusword=0x1237, allowed=1000.0)


def observation(axis: AxisView | None = None, **values: object) -> Observation:
    axes = (replace(WELL), axis or replace(WELL), replace(WELL))
    seen = Observation(axes=axes, enabled=True, moving=True)
    for name, value in values.items():
        setattr(seen, name, value)
    return seen


def test_nothing_follows_when_all_is_well() -> None:
    assert list(assess(observation(), POLICY)) == []


@pytest.mark.parametrize(
    ("changes", "condition", "reaction"),
    [
        ({"emergency": 0x4210}, Condition.EMERGENCY, Reaction.STOP_ON_PATH),
        ({"emergency": 0x8100}, Condition.EMERGENCY, Reaction.QUICK_STOP),  # not heard: it stops
        ({"emergency": 0x8250}, Condition.EMERGENCY, Reaction.QUICK_STOP),
        ({"state": State.FAULT}, Condition.FAULT, Reaction.QUICK_STOP),
        ({"state": State.FAULT_REACTION_ACTIVE}, Condition.FAULT, Reaction.QUICK_STOP),
        ({"state": None}, Condition.UNDEFINED, Reaction.QUICK_STOP),
        ({"state": State.SWITCHED_ON}, Condition.NOT_ENABLED, Reaction.QUICK_STOP),
        ({"statusword": 0x3237}, Condition.FOLLOWING_ERROR, Reaction.STOP_ON_PATH),
        ({"following": 1001}, Condition.FOLLOWING_ERROR, Reaction.STOP_ON_PATH),
        ({"away": True}, Condition.LOST, Reaction.STOP_ON_PATH),
        ({"away": True, "far": True}, Condition.LOST, Reaction.QUICK_STOP),
        ({"stays": True}, Condition.LASTING, Reaction.STOP_ON_PATH),
        ({"statusword": 0x0237}, Condition.NOT_FOLLOWING, Reaction.QUICK_STOP),
        ({"limited": 3}, Condition.LIMIT, Reaction.STOP_ON_PATH),
        ({"missing": 3, "alone": 3}, Condition.SILENT, Reaction.STOP_ON_PATH),
        ({"missing": 40}, Condition.SILENT, Reaction.STOP_ON_PATH),
        ({"heartbeat": 100}, Condition.HEARTBEAT, Reaction.STOP_ON_PATH),
        ({"nmt": NmtState.PRE_OPERATIONAL}, Condition.NMT, Reaction.QUICK_STOP),
        ({"booted": True}, Condition.BOOT_UP, Reaction.QUICK_STOP),
    ],
)
def test_each_row_of_the_table_names_the_axis_and_its_reaction(
    changes: dict[str, object], condition: Condition, reaction: Reaction
) -> None:
    trips = list(assess(observation(replace(WELL, **changes)), POLICY))
    assert [(trip.condition, trip.axis, trip.reaction) for trip in trips] == [
        (condition, 2, reaction)
    ]


@pytest.mark.parametrize(
    ("changes", "condition", "reaction"),
    [
        ({"host_gone": True}, Condition.HOST_GONE, Reaction.STOP_AND_DISABLE),
        ({"pressed": True}, Condition.PRESSED, Reaction.QUICK_STOP),
        ({"bus_failed": True}, Condition.BUS, Reaction.QUICK_STOP),
        ({"foreign": True}, Condition.FOREIGN, Reaction.QUICK_STOP),
        ({"refused": 3}, Condition.REFUSED, Reaction.QUICK_STOP),
        ({"astray": 1}, Condition.ASTRAY, Reaction.STOP_ON_PATH),
        ({"unled": 2}, Condition.UNLED, Reaction.QUICK_STOP),
        ({"unsent": 3}, Condition.UNSENT, Reaction.STOP_ON_PATH),
        ({"late": 3}, Condition.LATE, Reaction.STOP_ON_PATH),
        ({"host": 500}, Condition.HOST_SILENT, Reaction.STOP_AND_DISABLE),
    ],
)
def test_what_concerns_all_of_them_has_its_row_too(
    changes: dict[str, object], condition: Condition, reaction: Reaction
) -> None:
    (trip,) = assess(observation(**changes), POLICY)
    assert (trip.condition, trip.reaction) == (condition, reaction)


@pytest.mark.parametrize("changes", [{"following": 1001}, {"away": True}, {"stays": True}], ids=str)
def test_a_carriage_that_is_not_where_it_stands_gets_a_quick_stop(
    changes: dict[str, object],
) -> None:
    """No path is left to stop on, and its drive would pull, or creep away, under power."""
    (trip,) = assess(observation(replace(WELL, **changes), moving=False), POLICY)
    assert trip.reaction is Reaction.QUICK_STOP


@pytest.mark.parametrize(
    "changes", [{"missing": 39, "alone": 2}, {"heartbeat": 99}, {"following": 1000}], ids=str
)
def test_what_is_within_its_bounds_is_bridged(changes: dict[str, int]) -> None:
    assert list(assess(observation(replace(WELL, **changes)), POLICY)) == []


def test_every_condition_has_a_row() -> None:
    """What this file provokes is everything that there is."""
    marks = [
        *test_each_row_of_the_table_names_the_axis_and_its_reaction.pytestmark,
        *test_what_concerns_all_of_them_has_its_row_too.pytestmark,
    ]
    assert {row[1] for mark in marks for row in mark.args[1]} == set(Condition)


def test_a_drive_that_is_off_may_be_in_any_state() -> None:
    axis = AxisView(state=State.FAULT, missing=1000, heartbeat=1000, nmt=NmtState.STOPPED)
    assert list(assess(observation(axis, enabled=False, moving=False), POLICY)) == []


@settings(max_examples=80, deadline=None, derandomize=True)
@given(
    st.lists(
        st.tuples(st.sampled_from([None, *State]), st.integers(0, 0xFFFF), st.integers(0, 5)),
        min_size=1,
        max_size=8,
    )
)
def test_a_reaction_never_gets_weaker_and_each_thing_is_told_once(
    cycles: list[tuple[State | None, int, int]],
) -> None:
    watch = Watch(POLICY)
    before, told = Reaction.NONE, []
    for state, code, missing in cycles:
        watch.seen = observation(
            AxisView(state=state, statusword=0x1237, emergency=code, missing=missing)
        )
        told += [(trip.condition, trip.axis, trip.code) for trip in watch.find_new_trips()]
        assert watch.reaction >= before
        before = watch.reaction
    assert len(told) == len(set(told))
    watch.forget()
    assert watch.reaction is Reaction.NONE


@pytest.mark.parametrize("tells", [True, False])
def test_a_drive_without_the_bit_that_says_it_follows_is_not_asked_for_it(tells: bool) -> None:
    """Also not in a cycle without its answer, as on a busy computer: seen as a quick stop."""
    watch = Watch(POLICY, [TrailRule(tells=tells)] * 3)
    tracks = tuple(AxisTrack() for _ in range(3))
    due = DueSetpoints([(0, 0, 0)] * 3, math.inf, 0)
    watch.seen.moving = True
    for answers in (True, True, True, True, False, True):
        for track in tracks:
            track.on_heartbeat(bytes([NmtState.OPERATIONAL]))
            if answers:
                track.on_feedback(pdo.FEEDBACK.pack(0x0637, 0))
            track.end_of_cycle(1)
        watch.see_axes(tracks, due)
        seen = {trip.condition for trip in assess(watch.seen, POLICY)}
        assert seen == ({Condition.NOT_FOLLOWING} if tells else set())


def test_a_trip_says_axis_condition_and_code_in_words() -> None:
    trip = Trip(Condition.EMERGENCY, Reaction.STOP_ON_PATH, 2, 0x2310)
    assert trip.words == "axis 2: emergency message 0x2310: continuous over-current"
