"""A drive that brakes by itself leads the others along the path, where the plan allows it."""

from __future__ import annotations

from collections.abc import Callable
from struct import Struct

import numpy as np
import pytest
from cell_by_hand import CellByHand, Frame
from drive_stops import closes
from led_runs import FIVE_LINES, LedRuns, by_themselves, fail, given_up

import duoglide as dg
from duoglide.control.channel.events import Condition, Happening
from duoglide.control.streamer.braking_drive import BrakingDrive, Trailing
from duoglide.drives import pdo
from duoglide.drives.cia402 import State
from duoglide.drives.simulation.faults import Jam

WORDS = Struct("<Hi")
AXES = (1, 2, 3)


@pytest.fixture(scope="module")
def runs() -> LedRuns:
    """Return the runs of an ordinary path of five lines at full speed."""
    machine = dg.Machine.default()
    return LedRuns.of(dg.plan(machine, dg.Path.polyline(FIVE_LINES, tolerance=5.0)))


def fastest(runs: LedRuns, axis: int) -> int:
    """Return the cycle, of those that are promised, in which a carriage is the fastest."""
    cycle = runs.plan.machine.drives.cycle
    cycles = np.array(runs.promised(axis))
    return int(cycles[np.argmax(np.abs(runs.plan.at(cycles * cycle).velocity[:, axis - 1]))])


def states(cell: CellByHand) -> list[State]:
    return [drive.state for drive in cell.rack.snapshot()]


@pytest.mark.parametrize("axis", [1, 3])
def test_the_platform_stays_within_a_millimetre_where_that_is_promised(
    runs: LedRuns, axis: int
) -> None:
    cell = runs.until(fastest(runs, axis))
    fail(cell, axis)
    assert runs.off_path(cell) < 1.0
    assert not by_themselves(cell) and not given_up(cell)
    assert (Condition.FAULT, axis) in cell.tripped()
    assert [i for i, state in enumerate(states(cell), 1) if state is State.FAULT] == [axis]


def test_elsewhere_the_others_may_follow_too_though_less_is_promised(runs: LedRuns) -> None:
    cell = runs.until(runs.allowed(2)[len(runs.allowed(2)) // 2])
    fail(cell, 2)
    assert runs.off_path(cell) < 3.5
    assert not by_themselves(cell)


def test_without_it_the_platform_leaves_its_path_by_more(runs: LedRuns) -> None:
    cell = LedRuns(runs.plan, None).until(fastest(runs, 1))
    fail(cell, 1)
    assert runs.off_path(cell) > 2.0
    assert by_themselves(cell)


def test_a_drive_that_stops_by_its_own_interlock_leads_too(runs: LedRuns) -> None:
    """It sends no emergency message: its state tells, one cycle later."""
    cell = runs.until(fastest(runs, 3))
    cell.rack.nodes[2].axis._quick_stop()
    assert runs.off_path(cell) < 1.5
    assert not by_themselves(cell)
    assert (Condition.NOT_ENABLED, 3) in cell.tripped()


def test_a_message_of_a_drive_that_goes_on_stops_all_three_on_the_path(runs: LedRuns) -> None:
    cell = runs.until(fastest(runs, 1))
    cell.strange.append((pdo.EMCY + 1, pdo.pack_emergency(0x4210, 8)))
    assert runs.off_path(cell) < 0.3
    assert not by_themselves(cell)
    assert states(cell) == [State.OPERATION_ENABLED] * 3


def test_what_is_latched_stays_latched_and_nothing_moves_again(runs: LedRuns) -> None:
    cell = runs.until(fastest(runs, 1))
    fail(cell, 1)
    runs.off_path(cell)
    before = cell.carriages
    assert states(cell)[1:] == [State.QUICK_STOP_ACTIVE] * 2
    cell.run(runs.plan)
    cell.cycles(50)
    assert cell.happened(Happening.REFUSED)
    assert np.abs(cell.carriages - before).max() < 0.01


def test_the_others_are_asked_for_no_more_than_twice_the_stop_limits(runs: LedRuns) -> None:
    cell = runs.until(runs.allowed(3)[len(runs.allowed(3)) // 2])
    fail(cell, 3)
    since = len(cell.log)
    runs.off_path(cell)
    sent = np.array([entry.setpoint for entry in cell.log[since - 3 :]]) / 1000.0
    asked = np.abs(np.diff(sent, 2, axis=0))[:, :2] / runs.plan.machine.drives.cycle**2
    assert asked.max() < 1.1 * 2.0 * 90e3
    assert asked.max() > 90e3  # they catch up harder than a stop on the path does


Spoil = Callable[[Frame], list[Frame]]


def feedback(axis: int, change: Callable[[int, int], tuple[int, int]]) -> Spoil:
    """Change what a drive says: statusword and position."""

    def spoil(frame: Frame) -> list[Frame]:
        if frame[0] != pdo.TPDO1 + axis:
            return [frame]
        return [(frame[0], WORDS.pack(*change(*WORDS.unpack(frame[1]))))]

    return spoil


def silence(cell: CellByHand) -> None:
    cell.to_host = lambda frame: [] if frame[0] == pdo.TPDO1 + 1 else [frame]


def jump(cell: CellByHand) -> None:
    cell.to_host = feedback(1, lambda word, place: (word, place + 5000))


def freeze(cell: CellByHand) -> None:
    place = cell.log[-1].actual[0]
    cell.to_host = feedback(1, lambda word, _: (word, place))


def lose_torque(cell: CellByHand) -> None:
    cell.rack.nodes[0].axis.set_sto(True)


def fail_too(cell: CellByHand) -> None:
    fail(cell, 3)


def reboot(cell: CellByHand) -> None:
    cell.strange.append((pdo.HEARTBEAT + 1, b"\0"))


@pytest.mark.parametrize("what", [silence, jump, freeze, fail_too, reboot])
def test_what_is_not_a_drive_that_brakes_is_not_followed(
    runs: LedRuns, what: Callable[[CellByHand], None]
) -> None:
    """All brake by themselves then, at once and latched; the plan has proved that to be safe."""
    cell = runs.until(fastest(runs, 1))
    fail(cell, 1)
    off = runs.off_path(cell, each=lambda number: what(cell) if number == 4 else None)
    assert off < np.inf
    assert by_themselves(cell)
    assert (Condition.UNLED, 1) in cell.tripped() or what is reboot
    stopped = cell.happened(Happening.STOPPED)[0].cycle
    assert stopped - (cell.number - 90) < 10


def test_a_drive_that_loses_its_torque_is_not_followed(runs: LedRuns) -> None:
    cell = runs.until(fastest(runs, 1))
    lose_torque(cell)
    assert runs.off_path(cell) < np.inf
    assert by_themselves(cell)


def test_one_lost_feedback_of_the_drive_is_predicted(runs: LedRuns) -> None:
    cell = runs.until(fastest(runs, 1))
    fail(cell, 1)

    def lose_one(number: int) -> None:
        drop = number == 4
        cell.to_host = lambda frame: [] if drop and frame[0] == pdo.TPDO1 + 1 else [frame]

    assert runs.off_path(cell, each=lose_one) < 1.2
    assert not by_themselves(cell)


def test_at_a_tenth_of_the_speed_the_others_follow_too(runs: LedRuns) -> None:
    cell = runs.until(10 * fastest(runs, 1), override=0.1)
    fail(cell, 1)
    assert runs.off_path(cell) < 1.0
    assert not by_themselves(cell)


@pytest.mark.parametrize("began", [0.05, 0.5, 0.95])
@pytest.mark.parametrize("harder", [0.95, 1.0, 1.05])
def test_a_drive_that_brakes_is_told_to_a_quarter_of_a_millimetre_after_some_cycles(
    began: float, harder: float
) -> None:
    """Whenever in its cycle it began, and however far its deceleration is off."""
    v, d = 8.0, 0.24
    drive = BrakingDrive(v, v, d, Trailing(0.0, 0.0))
    for cycles in range(12):
        t = 1.0 + cycles - began
        drive.see(v * (began + t) - 0.5 * harder * d * t * t)
        drive.pass_cycle()
    t = 13.0 - began + 3.0
    place, velocity = drive.after(3)
    assert place == pytest.approx(v * (began + t) - 0.5 * harder * d * t * t, abs=0.25)
    assert velocity == pytest.approx(v - harder * d * t, abs=0.12)


def lose_setpoints(cell: CellByHand, axis: int) -> None:
    cell.to_drives = lambda frame: [] if frame[0] == pdo.RPDO1 + axis else [frame]


@pytest.mark.parametrize(("axis", "cycle"), [(1, 12), (2, 102), (3, 93)])
def test_a_drive_that_hears_no_setpoints_any_more_is_followed_before_it_says_so(
    runs: LedRuns, axis: int, cycle: int
) -> None:
    """At the worst places of this path, where it speeds up; not followed it is 40 to 60 mm."""
    cell = runs.until(cycle)
    lose_setpoints(cell, axis)
    since = len(cell.log)
    assert runs.off_path(cell) < 16.0
    assert not by_themselves(cell) and not given_up(cell)
    assert cell.tripped()[0] == (Condition.LOST, axis)
    words = [entry.controlword[axis - 1] for entry in cell.log[since:]]
    assert 2 in words, "it is told to brake on, should it hear again"
    deaf = LedRuns(runs.plan, None).until(cycle)
    lose_setpoints(deaf, axis)
    assert runs.off_path(deaf) > 35.0


def test_a_drive_that_hears_again_brakes_on(runs: LedRuns) -> None:
    cell = runs.until(93)
    lose_setpoints(cell, 3)

    def hear(number: int) -> None:
        if number == 8:
            cell.to_drives = lambda frame: [frame]

    assert runs.off_path(cell, each=hear) < 12.0
    assert not by_themselves(cell)
    assert states(cell)[2] is State.QUICK_STOP_ACTIVE
    before = cell.carriages
    cell.cycles(50)
    assert np.abs(cell.carriages - before).max() < 0.01


def test_where_it_goes_on_beyond_the_place_where_its_plan_turns_it_round(runs: LedRuns) -> None:
    """No path time is there; the others go as near as they can, and never on along the path."""
    cell = runs.until(201)
    lose_setpoints(cell, 3)
    assert runs.off_path(cell) < 5.0
    assert not by_themselves(cell)


@pytest.mark.parametrize(("axis", "cycle"), [(1, 16), (3, 107)])
def test_a_carriage_that_jams_leads_too_and_the_others_stop_as_soon_as_they_can(
    runs: LedRuns, axis: int, cycle: int
) -> None:
    off = []
    for stops in (runs.stops, None):
        cell = LedRuns(runs.plan, stops).until(cycle)
        Jam(axis).apply(cell.rack.nodes[axis - 1])
        off.append(runs.off_path(cell))
        assert cell.happened(Happening.STOPPED)
    assert off[0] < 0.75 * off[1] < np.inf


@pytest.mark.parametrize("coast", [0.0, 1.0, 1.5])
@pytest.mark.parametrize("speeding_up", [-0.2, 0.0, 0.24])
def test_a_drive_that_has_left_its_setpoints_is_told_from_others(
    coast: float, speeding_up: float
) -> None:
    d, heard = 0.24, 8
    k = np.arange(13.0)
    due = 100.0 + 5.0 * k + 0.5 * speeding_up * k**2
    v = due[heard] - due[heard - 1]
    t = np.clip(k - heard - coast, 0.0, v / d)
    braking = due[heard] + v * (np.minimum(k - heard, coast) + t) - 0.5 * d * t**2
    trailing = Trailing(0.0, 0.0)
    chance = np.random.default_rng(1).normal(0.0, 0.05, 13)
    places = np.where(k <= heard, due, braking)
    drive = BrakingDrive.recognise(list(due), list(places + chance), d, trailing)
    assert drive is not None
    assert drive.place == pytest.approx(places[-1], abs=0.4)
    assert drive.velocity == pytest.approx(v - d * t[-1], abs=0.4)
    held = BrakingDrive.recognise(list(due), list(np.minimum(due, due[heard])), d, trailing)
    assert held is not None and held.stands
    assert held.place == pytest.approx(due[heard], abs=0.6)
    for other in (
        due + np.where(k > heard, 10.0, 0.0),  # it leaps
        due + np.where(k > heard, 1.5 * d * (k - heard) ** 2, 0.0),  # it runs away
    ):
        assert BrakingDrive.recognise(list(due), list(other), d, trailing) is None


@pytest.mark.parametrize("seed", [3, 4])
def test_random_faults_on_random_paths_part_no_links(seed: int) -> None:
    """Anywhere, also where a second drive fails meanwhile; more in benchmarks/led_stops.py."""
    rng, machine = np.random.default_rng(seed), dg.Machine.default()
    points = rng.uniform([-60.0, -120.0, 290.0], [60.0, 120.0, 320.0], (4, 3))
    runs = LedRuns.of(dg.plan(machine, dg.Path.polyline(points, tolerance=5.0)))
    assert runs.stops is not None
    for number in range(4):
        first, second = rng.permutation(AXES)[:2].tolist()
        cell = runs.until(int(rng.integers(2, len(runs.stops.promised) - 4)))
        fail(cell, first)
        places: list[np.ndarray] = []
        later = int(rng.integers(1, 8)) if number % 2 else -1
        runs.off_path(cell, 60, fail_at(later, cell, second), places)
        assert closes(machine.geometry, np.array(places)).all()


def fail_at(later: int, cell: CellByHand, axis: int) -> Callable[[int], None]:
    return lambda number: fail(cell, axis) if number == later else None


@pytest.mark.parametrize(("by_message", "cycles"), [(True, 2), (False, 3)])
def test_the_others_react_within_the_reaction_cycles(
    runs: LedRuns, by_message: bool, cycles: int
) -> None:
    """From the SYNC after which a drive fails to the one at which the first other setpoint acts."""
    cycle = fastest(runs, 3)
    sent: list[list[int]] = []
    for fails in (False, True):
        cell = runs.until(cycle)
        before = len(cell.log)
        if fails and by_message:
            fail(cell, 3)
        elif fails:
            cell.rack.nodes[2].axis._quick_stop()
        cell.cycles(8)
        sent.append([entry.setpoint[0] for entry in cell.log[before - 1 :]])
    told = next(k for k, (a, b) in enumerate(zip(*sent, strict=True)) if a != b)
    # The second entry is of the cycle of the fault; what is sent after a SYNC acts at the next one.
    assert told == cycles <= runs.plan.machine.reaction_cycles
