from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.writer import Writer

import duoglide as dg
from duoglide.storage import EventKind, EventRecord, LogKind, LogWriter, Topic
from duoglide.storage.atomic import appearing
from duoglide.storage.head import kind_of
from duoglide.storage.paths import require_replaceable


def ours(kind: LogKind) -> Callable[[Path], object]:
    def write(file: Path) -> None:
        with LogWriter(file, kind) as log:
            log.write(Topic.EVENT, 0.0, EventRecord(EventKind.NOTE, "x"))

    return write


def torn(file: Path) -> None:
    ours(LogKind.RUN)(file)
    file.write_bytes(file.read_bytes()[:-200])


def foreign(file: Path) -> None:
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "someone")
        writer.add_metadata("duoglides", {"kind": "run"})
        writer.finish()


WRITE: dict[str, Callable[[Path], object]] = {
    "nothing": lambda file: None,
    "an empty file": lambda file: file.touch(),
    "text": lambda file: file.write_text("my thesis"),
    "another mcap": foreign,
    "a plan": ours(LogKind.PLAN),
    "a run": ours(LogKind.RUN),
    "a torn run": torn,
}
MAY = {
    LogKind.PLAN: {"nothing", "an empty file", "a plan"},
    LogKind.RUN: {"nothing", "an empty file", "a run", "a torn run"},
    None: {"nothing", "an empty file", "text", "another mcap"},
}


@pytest.mark.parametrize("there", WRITE)
@pytest.mark.parametrize("kind", MAY)
def test_only_a_file_of_its_own_kind_is_replaced(
    there: str, kind: LogKind | None, tmp_path: Path
) -> None:
    file = tmp_path / "file.mcap"
    WRITE[there](file)
    old = file.read_bytes() if file.exists() else None
    if there in MAY[kind]:
        require_replaceable(file, kind)
    else:
        with pytest.raises(dg.LogError, match=r"cannot write .*file\.mcap.*is not replaced"):
            require_replaceable(file, kind)
    assert (file.read_bytes() if file.exists() else None) == old


def test_those_who_write_ask_first(tmp_path: Path) -> None:
    file = tmp_path / "file"
    ours(LogKind.RUN)(file)
    old = file.read_bytes()
    with pytest.raises(dg.LogError, match="there is a run"), appearing(file):
        pass
    with pytest.raises(dg.LogError, match="there is a run"), LogWriter(file, LogKind.PLAN):
        pass
    assert file.read_bytes() == old
    file.write_text("my thesis")
    with pytest.raises(dg.LogError, match="no plan of Duoglide"), LogWriter(file, LogKind.PLAN):
        pass
    assert file.read_text() == "my thesis"
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_a_head_with_any_length_of_record_is_looked_at_without_harm(tmp_path: Path) -> None:
    file = tmp_path / "file.mcap"
    ours(LogKind.RUN)(file)
    whole = file.read_bytes()
    for at in range(9, 17):
        for value in (0x7F, 0xFF):
            file.write_bytes(whole[:at] + bytes([value]) + whole[at + 1 :])
            kind_of(file)
