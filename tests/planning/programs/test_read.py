from __future__ import annotations

import pathlib

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.path.actions import Dwell, SetOutput, WaitInput
from duoglide.motion.path.rounded import round_corners
from duoglide.planning.programs import read as programs
from duoglide.planning.programs.read import read_program


@pytest.fixture
def read(tmp_path: pathlib.Path):  # type: ignore[no-untyped-def]
    def reader(name: str, text: str, tolerance: float = 0.0) -> dg.Path:
        file = tmp_path / name
        file.write_text(text, encoding="utf-8")
        return read_program(file, tolerance)

    return reader


def example() -> str:
    """The TOML program in the module's docstring."""
    text = programs.__doc__.split("::\n\n", 1)[1].split("**CSV**")[0]
    return "\n".join(line[4:] for line in text.splitlines())


def test_the_documented_program_is_read_and_passes_the_check(read) -> None:  # type: ignore[no-untyped-def]
    path = read("cell.toml", example())
    assert path.start == (-41.0, -100.0, 295.0)
    assert path.end == (-41.0, 0.0, 295.0)
    assert path.tool_speed == 800.0
    assert path.tool_acceleration == 20_000.0
    assert [type(action) for _, action in path.actions] == [SetOutput, WaitInput, Dwell]
    checked = dg.check_path(dg.Machine.default(), path)
    assert checked.curve.rests


def test_toml_moves_have_their_own_caps_and_corners(read) -> None:  # type: ignore[no-untyped-def]
    path = read(
        "a.toml",
        """
        start = [0, 0, 300]
        tolerance = 1.5
        moves = [
            {type = "line", to = [0, 10, 300], speed = 50, tolerance = 0.5},
            {type = "polyline", points = [[0, 10, 310], [0, 30, 310]]},
            {type = "through", points = [[0, 40, 305], [0, 50, 310]]},
        ]
        """,
    )
    assert path.corners == (0.5, 1.5, 1.5)
    assert [segment.speed for segment in path.segments] == [50.0, None, None, None]


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("moves = 3", "list of tables"),
        ("start = [0, 0", "not TOML"),
        ("speeed = 3\nmoves = []", "did you mean speed\\?"),
        ("start = [0, 0, 0]\nmoves = []", "nothing moves"),
        ("moves = [{type = 'line', to = [0, 0, 1]}]", "move 1: .*where it starts"),
        ("moves = [{to = [0, 0, 1]}]", "move 1: it lacks a type; there are line, arc"),
        ("moves = [{type = ['line']}]", r"move 1: type = \['line'\]: must be one of"),
        ("start = [0, 0, 0]\nmoves = [{type = 'jump'}]", "move 1: type = 'jump'"),
        ("start = [0, 0, 0]\nmoves = [{type = 'line'}]", "move 1: line needs to"),
        ("start = [0, 0, 0]\nmoves = [{type = 'line', to = [0, 0]}]", "move 1: to"),
        ("start = [0, 0, 0]\nmoves = [{type = 'line', to = [0, 0, 0]}]", "move 1: .*coincide"),
        ("start = [0, 0, 0]\nmoves = [{type = 'line', to = 'x'}]", "move 1: to"),
        ("start = [0, 0, 0]\nmoves = [{type = 'line', too = 1}]", "did you mean to"),
        ("start = [0, 0, 0]\nmoves = [{type = 'dwell', seconds = 0}]", "move 1: dwell"),
        ("start = [0, 0, nan]\nmoves = []", "finite"),
        (
            "start=[0,0,0]\nmoves=[{type='line',to=[1,0,0]},"
            "{type='pick_and_place',pick=[9,0,0],place=[2,0,0]}]",
            "move 2: it starts at .* 8 mm from",
        ),
    ],
)
def test_a_toml_mistake_names_file_move_and_rule(read, text: str, match: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(dg.InputError, match=rf"bad\.toml: .*{match}"):
        read("bad.toml", text)


def test_csv_has_a_header_comments_and_speeds_as_wished(read) -> None:  # type: ignore[no-untyped-def]
    text = "# a square\nx; y; z; speed\n0;0;300;1\n\n0; 10; 300; 50\n0;10;310\n"
    path = read("square.csv", text, tolerance=0.5)
    assert path.waypoints == ((0, 0, 300), (0, 10, 300), (0, 10, 310))
    assert [segment.speed for segment in path.segments] == [50.0, None]
    assert path.corners == (0.5,)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("0,0,0\n0,a,1", "line 2: 'a' is not a number"),
        ("0,0,0\n\n0,1", "line 3: expected x, y, z"),
        ("0,0,0\n0,nan,1", "line 2: .*finite"),
        ("0,0,0\n1,0,0\n1,0,0", "coincide"),
        ("0,0,0", "two points"),
        ("", "two points"),
        ("0,0,0\n1,1,1,-5", "line 2: speed"),
        ("x,y,z\nx,y,z\n", "line 2: 'x' is not a number"),
    ],
)
def test_a_csv_mistake_names_file_line_and_rule(read, text: str, match: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(dg.InputError, match=rf"bad\.csv: .*{match}"):
        read("bad.csv", text)


def test_ten_thousand_csv_points_become_one_path(read) -> None:  # type: ignore[no-untyped-def]
    points = np.cumsum(np.random.default_rng(1).normal(size=(10_001, 3)), axis=0)
    path = read("long.csv", "\n".join(",".join(map(repr, p)) for p in points.tolist()), 0.1)
    assert len(path.segments) == 10_000
    assert round_corners(path).deviation.max() <= 0.1


def test_files_that_cannot_be_read_are_refused(tmp_path: pathlib.Path) -> None:
    with pytest.raises(dg.InputError, match="cannot read program"):
        read_program(tmp_path / "none.toml")
    with pytest.raises(dg.InputError, match=r"unknown kind of program; known: \.toml, \.csv, \.nc"):
        read_program(tmp_path / "program.docx")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(dg.InputError, match="cannot read program"):
        read_program(tmp_path / "binary.csv")
    with pytest.raises(dg.InputError, match="cannot read program"):
        (tmp_path / "folder.csv").mkdir()
        read_program(tmp_path / "folder.csv")
    with pytest.raises(dg.InputError, match="tolerance"):
        read_program(tmp_path / "none.csv", tolerance=-1.0)


GOOD = {
    "a.toml": "",
    "a.csv": "x,y,z,speed\n0,0,300,10\n0,10,300\n5;5;310;3\n",
    "a.nc": "%\nN10 G21 G90 (x)\nG0 X0 Y0 Z300\nG1 Y10 F600\nG2 X10 Y0 I5 J-5\nG3 X20 R8\n"
    "G4 P0.5\nM64 P16\nG91 G1 X1\nG64 P0.2\nM66 P1 L3 Q2\nM30",
}
LETTERS = "GMXYZIJKRFPLQ0123456789.-+ \n,;=[]{}'\"#()truefalsenainf"


@pytest.mark.parametrize("name", GOOD)
def test_a_damaged_program_is_a_path_or_an_input_error(read, name: str) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(9)
    good = GOOD[name] or example()
    for _ in range(150):
        text = list(good)
        for _ in range(rng.integers(1, 4)):
            place = int(rng.integers(len(text)))
            text[place] = "" if rng.random() < 0.3 else LETTERS[rng.integers(len(LETTERS))]
        try:
            assert read(name, "".join(text)).segments
        except dg.InputError as error:
            assert name in str(error)
