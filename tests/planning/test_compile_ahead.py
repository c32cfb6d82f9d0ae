from __future__ import annotations

import subprocess
import sys
from typing import Any

import pytest

from duoglide.kinematics import compiled
from duoglide.planning import compile_ahead

AHEAD = """
import duoglide as dg
from duoglide.planning import compile_ahead
from duoglide.planning.braking import kernel as _brake_kernel
from duoglide.planning.braking import led_kernel as _led_kernel
from duoglide.planning.braking import carriage_bounds as _carriage_bounds
from duoglide.kinematics.headroom import nearby_kernel as _nearby_kernel
from duoglide.planning.stops import kernel as _stopping_kernel
compile_ahead.main()
loops = [
    _brake_kernel.spread, _carriage_bounds.through_links, _nearby_kernel.swing,
    _stopping_kernel.find_largest_slopes, _stopping_kernel.fill_windows, _led_kernel.follow,
]
before = [loop.signatures for loop in loops]
dg.plan(dg.Machine.default(), dg.pick_and_place((-41, -60, 295), (-41, 60, 295), lift=25)).audit()
print(all(before), before == [loop.signatures for loop in loops])
"""


def test_what_is_compiled_ahead_is_what_a_plan_needs() -> None:
    said = subprocess.run(
        [sys.executable, "-c", AHEAD], capture_output=True, text=True, check=True, timeout=600
    )
    assert said.stdout.split() == ["True", "True"]


class Process:
    """A process that knows whether it has been ended and waited for."""

    def __init__(self) -> None:
        self.done: list[str] = []

    def kill(self) -> None:
        self.done.append("killed")

    def wait(self) -> None:
        self.done.append("waited for")


@pytest.mark.parametrize("there", [False, True])
def test_a_process_is_started_only_where_something_is_missing_and_left_to_nobody(
    monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    started: list[Process] = []

    def start(words: Any, **_: Any) -> Process:
        started.append(Process())
        return started[-1]

    monkeypatch.setattr(compiled, "kept", lambda loop: there)
    monkeypatch.setattr(subprocess, "Popen", start)
    with pytest.raises(ValueError, match="bad path"), compile_ahead.beside():
        raise ValueError("bad path")
    assert [process.done for process in started] == ([] if there else [["killed", "waited for"]])


def test_without_another_process_the_plan_is_made_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise OSError("no more processes")

    monkeypatch.setattr(compiled, "kept", lambda loop: False)
    monkeypatch.setattr(subprocess, "Popen", fail)
    with compile_ahead.beside():
        pass
