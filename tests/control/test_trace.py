"""What is kept of the last seconds of a machine."""

from __future__ import annotations

import pytest

import duoglide as dg
from duoglide.control.channel.events import Happening, RunState
from duoglide.control.channel.ring import CycleEntry, EventEntry
from duoglide.control.channel.scale import Scales
from duoglide.control.host.trace import KEPT, ROW, Trace
from duoglide.storage.records import Phase

CYCLE_NS = 2_000_000


def cycle(number: int, following: int = 0, lateness: int = 0, moving: bool = True) -> CycleEntry:
    state = RunState.RUNNING if moving else RunState.NONE
    actual = (number, 2 * number, 3 * number)
    return CycleEntry(
        number, number * CYCLE_NS, lateness, 0, 0.0, 1.0, actual, actual,
        (following, 0, -following), (0, 0, 0), (0, 0, 0), int(Phase.PROGRAM), 0, int(state), 0, 1,
    )  # fmt: skip


def test_a_row_has_the_worst_of_its_cycles_and_the_newest_place() -> None:
    drives = dg.DriveSettings()
    trace = Trace(drives)
    for number, following, lateness in ((5, 3, 900), (6, -7, 100), (7, 2, 4000), (8, 0, 0)):
        trace.add_cycle(cycle(number, following, lateness))
    assert trace.rows(0) == []  # none is whole before the next one begins
    trace.add_cycle(cycle(10, moving=False))
    (row,) = trace.rows(0)
    mm = Scales.of(drives).mm
    assert row.following_error == pytest.approx(mm((-7, 0, 7)))
    assert row.carriages == pytest.approx(mm((8, 16, 24)))
    assert (row.lateness, row.moving) == (4.0, True)
    assert row.time == pytest.approx(8 * CYCLE_NS * 1e-9)
    assert trace.rows(row.number) == []


def test_memory_is_bounded_however_long_a_machine_is_watched() -> None:
    trace = Trace(dg.DriveSettings())
    for number in range(0, 60_000, 3):  # two minutes
        trace.add_cycle(cycle(number))
        trace.add_event(EventEntry(number, number * CYCLE_NS, Happening.FOREIGN, 0, 0, 0, 0.0))
    rows, events = trace.rows(0), trace.events(0)
    assert len(rows) == round(KEPT / ROW)
    assert rows[-1].time - rows[0].time == pytest.approx(KEPT, abs=0.1)
    assert len(events) == 500
    assert events[-1].number == 20_000
    assert trace.events(events[-3].number) == events[-2:]
