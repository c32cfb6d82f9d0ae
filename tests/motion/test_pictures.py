from __future__ import annotations

import re
from base64 import b64decode
from dataclasses import replace

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.curve.picture import plot_in_machine
from duoglide.motion.path.rounded import round_corners


@pytest.fixture(scope="module")
def path() -> dg.Path:
    corners = [(-41, -100, 290), (-60, 0, 320), (0, 50, 300), (-41, 100, 290)]
    return dg.Path.polyline(corners, tolerance=8.0).at(1, dg.SetOutput(1, 2, True)).capped(900.0)


@pytest.fixture(scope="module")
def move(path: dg.Path) -> dg.Trajectory:
    return dg.plan(dg.Machine.default(), path, brake_safe=False)


def pictures(page: str) -> list[bytes]:
    """Return what the page shows; it fetches nothing from elsewhere."""
    sources = re.findall(r'src="([^"]*)"', page)
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert "://" not in page and "<script" not in page  # base64 has no colon
    return [b64decode(source.partition(",")[2]) for source in sources]


def rows(page: str) -> dict[str, list[str]]:
    """Return the cells of the tables by the name of their row."""
    table = re.findall(r"<tr><th[^>]*>(.*?)</th>(.*?)</tr>", page)
    return {name: re.findall(r"<td[^>]*>(.*?)</td>", cells) for name, cells in table}


def test_a_path_shows_its_measures_with_units(path: dg.Path) -> None:
    page = path._repr_html_()
    (picture,) = pictures(page)
    assert picture.startswith(b"\x89PNG")
    found = rows(page)
    assert found["from"] == ["(-41, -100, 290) mm"]
    assert found["corners"] == ["2 within 8 mm"]
    assert found["tool speed"] == ["at most 900 mm/s"]
    assert float(found["length"][0].split(" mm")[0]) == pytest.approx(237.0, abs=0.5)


def test_a_path_whose_blends_do_not_fit_is_shown_in_words() -> None:
    blend = dg.Blend(40.0, 40.0)
    points = [(0, 0, 300), (50, 0, 300), (50, 50, 300), (0, 50, 300)]
    crowded = dg.Path.polyline(points, blends=[blend, blend])
    page = crowded._repr_html_()
    assert pictures(page) == []
    with pytest.raises(dg.PathError) as refusal:
        crowded.plot()
    assert str(refusal.value)[:20] in page


def test_a_path_is_drawn_as_it_will_be_followed(path: dg.Path) -> None:
    side, front, top = path.plot().axes
    assert (side.get_xlabel(), side.get_ylabel()) == ("y [mm]", "z [mm]")
    assert (front.get_xlabel(), top.get_ylabel()) == ("x [mm]", "x [mm]")
    across, up = np.array(side.lines[0].get_data())
    assert across[[0, -1]] == pytest.approx([-100.0, 100.0])
    assert 310.0 < up.max() < 320.0 - 1.0, "corners are rounded"


def test_a_checked_path_shows_every_margin(move: dg.Trajectory, path: dg.Path) -> None:
    checked = dg.check_path(dg.Machine.default(), path)
    page = checked._repr_html_()
    assert len(pictures(page)) == 1
    found = rows(page)
    for entry in checked.report.least:
        is_, needed, along, _ = found[entry.family.replace("_", " ")]
        assert is_ == f"{entry.margin:.2f} mm"
        assert needed.endswith("mm") and along.endswith("mm")
    titles = [axes.get_title(loc="left") for axes in checked.plot().axes]
    assert {"Clearance [mm]", "Carriage margin [mm]"} <= set(titles)


def test_every_value_has_a_short_repr_with_its_unit(move: dg.Trajectory, path: dg.Path) -> None:
    checked = dg.check_path(dg.Machine.default(), path)
    values = (
        path, checked, checked.report, checked.curve, move, move.at(0.1), move.path, move.profile,
        move.stops, move.audit(), dg.transfer(move.machine, (-41, 0, 302), (-41, 5, 302)).path,
    )  # fmt: skip
    for value in values:
        assert len(repr(value)) < 240, repr(value)
        assert re.search(r"[\d)] (mm|s)\b", repr(value)), repr(value)
    assert repr(move.at(np.zeros((2, 3)))) == "State(2 x 3 times)"
    tightest = checked.report.tightest
    name = tightest.family.replace("_", " ")
    assert rows(checked.report._repr_html_())[name][0] == f"{tightest.margin:.2f} mm"


def test_a_refused_path_is_drawn_with_the_place_where_it_fails() -> None:
    machine = dg.Machine(work_frame=(0.0, 0.0, 10.0))  # the picture is in the machine's frame
    path = dg.Path.polyline([(-41, -100, 280), (-41, 0, 335), (-70, 80, 370)], 2.0)
    with pytest.raises(dg.PathError) as refusal:
        dg.check_path(machine, path)
    curve = round_corners(path).platform_curve(machine)
    figure = plot_in_machine(machine, curve, refusal=refusal.value)
    assert " ".join(figure.get_suptitle().split()) == str(refusal.value)
    side, section, *_ = figure.axes
    x, y, z = refusal.value.position
    mark = side.lines[-1]
    assert np.array(mark.get_data()).ravel() == pytest.approx([y, z])
    across, up = np.array(side.lines[0].get_data())
    assert np.hypot(across - y, up - z).min() < 0.2, "it lies on the path that is drawn"
    assert section.get_ylim()[1] > 380.0, "all of the path is in the picture"
    assert np.array(section.lines[-1].get_data()).ravel() == pytest.approx([x, z])


def test_a_trajectory_shows_peaks_below_their_limits(move: dg.Trajectory) -> None:
    page = move._repr_html_()
    assert len(pictures(page)) == 1
    found = rows(page)
    assert found["duration"] == [f"{move.duration:.4f} s"]
    assert found["brake-safe"] == ["no"]
    for name in ("peak velocity", "peak acceleration", "peak jerk"):
        *peaks, limit = found[name]
        assert limit.split()[1].startswith("m/s")
        assert max(map(float, peaks)) <= 1.002 * float(limit.split()[0])


@pytest.mark.parametrize(
    ("clearance", "words"),
    [(2.504, "yes, clearance while braking at least 2.50 mm"), (float("nan"), "yes")],
)
def test_a_trajectory_shows_how_near_drives_come_that_brake_by_themselves(
    move: dg.Trajectory, clearance: float, words: str
) -> None:
    report = replace(move.report, brake_safe=True, braking_clearance=clearance)
    page = replace(move, report=report)._repr_html_()
    assert rows(page)["brake-safe"] == [words]


def test_a_trajectory_is_drawn_with_its_limits_in_the_same_unit(move: dg.Trajectory) -> None:
    axes = move.plot().axes
    titles = [one.get_title(loc="left") for one in axes]
    rates = ["Velocity [m/s]", "Acceleration [m/s²]", "Jerk [m/s³]"]
    assert titles == ["Carriages [mm]", *rates, "Force [N]"]
    assert len(axes[-1].lines) == 3  # no limit, no line
    for one in axes[1:-1]:
        limit = max(float(np.max(line.get_ydata())) for line in one.lines[3:])
        most = max(float(np.abs(line.get_ydata()).max()) for line in one.lines[:3])
        assert 0.1 * limit < most < 1.002 * limit
