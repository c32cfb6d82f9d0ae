"""vcan0 as these tests want it: what its queue drops, nobody receives."""

from __future__ import annotations

import ctypes
import os
import subprocess
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

INTERFACE = "vcan0"
_FLAGS = Path(f"/sys/class/net/{INTERFACE}/flags")
_IFF_ECHO = 0x40000
_FINIT_MODULE, _DELETE_MODULE = 313, 176  # system calls of x86-64; kmod is not installed there


def run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True)


def echoes() -> bool:
    return bool(int(_FLAGS.read_text(), 16) & _IFF_ECHO)


def load_with_echo() -> None:
    """Load the kernel's module again, so that frames come back through the interface.

    By default vcan hands what is sent to its receivers past the interface's queue: netem then
    drops frames that all have received, and no test on losses could fail.
    """
    found = sorted(Path.home().glob(".cache/vcan-vm/usr/lib/uml/modules/*/**/net/can/vcan.ko"))
    if os.uname().machine != "x86_64" or os.environ.get("VCAN_VM") is None or not found:
        return
    call = ctypes.CDLL(None, use_errno=True).syscall
    run("ip", "link", "del", INTERFACE)
    module = os.open(found[-1], os.O_RDONLY)
    try:
        failed = call(_DELETE_MODULE, b"vcan", os.O_NONBLOCK)
        failed = failed or call(_FINIT_MODULE, module, b"echo=1", 0)
        assert not failed, os.strerror(ctypes.get_errno())
    finally:
        os.close(module)
    run("ip", "link", "add", INTERFACE, "type", "vcan")
    run("ip", "link", "set", INTERFACE, "mtu", "72", "up")


@pytest.fixture(scope="session", autouse=True)
def interface() -> None:
    """Prepare the interface before anything opens it."""
    if _FLAGS.exists() and not echoes():
        load_with_echo()


@pytest.fixture
def lossy(interface: None) -> Callable[[int], AbstractContextManager[None]]:
    """Return a context in which so many percent of all frames reach nobody."""
    if not echoes():
        pytest.skip(f"{INTERFACE} hands frames on past its queue: load vcan with echo=1")

    @contextmanager
    def losing(percent: int) -> Iterator[None]:
        run("tc", "qdisc", "add", "dev", INTERFACE, "root", "netem", "loss", f"{percent}%")
        try:
            yield
        finally:
            run("tc", "qdisc", "del", "dev", INTERFACE, "root")

    return losing
