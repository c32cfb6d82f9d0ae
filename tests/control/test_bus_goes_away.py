"""A bus that goes away in each state of a connection: one named error, no traceback, no wait."""

from __future__ import annotations

import os
import selectors
import signal
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

import duoglide as dg
from duoglide.control.channel.events import Condition
from duoglide.control.host.connection import bring_up, open_axes
from duoglide.drives.bus.network import open_network
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.kinematics.home import home_carriages

MACHINE = dg.Machine.default()
START = home_carriages(MACHINE).tolist()


class Relay:
    """Carries a hub's connections on, until a request too many: then all of them end.

    Args:
        address: Of the hub.
        requests: To a drive's objects that are carried; the next one ends it.
    """

    def __init__(self, address: str, requests: int) -> None:
        self._upstream = int(address.rsplit(":", 1)[1])
        self._left = requests
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"socketcand:127.0.0.1:{self._listener.getsockname()[1]}"
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._wake, wake = socket.socketpair()
        self._selector.register(wake, selectors.EVENT_READ)
        self._ends: list[socket.socket] = [self._listener, wake]
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self) -> Relay:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._wake.close()
        self._thread.join()

    def _serve(self) -> None:
        while self._turn():
            pass
        for end in self._ends:
            end.close()
        self._selector.close()

    def _turn(self) -> bool:
        for key, _ in self._selector.select():
            if key.fileobj is self._listener:
                client, _ = self._listener.accept()
                hub = socket.create_connection(("127.0.0.1", self._upstream))
                for end in (client, hub):
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._ends += [client, hub]
                self._selector.register(client, selectors.EVENT_READ, hub)
                self._selector.register(hub, selectors.EVENT_READ, client)
            elif key.data is None or not self._carry(key.fileobj, key.data):  # type: ignore[arg-type]
                return False
        return True

    def _carry(self, source: socket.socket, goal: socket.socket) -> bool:
        """Hand on what has come; False for a request too many."""
        try:
            data = source.recv(65536)
            self._left -= data.count(b"send 60")
            if self._left < 0:
                return False
            goal.sendall(data)
        except OSError:  # an end that has closed with something unread
            data = b""
        if not data:
            self._selector.unregister(source)
            with suppress(OSError):
                goal.shutdown(socket.SHUT_WR)
        return True


@pytest.fixture(scope="module")
def hub() -> Iterator[SimulatedDrives]:
    with SimulatedDrives(MACHINE.drives, START) as drives:
        yield drives


@pytest.mark.parametrize("requests", [0, 1, 7, 60, 200])
def test_bring_up_ends_with_one_error_and_no_traceback(
    hub: SimulatedDrives, requests: int, capfd: pytest.CaptureFixture[str]
) -> None:
    begin = time.monotonic()
    with (
        Relay(hub.address, requests) as relay,
        pytest.raises(dg.BusError, match=r"axis \d, .*socketcand can0 at 127"),
        open_axes(MACHINE, relay.address) as axes,
    ):
        bring_up(MACHINE, axes)
    assert capfd.readouterr() == ("", "")
    assert time.monotonic() - begin < 0.5 * MACHINE.drives.boot_timeout, "somebody waited for it"


def test_a_bus_that_goes_away_while_nothing_is_asked_is_named_by_the_next_question(
    hub: SimulatedDrives, capfd: pytest.CaptureFixture[str]
) -> None:
    with (
        pytest.raises(dg.BusError, match="bus socketcand:127"),
        Relay(hub.address, 99) as relay,
        open_network(relay.address, MACHINE.drives.bit_rate) as network,
    ):
        relay.__exit__()
        while network.notifier.exception is None:
            time.sleep(0.001)
        network.scanner.search()
    assert capfd.readouterr() == ("", "")


def test_connecting_through_a_bus_that_goes_away_leaves_no_streamer_behind(
    hub: SimulatedDrives, capfd: pytest.CaptureFixture[str]
) -> None:
    with Relay(hub.address, 90) as relay, pytest.raises(dg.BusError, match="socketcand"):
        dg.Robot.connect(MACHINE, bus=relay.address)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("state", ["without power", "running"])
def test_a_hub_that_is_killed_is_named_in_whatever_is_done_next(
    state: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with (
        SimulatedDrives(MACHINE.drives, START, standstill=0.0) as drives,
        dg.Robot.connect(MACHINE, bus=drives.address) as robot,
    ):
        if state != "without power":
            robot.enable()
            robot.home()
        if state == "running":
            x, y, z = dg.forward(MACHINE.geometry, robot.held)
            run = robot.start(dg.transfer(MACHINE, (x, y, z), (x, y + 60.0, z)), override=0.1)
            while not run.status.path_time:
                time.sleep(0.001)
        os.kill(drives.pid, signal.SIGKILL)
        begin = time.monotonic()
        if state == "running":
            report = run.wait(10.0)
            assert not report.completed
            assert Condition.BUS in [trip.condition for trip in report.faults]
        robot.stop()
        robot.disable()
        # To begin anew waits for a streamer that has had power to leave; once is enough.
        for again in (robot.enable, robot.reset_fault)[: 1 if state == "running" else 2]:
            with pytest.raises(dg.BusError, match="cannot open bus socketcand"):
                again()
        with pytest.raises(dg.DuoglideError):
            robot.jog((1.0, 0.0, 0.0))
        assert time.monotonic() - begin < 10.0
    assert capfd.readouterr() == ("", "")
