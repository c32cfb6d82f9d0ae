"""Rows of the fault matrix by a clock that is a counter: what the bus does to frames.

The proxy's own spoilers, on a whole cell in one thread. The default run takes some rows by chance,
the slow one all; ``tests/benchmarks/fault_matrix.py`` prints them for processes and a real clock.
"""

from __future__ import annotations

import random
import sys
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("viser")
sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import fault_matrix
from bus_proxy import _Spoiling
from cell_by_hand import CellByHand

import duoglide as dg
from duoglide.control.channel.events import Happening
from duoglide.control.streamer.cycle import Streamer

FEW = 8
ROWS = {
    fault.name: fault
    for fault in fault_matrix.FAULTS[: sum(1 for _ in fault_matrix._bus())]
    if not fault.name.startswith(("1000 frames", "a message", "a frame", "10 kB", "connection"))
    and "error frame" not in fault.name  # what is no frame needs a socket
}
CHOSEN = random.Random(4).sample(sorted(ROWS), FEW)


@cache
def trajectory() -> dg.Trajectory:
    return dg.plan(fault_matrix.MACHINE, fault_matrix.PATH)


def react(fault: fault_matrix.Fault) -> tuple[str, CellByHand]:
    """Run the path of the matrix with a fault on the way; return the reaction."""
    plan, spoiling = trajectory(), _Spoiling()
    cell = CellByHand(fault_matrix.MACHINE, plan.at(0.0).carriages).enable()
    cell.to_drives = lambda frame: spoiling.pass_on("drives", frame)
    cell.to_host = lambda frame: spoiling.pass_on("host", frame)

    def send(way: str, *frames: tuple[int, bytes]) -> None:
        if way == "host":
            cell.strange += frames
            return
        for can_id, data in frames:
            cell.rack.receive(can_id, data, cell.number * 2000)

    cell.run(plan)
    cell.cycles(round(fault_matrix.WHEN * plan.duration / cell.machine.drives.cycle))
    spoil = lambda *spoilers: spoiling.begin(list(spoilers))  # noqa: E731
    scene: Any = SimpleNamespace(proxy=SimpleNamespace(spoil=spoil, send=send))
    fault.inject(scene)
    cell.to_the_end(2000)
    if cell.completed:
        return fault_matrix.COMPLETED, cell
    words = np.array([entry.controlword for entry in cell.log])
    quick = (words == fault_matrix.QUICK_STOP).any()
    return (fault_matrix.QUICK if quick else fault_matrix.STOPPED), cell


@pytest.mark.parametrize(
    "name", [n if n in CHOSEN else pytest.param(n, marks=pytest.mark.slow) for n in ROWS]
)
def test_a_fault_of_the_bus_ends_as_the_matrix_says(name: str) -> None:
    reaction, cell = react(ROWS[name])
    assert reaction in ROWS[name].expected
    silent = reaction == fault_matrix.COMPLETED and not name.startswith("5 setpoints")
    assert silent or cell.tripped() or cell.events_of_loss, "what happened has a name"


def test_a_streamer_that_watches_nothing_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Streamer, "_judge", lambda self: None)
    name = "emergency message of axis 1"
    reaction, cell = react(ROWS[name])
    assert reaction not in ROWS[name].expected
    assert not cell.happened(Happening.TRIP)
