"""The machine's day from a shell: reset, home, jog, park; and after a failure, which comes next."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.cli.main import run
from duoglide.cli.next_verb import next_command
from duoglide.drives.cia402 import State
from duoglide.drives.simulation import faults
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.kinematics.home import home_carriages

HOME = np.array([-41.0, 0.0, 302.0])
MACHINE = dg.Machine.default()


@pytest.fixture
def served() -> Iterator[SimulatedDrives]:
    carriages = home_carriages(MACHINE).tolist()
    with SimulatedDrives(MACHINE.drives, carriages, bus="virtual") as drives:
        yield drives


def answer(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> dict[str, Any]:
    capsys.readouterr()
    assert run([*words, "--json"]) == code
    said: dict[str, Any] = json.loads(capsys.readouterr().out)
    return said


def test_a_day_of_the_machine(served: SimulatedDrives, capsys: pytest.CaptureFixture[str]) -> None:
    bus = ["--bus", served.address]
    homed = answer(capsys, "home", *bus)
    assert homed["homed"] and np.allclose(homed["position"], HOME, atol=0.01)
    assert set(homed) == {"duoglide", "verb", "ok", "bus", "homed", "carriages", "position"}
    moved = answer(capsys, "jog", "-1,2,0", *bus)
    assert moved["completed"]
    assert np.allclose(moved["position"], HOME + np.array([-1.0, 2.0, 0.0]), atol=0.02)
    served.inject(faults.DeviceFault(2))
    failed = answer(capsys, "jog", "0,1,0", *bus, code=1)
    assert failed["type"] == "DriveFault"
    assert failed["next"] == f"duoglide reset --bus {served.address}"
    served.inject(faults.Clear(2))
    reset = answer(capsys, *failed["next"].split()[1:])
    assert reset["states"] == ["switch on disabled"] * 3
    assert reset["homed"] and np.allclose(reset["position"], moved["position"], atol=0.02)
    parked = answer(capsys, "park", *bus)
    assert np.allclose(parked["position"], HOME, atol=0.02)
    assert {drive.state for drive in served.snapshot()} == {State.SWITCH_ON_DISABLED}


def test_a_jog_at_a_velocity_goes_that_way_and_ends(
    served: SimulatedDrives, capsys: pytest.CaptureFixture[str]
) -> None:
    """How far depends on how busy the computer is: a step that is late is waited for."""
    bus = ["--bus", served.address]
    answer(capsys, "home", *bus)
    moved = answer(capsys, "jog", "--velocity", "0,20,0", "--seconds", "1", *bus)
    way = np.array(moved["position"]) - HOME
    assert 0.1 < way[1] < 25.0 and np.abs(way[[0, 2]]).max() < 0.05
    assert {drive.state for drive in served.snapshot()} == {State.SWITCH_ON_DISABLED}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["jog", "0,x,0"], "'x' is no number"),
        (["jog", "0,1"], "must be x,y,z"),
        (["jog", "--overide", "5", "0,1,0"], "unexpected extra argument"),
        (["home", "--again"], "add --home-here"),
    ],
)
def test_misuse_is_said_before_anything_is_opened(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(words) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "moved", "verb"),
    [
        (dg.NotHomedError("x"), False, "home --home-here"),
        (dg.DriveFault("x", axis=1), False, "reset"),
        (dg.FollowingError("x", axis=1), True, "reset"),
        (dg.DriveError("x", code=0x5441), False, "reset"),
        (dg.DriveError("a stop is latched; reset_fault() acknowledges it"), False, "reset"),
        (dg.DriveError("x"), True, "park"),
        (dg.BusError("x"), True, "doctor"),
        (dg.DriveError("x"), False, None),
        (dg.PathError("x"), False, None),
    ],
)
def test_after_a_failure_the_verb_that_comes_next_is_named(
    error: dg.DuoglideError, moved: bool, verb: str | None
) -> None:
    words = ["stream", "p.mcap", "--bus=socketcan:can0", "--machine", "my cell.toml"]
    facts = {"cycles": 5} if moved else {}
    wanted = f"duoglide {verb} --bus socketcan:can0 --machine 'my cell.toml'"
    assert next_command(error, facts, words) == (verb and wanted)
    assert next_command(error, facts, ["stream", "p.mcap"]) is None  # the drives have ended with it
