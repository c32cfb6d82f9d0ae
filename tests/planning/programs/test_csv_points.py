from __future__ import annotations

import pathlib

import pytest

import duoglide as dg
from duoglide.planning.programs.csv_points import read_csv
from duoglide.planning.programs.read import read_program


def points(text: str) -> tuple[tuple[float, float, float], ...]:
    return read_csv(text).waypoints


ENDS = ((-41.5, 0.0, 300.0), (-41.5, 10.0, 310.25))


@pytest.mark.parametrize(
    "text",
    [
        "-41.5,0,300\n-41.5,10,310.25",
        "-41.5;0;300\n-41.5;10;310.25",
        "-41.5\t0\t300\n-41.5\t10\t310.25",
        "-41.5, \t0,\t300\r\n-41.5 ,10 ,310.25\r\n",
        "-41.5;0;300\r-41.5;10;310.25\r",
        "sep=;\n-41.5;0;300\n-41.5;10;310.25",
        "SEP=,\nx,y,z\n-41.5,0,300\n-41.5,10,310.25",
        "sep=\t\nX\tY\tZ\n-41.5\t0\t300\n-41.5\t10\t310.25",
        "# a \x85 -41.5,0,3\nx,y,z\n;;;\n,,\n-41.5,0,300,\n-41.5,10,310.25,",
        '"x","y","z"\n"-41.5","0","300"\n"-41.5","10","310.25"',
        "-4.15e1,0,3E+2\n-41.500,10.000,310.250",
        "-41.5;0.000;300\n-41.50;10;310.25\n\x1a",
    ],
)
def test_points_are_read_in_every_shape_that_has_one_meaning(text: str) -> None:
    assert points(text) == ENDS


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("0;0;300\n1,5;2,5;300", "line 2: '1,5' is not a number; numbers are written as -41.5"),
        ("0;0;300\n1,5;300;0", "line 2: '1,5' is not a number"),
        ("x;y;z;speed\n0;0;300\n1,5;2;300", "line 3: '1,5' is not a number"),
        ("1,5\t2,5\t300\n0\t0\t300", "line 1: '1,5' is not a number"),
        ('0,0,300\n"1,5",2,300', "line 2: '1,5' is not a number"),
        ("0,0,300\n5;5;310", "line 1: '0,0,300' is not a number"),
        ("0,0,300\n5,5\t310", "line 1: '0,0,300' is not a number"),
        ("1,5,2,5,300\n0,0,0", "line 1: expected x, y, z and perhaps a speed, got 5"),
        ("-41,500000,10,000000,300,000000\n0,0,0", "line 1: expected"),
        ("-41,5,0,300\n-41,5,10,300", "line 1: -41,5,0,300 may be x, y, z and a speed"),
        ("0,0,300,10\n0,10,300,10", "line 1: .*begin the file with the line x,y,z,speed"),
        ("1.200;0;300\n1.300;0;300", "line 1: '1.200' may be 1.2 or.*1200; write 1.2 or 1.2000"),
        ("x;y;z;speed\n0;0;300\n9;0;300;1.200", "line 3: '1.200' may be"),
        ("0\t0\t300\n-1.200\t9\t300", "line 2: '-1.200' may be"),
        ("1.234,5;0;300\n0;0;0", "line 1: '1.234,5' is not a number"),
        ("1.234.567;0;300\n0;0;0", "line 1: '1.234.567' is not a number"),
        ("1 234;0;300\n0;0;0", "line 1: '1 234' is not a number"),
        ("1'234;0;300\n0;0;0", 'line 1: "1\'234" is not a number'),
        ("1_234;0;300\n0;0;0", "line 1: '1_234' is not a number"),
        ("1\u00a0234;0;300\n0;0;0", "line 1: .* is not a number"),
        ("\u0661,0,300\n0,0,0", "line 1: .* is not a number"),
        ("\u22121,0,300\n0,0,0", "line 1: .* is not a number"),
        ("0x10,0,300\n0,0,0", "line 1: '0x10' is not a number"),
        ("1e999,0,300\n0,0,0", "line 1: point"),
        ("1e19,0,300\n0,0,0", "line 1: point: a coordinate of 1e"),
        ("inf,0,300\n0,0,0", "line 1: inf: every number must be finite"),
        ("0,0,300\n-Infinity,0,0", "line 2: -Infinity: every number must be finite"),
        ("1,,300\n0,0,0", "line 1: '' is not a number"),
        ("x,y,z\n0,0,300\n0,1,300,5", "line 3: expected x, y, z, got 4"),
        ("0,0,300\nx,y,z\n0,1,300", "line 2: 'x' is not a number"),
        ("y,x,z\n0,0,300\n0,1,300", "line 1: 'y' is not a number"),
        ('0,0,300\n"0,1,300', "line 2: "),
        ("0,0,300\n" + "9" * 5000 + ",1,300", "line 2: point"),
    ],
)
def test_what_a_spreadsheet_may_mean_otherwise_is_refused(text: str, match: str) -> None:
    with pytest.raises(dg.InputError, match=match) as refusal:
        points(text)
    assert len(str(refusal.value)) < 500


def test_speeds_need_the_first_line_only_where_numbers_may_have_a_decimal_comma() -> None:
    for text in (
        "x,y,z,speed\n0,0,300,10\n0,10,300,20",
        "0,0,300.0,10\n0,10,300,20",
        "0;0;300;10\n0;10;300;20",
        "-4,-1,-300\n0,-10,-300.,20",
    ):
        (segment,) = read_csv(text).segments
        assert segment.speed == 20.0, text


def test_bytes_that_are_no_utf_8_pass_in_comments_and_nowhere_else(tmp_path: pathlib.Path) -> None:
    for name, comment, first, last in (
        ("a.csv", "# M\xfcnchen\n", "0,0,300\n", "0,10,300\n"),
        ("a.nc", "(M\xfcnchen) ; \xb5m \x85 G1 X7\n", "G0 X0 Y0 Z300\n", "G1 Y10 (\xb0)\n"),
    ):
        file = tmp_path / name
        for encoding in ("latin-1", "utf-8", "utf-8-sig", "cp1252"):
            with file.open("wb") as out:
                text = comment + first + last
                out.write(text.replace("\x85", "").encode(encoding))
            assert read_program(file).end == (0.0, 10.0, 300.0)
        file.write_bytes((comment + first).encode("latin-1") + b"\xfc" + last.encode("latin-1"))
        with pytest.raises(dg.InputError, match=rf"{name}: line 3: .*\\udcfc"):
            read_program(file)
        file.write_bytes((comment + first + last).encode("latin-1"))
        assert read_program(file).end == (0.0, 10.0, 300.0)


@pytest.mark.parametrize("name", ["a.csv", "a.nc", "a.toml"])
def test_other_encodings_are_refused_with_the_line(tmp_path: pathlib.Path, name: str) -> None:
    file = tmp_path / name
    text = {"a.csv": "0,0,300\n0,10,300\n", "a.nc": "G0 X0 Y0 Z0\nG1 Y5\n", "a.toml": "# x\n"}[name]
    for encoding, match in (
        ("utf-16", "line 1: the file is in UTF-16; save it as UTF-8"),
        ("utf-16-le", "line 1: a zero byte"),
        ("utf-32", "line 1: the file is in UTF-32"),
    ):
        file.write_bytes(text.encode(encoding))
        with pytest.raises(dg.InputError, match=rf"cannot read program .*{name}: {match}"):
            read_program(file)
    file.write_bytes(text.encode() + b"\0")
    with pytest.raises(dg.InputError, match=rf"line {text.count(chr(10)) + 1}: a zero byte"):
        read_program(file)


def test_toml_is_utf_8_and_the_line_that_is_not_is_named(tmp_path: pathlib.Path) -> None:
    file = tmp_path / "a.toml"
    file.write_bytes("start = [0, 0, 300]\n# M\xfcnchen\n".encode("latin-1"))
    with pytest.raises(dg.InputError, match=r"a\.toml: line 2: byte 0xfc is no UTF-8"):
        read_program(file)
    with pytest.raises(dg.ConfigError, match=r"a\.toml: line 2: byte 0xfc is no UTF-8"):
        dg.Machine.load(file)
