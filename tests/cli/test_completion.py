"""What a shell offers behind a verb: files that it reads, buses, makes of drives, keys."""

from __future__ import annotations

from pathlib import Path

import pytest

from duoglide.cli.completion import buses, can_interfaces, files
from duoglide.cli.main import run
from duoglide.machine.drive_profiles import PROFILES


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("plan.mcap", "notes.txt", "cell.toml", "part.nc", "maker.EDS", "sub/run.mcap"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)


def offered(
    line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> list[str]:
    """Return what bash would be offered for the last word of a line."""
    monkeypatch.setenv("_DUOGLIDE_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(len(line.split(" ")) - 1))
    capsys.readouterr()
    with pytest.raises(SystemExit):
        run([])
    return capsys.readouterr().out.split()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("duoglide stream p", ["plan.mcap"]),
        ("duoglide stream s", ["sub/run.mcap"]),
        ("duoglide log ", ["plan.mcap", "sub/"]),
        ("duoglide check p", ["part.nc"]),
        ("duoglide status --machine c", ["cell.toml"]),
        ("duoglide drives probe --eds m", ["maker.EDS"]),
        ("duoglide jog 0,1,0 --bus v", ["virtual"]),
        ("duoglide machine --profile ", list(PROFILES)),
        ("duoglide machine --explain drives.cy", ["drives.cycle"]),
        ("duoglide ho", ["home"]),
    ],
)
def test_words_are_completed(
    line: str,
    words: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert offered(line, monkeypatch, capsys) == words


def test_interfaces_of_this_computer_are_among_the_buses(tmp_path: Path) -> None:
    for name, kind in (("can0", "280"), ("eth0", "1"), ("vcan0", "280")):
        (tmp_path / "net" / name).mkdir(parents=True)
        (tmp_path / "net" / name / "type").write_text(f"{kind}\n")
    assert can_interfaces(tmp_path / "net") == ["socketcan:can0", "socketcan:vcan0"]
    assert can_interfaces(tmp_path / "none") == []
    assert "udp:239.74.163.2:43113" in buses("")


def test_a_folder_that_is_not_there_offers_nothing() -> None:
    assert files(".mcap")("none/p") == []
    assert files(".mcap")("sub/") == ["sub/run.mcap"]
