"""What probing prints is a machine file that connects, and the drives keep what they had."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import duoglide as dg
from duoglide.cli.main import run
from duoglide.drives.axis.axis import Axis
from duoglide.drives.onboarding.probe import Probed, probe
from duoglide.drives.simulation import faults
from duoglide.drives.simulation.simulated import SimulatedDrives

EDS = Path(__file__).parents[2] / "firmware_interface" / "linear_axis.eds"
FOREIGN = Path(__file__).parents[3] / "shared" / "tools" / "foreign-drives"
TRIED = [(0x6007, 0), (0x605A, 0), (0x6065, 0), (0x6066, 0), (0x6085, 0), (0x607D, 1), (0x1400, 5)]


def probed(axis: Axis) -> Probed:
    return probe(axis, (-360.0, 360.0), 4000.0)


def test_a_drive_of_the_contract_has_no_gap_and_keeps_its_settings(axis: Axis) -> None:
    before = [axis.read(*key) for key in TRIED]
    found = probed(axis)
    assert not found.refusals and not found.costs
    assert "absent" not in found.quirks
    assert found.homing_method == 37
    assert [axis.read(*key) for key in TRIED] == before


def test_a_drive_that_takes_csp_without_saying_so_is_to_be_trusted_on_purpose(
    drives: SimulatedDrives, axis: Axis
) -> None:
    drives.inject(faults.Override(1, 0x6502, 0, 0x21))
    found = probed(axis)
    assert found.quirks["trust_csp"] is True and not found.refusals
    assert any("trust_csp = true is right only where the manual" in why for why in found.unsafe)


def test_a_drive_under_power_is_not_probed(enabled: list[Axis]) -> None:
    with pytest.raises(dg.DriveError, match="is under power"):
        probed(enabled[0])


def without(tmp_path: Path, *headings: str) -> Path:
    """Write the contract's dictionary without some objects."""
    sections = re.split(r"(?m)^(?=\[)", EDS.read_text("ascii"))
    gone = tuple(f"[{heading}" for heading in headings)
    file = tmp_path / "maker.eds"
    file.write_text("".join(s for s in sections if not s.startswith(gone)), "ascii")
    return file


def test_a_dictionary_alone_gives_the_same_tables(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = without(tmp_path, "603F", "6085", "1400sub5")
    assert run(["drives", "probe", "--eds", str(file)]) == 0
    text = capsys.readouterr().out
    machine = dg.Machine.from_dict(tomllib.loads(text))  # one table stands for all three
    for quirks in machine.drives.quirks:
        assert set(quirks.absent) == {0x603F, 0x6085}
        assert not quirks.setpoint_timer
    assert "brake-safe plans rely on it" in text


def test_what_is_no_dictionary_is_one_clear_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bad.eds").write_bytes(b"\xff\x00[[[")
    for name in ("bad.eds", "none.eds"):
        assert run(["drives", "probe", "--eds", str(tmp_path / name)]) == 1
        assert name in capsys.readouterr().err


UNITS = """[[drives.quirks]]
velocity_unit = 0.5
acceleration_unit = 0.5"""


@pytest.fixture
def mixed() -> Iterator[str]:
    if not FOREIGN.is_dir():
        pytest.skip(f"no imitations of makers' drives here: {FOREIGN} is missing")
    command = [sys.executable, str(FOREIGN / "run.py"), "mixed", "--port", "29816"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as served:
        assert served.stdout is not None
        yield served.stdout.readline().split()[1]
        served.terminate()


def test_what_is_printed_of_three_makes_connects(
    mixed: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["drives", "probe", "--bus", mixed]) == 0
    file = tmp_path / "cell.toml"
    text = capsys.readouterr().out
    assert "drives.quirks velocity_unit" in text  # the first counts rpm, of a motor not known here
    file.write_text(text.replace("[[drives.quirks]]", UNITS, 1), "utf-8")
    machine = dg.Machine.load(file)
    assert machine.drives.profile == ("maxon-epos4", "elmo-gold", "trinamic-tmcm")
    with dg.Robot.connect(machine, bus=mixed) as robot:
        assert len(robot.states) == 3
