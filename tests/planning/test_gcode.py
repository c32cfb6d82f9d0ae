from __future__ import annotations

from math import pi

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.actions import Dwell, SetOutput, WaitInput
from duoglide.motion.path_segments import Arc
from duoglide.motion.rounded_path import round_corners
from duoglide.planning.gcode import read_gcode


def test_straight_moves_feeds_comments_and_line_numbers() -> None:
    path = read_gcode(
        """%
        (a program) N10 G21 G90 ; millimetres
        N20 g0 x0 y0 z300
        N30 G1 Y10 F600
        Y20 (modal) Z310.5
        G0 Y-30
        G1 X+5
        X5 Y-30 (goes nowhere)
        M30
        and this is not read
        """
    )
    assert path.waypoints == (
        (0, 0, 300),
        (0, 10, 300),
        (0, 20, 310.5),
        (0, -30, 310.5),
        (5, -30, 310.5),
    )
    assert [segment.speed for segment in path.segments] == [10.0, 10.0, None, 10.0]
    assert path.corners == (0.0, 0.0, 0.0)


def test_relative_coordinates_add_up() -> None:
    path = read_gcode("G0 X0 Y0 Z300\nG91 G1 Y5\nX1 Z-2\nG90 Y0")
    assert path.waypoints[1:] == ((0, 5, 300), (1, 5, 298), (1, 0, 298))


def test_exact_stop_and_tolerance_words_set_the_corners() -> None:
    path = read_gcode("G0 X0 Y0 Z0\nG1 X1\nY1\nG64 P0.2\nX2\nG61\nX2 Y2\nX3", tolerance=0.5)
    assert path.corners == (0.5, 0.5, 0.2, 0.0)


def test_dwells_outputs_and_inputs_become_actions_where_they_stand() -> None:
    path = read_gcode(
        "G0 X0 Y0 Z0\nM64 P16\nG1 X1\nG4 P0.5\nG4 S2\nM63 P33\nX2\nM66 P64 L3 Q1.5\nM66 P0 L4 Q2"
    )
    assert path.actions == (
        (0, SetOutput(1, 16, True)),
        (1, Dwell(0.5)),
        (1, Dwell(2.0)),
        (1, SetOutput(2, 1, False)),
        (2, WaitInput(3, 0, True, 1.5)),
        (2, WaitInput(1, 0, False, 2.0)),
    )


@pytest.mark.parametrize(
    ("plane", "axes", "offset"), [("G17", "XY", "IJ"), ("G18", "ZX", "KI"), ("G19", "YZ", "JK")]
)
@pytest.mark.parametrize("word", ["G2", "G3"])
def test_arcs_run_the_right_way_round_in_every_plane(
    plane: str, axes: str, offset: str, word: str
) -> None:
    a, b = axes
    text = f"G0 X0 Y0 Z0\nG1 {a}10\n{plane} {word} {a}0 {b}10 {offset[0]}-10 {offset[1]}0 F60"
    curve = round_corners(read_gcode(text)).curve
    quarter = 0.5 * pi * 10.0
    assert curve.end == pytest.approx(10.0 + (quarter if word == "G3" else 3.0 * quarter))
    first = "XYZ".index(a)
    np.testing.assert_allclose(curve.position(10.0)[first], 10.0, atol=1e-12)
    tangent = curve.derivatives(np.array([10.0]), np.array([1]))[0, 1]
    sign = 1.0 if word == "G3" else -1.0
    assert tangent["XYZ".index(b)] == pytest.approx(sign)


def test_radius_and_centre_describe_the_same_arcs() -> None:
    start = "G0 X0 Y0 Z0\n"
    for word in ("G2", "G3"):
        for radius, sweep in ((10.0, 0.5 * pi), (-10.0, 1.5 * pi)):
            curve = round_corners(read_gcode(start + f"{word} X10 Y10 R{radius}")).curve
            assert curve.end == pytest.approx(10.0 * sweep)
    half = round_corners(read_gcode(start + "G2 X20 Y0 R10")).curve
    assert half.end == pytest.approx(10.0 * pi)
    assert half.position(0.5 * half.end)[1] == pytest.approx(10.0)


def test_a_full_circle_is_two_arcs_without_a_rest() -> None:
    path = read_gcode("G0 X10 Y0 Z300\nG3 I-10 J0 F600")
    assert [type(segment) for segment in path.segments] == [Arc, Arc]
    curve = round_corners(path).curve
    assert curve.end == pytest.approx(20.0 * pi)
    assert curve.rests == ()
    np.testing.assert_allclose(curve.position(curve.end), (10, 0, 300), atol=1e-12)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("G1 X0 Y0", "line 1: the first move"),
        ("G91 G1 X0 Y0 Z0", "line 1: the first move"),
        ("X0 Y0 Z0", "line 1: coordinates before"),
        ("G0 X0 Y0 Z0\nG20 G1 X1", "line 2: G20: inches"),
        ("G0 X0 Y0 Z0\nG5 X1", "line 2: G5 is not known"),
        ("G0 X0 Y0 Z0\nM3 S1000", "line 2: M3 is not known"),
        ("G0 X0 Y0 Z0\nG1 X1 E5", "line 2: E: of no meaning"),
        ("G0 X0 Y0 Z0\nG1 X", "line 2: cannot read 'X'"),
        ("G0 X0 Y0 Z0\nG1 Xabc", "line 2: cannot read"),
        ("G0 X0 Y0 Z0\nG1 X1 X2", "line 2: X twice"),
        ("G0 X0 Y0 Z0\nG1 X1 F0", "line 2: F0: must be above 0"),
        ("G0 X0 Y0 Z0\nG4", "line 2: G4 needs P or S"),
        ("G0 X0 Y0 Z0\nG4 P500", "line 2: G4 P500 .* write P0.5"),
        ("G0 X0 Y0 Z0\nG2 X10", "line 2: an arc needs I or J, or R"),
        ("G0 X0 Y0 Z0\nG2 X10 R2", "line 2: R2 is too small: the ends are 10 mm apart"),
        ("G0 X0 Y0 Z0\nG2 X10 I3", "line 2: the centre does not fit"),
        ("G0 X0 Y0 Z0\nG2 X10 Z5 I5", "line 2: helical"),
        ("G0 X0 Y0 Z0\nG2 R5", "line 2: a full circle needs"),
        ("G0 X0 Y0 Z0\nG2 X10 K5", "line 2: an arc needs I or J"),
        ("G0 X0 Y0 Z0\nM64 P99", "line 2: M64 P99"),
        ("G0 X0 Y0 Z0\nM66 P1 L1 Q1", "line 2: M66 L1"),
        ("G0 X0 Y0 Z0\nG64", "line 2: G64 needs P"),
        ("G0 X0 Y0 Z0", "nothing moves"),
        ("", "nothing moves"),
    ],
)
def test_a_mistake_names_the_line_and_what_is_wrong(text: str, match: str) -> None:
    with pytest.raises(dg.InputError, match=match):
        read_gcode(text)
