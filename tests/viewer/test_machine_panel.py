"""What the page shows of a machine, without a browser."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("viser")

from duoglide.viewer.door import News
from duoglide.viewer.machine_panel import MachinePanel
from duoglide.viewer.situation import Situation


class Broken:
    """A machine whose state cannot be asked for, through a mistake in a program."""

    @property
    def current_run(self) -> object:
        """Fail as a mistake does."""
        raise KeyError("no such state")


def test_a_page_that_cannot_look_any_more_does_not_show_the_past_as_the_present() -> None:
    rounds, told = iter([False, True]), News()
    panel: Any = SimpleNamespace(
        _robot=Broken(), _closed=SimpleNamespace(wait=lambda _: next(rounds)),
        _state=SimpleNamespace(content="| 1 | enabled | 0.0 |"),
        _allow=lambda situation: told.tell(situation.banner._asdict()),
    )  # fmt: skip
    panel._look = lambda: MachinePanel._look(panel)
    panel._situation = lambda look, blind: Situation(own=True, look=look, blind=blind)
    MachinePanel._watch(panel)
    assert panel._state.content.startswith("**KeyError.**")
    assert "No answer" in told.newest[1]
