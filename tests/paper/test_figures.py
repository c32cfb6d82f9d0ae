from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import duoglide as dg
from duoglide.drawing.picture import save
from duoglide.errors import ConfigError
from duoglide.kinematics.modes import WORKING
from duoglide.kinematics.workspace import analyse
from duoglide.paper.elimination import Family, Space, Surface, surfaces
from duoglide.paper.figures import mechanism_plates, surface_plates
from duoglide.paper.figures.interactive import interactive_page
from duoglide.paper.figures.joint_space import joint_space_panels
from duoglide.paper.figures.plates import Plate, Solid
from duoglide.paper.figures.raster import paint_panels
from duoglide.paper.figures.scene import View, page_box
from duoglide.paper.figures.surfaces import COLOURS, workspace_curves, workspace_panels
from duoglide.paper.figures.write import FIGURES, write_figures
from duoglide.viewer.workspace_picture import plot_workspace

TABLE_1 = dg.Geometry()
PNG = b"\x89PNG"
NAMES = {
    "legs vertical": Family.LEGS_VERTICAL,
    "strut": Family.STRUT,
    "legs parallel": Family.LEGS_PARALLEL,
    "legs flat": Family.LEGS_FLAT,
    "arm in line with strut (case 2)": Family.ARM_STRUT,
    "arm flat": Family.ARM_FLAT,
}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Path], list[str]]:
    """Two of the figures, drawn coarsely, and what progress was told."""
    told: list[str] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("duoglide.paper.figures.write.FIGURES", (FIGURES[0], FIGURES[6]))
        patch.setattr("duoglide.paper.figures.scene.IMAGE", 120)
        files = write_figures(
            tmp_path_factory.mktemp("out") / "figures",
            TABLE_1,
            lambda name, done, total: told.append(f"{name} {done}/{total}"),
        )
    return files, told


def test_every_figure_is_written_for_print_and_screen(
    written: tuple[list[Path], list[str]],
) -> None:
    files, _ = written
    names = {file.name for file in files}
    for number in (2, 9):
        assert {f"figure_{number:02d}.pdf", f"figure_{number:02d}.png"} <= names
    for file in files:
        start = file.read_bytes()[:4]
        assert {".pdf": start == b"%PDF", ".png": start == PNG}.get(file.suffix, True)
        assert file.stat().st_size > 500


def test_progress_names_each_figure(written: tuple[list[Path], list[str]]) -> None:
    _, told = written
    assert told == ["figure 2 0/3", "figure 9 1/3", "interactive page 2/3"]


def test_the_files_hold_the_captions(written: tuple[list[Path], list[str]]) -> None:
    captions = next(file for file in written[0] if file.name == "captions.md").read_text()
    assert captions.count("**Figure ") == 2
    assert "are parallel to y, as Eq. 10 needs" in captions.replace("\n", " ")


def test_captions_say_what_differs_from_the_paper() -> None:
    plates = {plate.number: plate for plate in (make(TABLE_1) for make in FIGURES)}
    assert sorted(plates) == [2, 4, 5, 6, 7, 8, 9, 10, 11]
    assert all("paper" in plate.caption for plate in plates.values())
    assert "case 2 does not exist" in plates[7].caption
    for words in ("380 <= z <= 550", "39.58 litres"):
        assert words in plates[10].caption


def test_the_page_needs_no_network_and_holds_every_solid_figure() -> None:
    page = interactive_page([make(TABLE_1) for make in FIGURES])
    assert not re.search(r"(src|href)\s*=|https?://|@import|fetch\(", page)
    data = json.loads(re.search(r"const FIGURES = (.*);\n", page)[1])  # type: ignore[index]
    assert len(data) == 9
    assert sum(len(figure["panels"]) for figure in data) >= 20
    assert len(page) < 3e6


@pytest.mark.parametrize(
    "geometry",
    [dg.Geometry(riser_height=15.0, arm_drop=10.0, strut_drop=8.0), dg.Geometry(leg_length=150.0)],
    ids=["riser and drops", "short legs"],
)
def test_figures_of_other_geometries_can_be_made(geometry: dg.Geometry) -> None:
    for make in FIGURES:
        plate: Plate = make(geometry)
        assert plate.panels
        for panel in plate.panels:
            if isinstance(panel, Solid):
                assert np.isfinite(page_box(panel.scene, panel.view)).all()


def test_figure_5_shows_the_six_realisable_solutions_four_of_them_singular() -> None:
    titles = [panel.title for panel in mechanism_plates.figure_5(TABLE_1).panels]
    assert [title.split()[1] for title in titles] == ["1", "2", "5", "6", "7", "8"]
    assert sum("singular" in title for title in titles) == 4
    assert "246.92" in titles[2]


def test_free_motion_is_along_the_null_space_of_the_jacobian() -> None:
    (pose,) = mechanism_plates._case_2_pose(TABLE_1)
    free = mechanism_plates.free_motion(TABLE_1, pose, WORKING)
    assert np.abs(dg.jacobian(TABLE_1, pose) @ free).max() < 1e-6


@pytest.mark.parametrize("name", COLOURS)
def test_drawn_surfaces_are_roots_of_the_eliminated_polynomials(name: str) -> None:
    found = eliminated()
    in_space = found[NAMES[name], Space.CARRIAGES]
    points = joint_space_panels(TABLE_1, (name,), 360.0)[0].corners.reshape(-1, 3)
    assert np.abs(points).max() <= 360.0 + 1e-6
    relative = [np.abs(v) / _size(in_space, points) for v in in_space.values(*points.T)]
    assert np.min(relative, axis=0).max() < 1e-4  # tips are interpolated
    for curve in workspace_curves(TABLE_1):
        if curve.family == name:
            plane = found[NAMES[name], Space.WORKSPACE]
            relative = [np.abs(v) / 1e10 for v in plane.values(*curve.points.T)]
            assert np.min(relative, axis=0).max() < 1e-6


@cache
def eliminated() -> dict[tuple[Family, Space], Surface]:
    return {(s.family, s.space): s for s in surfaces(TABLE_1)}


def _size(surface: Surface, points: np.ndarray) -> float:
    """Typical size of a polynomial's value, to hold a root against."""
    values = surface.values(*(points + 20.0 * np.array([1.0, -2.0, 3.0])).T)
    return float(np.max([np.abs(np.broadcast_to(v, len(points))).max() for v in values]))


def test_the_drawn_workspace_holds_carriages_at_the_ends_of_their_rails() -> None:
    corners = workspace_panels(TABLE_1).corners.reshape(-1, 3)
    inside = corners[dg.reachable(TABLE_1, corners)]
    assert len(inside) > 0.9 * len(corners)
    reach = np.abs(dg.inverse(TABLE_1, inside)).max(axis=1)
    assert reach.max() < 360.0 + 1e-3
    assert (reach > 359.9).mean() > 0.3


def test_translucent_neighbours_show_no_seam_and_the_nearer_panel_covers() -> None:
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    left = np.column_stack([square, np.zeros(4)])
    right = left + np.array([1.0, 0.0, 0.0])
    red, blue = [1.0, 0.0, 0.0, 0.5], [0.0, 0.0, 1.0, 1.0]
    image = paint_panels(np.stack([left, right]), np.array([red, red]), (0, 2, 0, 1), 40)
    assert image.shape == (20, 40, 4)
    assert np.allclose(image[..., 3], 0.5)
    above = left + np.array([0.0, 0.0, 1.0])
    for order in ([left, above], [above, left]):
        colours = np.array([red, blue] if order[0] is left else [blue, red])
        stacked = paint_panels(np.stack(order), colours, (0, 1, 0, 1), 10)
        assert np.allclose(stacked, blue)


def test_panels_that_cut_each_other_are_sorted_in_every_pixel() -> None:
    flat = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    tilted = flat + np.array([[0, 0, -1], [0, 0, 1], [0, 0, 1], [0, 0, -1]])
    colours = np.array([[1.0, 0, 0, 1], [0, 0, 1.0, 1]])
    image = paint_panels(np.stack([flat, tilted]), colours, (0, 1, 0, 1), 20)
    assert (image[:, :9, 0] == 1.0).all()
    assert (image[:, 11:, 2] == 1.0).all()


def test_a_view_is_a_rotation() -> None:
    basis = View(31.0, -17.0).basis
    assert basis @ basis.T == pytest.approx(np.eye(3))
    assert np.linalg.det(basis) == pytest.approx(1.0)


def test_the_workspace_picture_is_written_with_its_report(tmp_path: Path) -> None:
    machine = replace(dg.Machine.default(), clearance=0.0)
    report = analyse(machine, step=6.0)
    save(plot_workspace(machine, report), tmp_path / "workspace.png")
    assert (tmp_path / "workspace.png").read_bytes()[:4] == PNG
    assert report.constraints.carriage_width == 60.0
    assert report.volume > 1e7


def test_a_place_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="cannot write"):
        write_figures(tmp_path / "file" / "figures", TABLE_1)


def test_a_singularity_beyond_reach_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    short = replace(TABLE_1, strut_length=85.0)  # ends before the circle of legs flat, 90 mm away
    assert mechanism_plates._flat_pose(short).shape == (0, 3)
    monkeypatch.setattr(mechanism_plates, "_flat_pose", lambda _: np.empty((0, 3)))
    titles = [panel.title for panel in mechanism_plates.figure_7(TABLE_1).panels]
    assert [title[:3] for title in titles] == ["(a)", "(b)"]


def test_surface_figures_carry_their_key() -> None:
    assert {name for name, _ in surface_plates.figure_9(TABLE_1).key} == set(COLOURS)
