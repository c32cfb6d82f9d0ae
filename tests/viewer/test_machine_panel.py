"""What the page shows of a machine, without a browser."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("viser")

from duoglide.viewer.machine_panel import MachinePanel


class Broken:
    """A machine whose state cannot be asked for, through a mistake in a program."""

    @property
    def current_run(self) -> object:
        """Fail as a mistake does."""
        raise KeyError("no such state")


def test_a_page_that_cannot_look_any_more_does_not_show_the_past_as_the_present() -> None:
    rounds = iter([False, True])
    closed = SimpleNamespace(wait=lambda _: next(rounds))
    panel: Any = SimpleNamespace(
        _robot=Broken(), _closed=closed, _state=SimpleNamespace(content="| 1 | enabled | 0.0 |")
    )
    MachinePanel._watch(panel)
    assert panel._state.content.startswith("**KeyError.**")
