from __future__ import annotations

import subprocess
import sys
import tomllib
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import duoglide as dg
from duoglide.machine import toml_text

POST = dg.Box(name='a "post" = [\n1,\n]', low=(0, 0, 0), high=(10, 10, 10))
MACHINE = dg.Machine(
    keep_out=(POST, POST),
    home_position=(-41, 0, 302),
    limits=dg.CarriageLimits(jerk=(1e6, 2e6, 3e6)),
)


def test_a_commented_file_is_read_back_exactly(tmp_path: Path) -> None:
    MACHINE.save(tmp_path / "cell.toml")
    assert dg.Machine.load(tmp_path / "cell.toml").to_dict() == MACHINE.to_dict()


def test_every_key_is_explained_once_and_fits_the_page(tmp_path: Path) -> None:
    MACHINE.save(tmp_path / "cell.toml")
    lines = (tmp_path / "cell.toml").read_text().splitlines()
    assert max(map(len, lines)) <= toml_text.WIDTH
    explained: set[str] = set()
    for before, line in pairwise(lines):
        key, equals, _ = line.partition(" = ")
        if equals and not line.startswith("#") and ("  # " in line or before.startswith("# ")):
            explained.add(key)
    tables = MACHINE.to_dict()
    keys = {key for key, value in tables.items() if not isinstance(value, dict | list)}
    for name in ("geometry", "limits", "drives", "masses"):
        keys |= {key for key in tables[name] if key not in ("homing", "quirks")}
    assert keys <= explained
    assert "leg_length = 160.0  # l2, the legs B1C1 and B2C2 [mm]" in lines
    assert (
        "jerk = [1000000.0, 2000000.0, 3000000.0]  # the largest jerk; inf: no limit [mm/s^3]"
        in lines
    )


def test_what_a_machine_leaves_out_is_told_and_what_it_gives_is_not(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    dg.Machine.default().save(file)
    text = " ".join(line.removeprefix("# ") for line in file.read_text().splitlines())
    assert "Not given here, home_position: platform position at which" in text
    assert "left out, the deepest point of the workspace" in text
    assert "[stop_limits] with velocity, acceleration, jerk, force, rms_force: what a st" in text
    assert dg.Machine.load(file).to_dict() == dg.Machine.default().to_dict()
    limits = dg.CarriageLimits(acceleration=1e5, jerk=1e7)
    whole = dg.Machine(stop_limits=limits, home_position=(-41, 0, 302), timing=dg.Timing.TOPPRA)
    whole = replace(whole, masses=whole.masses.complete(whole.geometry))
    whole.save(file)
    assert "Not given here" not in file.read_text()


def test_the_file_is_the_same_where_python_drops_docstrings(tmp_path: Path) -> None:
    MACHINE.save(tmp_path / "cell.toml")
    code = (
        "import sys, duoglide as dg; assert dg.Machine.load.__doc__ is None, 'not -OO';"
        "dg.Machine.load(sys.argv[1]).save(sys.argv[2])"
    )
    files = [str(tmp_path / "cell.toml"), str(tmp_path / "again.toml")]
    subprocess.run([sys.executable, "-OO", "-c", code, *files], check=True)
    assert (tmp_path / "again.toml").read_text() == (tmp_path / "cell.toml").read_text()


def test_long_arrays_and_nested_ones_stay_as_they_are() -> None:
    tables = {"short": [1, 2], "long": list(range(100, 140)), "nested": [[1, 2], [3]], "none": []}
    text = toml_text.commented(tables, {})
    assert tomllib.loads(text) == tables
    assert "short = [1, 2]" in text
