from __future__ import annotations

import numpy as np
import pytest

import duoglide as dg
from duoglide.control.channel.events import Condition, Happening, Reaction, Refusal, Trip
from duoglide.control.channel.orders import Command
from duoglide.control.channel.ring import CycleEntry, EventEntry
from duoglide.control.host.run.happenings import describe_event
from duoglide.control.host.run.report import Lateness, RunReport, Tally, require_success
from duoglide.storage.records import EventKind

NONE = ((0.0,) * 3,) * 3


def cycle(number: int, following: int, missing: int = 0) -> CycleEntry:
    return CycleEntry(
        number, number * 2_000_000, 50_000 * number, 0, 0.002 * number, 1.0,
        (0, 0, 0), (0, 0, 0), (following, -following, 0), (15, 15, 15), (0, 0, 0),
        2, missing, 1, 2, 1,
    )  # fmt: skip


@pytest.fixture
def tally() -> Tally:
    tally = Tally(number=1, limit_use=NONE)
    for entry in (cycle(1, 100), cycle(2, -300, missing=5), cycle(3, 200)):
        tally.add_cycle(entry)
    return tally


def report(tally: Tally) -> RunReport:
    return tally.report(dg.Machine.default().drives, 0, None)


def test_a_report_counts_what_was_streamed(tally: Tally) -> None:
    found = report(tally)
    assert (found.cycles, found.lost, found.following_error) == (3, 2, (0.3, 0.3, 0.0))
    assert found.duration == pytest.approx(0.004)
    assert found.path_time == pytest.approx(0.006)
    assert found.lateness.worst == pytest.approx(150.0)
    assert "3 cycles" in repr(found) and "mm" in repr(found)
    assert found.to_dict()["following_error"] == [0.3, 0.3, 0.0]


def test_a_report_shows_itself_with_units_in_a_notebook(tally: Tally) -> None:
    tally.faults.append(Trip(Condition.FAULT, Reaction.QUICK_STOP, 2))
    found = report(tally)
    page = found._repr_html_()
    assert "data:image/png;base64," in page and "http" not in page
    assert "0.300 mm" in page and "150 µs" in page and "axis 2" in page
    error, late = found.plot().axes
    assert np.array(error.lines[0].get_ydata()) == pytest.approx([100.0, 300.0, 200.0])
    assert np.array(late.lines[0].get_ydata()) == pytest.approx([50.0, 100.0, 150.0])
    nothing = report(Tally(number=1, limit_use=NONE))
    assert "<img" not in nothing._repr_html_()
    assert len(nothing.plot().axes) == 2


def test_lateness_of_nothing_is_nothing() -> None:
    assert Lateness.of({}).worst == 0.0


@pytest.mark.parametrize(
    ("condition", "code", "error"),
    [
        (Condition.FAULT, 0, dg.DriveFault),
        (Condition.EMERGENCY, 0x8611, dg.FollowingError),
        (Condition.FOLLOWING_ERROR, 0, dg.FollowingError),
        (Condition.SILENT, 0, dg.DriveTimeout),
        (Condition.BUS, 0, dg.BusError),
        (Condition.LATE, 0, dg.DriveError),
    ],
)
def test_what_stopped_a_run_is_raised_by_its_own_name(
    tally: Tally, condition: Condition, code: int, error: type[Exception]
) -> None:
    tally.faults.append(Trip(condition, Reaction.QUICK_STOP, 2, code))
    with pytest.raises(error, match="axis 2"):
        require_success(report(tally))


def test_an_operators_stop_is_no_error(tally: Tally) -> None:
    tally.faults.append(Trip(Condition.PRESSED, Reaction.QUICK_STOP))
    require_success(report(tally))


@pytest.mark.parametrize("kind", list(Happening))
def test_everything_that_can_happen_has_words(kind: Happening) -> None:
    detail = {Happening.ORDER: Command.STOP, Happening.REFUSED: Command.RUN}.get(kind, 2)
    event = EventEntry(1, 2, kind, 3, detail, Refusal.BUSY, 1.0)
    record = describe_event(event)
    assert isinstance(record.kind, EventKind) and record.text
