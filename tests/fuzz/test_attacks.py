"""The rows of the fault matrix that need no drives: tampered files, and attacks on the page.

``tests/benchmarks/fault_matrix.py`` prints all of them, with those of the bus, drives and host.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import file_attacks
import pytest

import duoglide as dg

pytest.importorskip("viser")

import page_attacks

from duoglide.viewer.page import Page

pytestmark = pytest.mark.filterwarnings(
    "ignore::DeprecationWarning", "ignore::ResourceWarning", "ignore::UserWarning:viser"
)


@pytest.mark.parametrize("name", file_attacks.REFUSED)
def test_a_tampered_file_is_refused_by_an_error_of_ours(name: str, tmp_path: Path) -> None:
    with pytest.raises(dg.DuoglideError) as refused:
        file_attacks.REFUSED[name](tmp_path)
    assert 10 < len(str(refused.value)) < 1000


@pytest.mark.parametrize("name", file_attacks.HARMLESS)
def test_what_a_file_promises_is_derived_again(name: str, tmp_path: Path) -> None:
    assert "derived again" in file_attacks.HARMLESS[name](tmp_path)


@pytest.fixture(scope="module")
def target(tmp_path_factory: pytest.TempPathFactory) -> Iterator[page_attacks.Target]:
    folder = tmp_path_factory.mktemp("above") / "page"
    folder.mkdir()
    robot: Any = SimpleNamespace(
        machine=dg.Machine.default(), bus="virtual", homed=False, states=(), carriages=(),
        current_run=None, stops=[], stop=lambda: robot.stops.append(1),
        start=lambda *_, **__: (_ for _ in ()).throw(dg.DriveError("no power")),
    )  # fmt: skip
    with Page(robot.machine, drives=robot, port=0, folder=folder) as page:
        page._motion.trajectory = dg.transfer(robot.machine, (-41, 0, 300), (-41, 5, 300))
        yield page_attacks.Target(page, folder)


@pytest.mark.parametrize("name", page_attacks.REFUSED)
def test_the_page_lets_nobody_do_what_is_not_theirs(
    target: page_attacks.Target, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    before = len(target.page._machine._robot.stops)  # type: ignore[union-attr]
    assert page_attacks.REFUSED[name](target)
    assert len(target.page._machine._robot.stops) == before  # type: ignore[union-attr]
    assert "Traceback" not in capfd.readouterr().err


QUICK = ("page: Stop, dialog open, orders stuck",)  # the others start processes


@pytest.mark.parametrize(
    "name",
    [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in page_attacks.STOPS],
)
def test_stop_arrives_whatever_the_page_does(target: page_attacks.Target, name: str) -> None:
    before = len(target.page._machine._robot.stops)  # type: ignore[union-attr]
    assert page_attacks.STOPS[name](target).startswith("Stop took")
    assert len(target.page._machine._robot.stops) == before + 1  # type: ignore[union-attr]
