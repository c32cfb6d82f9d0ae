"""Whatever a program or a machine file holds, it is read, or a DuoglideError says why not.

The long run with its figures: ``python tests/benchmarks/fuzz_readers.py``.
"""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Callable

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.path.rounded import round_corners
from duoglide.planning.programs import read as programs
from duoglide.planning.programs.read import read_program

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from mutate import Outcome, Target, fuzz

COUNT = 150
GCODE = (
    b"%\nN10 G21 G90 (x)\nG0 X0 Y0 Z300\nG1 Y10 F600 ; y\nG2 X10 Y0 I5 J-5\nG3 X20 R8 Z301\n"
    b"G4 P0.5\nM64 P16\nG91 G1 X1\nG64 P0.2\nM66 P1 L3 Q2\nG61\nG80\nG1 G18 X2\nG2 K3\nM30\n%\n",
    b"; sliced\nM104 S200\nM117 Hello\nG92 E0\nG0 X0 Y0 Z300\nG1 X1 E2 F60\nG64\nT1 M6\nG3 I-5 Z1\n"
    b"M201 X9000\nN3 G1 Y5*103\n",
    b"G0 X-20 Y0 Z300\nG2 X-20.001 Y0.001 I-20 J0 F1200\nG19 G3 Y5 R-9\nM62 P3\nG17\n",
)
CSV = (
    b"x,y,z,speed\n0,0,300,10\n0,10,300\n5,5.5,310,3\n",
    b"sep=;\n# x\nx;y;z\n0;0;300\n\n;;;\n0;10;300\n",
    b'"1.5"\t2\t3\n4\t5\t6\n',
)
_TEXT = programs.__doc__.split("::\n\n", 1)[1].split("**CSV**")[0]
TOML = (
    "\n".join(line[4:] for line in _TEXT.splitlines()).encode(),
    b"ignore = ['note']\nstart = [0, 0, 300]\ntolerance = 1.5\nmoves = [\n{type = 'line', to ="
    b" [0, 10, 300], speed = 50, note = 1},\n{type = 'polyline', points = [[0, 10, 310], [0, 30,"
    b" 310]]},\n{type = 'arc', via = [0, 35, 315], to = [0, 40, 310]},\n]\n",
)
MACHINE = (
    b"clearance = 3.0\n[geometry]\nleg_length = 165\n[limits]\nvelocity = [1000, 1000.0, 900]\n",
    b"[[keep_out]]\nlow = [0, 0, 0]\nhigh = [1, 1, 1]\n[drives]\ncycle = 0.001\nnode_ids = [4, 5,"
    b" 6]\n[drives.homing]\nmethod = 35\n",
)
WORDS = {
    "a.nc": [
        *(f"{g} ".encode() for g in ("G0", "G1", "G2", "G3", "G4", "G17", "G18", "G19", "G20")),
        *(f"{g} ".encode() for g in ("G21", "G61", "G64", "G80", "G90", "G91", "G92", "G98", "M2")),
        *(f"{m}".encode() for m in ("M62", "M64 P1", "M66", "M104", "M117", "M30", "M6", "T1")),
        *(letter.encode() for letter in "XYZIJKRFPSLQENOxyz"),
        *(b"\n", b" ", b"(", b")", b";", b"%", b"/", b"*", b"G92 E0", b"X1", b"Y5", b"Z300"),
    ],
    "a.csv": [
        b",",
        b";",
        b"\t",
        b"\n",
        b"x,y,z\n",
        b"sep=;\n",
        b"1,5",
        b"#",
        b'"',
        b"300",
        b"speed",
    ],
    "a.toml": [
        *(b"[[moves]]\n", b"type = ", b"'line'", b"'arc'", b"'through'", b"'polyline'", b"'arch'"),
        *(b"'pick_and_place'", b"'set_output'", b"'wait_input'", b"'dwell'", b"to = ", b"via = "),
        *(b"points = ", b"place = ", b"lift = ", b"tolerance = ", b"speed = ", b"seconds = "),
        *(b"[0, 0, 300]", b"true", b"1979-05-27", b"[]", b"{}", b"{type = ", b"}", b"start = "),
        *(b"ignore = ", b"[[1, 2, 3], [4, 5, 6]]", b"straight = ", b"'E'", b"nan", b"inf", b"\n"),
    ],
    "machine.toml": [
        *(b"[geometry]\n", b"[limits]\n", b"[drives]\n", b"[[keep_out]]\n", b"[tool]\n", b"true"),
        *(b"low = ", b"high = ", b"velocity = ", b"[1, 2, 3]", b"'text'", b"{}", b"[[]]", b"nan"),
        *(b"inf", b"1979-05-27T00:00:00Z", b"\n", b" = ", b"clearance", b"'''", b"a.b = 1"),
    ],
}
SEEDS = {"a.nc": GCODE, "a.csv": CSV, "a.toml": TOML, "machine.toml": MACHINE}
MODULES = {
    "a.nc": ("planning/gcode", "planning/program", "motion/path"),
    "a.csv": ("planning/program", "motion/path", "toml_read"),
    "a.toml": ("planning/p", "motion/path", "motion/actions", "toml_read"),
    "machine.toml": ("duoglide/machine/",),
}
IGNORED = ("M104", "M117", "M201", "E", "M6", "T", "note")


def reader(name: str, folder: pathlib.Path) -> Callable[[bytes], object]:
    """Return what writes a file and reads it; a path must stand all that is done with paths."""
    file = folder / name

    def read(data: bytes) -> object:
        file.write_bytes(data)
        if name == "machine.toml":
            machine = dg.Machine.load(file)
            assert dg.Machine.from_dict(machine.to_dict()).to_dict() == machine.to_dict()
            return machine
        path = read_program(file, ignore=IGNORED)
        assert np.isfinite(path.waypoints).all()
        assert dg.Path.from_dict(path.to_dict()) == path
        assert path.reversed().end == path.start
        if max(map(abs, np.ravel(path.waypoints))) < 1e6:
            curve = round_corners(path).curve
            assert np.isfinite(curve.position(np.linspace(0.0, curve.end, 20))).all()
        return path

    return read


def run(name: str, folder: pathlib.Path, count: int, seed: int) -> Outcome:
    """Fuzz one reader."""
    seeds = SEEDS[name]
    if name == "machine.toml":
        dg.Machine.default().save(folder / name)
        seeds = (*seeds, (folder / name).read_bytes())
    return fuzz(Target(reader(name, folder), seeds, WORDS[name], MODULES[name]), count, seed)


@pytest.mark.parametrize("name", list(SEEDS))
def test_only_our_errors_leave_a_reader(name: str, tmp_path: pathlib.Path) -> None:
    outcome = run(name, tmp_path, COUNT, seed=3)
    for data, error in outcome.escaped:
        raise AssertionError(f"{name} {data!r:.300}: {error!r}") from error
    assert outcome.read > 2 * len(SEEDS[name])
    assert outcome.refused > COUNT // 10
    assert outcome.longest < 1000
    assert len(outcome.kept) > len(SEEDS[name])
