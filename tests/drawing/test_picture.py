from __future__ import annotations

import resource
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

import duoglide as dg
from duoglide.drawing.notebook import notebook_html
from duoglide.drawing.picture import COLOURS, CURVE, LIMIT, LOST, drawn, save
from duoglide.drawing.section import draw_section

PNG = b"\x89PNG"


def test_a_picture_is_written_in_the_form_that_its_name_ends_in(tmp_path: Path) -> None:
    with drawn((2.0, 1.0)) as figure:
        figure.subplots().plot([0.0, 1.0], [0.0, 1.0])
    for name, start in (("a.png", PNG), ("a.pdf", b"%PDF"), ("a.svg", b"<?xml")):
        save(figure, tmp_path / name)
        assert (tmp_path / name).read_bytes().startswith(start)
    with pytest.raises(dg.InputError, match=r"must end in one of .*\.png"):
        save(figure, tmp_path / "a.docx")
    with pytest.raises(dg.LogError, match="cannot write"):
        save(figure, tmp_path / "none" / "a.png")


@pytest.mark.parametrize("suffix", ["pdf", "png", "svg"])
def test_a_picture_for_which_there_is_no_room_is_no_file(suffix: str, tmp_path: Path) -> None:
    with drawn((3.0, 2.0)) as figure:
        figure.subplots().plot([0.0, 1.0])
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))  # fails as a full disk does
    try:
        with pytest.raises(dg.LogError, match="cannot write"):
            save(figure, tmp_path / f"picture.{suffix}")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not list(tmp_path.iterdir())


def test_a_picture_shows_itself_in_a_notebook_and_leaves_matplotlib_as_it_was() -> None:
    before = dict(mpl.rcParams)
    with drawn((2.0, 1.0)) as figure:
        figure.subplots()
    assert isinstance(figure, Figure)
    assert figure._repr_png_().startswith(PNG)
    assert dict(mpl.rcParams) == before


def test_a_notebook_table_escapes_what_it_holds() -> None:
    page = notebook_html("a <b>", [[("log", "<script>.mcap"), ("cycles", "3")]])
    assert "<script>" not in page
    assert "&lt;script&gt;.mcap" in page
    assert page.count("<tr>") == 2


@pytest.mark.parametrize(("height", "shown"), [(302.0, (252.0, 368.0)), (170.0, (90.0, 250.0))])
def test_only_the_part_of_the_reach_around_the_path_is_drawn(
    height: float, shown: tuple[float, float]
) -> None:
    """Below the circle of legs flat is another workspace, which the machine cannot get to."""
    machine = dg.Machine.default()
    with drawn((3.0, 3.0)) as figure:
        axes = figure.subplots()
        draw_section(axes, machine, (45.0, 0.0, height))
    field, *_ = [child for child in axes.get_children() if hasattr(child, "levels")]
    vertices = np.concatenate([path.vertices for path in field.get_paths() if len(path.vertices)])
    above = vertices[np.abs(vertices[:, 0] - 45.0) < 3.0, 1]
    low, high = shown
    assert low - 4.0 < above.min() < above.max() < high + 4.0


def test_carriages_have_one_colour_each_everywhere_and_nothing_else_has_it() -> None:
    from duoglide.kinematics.export import COLOURS as BODIES
    from duoglide.paper.figures.robot import KEY
    from duoglide.paper.figures.surfaces import COLOURS as SURFACES
    from duoglide.paper.figures.surfaces import WORKSPACE
    from duoglide.viewer.mechanism import CARRIAGES, LINK_COLOURS

    assert [colour for name, colour in KEY if name.startswith("carriage")] == list(COLOURS)
    for number, colour in enumerate(COLOURS, start=1):
        channels = tuple(bytes.fromhex(colour.removeprefix("#")))
        assert CARRIAGES[number - 1] == channels
        assert BODIES[f"carriage_{number}"] == pytest.approx(
            [c / 255.0 for c in channels], abs=2e-3
        )
        assert LINK_COLOURS["strut" if number == 3 else f"leg {number}"] == channels
    others = {*SURFACES.values(), WORKSPACE, CURVE, LOST, LIMIT}
    others |= {colour for name, colour in KEY if not name.startswith("carriage")}
    assert not others & set(COLOURS)
