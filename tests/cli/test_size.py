"""``duoglide drives size`` says what the plan of the same cycle demands."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import duoglide as dg
from duoglide.cli.main import run

PICK = ["--pick", "-41,-20,300", "--place", "-41,20,300"]


def test_the_table_is_what_the_plan_of_the_cycle_demands(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    masses = dg.Masses(payload=0.1, strut=0.3)
    dg.Machine(masses=masses).save(tmp_path / "cell.toml")
    asked = ["drives", "size", *PICK, "--machine", str(tmp_path / "cell.toml"), "--payload", "0.4"]
    assert run([*asked, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    machine = dg.Machine(masses=dg.Masses(payload=0.4, strut=0.3))
    path = dg.pick_and_place((-41.0, -20.0, 300.0), (-41.0, 20.0, 300.0), 25.0, 2.0)
    demand = dg.plan(machine, path).demand()
    assert told["peak_force"] == pytest.approx(demand.peak_force.tolist(), rel=1e-9)
    assert told["rms_force"] == pytest.approx(demand.rms_force.tolist(), rel=1e-9)
    assert told["payload"] == 0.4
    assert told["assumed"] == ["leg", "coupler", "riser", "arm", "platform"]
    assert told["mean_power"] == pytest.approx(demand.energy.sum() / demand.duration)
    assert run(asked) == 0
    words = capsys.readouterr().out
    assert f"{demand.peak_force[1]:.1f}" in words
    assert "assumed masses" in words
    assert run(["drives", "size", *PICK, "--payload", "-1"]) == 2
