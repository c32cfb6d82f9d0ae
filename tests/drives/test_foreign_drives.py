"""From the box to the first move, on imitations of makers' drives: a table of drives by step.

``python -m pytest tests/drives/test_foreign_drives.py -m slow -s`` prints it, in a minute or so.
"""

from __future__ import annotations

import time
import tomllib
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_drives import ForeignDrives, foreign_drives

import duoglide as dg
from duoglide.control.host.commission import describe_drives, probe_drives
from duoglide.drives.onboarding.probe_text import tables
from duoglide.kinematics.home import home_carriages

STEPS = ("status", "probe", "bring-up", "homing", "stream", "stop", "fault", "reset", "off")
ALL = ("epos4", "gold", "tmcm", "gold_slow", "gold_coupled", "gold_level")
RPM = {"epos4": (1.0, 1.0, 1.0), "mixed": (1.0, 0.0, 0.0)}  # [mm/s], only a person knows it
PATIENT = {  # the imitations go by the wall clock of a busy computer
    "following_error_window": 30.0,
    "following_error_at_rest": 10.0,
    "lasting_error": 10.0,
    "missing_frames": 200,
    "late_cycles": 200,
    "heartbeat_timeout": 2.0,
}
OVERRIDE = 0.25


class Walk:
    """One make of drive, step by step.

    Attributes:
        cells: What came of each step, in words.
    """

    def __init__(self, name: str, drives: ForeignDrives, path: dg.Path) -> None:
        self.name, self.drives, self.path = name, drives, path
        self.cells: dict[str, str] = {}
        self.machine = dg.Machine.default()

    def go(self) -> dict[str, str]:
        """Take every step, until one fails."""
        steps = (self.ask_status, self.probe)
        for step, do in zip(STEPS, steps, strict=False):
            self._take(step, do)
        if self.failed:
            return self.cells
        motion = dg.plan(self.machine, self.path)
        self._take("bring-up", self.connect)
        if self.failed:
            return self.cells
        with self.robot:
            self._take("homing", self.home)
            self._take("stream", lambda: self.stream(motion))
            self._take("stop", lambda: self.stop(motion))
            self._take("fault", lambda: self.fault(motion))
            self._take("reset", self.reset)
            self._take("off", self.robot.disable)
        return self.cells

    @property
    def failed(self) -> bool:
        return any(cell.startswith("FAILED") for cell in self.cells.values())

    def _take(self, step: str, do: Callable[[], str | None]) -> None:
        if self.failed:
            return
        begin = time.monotonic()
        try:
            said = do() or "ok"
            self.cells[step] = f"{said}, {time.monotonic() - begin:.1f} s"
        except (dg.DuoglideError, AssertionError) as error:
            self.cells[step] = f"FAILED: {type(error).__name__}: {error}"

    def ask_status(self) -> str:
        """Ask with the machine file of another make: a refusal names all the keys at once."""
        try:
            with dg.Robot.connect(self.machine, bus=self.drives.bus):
                return "ok"
        except dg.DriveError as refusal:
            assert "drives.quirks" in str(refusal), refusal
            return f"{str(refusal).count('drives.quirks')} keys named"

    def probe(self) -> None:
        """Paste what probing prints; only what a motor's revolution moves is filled in by hand."""
        text = tables(self._probed(), self.machine.drives, self.name)
        table: dict[str, Any] = tomllib.loads(text)
        assert ("# velocity_unit =    # TO FILL IN" in text) is (self.name in RPM)
        for quirks, unit in zip(table["drives"]["quirks"], RPM.get(self.name, ()), strict=False):
            if unit:
                quirks["velocity_unit"] = unit
        table["drives"].update(PATIENT)
        self.machine = dg.Machine.from_dict(table)
        if self.name in RPM:  # what could not be tried before
            table = tomllib.loads(tables(self._probed(), self.machine.drives, self.name))
            table["drives"].update(PATIENT)
            assert table["drives"]["quirks"][0]["velocity_unit"] == 1.0
            self.machine = dg.Machine.from_dict(table)

    def _probed(self) -> Any:
        found = probe_drives(self.machine, self.drives.bus)
        assert not any(one.refusals for one in found), [one.refusals for one in found]
        return found

    def connect(self) -> None:
        self.robot = dg.Robot.connect(self.machine, bus=self.drives.bus)
        assert not self.robot.homed

    def home(self) -> None:
        self.robot.enable()
        with pytest.raises(dg.NotHomedError, match="confirm"):
            self.robot.home()
        before = self.drives.encoders()
        self.robot.home(confirm=True)
        assert self.drives.encoders() == before, "something moved while homing"
        assert np.abs(self.robot.carriages - home_carriages(self.machine)).max() < 0.01
        self.origin = np.array(before) / 1000.0 - self.robot.carriages

    def stream(self, motion: dg.Trajectory) -> None:
        """Stream three times: each ends where the plan does, seen by the encoders."""
        goal = motion.end
        for _ in range(3):
            assert self.robot.run(motion, approach=True, override=OVERRIDE).completed
            there = np.array(self.drives.encoders()) / 1000.0 - self.origin
            assert np.abs(there - goal).max() < 0.05, (there, goal)

    def stop(self, motion: dg.Trajectory) -> None:
        run = self.robot.start(motion, approach=True, override=OVERRIDE)
        time.sleep(0.3)
        run.stop()
        assert not run.wait(timeout=10.0).completed
        assert not self.robot.latched

    def fault(self, motion: dg.Trajectory) -> None:
        run = self.robot.start(motion, approach=True, override=OVERRIDE)
        time.sleep(0.5)
        self.drives.order("fault", 2, 0x7500)
        report = run.wait(timeout=10.0)
        assert any(fault.axis == 2 for fault in report.faults), report
        assert self.robot.latched
        assert max(abs(drive["vel"]) for drive in self.drives.state()) < 1.0

    def reset(self) -> None:
        """Reset, see that the place is still known, and back out."""
        self.robot.reset_fault()
        self.robot.enable()
        assert self.robot.homed, self.robot.why_not_homed
        self.robot.recover()
        assert self.robot.park().completed


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture(scope="module")
def pick() -> dg.Path:
    return dg.pick_and_place((-41, -60, 295), (-41, 60, 295))


def walk(name: str, port: int, folder: Path, path: dg.Path) -> dict[str, str]:
    with foreign_drives(name, port, folder) as drives:
        return Walk(name, drives, path).go()


def show(table: dict[str, dict[str, str]]) -> None:
    for name, cells in table.items():
        print(f"\n{name}")
        for step in STEPS:
            print(f"  {step:9} {cells.get(step, '-')}")


def require_all(table: dict[str, dict[str, str]]) -> None:
    show(table)
    bad = {
        (name, step): cells.get(step, "not reached")
        for name, cells in table.items()
        for step in STEPS
        if cells.get(step, "FAILED").startswith("FAILED")
    }
    assert not bad


@pytest.mark.slow
def test_three_makes_on_one_machine_come_up_move_fail_and_recover(
    tmp_path: Path, state: None, pick: dg.Path
) -> None:
    require_all({"mixed": walk("mixed", 29840, tmp_path, pick)})


def test_drives_without_csp_are_refused(tmp_path: Path) -> None:
    machine = dg.Machine.default()
    with foreign_drives("prl", 29844, tmp_path) as drives:
        for one in probe_drives(machine, drives.bus):
            assert any("does not take 8" in why for why in one.refusals)
        with pytest.raises(dg.DriveError, match="trust_csp"):
            describe_drives(machine, drives.bus)
        written = [f for f in drives.frames() if f.by_host and f.can_id & 0x780 == 0x200]
    assert not written  # no setpoint for a drive that is none of this machine


@pytest.mark.slow
def test_the_table_of_drives_by_step(tmp_path: Path, state: None, pick: dg.Path) -> None:
    with ThreadPoolExecutor(2) as pool, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of slow drives
        walks = {
            name: pool.submit(walk, name, 29850 + 2 * i, tmp_path, pick)
            for i, name in enumerate(ALL)
        }
        require_all({name: one.result() for name, one in walks.items()})
