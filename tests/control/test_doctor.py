"""What the doctor says of computers and CAN interfaces that are not as they should be."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import pytest

import duoglide as dg
from duoglide.control.host.doctor import (
    Finding,
    Level,
    examine,
    judge_interface,
    judge_lateness,
    measure_lateness,
)

MACHINE = dg.Machine.default()


def by_point(findings: list[Finding]) -> dict[str, Finding]:
    """Return findings by their points, after what all of them promise."""
    for finding in findings:
        assert finding.found
        if finding.level is Level.GOOD:
            assert not finding.mend
    return {finding.point: finding for finding in findings}


def a_computer(root: Path, **files: str) -> Path:
    """Write files of a kernel; ``__`` in a name stands for a slash."""
    for name, text in files.items():
        file = root / name.replace("__", "/")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return root


def test_a_good_kernel_needs_nothing(tmp_path: Path) -> None:
    root = a_computer(
        tmp_path,
        proc__sys__kernel__osrelease="6.12.1-rt",
        sys__kernel__realtime="1\n",
        sys__devices__system__cpu__cpu0__cpufreq__scaling_governor="performance\n",
        sys__devices__system__clocksource__clocksource0__current_clocksource="tsc\n",
    )
    found = by_point(list(examine(MACHINE, seconds=0.0, root=root)))
    for point in ("kernel", "CPU governor", "clock"):
        assert found[point].level is Level.GOOD, found[point]


def test_each_fault_of_a_kernel_names_the_command_that_mends_it(tmp_path: Path) -> None:
    clock = "sys__devices__system__clocksource__clocksource0__"
    root = a_computer(
        tmp_path,
        proc__sys__kernel__osrelease="6.12.1",
        sys__devices__system__cpu__cpu0__cpufreq__scaling_governor="powersave\n",
        sys__devices__system__cpu__cpu1__cpufreq__scaling_governor="performance\n",
        **{clock + "current_clocksource": "hpet", clock + "available_clocksource": "tsc hpet"},
    )
    found = by_point(list(examine(MACHINE, seconds=0.0, root=root)))
    assert "PREEMPT_RT" in found["kernel"].found
    assert "linux-image-rt" in found["kernel"].mend
    assert "powersave" in found["CPU governor"].found
    assert "scaling_governor" in found["CPU governor"].mend
    assert found["clock"].mend.startswith("echo tsc")


def test_an_ordinary_account_is_told_both_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    monkeypatch.setattr("resource.getrlimit", lambda _: (0, 0))
    found = by_point(list(examine(MACHINE, seconds=0.0)))
    for point, word in (("real-time priority", "rtprio"), ("locked memory", "memlock")):
        assert found[point].level is Level.BAD
        assert f"{word}" in found[point].mend
        assert "/etc/security/limits.d/" in found[point].mend


def test_a_port_that_is_taken_is_noticed() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        found = by_point(list(examine(MACHINE, seconds=0.0, port=port)))
    assert found["port of the page"].level is Level.NOTICE


def test_a_server_that_is_not_there_is_bad() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    found = by_point(list(examine(MACHINE, f"socketcand:127.0.0.1:{port}", seconds=0.0)))
    assert found["bus"].level is Level.BAD


def link(**changes: Any) -> dict[str, Any]:
    """Return what ``ip`` says of a CAN interface in order, but for changes."""
    data = {"state": "ERROR-ACTIVE", "restart_ms": 0, "bittiming": {"bitrate": 1_000_000}}
    told = {key: changes.pop(key) for key in list(changes) if key in data}
    return {
        "flags": ["NOARP", "UP", "ECHO"],
        "txqlen": 100,
        "linkinfo": {"info_kind": "can", "info_data": {**data, **told}},
        **changes,
    }


@pytest.mark.parametrize(
    ("said", "point", "level", "mend"),
    [
        (None, "CAN interface", Level.BAD, "modprobe"),
        (link(flags=["NOARP"]), "CAN interface", Level.BAD, "up type can bitrate 1000000"),
        (link(txqlen=10), "send queue", Level.NOTICE, "txqueuelen"),
        (link(bittiming={"bitrate": 500_000}), "bit rate", Level.BAD, "bitrate 1000000"),
        (link(state="BUS-OFF"), "error state", Level.BAD, "termination"),
        (link(restart_ms=100), "restart", Level.NOTICE, "restart-ms 0"),
    ],
)
def test_what_is_wrong_with_an_interface(
    said: dict[str, Any] | None, point: str, level: Level, mend: str
) -> None:
    found = by_point(list(judge_interface("can0", 1_000_000, said)))
    assert found[point].level is level
    assert mend in found[point].mend
    assert all(f.level is Level.GOOD for f in found.values() if f.point != point)


def test_an_interface_in_order_needs_nothing() -> None:
    found = by_point(list(judge_interface("can0", 1_000_000, link())))
    assert all(finding.level is Level.GOOD for finding in found.values())
    assert len(found) == 5


def test_lateness_is_measured_and_judged() -> None:
    measured = measure_lateness(0.05, MACHINE.drives.cycle)
    assert measured["streamer"]["cycles"] == 25
    measured["streamer"] = {
        "median": 30.0,
        "p99": 499.0,
        "worst": 900.0,
        "skipped": 0,
        "cycles": 25,
    }
    assert by_point(list(judge_lateness(measured, MACHINE)))["lateness"].level is Level.GOOD
    measured["streamer"]["p99"] = 501.0
    assert by_point(list(judge_lateness(measured, MACHINE)))["lateness"].level is Level.BAD
    measured["streamer"].update(p99=40.0, skipped=1, cycles=5000)
    assert by_point(list(judge_lateness(measured, MACHINE)))["lateness"].level is Level.NOTICE
