from __future__ import annotations

from math import atan2, cos, hypot, pi, sin

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.path.actions import Dwell, SetOutput, WaitInput
from duoglide.motion.path.rounded import round_corners
from duoglide.motion.path.segments import Helix
from duoglide.planning.programs.gcode import read_gcode
from duoglide.planning.programs.notes import ProgramNotes


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


@pytest.mark.parametrize(
    "head", ["G0 X1 Y2\nG0 Z300", "G1 Z300 F720\nG1 X1 Y2 F9000", "G0 Y2\nM64 P0\nX1 Z300"]
)
def test_the_start_may_come_one_axis_after_the_other(head: str) -> None:
    path = read_gcode(f"{head}\nG1 X5\n")
    assert path.waypoints == ((1, 2, 300), (5, 2, 300))
    assert [waypoint for waypoint, _ in path.actions] == [0] * head.count("M64")


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


def test_a_full_circle_is_one_arc_without_a_rest() -> None:
    path = read_gcode("G0 X10 Y0 Z300\nG3 I-10 J0 F600")
    assert [type(segment) for segment in path.segments] == [Helix]
    curve = round_corners(path).curve
    assert curve.end == pytest.approx(20.0 * pi)
    assert curve.rests == ()
    np.testing.assert_allclose(curve.position(curve.end), (10, 0, 300), atol=1e-12)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("G1 X0 Y0", "it does not say where it starts: there is no Z"),
        ("G1 Y0\nM30", "it does not say where it starts: there is no X and Z"),
        ("G91 G1 X0 Y0 Z0", "line 1: the first moves"),
        ("G1 X0 Y0\nX5 Y5\nZ300", "line 2: the first moves .* each of X, Y and Z once"),
        ("G1 X0 Y0\nG91 Z300", "line 2: the first moves"),
        ("G1 X0 Y0\nG2 Z300 I5", "line 2: the first moves"),
        ("G1 I5", "line 1: the first moves"),
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
        ("G0 X0 Y0 Z0\nG2 R5", "line 2: a full circle needs"),
        ("G0 X0 Y0 Z0\nG2 X10 K5", "line 2: an arc needs I or J"),
        ("G0 X0 Y0 Z0\nM64 P99", "line 2: M64 P99"),
        ("G0 X0 Y0 Z0\nM66 P1 L1 Q1", "line 2: M66 L1"),
        ("G0 X0 Y0 Z0\nG64 P-1", "line 2: G64 P-1: must be 0 mm or above"),
        ("G0 X0 Y0 Z0\nG4 P-1", "line 2: G4 P-1: must be 0 s or above"),
        ("G0 X0 Y0 Z0\nG2 X10 I5 R5", "line 2: I: of no meaning"),
        ("G0 X0 Y0 Z0\nG2 X10 I5 P2", "line 2: P: of no meaning"),
        ("G0 X0 Y0 Z0\nG2 X0.001 R-20", "line 2: R-20 with ends 0.001 mm apart"),
        ("G0 X0 Y0 Z0\nG90.1 G2 X10 I5", "line 2: G90.1: absolute arc centres"),
        ("G0 X0 Y0 Z0\nG93 G1 X10 F5", "line 2: G93: F as inverse time"),
        ("G0 X0 Y0 Z0\nG95 G1 X10 F5", "line 2: G95: F per revolution"),
        ("G0 X0 Y0 Z0\nG92 X5", "line 2: G92: the origin is not moved"),
        ("G0 X0 Y0 Z0\nG2 X1000 I500 J1e3", "line 2: E: .* if e3 is an exponent, write the number"),
        ("G0 X0 Y0 Z0\nG1 X2e18", "line 2: E: of no meaning"),
        ("G0 X0 Y0 Z0", "nothing moves"),
        ("", "nothing moves"),
    ],
)
def test_a_mistake_names_the_line_and_what_is_wrong(text: str, match: str) -> None:
    with pytest.raises(dg.InputError, match=match):
        read_gcode(text)


CIRCLE = "G21 G90 G17\nG0 X-20 Y0 Z300\n"


def only_arc(text: str) -> Helix:
    (segment,) = read_gcode(text).segments
    assert isinstance(segment, Helix)
    return segment


def test_a_nearly_closed_arc_goes_round_about_its_centre() -> None:
    text = CIRCLE + "G2 X-20.001 Y0.001 I-20 J0 F1200"
    arc = only_arc(text)
    assert arc.centre == (-40.0, 0.0, 300.0)
    assert arc.axis == (0.0, 0.0, -1.0)
    assert arc.radius == 20.0
    curve = round_corners(read_gcode(text)).curve
    assert curve.length == pytest.approx(125.66, abs=0.005)
    np.testing.assert_allclose(curve.position(curve.end), (-20.001, 0.001, 300), atol=1e-12)
    away = curve.position(np.linspace(0.0, curve.end, 1000)) - arc.centre
    np.testing.assert_allclose(np.hypot(away[:, 0], away[:, 1]), 20.0, atol=0.0015)


def test_thousands_of_nearly_closed_arcs_keep_to_their_circle() -> None:
    rng = np.random.default_rng(9)
    worst, count = 0.0, 0
    for _ in range(400):
        radius, angle = rng.uniform(1.0, 100.0), rng.uniform(0.0, 2.0 * pi)
        gap = rng.uniform(-0.005, 0.005) / radius
        centre = rng.uniform(-50.0, 50.0, 2).round(3)
        start, end = (
            (centre + radius * np.array([cos(a), sin(a)])).round(3) for a in (angle, angle + gap)
        )
        offset = (centre - start).round(3)
        word = "G2" if rng.random() < 0.5 else "G3"
        text = (
            f"G0 X{start[0]:.3f} Y{start[1]:.3f} Z0\n"
            f"{word} X{end[0]:.3f} Y{end[1]:.3f} I{offset[0]:.3f} J{offset[1]:.3f}"
        )
        path = read_gcode(text)
        (arc,) = path.segments
        assert isinstance(arc, Helix)
        curve = round_corners(path).curve
        size = hypot(*offset)
        exact = (atan2(*(end - centre)[::-1]) - atan2(*(start - centre)[::-1])) % (2.0 * pi)
        exact = exact if word == "G3" else 2.0 * pi - exact
        once_round = 2.0 * pi * (exact < 5e-7)  # where both ends are at the same angle
        assert arc.sweep == pytest.approx(exact + once_round, abs=1e-9)
        away = curve.position(np.linspace(0.0, curve.end, 50))[:, :2] - start - offset
        worst = max(worst, np.abs(np.hypot(*away.T) - size).max())
        count += exact > pi
    assert count > 100
    assert worst < 0.002


@pytest.mark.parametrize("word", ["G2", "G3"])
def test_an_end_on_the_radius_of_the_start_goes_once_round(word: str) -> None:
    arc = only_arc(CIRCLE + f"{word} X-20.001 Y0 I-20 J0")
    assert arc.sweep == pytest.approx(2.0 * pi, abs=1e-12)
    assert arc.end == (-20.001, 0.0, 300.0)
    assert only_arc(CIRCLE + f"{word} X-20 Y0 I-20 J0").sweep == 2.0 * pi


def test_arcs_that_hardly_bulge_are_read_as_arcs() -> None:
    for text, length in (
        ("G2 X-19.9 Y0 R1e9".replace("1e9", "1000000000"), 0.1),  # bulges 1.25e-12 mm
        ("G2 X-19.999 Y0 R1000", 0.001),  # 1.25e-10 mm
        ("G3 X-10 Y0 R1000000000000", 10.0),
        ("G2 X-19.999 Y0 I0.0005 J-100", 0.001),
        ("G2 X-10 Y0 I5 J-1000000", 10.0),
    ):
        curve = round_corners(read_gcode(CIRCLE + text)).curve
        assert curve.length == pytest.approx(length, rel=1e-9), text
        straight = curve.position(np.linspace(0.0, curve.end, 9))[:, 1:]
        np.testing.assert_allclose(straight, [[0.0, 300.0]] * 9, atol=2e-5)


def test_a_rounded_radius_of_a_half_circle_is_taken_as_half_the_way() -> None:
    arc = only_arc(CIRCLE + "G2 X20 Y0 R19.9999")
    assert arc.radius == pytest.approx(20.0)
    assert arc.sweep == pytest.approx(pi)


@pytest.mark.parametrize(
    ("plane", "axes", "offsets"), [("G17", "XYZ", "IJ"), ("G18", "ZXY", "KI"), ("G19", "YZX", "JK")]
)
def test_helices_advance_along_the_axis_of_the_plane(plane: str, axes: str, offsets: str) -> None:
    a, b, c = axes
    i, j = offsets
    for word, quarter in (("G3", 0.5 * pi), ("G2", 1.5 * pi)):
        text = f"G0 X0 Y0 Z0\nG1 {a}10\n{plane} {word} {a}0 {b}10 {c}5 {i}-10 {j}0"
        path = read_gcode(text)
        assert isinstance(path.segments[1], Helix)
        curve = round_corners(path).curve
        assert curve.length == pytest.approx(10.0 + hypot(quarter * 10.0, 5.0))
        end = dict(zip("XYZ", curve.position(curve.end), strict=True))
        assert (end[a], end[b], end[c]) == pytest.approx((0.0, 10.0, 5.0), abs=1e-12)
    whole = round_corners(read_gcode(f"G0 X0 Y0 Z0\n{plane} G2 {c}-4 {i}6")).curve
    assert whole.length == pytest.approx(hypot(12.0 * pi, 4.0))


def test_arcs_in_relative_coordinates_count_from_where_they_start() -> None:
    arc = only_arc(CIRCLE + "G91 G3 X-40 Y0 I-20")
    assert (arc.centre, arc.end) == ((-40.0, 0.0, 300.0), (-60.0, 0.0, 300.0))


def test_relative_moves_too_short_for_a_line_add_up() -> None:
    steps = "X0.0000004\n" * 10
    path = read_gcode(CIRCLE + "G91 G1\n" + steps + "G90 Y5")
    assert path.segments[0].end == pytest.approx((-20.0 + 1.2e-6, 0.0, 300.0), abs=1e-12)
    assert path.end == pytest.approx((-20.0 + 4e-6, 5.0, 300.0), abs=1e-12)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("G1 Y10\nG80\nY20", "line 5: coordinates after G80"),
        ("G80 Y20", "line 3: coordinates after G80"),
        ("G1 Y10\nG80\nG91\nI5", "line 6: coordinates after G80"),
        ("G0 G1 Y5", "line 3: G0 and G1 in one line: both set the motion"),
        ("G1 G2 Y5 I5", "line 3: G1 and G2 in one line"),
        ("G1 G80 Y5", "line 3: G1 and G80 in one line"),
        ("G1 G01 Y5", "line 3: G1 twice"),
        ("G90 G91 G1 Y5", "line 3: G90 and G91 in one line: both set the distance"),
        ("G17 G18", "line 3: G17 and G18 in one line: both set the plane"),
        ("G61 G64 P1", "line 3: G61 and G64 in one line: both set the path control"),
        ("G20 G21", "line 3: G20 and G21 in one line: both set the units"),
        ("G93 G94", "line 3: G93 and G94 in one line: both set the feed"),
        ("G54 G55", "line 3: G54 and G55 in one line: both set the work offset"),
        ("G4 P1 G4 S1", "line 3: G4 twice"),
        ("M2 M30", "line 3: M2 and M30 in one line: both set the stop"),
        ("M62 M63 P1", "line 3: M62 and M63 in one line: both set the input or output"),
    ],
)
def test_no_two_words_of_one_modal_group_and_no_move_without_a_mode(text: str, match: str) -> None:
    with pytest.raises(dg.InputError, match=match):
        read_gcode(CIRCLE + text + "\nG1 X5")


def test_words_of_different_groups_share_a_line() -> None:
    path = read_gcode("G17 G21 G40 G49 G54 G80 G90 G94 G61\n" + CIRCLE + "G91 G1 Y5 F60 M64 P1 M30")
    assert path.end == (-20.0, 5.0, 300.0)
    assert path.actions == ((0, SetOutput(1, 1, True)),)


@pytest.mark.parametrize("text", ["%\n{}%\nG1 Y99", "\n(head)\n%\n{}%\n)(?!", "{}%\n\n ; tail\n"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_the_closing_percent_ends_a_program(text: str, end: str) -> None:
    path = read_gcode(text.format(CIRCLE + "G1 Y10\n").replace("\n", end))
    assert path.end == (-20.0, 10.0, 300.0)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("{}G1 Y10\n%\nG1 Y20", "line 5: it comes after the % of line 4"),
        ("{}G1 Y10\n%\n%", "line 5: it comes after the % of line 4"),
        ("%\n{}G1 Y10\n%G1 Y20", "line 5: cannot read '%G1 Y20'"),
        ("% G1 Y20\n{}G1 Y10", "line 1: cannot read '% G1 Y20'"),
        ("%\n%\n{}G1 Y10", "nothing moves"),
    ],
)
def test_a_percent_that_may_mean_either_is_refused(text: str, match: str) -> None:
    with pytest.raises(dg.InputError, match=match):
        read_gcode(text.format(CIRCLE))


def test_a_percent_may_carry_a_program_number() -> None:
    assert read_gcode("%1234\n" + CIRCLE + "G1 Y10").end == (-20.0, 10.0, 300.0)


@pytest.mark.parametrize("word", ["P", "S"])
def test_to_dwell_for_no_time_is_nothing(word: str) -> None:
    assert read_gcode(CIRCLE + f"G4 {word}0\nG1 Y10\nG4 {word}0.0").actions == ()


def test_smoothness_keeps_every_point() -> None:
    notes = ProgramNotes()
    path = read_gcode("G0 X0 Y0 Z300\nG64 P0.05 Q0.02\nG1 X5\nX6\nX6 Y5", notes=notes)
    assert path.corners == (0.05, 0.05)
    assert notes.remarks == ["line 2: G64 Q: no point is left out; P is the tolerance"]
    with pytest.raises(dg.InputError, match="Q: of no meaning"):
        read_gcode("G0 X0 Y0 Z300\nG64 Q0.02\nG1 X5")


def test_smoothness_without_a_number_is_that_of_the_program_and_says_so() -> None:
    from duoglide.planning.programs.notes import ProgramNotes

    text = CIRCLE + "G1 Y10\nG61\nX-10\nG64\nY20\nX-20\nG64 P0.2\nY30\nX-30"
    notes = ProgramNotes()
    assert read_gcode(text, 0.7, notes).corners == (0.7, 0.0, 0.7, 0.7, 0.2)
    assert notes.remarks == [
        "line 6: G64 without P: the smoothest within 0.7 mm, the program's tolerance"
    ]
    notes = ProgramNotes()
    assert read_gcode(text, 0.0, notes).corners == (0.0, 0.0, 0.0, 0.0, 0.2)
    assert notes.remarks == [
        "line 6: G64 without P: exact corners, of 0 mm, the program's tolerance"
    ]


@pytest.mark.parametrize("letter", "NOGMXIJKRFPSQLTEH")
def test_no_number_is_too_long_for_a_clear_answer(letter: str) -> None:
    nines = "9" * 400
    for digits in (nines, nines + ".5", "0." + nines, "." + nines, "-" + nines, "+" + 9 * nines):
        for text in (f"M62 {letter}{digits}", f"G2 X5 R5 {letter}{digits}"):
            try:
                read_gcode(CIRCLE + text + "\nG1 X7")
            except dg.InputError as error:
                assert len(str(error)) < 400


def test_the_line_with_four_hundred_digits_is_named() -> None:
    with pytest.raises(dg.InputError, match=r"line 3: P9{12}\.\.\.: a number of 400 digits"):
        read_gcode(CIRCLE + "M62 P" + "9" * 400)


@pytest.mark.parametrize(
    ("line", "match"),
    [
        ("G1 Y1 0", "cannot read '0': a number without a letter"),
        ("G1 Y1 000.5", "cannot read '000.5': a number without a letter"),
        ("G1 Y1(c)0", "cannot read '0': a number without a letter"),
        ("G1 Y1,5", "cannot read ',5': the decimal sign is a point"),
        ("G1 Y1.234,5", "the decimal sign is a point"),
        ("G1 Y1.2.3", "cannot read '.3'"),
        ("G1 Y1_000", "cannot read '_000'"),
        ("G1 Y- 5", "cannot read 'Y- 5'"),
        ("G1 Y--5", "cannot read 'Y--5'"),
        ("G1 Ynan", "cannot read"),
        ("G1 Y\u0661\u0662", "cannot read"),
        ("G1 Y\u22125", "cannot read"),
        ("G1 \u017f5", "cannot read"),
        ("G1 Y1\u00a05", "cannot read"),
        ("G1 Y#1", "cannot read"),
        ("G1 Y[1+2]", "cannot read"),
        ("/G1 Y5", "'/' leaves it to a switch"),
        ("N30 /G1 Y5", "cannot read '/G1 Y5'"),
        ("N10 N20 G1 Y5", "N: of no meaning"),
        ("N10.5 G1 Y5", "N: of no meaning"),
        ("O100 sub", "cannot read"),
        ("G1 Y5 (open", "a comment goes from"),
        ("G1 Y5 (a (b) c)", "a comment goes from"),
        ("G1 Y5 )", "a comment goes from"),
        ("N3 G1 Y5*71", "the checksum is 71, that of the line is"),
        ("G1 Y5 *", "cannot read"),
    ],
)
def test_what_can_be_read_in_two_ways_is_refused(line: str, match: str) -> None:
    with pytest.raises(dg.InputError, match=r"line 3: .*" + match.replace("(", r"\(")):
        read_gcode(CIRCLE + line + "\nG1 X7")


@pytest.mark.parametrize(
    "line",
    [
        "g1y5",
        "G01Y+5.",
        "\tG 1 Y 5",
        "N0010G1Y5",
        "O12 G1 Y5",
        "n10 g1 y05.000",
        "G1 Y5 (a ; b) ; (c",
        "G1 Y5 ; 100 % \x85 G1 Y7",
        "G1 (a)(b) Y5",
        "G1 Y5\x1a",
        "N3 G1 Y5*103",
        "N3 G1 Y5 *71 ; checked",
    ],
)
def test_what_can_be_read_in_one_way_is_read(line: str) -> None:
    assert read_gcode(CIRCLE + line).end == (-20.0, 5.0, 300.0)
