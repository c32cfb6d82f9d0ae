from __future__ import annotations

from pathlib import Path

import pytest

import duoglide as dg
from duoglide.control.host.run.run_log import RunLog


def test_a_log_that_fails_at_its_head_leaves_nothing_and_the_old_one(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    file.write_bytes(b"of yesterday")
    plan = {"duration": float("nan")}  # no JSON: the head of the log fails
    with pytest.raises(dg.LogError), RunLog(file, dg.Machine.default(), plan, None, "none"):
        pass
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.mcap"]
    assert file.read_bytes() == b"of yesterday"
