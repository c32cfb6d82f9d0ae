"""What a drive's lag is, learned by the command line and used by the next run."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from math import pi
from pathlib import Path

import pytest

import duoglide as dg
from duoglide.cli.main import run
from duoglide.control.host.commission import plan_lag_motion
from duoglide.drives.simulation.plant import PlantParameters
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.kinematics.home import home_carriages

FEED_FORWARD = 0.9, 0.95, 1.0
DEFAULT = dg.Machine.default()
MACHINE = replace(  # a busy computer must not be what stops these runs
    DEFAULT,
    drives=replace(
        DEFAULT.drives,
        sdo_timeout=5.0,
        setpoint_timeout=0.25,
        heartbeat_timeout=1.0,
        late_cycles=120,
        following_error_window=30.0,
    ),
)
LAGS = [2.0 * 0.9 * (1.0 - k) / (2.0 * pi * 80.0) for k in FEED_FORWARD]  # 2 zeta (1 - k) / omega


def test_lags_are_learned_and_explain_what_the_drives_do_next(
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    cell = tmp_path / "cell.toml"
    MACHINE.save(cell)
    start = home_carriages(MACHINE).tolist()
    plants = [PlantParameters(velocity_feedforward=k) for k in FEED_FORWARD]
    with SimulatedDrives(MACHINE.drives, start, plants=plants) as drives:
        bus = drives.address
        options = ["--machine", str(cell), "--home-here", "--override", "50"]
        assert run(["drives", "commission", "--bus", bus, *options]) == 0
        learned = tomllib.loads(capfd.readouterr().out)["drives"]
        assert learned["lag"] == pytest.approx(LAGS, abs=4e-5)
        assert all(0.0 < lag < 1.1 / (2.0 * pi * 80.0) ** 2 for lag in learned["acceleration_lag"])
        told = replace(MACHINE, drives=replace(MACHINE.drives, **learned))
        with dg.Robot.connect(told, bus=bus) as robot:
            robot.enable()
            robot.home(confirm=True)
            report = robot.run(plan_lag_motion(told), override=0.4)
    assert all(abs(drive.later) < 0.03 for drive in report.drives), report.drives
    assert not report.remarks
