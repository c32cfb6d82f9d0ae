"""Logs of raw frames: read exactly, or refused with the line."""

from __future__ import annotations

import logging
import zlib
from pathlib import Path

import can
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.cli.main import run
from duoglide.playback.can_log import SUFFIXES, Frame, FrameLog, read_frames

ASC = """\
date Mit Jan 15 10:20:30.123 am 2025
base {base}  timestamps {times}
internal events logged
// version 9.0.0
Begin Triggerblock Mit Jan 15 10:20:30.123 am 2025
   0.000000 Start of measurement
   0.001000 1  80              Tx   d 0
   0.001500 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%
   0.002000 1  {id}             Rx   d 2 {data} Length = 120 BitCount = 62
   0.003000 1  ErrorFrame
   0.004000 1  181x            Rx   d 1 07
End TriggerBlock
"""
HEX = ASC.format(base="hex", times="absolute", id="181", data="10 1F")
TRC = """\
;$FILEVERSION=1.1
;$STARTTIME=43008.5
;---+--   ----+----  --+--  ----+---  +  -+ -- -- -- -- -- -- --
     1)         1.0  Tx         0080  0
     2)         2.5  Rx         0181  2  10 1F
     3)         3.0  Warng  FFFFFFFF  4  00 00 00 08  BUSHEAVY
     4)         4.0  Rx     00000181  1  EC
"""


def read(folder: Path, name: str, content: str | bytes, channel: str | None = None) -> FrameLog:
    file = folder / name
    file.write_bytes(content.encode("latin-1") if isinstance(content, str) else content)
    return read_frames(file, channel)


def test_candump_is_read_exactly(tmp_path: Path) -> None:
    log = read(
        tmp_path,
        "FRAMES.LOG",
        "(1700000000.000100) can0 080#\n\n"
        "(1700000000.000200) can0 7fF#0011223344556677 R\r\n"
        "(1700000000.000300) can0 20000004#0008000000000000\n"
        "(1700000000.000400)  can0  1FFFFFFF#FF T\n"
        "(1700000000.000500) can0 20000080#\n",
    )
    assert list(log) == [
        Frame(1700000000.0001, 0x80, b""),
        Frame(1700000000.0002, 0x7FF, bytes.fromhex("0011223344556677")),
        Frame(1700000000.0004, 0x1FFFFFFF, b"\xff", extended=True),
    ]
    assert (log.channel, log.skipped, len(log)) == ("can0", 2, 3)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("(2.0) can0 FFF#00", "identifier FFF has more than 11 bits"),
        ("(2.0) can0 800#00", "identifier 800 has more than 11 bits"),
        ("(2.0) can0 40000000#00", "identifier 40000000 has more than 29 bits"),
        ("(2.0) can0 80000181#00", "more than 29 bits"),
        ("(2.0) can0 1234#00", "is no frame"),
        ("(2.0) can0 12#00", "is no frame"),
        ("(2.0) can0 0000123#00", "is no frame"),
        ("(2.0) can0 123#0", "is no frame"),
        ("(2.0) can0 123#001122334455667788", "is no frame"),
        ("(2.0) can0 123#0011223344556677_9", "is no frame"),
        ("(2.0) can0 123#00.11", "is no frame"),
        ("(2.0) can0 123#R", "a remote frame; only classic data frames"),
        ("(2.0) can0 123#R8 T", "a remote frame"),
        ("(2.0) can0 123##1001122", "a CAN FD frame"),
        ("(2) can0 123#00", "is no frame"),
        ("(2,0) can0 123#00", "is no frame"),
        ("(-2.0) can0 123#00", "is no frame"),
        ("(0x2.0) can0 123#00", "is no frame"),
        ("(\u0662.0) can0 123#00", "is no frame"),
        ("(9999999999999.0) can0 123#00", "is no frame"),
        (" can0  123   [2]  11 22", "is no frame"),
        ("# a comment", "is no frame"),
        ("(0.9) can0 123#00", r"its time is 0\.1 s before that of the frame it follows"),
        ("(4000.0) can0 123#00", r"its time is 3999 s after that .* the clock was set"),
    ],
)
def test_a_line_of_candump_that_says_something_else_is_refused(
    line: str, why: str, tmp_path: Path
) -> None:
    with pytest.raises(dg.LogError, match=rf"a\.log: line 2: .*{why}"):
        read(tmp_path, "a.log", f"(1.0) can0 080#\n{line}\n".encode())


def test_frames_of_several_interfaces_are_not_merged(tmp_path: Path) -> None:
    text = "(1.0) can0 080#\n(1.1) can1 081#\n(1.2) can0 082#\n(1.3) can1 083##000\n"
    with pytest.raises(dg.LogError, match=r"2 interfaces \(can0: 2, can1: 1\); --channel can0"):
        read(tmp_path, "a.log", text[: text.index("(1.3)")])
    assert [frame.can_id for frame in read(tmp_path, "a.log", text, "can0")] == [0x80, 0x82]
    with pytest.raises(dg.LogError, match="line 4: a CAN FD frame"):
        read(tmp_path, "a.log", text, "can1")
    with pytest.raises(dg.LogError, match=r"no frame of interface can2 \(can0: 2, can1: 2\)"):
        read(tmp_path, "a.log", text, "can2")


def test_small_disorder_keeps_the_order_of_the_file(tmp_path: Path) -> None:
    log = read(tmp_path, "a.log", "(1.0) can0 080#\n(0.9999) can0 081#\n(1.0001) can0 082#\n")
    assert [frame.can_id for frame in log] == [0x80, 0x81, 0x82]


@pytest.mark.parametrize(
    "text", [HEX, ASC.format(base="dec", times="absolute", id="385", data="16 31")]
)
def test_asc_is_read_exactly(text: str, tmp_path: Path) -> None:
    log = read(tmp_path, "a.ASC", text)
    assert log.channel == "1"
    assert log.skipped == 3, "an error frame, a statistic, the start"
    extended = 0x181 if "hex" in text else 181
    assert list(log)[1:] == [
        Frame(0.002, 0x181, b"\x10\x1f"),
        Frame(0.004, extended, b"\x07", extended=True),
    ]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (HEX.replace("absolute", "relative"), "its times count from the line before"),
        (HEX.replace("base hex  timestamps absolute\n", ""), "`base hex` or `base dec`"),
        (HEX.replace(" 181 ", " 881 "), "line 9: identifier 881 has more than 11 bits"),
        (HEX.replace(" 181 ", " Engine "), "line 9: cannot be read: ValueError"),
        (HEX.replace("d 2 10 1F", "d 8 10 1F"), "line 9: cannot be read"),
        (HEX.replace("d 2 10 1F", "d 2 10 11F"), "line 9: cannot be read"),
        (HEX.replace("d 2 10 1F Length = 120 BitCount = 62", "d 2 10"), "1 bytes of data, 2"),
        (HEX.replace(" 181 ", " 1 81 "), "line 9: .* cannot be read as a frame"),
        (HEX.replace("Rx   d 2", "Zx   d 2"), "line 9: .* cannot be read as a frame"),
        (HEX.replace("0.002000", "0,002000"), "line 9: .* cannot be read as a frame"),
        (HEX.replace("0.002000", "0.002.00"), "line 9: .* cannot be read as a frame"),
        (HEX.replace("d 2 10 1F", "r 2"), "line 9: a remote frame"),
        (HEX.replace("   0.001000 1", "   0.003500 1"), r"line 9: its time is 0\.0015 s before"),
        (
            "date Wed Jan 15\nbase hex timestamps absolute\n 0.1 1 80 Tx d 0\n 0.2 1 81 Tx d 0\n",
            "line 3: .* cannot be read as a frame",
        ),
        ("", "holds no frame"),
    ],
)
def test_asc_that_says_something_else_is_refused(text: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(dg.LogError, match=why):
        read(tmp_path, "a.asc", text)


def test_trc_is_read_exactly(tmp_path: Path) -> None:
    log = read(tmp_path, "a.Trc", TRC)
    frames = list(log)
    assert (log.channel, log.skipped) == ("1", 1)
    assert [(frame.can_id, frame.data, frame.extended) for frame in frames] == [
        (0x80, b"", False),
        (0x181, b"\x10\x1f", False),
        (0x181, b"\xec", True),
    ]
    assert [f.stamp - frames[0].stamp for f in frames] == pytest.approx([0, 1.5e-3, 3e-3], abs=1e-6)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (TRC.replace("=1.1", "=1.2"), r"its version '1.2' is not read; 1\.1, 1\.3, 2\.0 and 2\.1"),
        (TRC.replace("2  10 1F", "3  10 1F"), "line 5: .* cannot be read as a frame"),
        (TRC.replace("2  10 1F", "2  10"), "line 5: .* cannot be read as a frame"),
        (TRC.replace("Rx         0181", "??         0181"), "line 5: .* cannot be read as a frame"),
        (TRC.replace(" 0181 ", " 0881 "), "line 5: identifier 881 has more than 11 bits"),
        (TRC.replace("2  10 1F", "2  RTR"), "line 5: a remote frame"),
        (TRC.replace("2.5", "2,5"), "line 5: cannot be read"),
    ],
)
def test_trc_that_says_something_else_is_refused(text: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(dg.LogError, match=why):
        read(tmp_path, "a.trc", text)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.log", "(1.0) can0 123#1122\n(1.1) can0 123#3344\n"),
        ("a.log", "(1.0) can0 123#1122\r\n(1.1) can0 123#3344\r\n"),
        ("a.asc", HEX.removesuffix("End TriggerBlock\n")),
        ("a.trc", TRC),
    ],
)
def test_a_last_line_that_may_be_cut_is_no_shorter_frame(
    name: str, text: str, tmp_path: Path
) -> None:
    whole = list(read(tmp_path, name, text))
    refused = 0
    for size in range(len(text) - 40, len(text)):
        try:
            frames = list(read(tmp_path, name, text[:size]))
        except dg.LogError:
            refused += 1
        else:
            assert frames == whole[: len(frames)], text[:size]
    assert refused > 20
    with pytest.raises(dg.LogError, match=r"line \d+: .* may be cut within it; delete the line"):
        read(tmp_path, name, text.rstrip())


@pytest.fixture
def blf(tmp_path: Path) -> Path:
    file = tmp_path / "frames.blf"
    with can.BLFWriter(file) as writer:
        for n in range(300):
            writer.on_message_received(
                can.Message(
                    timestamp=1.7e9 + 0.001 * n,
                    arbitration_id=n,
                    is_extended_id=False,
                    data=n.to_bytes(2, "big"),
                )
            )
    return file


def test_blf_is_read_exactly(blf: Path) -> None:
    frames = list(read_frames(blf))
    assert [(frame.can_id, int.from_bytes(frame.data, "big")) for frame in frames] == [
        (n, n) for n in range(300)
    ]
    times = [frame.stamp - frames[0].stamp for frame in frames]
    assert times == pytest.approx([0.001 * n for n in range(300)], abs=1e-5)


def test_a_torn_blf_is_refused_at_every_length(blf: Path) -> None:
    whole = blf.read_bytes()
    for told in (len(whole), 0):  # 0: its writer was killed
        head = whole[:16] + told.to_bytes(8, "little") + whole[24:]
        for size in range(0, len(head) - 4, 13):
            blf.write_bytes(head[:size])
            with pytest.raises(dg.LogError, match=r"frames\.blf: it|holds no frame"):
                read_frames(blf)


def test_a_blf_that_grows_without_end_or_has_objects_of_no_size_is_refused(blf: Path) -> None:
    head, packed = blf.read_bytes()[:144], blf.read_bytes()[144 + 32 :]
    whole = zlib.decompress(packed).rstrip(b"\0")

    def container(content: bytes, size: int | None = None) -> bytes:
        packed = zlib.compress(content)
        body = b"\x02\0" + bytes(6) + (size or len(content)).to_bytes(4, "little") + bytes(4)
        length = 16 + len(body) + len(packed)
        start = b"LOBJ\x10\0\x01\0" + length.to_bytes(4, "little") + b"\x0a\0\0\0"
        return start + body + packed + bytes(length % 4)

    endless = b"LOBJ\x20\0\x01\0" + bytes(4) + b"\x01\0\0\0" + bytes(40)
    for content, why in (
        (container(whole[:-10]), "it ends within an object"),
        (container(bytes(100_000_000)), "a container of 100000000 bytes"),
        (container(bytes(100_000_000), 1000), "a container that is cut"),
        (container(endless), "an object of it has 0 bytes"),
        (container(b"rubbish " * 10), "an object of it is damaged"),
        (container(endless.replace(b"LOBJ\x20", b"LOBJ\x20")[:20]), "0 bytes|cut"),
    ):
        blf.write_bytes(head[:16] + bytes(8) + head[24:] + content)
        with pytest.raises(dg.LogError, match=why):
            read_frames(blf)


def test_other_kinds_and_missing_files_are_refused(tmp_path: Path) -> None:
    for name in ("frames.csv", "frames.log.gz", "frames"):
        with pytest.raises(dg.LogError, match=r"are read from \.log, \.asc, \.blf, \.trc only"):
            read_frames(tmp_path / name)
    for suffix in SUFFIXES:
        with pytest.raises(dg.LogError, match=r"cannot read .*none"):
            read_frames(tmp_path / f"none{suffix}")
        (tmp_path / f"folder{suffix}").mkdir()
        with pytest.raises(dg.LogError, match=r"cannot read .*folder"):
            read_frames(tmp_path / f"folder{suffix}")


def test_nothing_is_said_twice_nor_left_behind(tmp_path: Path) -> None:
    with pytest.raises(dg.LogError):
        read(tmp_path, "a.trc", TRC.replace("2  10 1F", "2  10"))
    assert not logging.getLogger("can.io").handlers


def test_nothing_is_sent_before_the_last_line_is_judged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    opened: list[str] = []
    monkeypatch.setattr("duoglide.drives.bus.buses.open_bus", opened.append)
    file = tmp_path / "frames.LOG"
    file.write_text("(1.0) can0 080#\n" * 1000 + "(1.0) can0 FFF#\n")
    assert run(["replay", str(file), "--bus", "inprocess:logs"]) == 1
    assert "line 1001: identifier FFF" in capsys.readouterr().err
    assert not opened


def test_the_command_sends_one_interface_and_counts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "frames.log"
    file.write_text("(1.0) can0 080#\n(1.0) can1 081#11\n(1.0) can1 20000080#\n(1.0) can1 082#\n")
    command = ["replay", str(file), "--bus", "inprocess:logs"]
    with can.Bus("logs", interface="virtual") as bus:
        assert run([*command, "--channel", "can1"]) == 0
        sent = [bus.recv(1.0), bus.recv(1.0)]
        assert bus.recv(0.0) is None
    assert [(m.arbitration_id, bytes(m.data)) for m in sent if m] == [(0x81, b"\x11"), (0x82, b"")]
    said = " ".join(capsys.readouterr().out.split())
    assert "2 frames of can1 sent to inprocess:logs; 1 error frames or status lines" in said
    assert run(command) == 1
    assert "--channel can0" in capsys.readouterr().err
    assert run([*command, "--approach"]) == 2
    assert run(["replay", "run.mcap", "--channel", "can0"]) == 2


@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    frames=st.lists(
        st.builds(Frame, st.integers(0, 10**9), st.integers(0, 0x7FF), st.binary(max_size=8)),
        min_size=1,
        max_size=5,
    ),
    suffix=st.sampled_from(SUFFIXES),
)
def test_what_python_can_writes_reads_back(
    frames: list[Frame], suffix: str, tmp_path: Path
) -> None:
    kinds = (can.CanutilsLogWriter, can.ASCWriter, can.BLFWriter, can.TRCWriter)
    writers = dict(zip(SUFFIXES, kinds, strict=True))
    file = tmp_path / f"frames{suffix}"
    stamps = [1.7e9 + n * 1e-3 for n in range(len(frames))]
    with writers[suffix](file) as writer:
        for stamp, frame in zip(stamps, frames, strict=True):
            writer.on_message_received(
                can.Message(
                    timestamp=stamp,
                    arbitration_id=frame.can_id,
                    is_extended_id=False,
                    data=frame.data,
                    channel="can0",
                )
            )
    again = list(read_frames(file))
    assert [(f.can_id, f.data) for f in again] == [(f.can_id, f.data) for f in frames]
    assert [f.stamp - again[0].stamp for f in again] == pytest.approx(
        [stamp - stamps[0] for stamp in stamps], abs=2e-5
    )
