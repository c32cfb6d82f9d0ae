"""Whether this computer and its bus can run a cell, point by point.

Everything is read, nothing is changed, and no frame is sent.
"""

from __future__ import annotations

import ctypes
import json
import os
import pwd
import resource
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from duoglide.drives.bus.buses import BusKind, parse_bus
from duoglide.errors import BusError
from duoglide.machine import Machine

_ROOT = Path("/")
_PRIORITY = 60  # what the streamer asks for, see streamer/realtime.py
_MEMORY = 256 << 20  # [byte] that the streamer locks at most
_SHARED = 16 << 20  # [byte] of /dev/shm; the ring takes 2
_SHIFT = 8 * 3600.0  # [s]
_CYCLE_BYTES = 100  # of a log, a cycle: 56 measured on a run of 6445 cycles, and room for events
_GOOD_CLOCKS = ("tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page")
_QUEUE = 100  # frames; the kernel's 10 fill up when three drives are configured at once
_UNSYNCHRONISED = 5  # what adjtimex returns then
_LATE = 0.25  # of a cycle: what 99 of 100 cycles may begin late
_SKIPPED = 1e-3  # share of cycles that may be left out; a single one is bridged by the drives


class Level(StrEnum):
    """How a point is."""

    GOOD = "good"
    NOTICE = "notice"  # runs, but not as well as it could
    BAD = "bad"  # a cell should not run so


@dataclass(frozen=True, slots=True)
class Finding:
    """One point.

    Attributes:
        point: What was looked at.
        level: How it is.
        found: What was seen, in words.
        mend: The command that mends it; empty where nothing has to be.
    """

    point: str
    level: Level
    found: str
    mend: str = ""


def examine(
    machine: Machine,
    bus: str = "virtual",
    *,
    seconds: float = 10.0,
    port: int = 8080,
    folder: Path = Path(),
    root: Path = _ROOT,
) -> Iterator[Finding]:
    """Look at a computer, one point after the other.

    Args:
        machine: Whose cycle and bit rate count.
        bus: Name of the bus.
        seconds: How long to measure lateness; 0 leaves it out [s].
        port: Where the page would be served.
        folder: Where logs would be written.
        root: Of the file system; tests bring one of their own.

    Raises:
        BusError: Not a bus name.
    """
    name = parse_bus(bus)
    yield _judge_kernel(root)
    yield _judge_priority()
    yield _judge_memory()
    yield _judge_governor(root)
    yield _judge_clock(root)
    yield _judge_wall_clock()
    yield _judge_shared_memory(root)
    yield _judge_disk(folder, machine.drives.cycle)
    yield _judge_port(port)
    if name.kind is BusKind.SOCKETCAN:
        yield from judge_interface(name.place, machine.drives.bit_rate, read_link(name.place))
    elif name.kind is BusKind.SOCKETCAND:
        yield _judge_server(name.place, name.port)
    if seconds > 0.0:
        yield from judge_lateness(measure_lateness(seconds, machine.drives.cycle), machine)


def _read(path: Path) -> str:
    """Return a file of the kernel's; empty where there is none."""
    try:
        return path.read_text("utf-8", errors="replace").strip()
    except OSError:
        return ""


def _judge_kernel(root: Path) -> Finding:
    version = _read(root / "proc/sys/kernel/osrelease") or os.uname().release
    preempt = _read(root / "sys/kernel/realtime") == "1"
    if preempt:
        return Finding("kernel", Level.GOOD, f"{version}, PREEMPT_RT")
    return Finding(
        "kernel",
        Level.NOTICE,
        f"{version}, without PREEMPT_RT: single cycles may begin milliseconds late",
        "sudo apt install linux-image-rt-$(dpkg --print-architecture) && sudo reboot",
    )


def _judge_priority() -> Finding:
    soft, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    if os.geteuid() == 0 or soft == resource.RLIM_INFINITY or soft >= _PRIORITY:
        return Finding("real-time priority", Level.GOOD, f"SCHED_FIFO {_PRIORITY} is granted")
    return Finding(
        "real-time priority",
        Level.BAD,
        f"refused: the limit is {soft}, the streamer asks for {_PRIORITY}",
        f"echo '{_user()} - rtprio {_PRIORITY}' |"
        " sudo tee /etc/security/limits.d/90-duoglide-rtprio.conf, then log in again",
    )


def _judge_memory() -> Finding:
    soft, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if os.geteuid() == 0 or soft == resource.RLIM_INFINITY or soft >= _MEMORY:
        return Finding("locked memory", Level.GOOD, "the streamer's memory can be locked")
    return Finding(
        "locked memory",
        Level.BAD,
        f"the limit is {soft >> 20} MiB, the streamer locks up to {_MEMORY >> 20}",
        f"echo '{_user()} - memlock unlimited' |"
        " sudo tee /etc/security/limits.d/90-duoglide-memlock.conf, then log in again",
    )


def _user() -> str:
    """Return the account as the file of limits wants it; one without a name by its number."""
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return f":{os.getuid()}"


def _judge_governor(root: Path) -> Finding:
    files = sorted(root.glob("sys/devices/system/cpu/cpu[0-9]*/cpufreq/scaling_governor"))
    governors = {_read(file) for file in files} - {""}
    if not governors:
        return Finding(
            "CPU governor", Level.GOOD, "none: the frequency is not this kernel's to set"
        )
    if governors == {"performance"}:
        return Finding("CPU governor", Level.GOOD, "performance")
    return Finding(
        "CPU governor",
        Level.NOTICE,
        f"{', '.join(sorted(governors))}: the first cycles after a rest begin late",
        "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
    )


def _judge_clock(root: Path) -> Finding:
    folder = root / "sys/devices/system/clocksource/clocksource0"
    source = _read(folder / "current_clocksource")
    if not source or source in _GOOD_CLOCKS:
        return Finding("clock", Level.GOOD, source or "the kernel does not say which")
    better = [name for name in _GOOD_CLOCKS if name in _read(folder / "available_clocksource")]
    return Finding(
        "clock",
        Level.NOTICE,
        f"{source}: reading the time is slow",
        f"echo {better[0]} | sudo tee {folder}/current_clocksource" if better else "",
    )


def _judge_wall_clock() -> Finding:
    room = ctypes.create_string_buffer(256)  # struct timex, modes = 0: only read
    try:
        state = ctypes.CDLL(None).adjtimex(room)
    except (OSError, AttributeError):
        return Finding("time of day", Level.NOTICE, "the kernel does not say whether it is right")
    if state != _UNSYNCHRONISED:
        return Finding("time of day", Level.GOOD, "synchronised")
    return Finding(
        "time of day",
        Level.NOTICE,
        "not synchronised: dates in logs may be wrong",
        "sudo timedatectl set-ntp true",
    )


def _judge_shared_memory(root: Path) -> Finding:
    place = root / "dev/shm"
    try:
        free = shutil.disk_usage(place).free
    except OSError:
        return Finding("shared memory", Level.GOOD, "no /dev/shm; the ring needs none")
    if free >= _SHARED:
        return Finding("shared memory", Level.GOOD, f"{free >> 20} MiB free")
    return Finding(
        "shared memory",
        Level.BAD,
        f"{free >> 10} KiB free in {place}, {_SHARED >> 20} MiB are wanted",
        "sudo mount -o remount,size=256M /dev/shm",
    )


def _judge_disk(folder: Path, cycle: float) -> Finding:
    free = shutil.disk_usage(folder).free
    needed = round(_SHIFT / cycle) * _CYCLE_BYTES
    found = f"{free / 1e9:.1f} GB free; a log of 8 h takes up to {needed / 1e9:.1f}"
    if free >= needed:
        return Finding("disk", Level.GOOD, found)
    return Finding("disk", Level.BAD, found, f"du -xh --max-depth=1 {folder.resolve()} | sort -h")


def _judge_port(port: int) -> Finding:
    try:
        socket.create_server(("127.0.0.1", port)).close()
    except OSError as error:
        return Finding(
            "port of the page",
            Level.NOTICE,
            f"{port}: {error.strerror}",
            f"duoglide view --port {port + 1}, or: sudo ss -ltnp 'sport = :{port}'",
        )
    return Finding("port of the page", Level.GOOD, f"{port} is free")


def _judge_server(host: str, port: int) -> Finding:
    try:
        socket.create_connection((host, port), 2.0).close()
    except OSError as error:
        return Finding(
            "bus",
            Level.BAD,
            f"no server at {host}:{port}: {error.strerror or error}",
            f"on {host}: sudo socketcand -i can0 -p {port} -l eth0",
        )
    return Finding("bus", Level.GOOD, f"a server answers at {host}:{port}")


# A CAN interface of the kernel


def read_link(interface: str) -> dict[str, Any] | None:
    """Return what ``ip`` says of a network interface; None where there is none.

    Raises:
        BusError: There is no ``ip``.
    """
    try:
        said = subprocess.run(
            ["ip", "-details", "-statistics", "-json", "link", "show", interface],
            capture_output=True,
            text=True,
            timeout=10.0,
            check=False,
        )
    except OSError as error:
        raise BusError(
            f"cannot ask for {interface}: no ip ({error}); apt install iproute2"
        ) from error
    links = json.loads(said.stdout) if said.returncode == 0 and said.stdout.strip() else []
    return links[0] if links else None


def judge_interface(
    interface: str, bit_rate: int, link: dict[str, Any] | None
) -> Iterator[Finding]:
    """Judge a CAN interface.

    Args:
        interface: Its name.
        bit_rate: What the machine file says [bit/s].
        link: What ``ip`` says of it; None where there is none.
    """
    up = f"sudo ip link set {interface} down; sudo ip link set {interface} up type can"
    if link is None:
        loaded = Path("/sys/module/can").exists()
        yield Finding(
            "CAN interface",
            Level.BAD,
            f"there is no {interface}" + ("" if loaded else ", and the kernel has no CAN loaded"),
            f"sudo modprobe can_raw; {up} bitrate {bit_rate} restart-ms 0",
        )
        return
    about = link.get("linkinfo", {})
    data = about.get("info_data", {})
    is_up = "UP" in link.get("flags", [])
    yield Finding(
        "CAN interface",
        Level.GOOD if is_up else Level.BAD,
        f"{interface} is {'up' if is_up else 'down'}",
        "" if is_up else f"{up} bitrate {bit_rate} restart-ms 0",
    )
    queue = link.get("txqlen", 0)
    yield Finding(
        "send queue",
        Level.GOOD if queue >= _QUEUE else Level.NOTICE,
        f"{queue} frames",
        "" if queue >= _QUEUE else f"sudo ip link set {interface} txqueuelen {_QUEUE}",
    )
    if about.get("info_kind") == "vcan":
        yield Finding("bit rate", Level.GOOD, "a virtual interface has none")
        return
    rate = data.get("bittiming", {}).get("bitrate", 0)
    yield Finding(
        "bit rate",
        Level.GOOD if rate == bit_rate else Level.BAD,
        f"{rate} bit/s" + ("" if rate == bit_rate else f"; the machine file says {bit_rate}"),
        "" if rate == bit_rate else f"{up} bitrate {bit_rate}",
    )
    state = str(data.get("state", "unknown"))
    good = state == "ERROR-ACTIVE"
    yield Finding(
        "error state",
        Level.GOOD if good else Level.BAD,
        state.lower(),
        "" if good else f"check wiring, termination (60 ohm) and bit rate, then: {up}",
    )
    restart = data.get("restart_ms", 0)
    yield Finding(
        "restart",
        Level.GOOD if restart == 0 else Level.NOTICE,
        "by hand only"
        if restart == 0
        else f"by itself after {restart} ms: a bus that fails again and again looks alive",
        "" if restart == 0 else f"{up} restart-ms 0",
    )


# Lateness


def measure_lateness(seconds: float, cycle: float) -> dict[str, Any]:
    """Run the streamer's empty cycle beside a sleeping loop; see ``streamer.lateness``.

    Args:
        seconds: How long.
        cycle: Of the machine [s].
    """
    done = subprocess.run(
        [
            sys.executable,
            "-P",
            "-m",
            "duoglide.control.streamer.lateness",
            str(seconds),
            str(1.0 / cycle),
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    measured: dict[str, Any] = json.loads(done.stdout)
    return measured


def judge_lateness(measured: dict[str, Any], machine: Machine) -> Iterator[Finding]:
    """Judge what ``measure_lateness`` has found."""
    granted, late, beside = measured["granted"], measured["streamer"], measured["sleeping"]
    yield Finding(
        "timer slack",
        Level.GOOD if granted["slack"] else Level.NOTICE,
        "1 us" if granted["slack"] else "50 us: the kernel did not grant less",
    )
    cycle = machine.drives.cycle
    late_often = late["p99"] > _LATE * cycle * 1e6 or late["skipped"] > _SKIPPED * late["cycles"]
    level = Level.BAD if late_often else Level.NOTICE if late["skipped"] else Level.GOOD
    found = (
        f"median {late['median']:.0f}, 99 % {late['p99']:.0f}, worst {late['worst']:.0f} us of a"
        f" cycle of {cycle * 1e6:.0f}, {late['skipped']} of {late['cycles']} left out; a sleeping"
        f" loop beside it: {beside['median']:.0f}, {beside['p99']:.0f}, {beside['worst']:.0f} us"
    )
    mend = "mend the points above, end other work on this computer, or set a longer drives.cycle"
    yield Finding("lateness", level, found, mend if level is Level.BAD else "")
