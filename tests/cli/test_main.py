from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import threading
import warnings
from pathlib import Path

import can
import pytest
import typer

import duoglide as dg
from duoglide.cli.main import app, run
from duoglide.drives.bus import listen
from duoglide.drives.bus.buses import open_bus
from duoglide.planning import compile_ahead
from duoglide.storage import LogKind, LogWriter

PICK = ["--pick", "-41,-60,300", "--place", "-41,60,300"]
VERBS = sorted(typer.main.get_command(app).commands)  # type: ignore[attr-defined]  # a group


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str], code: int = 1) -> str:
    """Run a command that must fail; return its few short lines on stderr as one."""
    assert run(arguments) == code
    captured = capsys.readouterr()
    lines = captured.err.strip().splitlines()
    lines = [line for line in lines if line != "compiling kernels (once)"]  # an empty cache
    assert 1 <= len(lines) <= 3, captured.err
    fits = [len(line) <= 80 or len(line.split()) == 1 for line in lines]  # a path is not cut
    assert all(fits), captured.err
    assert lines[0].startswith("duoglide: ")
    assert "Traceback" not in captured.out + captured.err
    return " ".join(line.strip() for line in lines)


def test_frames_are_not_replayed_into_a_bus_that_another_host_is_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listen, "_ALONE_PATIENCE", 0.1)
    (tmp_path / "frames.log").write_text("(1.0) can0 201#0F0000000000\n(1.1) can0 000#0100\n")
    over = threading.Event()

    def command() -> None:
        with open_bus("inprocess:taken") as host:
            while not over.wait(0.01):
                host.send(can.Message(arbitration_id=0x080, is_extended_id=False))

    with open_bus("inprocess:taken") as witness:
        other = threading.Thread(target=command)
        other.start()
        try:
            assert run(["replay", "frames.log", "--bus", "inprocess:taken"]) == 1
        finally:
            over.set()
            other.join()
        heard = {frame.arbitration_id for frame in iter(lambda: witness.recv(0.0), None)}
    assert "another host is on it, its SYNC is heard" in capsys.readouterr().err
    assert heard == {0x080}, "nothing was sent"


@pytest.mark.parametrize("suffix", [".mf4", ".csv", ".db"])
def test_a_log_of_another_kind_hears_which_kinds_are_read(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / f"x{suffix}"
    file.write_text("MDF     4.10")
    words = refused(["replay", file.name], capsys)
    assert "is not a log" in words
    assert "raw frames are read from .log, .asc, .blf, .trc" in words


def test_every_verb_has_help_with_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    for verb in VERBS:
        assert run([verb, "--help"]) == 0
        out = capsys.readouterr().out
        assert f"duoglide {verb}" in out.split("Examples:")[1], verb
    assert set(VERBS) >= {
        "check", "demo", "drives", "figures", "log", "machine", "plan", "replay", "stream", "view",
        "workspace",
    }  # fmt: skip


def test_help_and_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--version"]) == 0
    assert dg.__version__ in capsys.readouterr().out
    assert run(["--help"]) == 0
    assert run([]) == 2
    assert "Usage" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["paln"], "Did you mean"),
        (["plan"], "PROGRAM"),
        (["plan", "--pick", "1,2,3"], "--place"),
        (["plan", "--pick", "1,2", "--place", "1,2,3"], "x,y,z"),
        (["plan", "--pick", "one,2,3", "--place", "1,2,3"], "'one' is no number"),
        (["plan", "--pick", "nan,2,3", "--place", "1,2,3"], "not finite"),
        (["plan", *PICK, "--lift", "high"], "--lift"),
        (["plan", *PICK, "--tolerance", "inf"], "--tolerance"),
        (["plan", "--nonsense"], "--nonsense"),
        (["check", "program.toml", *PICK], "do not go with"),
        (["stream"], "plan"),
        (["stream", "plan.mcap", "--override", "0"], "above 0"),
        (["replay", "run.mcap", "--override", "150"], "at most 100"),
        (["view", "--port", "99999"], "65535"),
    ],
)
def test_wrong_use_is_a_short_answer_and_code_2(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    line = refused(arguments, capsys, code=2)
    assert words.lower() in line.lower()  # some typer writes the name of an argument in capitals
    assert "--help" in line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["plan", "none.toml"], "none.toml"),
        (["plan", *PICK, "--machine", "none.toml"], "none.toml"),
        (["plan", *PICK, "--lift", "-1"], "lift"),
        (["plan", "--pick", "-41,-60,300", "--place", "-41,60,390"], "reach"),
        (["plan", "--pick", "-41,-60,300", "--place", "-41,260,300"], "carriage 2"),
        (["check", "--pick", "0,0,240", "--place", "0,50,300"], "legs_flat"),
        (["stream", "none.mcap"], "none.mcap"),
        (["replay", "none.mcap"], "none.mcap"),
        (["replay", "none.log", "--bus", "udp:239.0.0.9:43999"], "none.log"),
        (["replay", "frames.log"], "--bus"),
        (["log", "none.mcap"], "none.mcap"),
        (["drives", "--bus", "none"], "unknown bus 'none'"),
        (["drives", "--scenario", "none.toml"], "cannot read scenario none.toml"),
        (["machine", "none.toml"], "none.toml"),
        (["plan", *PICK, "--out", "none/plan.mcap"], "none/plan.mcap"),
        (["plan", *PICK, "--picture", "plan.docx"], "docx"),
    ],
)
def test_what_cannot_be_done_is_a_short_answer_and_code_1(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert words in refused(arguments, capsys)


def test_a_refused_plan_leaves_nothing_behind(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "plan.mcap").write_bytes(b"the old plan")
    refused(["plan", "--pick", "-41,-60,300", "--place", "-41,60,390"], capsys)
    assert [file.name for file in tmp_path.iterdir()] == ["plan.mcap"]
    assert (tmp_path / "plan.mcap").read_bytes() == b"the old plan"


@pytest.mark.parametrize("content", [b"", b"rubbish", b"\x89MCAP0\r\n" + bytes(200)])
def test_broken_files_are_refused(content: bytes, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("x.mcap", "x.toml", "x.csv", "x.gcode", "x.log"):
        Path(name).write_bytes(content)
    for arguments in (
        ["log", "x.mcap"],
        ["stream", "x.mcap"],
        ["replay", "x.mcap"],
        ["plan", "x.toml"],
        ["plan", "x.csv"],
        ["plan", "x.gcode"],
        ["plan", *PICK, "--machine", "x.toml"] if content else ["log", "x.mcap"],
    ):
        assert "x." in refused(arguments, capsys)


def test_a_machine_file_with_an_error_names_the_key(capsys: pytest.CaptureFixture[str]) -> None:
    Path("cell.toml").write_text("[geometry]\nleg_lenght = 160\n")
    assert "geometry.leg_length" in refused(["machine", "cell.toml"], capsys)
    Path("cell.toml").write_text('clearance = "wide"\n')
    assert "clearance" in refused(["check", *PICK, "--machine", "cell.toml"], capsys)


def test_a_machine_file_is_written_once_and_read_back(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["machine", "--out", "cell.toml"]) == 0
    assert dg.Machine.load("cell.toml").to_dict() == dg.Machine.default().to_dict()
    capsys.readouterr()
    assert "--force" in refused(["machine", "--out", "cell.toml"], capsys)
    assert run(["machine", "cell.toml", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["clearance"] == 2.0


def test_check_explains_in_words_and_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", *PICK]) == 0
    out = capsys.readouterr().out
    assert "the machine can follow this path" in out
    assert "of rail left to carriage 1" in out
    assert run(["check", *PICK, "--json"]) == 0
    numbers = json.loads(capsys.readouterr().out)
    assert numbers["accepted"]
    assert numbers["least"]["clearance"]["margin"] > 2.0
    refusal = ["check", "--pick", "-41,0,300", "--place", "-41,0,390", "--json"]
    assert run([*refusal, "--picture", "path.png"]) == 1
    captured = capsys.readouterr()
    assert not json.loads(captured.out)["accepted"]
    assert captured.err == "", "a refusal is said once"
    assert Path("path.png").stat().st_size > 10_000, "where it fails is drawn"


def test_plan_writes_what_log_and_python_read(capsys: pytest.CaptureFixture[str]) -> None:
    Path("program.csv").write_text("x,y,z\n-41,-50,300\n-41,50,300\n")
    assert run(["plan", "program.csv", "--json"]) == 0
    numbers = json.loads(capsys.readouterr().out)
    assert numbers["duration"] == dg.Trajectory.load("plan.mcap").duration
    assert max(map(max, numbers["use"].values())) <= 1.001
    assert 2.0 - 1e-6 < numbers["braking_clearance"] <= numbers["least_clearance"] + 0.01
    assert run(["log", "plan.mcap"]) == 0
    assert "a plan" in capsys.readouterr().out
    assert run(["log", "plan.mcap", "--csv", "plan.csv", "--picture", "log.png"]) == 0
    assert Path("log.png").stat().st_size > 10_000
    capsys.readouterr()  # says how long it took on a slow computer
    assert Path("plan.csv").read_text().startswith("path_time_s,x_mm")
    assert "not a run" in refused(["replay", "plan.mcap"], capsys)
    assert "take the place" in refused(["stream", "plan.mcap", "--log", "plan.mcap"], capsys)


@pytest.mark.parametrize("brake_safe", [True, False])
def test_plan_tells_the_clearance_while_braking_where_it_is_known(
    brake_safe: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    flags = [] if brake_safe else ["--no-brake-safe"]
    assert run(["plan", "--pick", "-41,0,300", "--place", "-41,40,300", *flags]) == 0
    assert ("while braking" in capsys.readouterr().out) is brake_safe


def test_a_torn_log_is_summarised_with_a_warning(capsys: pytest.CaptureFixture[str]) -> None:
    with LogWriter("torn.mcap", LogKind.RUN) as log:
        log.attach("machine", dg.Machine.default().to_dict())
        log.attach("filler", ["x"] * 1000)
        log.flush()
    file = Path("torn.mcap")
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        assert run(["log", "torn.mcap"]) == 0
    captured = capsys.readouterr()
    assert "missing" in captured.out
    assert captured.err.startswith("duoglide: warning: torn.mcap: the log")


def test_a_missing_extra_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["plan", "--pick", "-41,0,300", "--place", "-41,40,300"]) == 0
    capsys.readouterr()
    for module in ("pyarrow", "pyarrow.parquet", "viser", "rerun", "rosbags", "rosbags.rosbag2"):
        monkeypatch.setitem(sys.modules, module, None)
    assert "duoglide[parquet]" in refused(["log", "plan.mcap", "--parquet", "p.parquet"], capsys)
    assert "duoglide[rerun]" in refused(["log", "plan.mcap", "--rerun", "plan.rrd"], capsys)
    assert "duoglide[ros2]" in refused(["log", "plan.mcap", "--ros2", "bag"], capsys)
    assert "duoglide[view]" in refused(["view", "--port", "0"], capsys)
    assert "duoglide[view]" in refused(["stream", "plan.mcap", "--view", "0"], capsys)
    assert sorted(path.name for path in Path().iterdir()) == ["plan.mcap"]


def test_a_page_that_cannot_be_served_is_refused_before_anything_gets_power(
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("viser")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        line = refused(["stream", "plan.mcap", "--view", port], capsys)
    assert f"cannot serve the page on port {port}" in line
    assert "virtual bus" not in line


def test_the_workspace_is_measured(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["workspace", "--json", "--picture", "workspace.svg"]) == 0
    numbers = json.loads(capsys.readouterr().out)
    assert numbers["depth"] == pytest.approx(67.7, abs=0.1)  # PAPER.md: deepest point (-41, 302)
    assert Path("workspace.svg").stat().st_size > 10_000


def test_a_reader_that_leaves_is_no_traceback() -> None:
    command = f"{sys.executable} -m duoglide.cli machine --json | head -n 1"
    done = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, timeout=600, check=True
    )
    assert done.stdout == "{\n"
    assert done.stderr == ""


def test_an_interrupt_while_the_verbs_are_put_together_is_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(app: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(typer.main, "get_command", interrupted)
    assert refused(["status"], capsys, code=130) == "duoglide: interrupted"


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams_are_no_traceback(closed: str) -> None:
    command = f"{sys.executable} -m duoglide.cli machine --out cell.toml --force {closed}"
    done = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, timeout=600, check=True
    )
    assert done.stderr == ""
    assert dg.Machine.load("cell.toml").to_dict() == dg.Machine.default().to_dict()


def test_a_name_that_the_terminal_cannot_show_is_no_traceback() -> None:
    name = os.fsdecode(b"caf\xff.toml")
    command = [sys.executable, "-m", "duoglide.cli", "machine", "--out", name]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=True)
    assert "caf" in done.stdout
    assert Path(name).exists()


@pytest.mark.parametrize(
    "command",
    [
        ["plan", "points.csv", "--out", "./points.csv"],
        ["log", "points.csv", "--csv", "points.csv"],
        ["log", "points.csv", "--foxglove", "points.csv"],
    ],
)
def test_no_output_takes_the_place_of_what_is_read(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    text = "-41,0,300\n-41,10,300\n"
    Path("points.csv").write_text(text)
    assert "take the place" in refused(command, capsys)
    assert Path("points.csv").read_text() == text


@pytest.mark.parametrize("content", [None, b"", b"text"])
def test_the_page_does_not_open_with_a_file_that_is_no_log(
    content: bytes | None, capsys: pytest.CaptureFixture[str]
) -> None:
    if content is not None:
        Path("some.mcap").write_bytes(content)
    assert "some.mcap" in refused(["view", "some.mcap", "--port", "0"], capsys)


def test_a_folder_that_is_not_ours_is_refused_before_the_work(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda folder, mode: False)  # root may write everywhere
    assert "no permission" in refused(["plan", *PICK, "--out", "plan.mcap"], capsys)


def test_help_is_the_same_where_python_drops_docstrings() -> None:
    code = (
        "from duoglide.cli.main import run, start; assert (start.__doc__ is None) != __debug__;"
        f"[run([*verb, '--help']) for verb in [[], *([name] for name in {VERBS!r})]]"
    )
    with_docstrings, without = (
        subprocess.run(
            [sys.executable, *options, "-c", code], capture_output=True, text=True, check=True
        ).stdout
        for options in ([], ["-OO"])
    )
    assert with_docstrings.count("Usage:") == len(VERBS) + 1
    assert without == with_docstrings


def test_help_loads_no_heavy_library() -> None:
    code = (
        "import sys; from duoglide.cli.main import run; run(['--help']);"
        "print('loaded', *sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.splitlines()[-1].split())
    assert "typer" in loaded
    heavy = {"can", "canopen", "matplotlib", "numba", "numpy", "ruckig", "scipy", "toppra", "viser"}
    assert not loaded & heavy


def test_a_plan_that_is_there_is_kept_unless_it_is_forced(
    capsys: pytest.CaptureFixture[str],
) -> None:
    move = ["plan", "--pick", "-41,0,300", "--place", "-41,40,300"]
    assert run([*move, "--picture", "plan.png"]) == 0
    assert "picture: plan.png" in capsys.readouterr().out
    first = Path("plan.mcap").read_bytes()
    for arguments in (
        move,
        ["stream", "plan.mcap", "--log", "kept.mcap"],
        ["log", "plan.mcap", "--csv", "kept.mcap"],
        ["log", "plan.mcap", "--foxglove", "kept.mcap"],
    ):
        Path("kept.mcap").write_bytes(first)
        assert "--force" in refused(arguments, capsys)
        assert Path("kept.mcap").read_bytes() == Path("plan.mcap").read_bytes() == first
    assert run([*move, "--force"]) == 0
    Path("notes.txt").write_text("mine")
    capsys.readouterr()
    assert "neither a plan nor a run" in refused([*move, "--out", "notes.txt", "--force"], capsys)
    assert Path("notes.txt").read_text() == "mine"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["plan", *PICK, "--machine", "cell.toml", "--out", "cell.toml"], "what is read"),
        (["plan", *PICK, "--out", "plan.png", "--picture", "plan.png"], "take the place"),
        (["log", "run.mcap", "--csv", "table", "--parquet", "./table"], "another file"),
        (["log", "run.mcap", "--compare", "other.mcap", "--csv", "other.mcap"], "what is read"),
    ],
)
def test_outputs_are_judged_together_before_anything_is_read(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert words in refused(arguments, capsys)


def test_a_full_disk_is_told_before_the_work(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    full = os.statvfs_result((4096, 4096, 100, 0, 0, 0, 0, 0, 0, 255))
    monkeypatch.setattr(os, "statvfs", lambda folder: full)
    assert "disk is full, 0 KiB" in refused(["plan", *PICK, "--out", "plan.mcap"], capsys)


@pytest.mark.parametrize(
    "arguments",
    [
        ["check", "--pick", "-41,-60,300", "--place", "-41,60,390"],
        ["check", "--pick", "-41,-60,300", "--place", "-41,260,300"],
        ["check", "--pick", "0,0,240", "--place", "0,50,300"],
        ["check", "--point=-41,-152.5,290", "--point=-41,152.5,290"],
        ["check", "--point=0,0,300", "--point=187.28,0,250"],
        ["status", "--bus", "nowhere"],
    ],
)
def test_long_refusals_are_three_short_lines(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    refused(arguments, capsys)


def test_whatever_is_printed_fits_eighty_columns(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for arguments in (
        *([verb, "--help"] for verb in VERBS),
        ["check", *PICK, "--picture", "path.png"],
        ["plan", *PICK],
        ["log", "plan.mcap"],
        ["machine"],
    ):
        assert run(arguments) == 0
        printed = capsys.readouterr().out
        assert printed
        assert not [line for line in printed.splitlines() if len(line) > 80], arguments


def test_picks_are_counted_only_where_there_are_picks(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["plan", *PICK]) == 0
    assert "picks a minute" in capsys.readouterr().out
    line = ["plan", "--point=-41,-40,300", "--point=-41,40,300", "--out", "line.mcap"]
    assert run([*line, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["picks_per_minute"] is None
    assert run([*line, "--force"]) == 0
    assert "a minute" not in capsys.readouterr().out


def test_a_first_plan_says_that_kernels_are_compiled(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run(["plan", *PICK]) == 0
    assert "compiling" not in capsys.readouterr().err
    monkeypatch.setattr(compile_ahead, "ready", lambda: False)
    monkeypatch.setattr(compile_ahead, "_start", lambda: None)
    assert run(["plan", *PICK, "--force"]) == 0
    assert capsys.readouterr().err.startswith("compiling kernels (once)\n")


def test_the_package_is_a_command_too() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "duoglide", "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout == f"duoglide {dg.__version__}\n"


def test_a_demo_that_is_interrupted_while_it_plans_leaves_no_empty_folder(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("duoglide.cli.verbs.demo._plan", interrupt)
    before = set(Path.cwd().iterdir())
    assert run(["demo"]) == 130
    assert set(Path.cwd().iterdir()) == before
    (tmp_path / "mine").mkdir()
    assert run(["demo", "--out", str(tmp_path / "mine")]) == 130
    assert (tmp_path / "mine").is_dir(), "a folder that was there stays"
    assert capsys.readouterr().err.count("interrupted") == 2


def test_a_program_that_is_not_there_is_named_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "none.toml"]) == 1
    said = capsys.readouterr().err
    assert said == "duoglide: cannot read program none.toml: No such file or directory\n"


def test_usage_has_no_brackets_twice(capsys: pytest.CaptureFixture[str]) -> None:
    for verb in ("plan", "check"):
        assert run([verb, "--help"]) == 0
        assert "[[" not in capsys.readouterr().out
