"""Who comes in to the page, over real connections but without a browser."""

from __future__ import annotations

import asyncio
import http.client
import logging
import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from http import HTTPStatus
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("viser")

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

import duoglide as dg
from duoglide.storage.paths import inside
from duoglide.viewer import door
from duoglide.viewer.door import Gate, Refusal
from duoglide.viewer.motion_panel import MotionPanel
from duoglide.viewer.owner import Owner
from duoglide.viewer.page import Page
from duoglide.viewer.planner import Planner

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")


class Robot:
    """A machine of somebody else that counts its stops."""

    machine = dg.Machine.default()
    bus = "virtual"
    homed = False
    states = ()
    carriages = ()
    current_run = None

    def __init__(self) -> None:
        self.stops: list[float] = []

    def stop(self) -> None:
        self.stops.append(time.monotonic())


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot()


@pytest.fixture(scope="module")
def page(robot: Any) -> Iterator[Page]:
    with Page(robot.machine, drives=robot, port=0) as page:
        yield page


def parts(page: Page) -> tuple[str, str]:
    """Return host with port, and the path with the token."""
    _, _, host, token, _ = page.address.split("/")
    return host, f"/{token}/"


def get(page: Page, path: str, **headers: str) -> tuple[int, str]:
    host, _ = parts(page)
    connection = http.client.HTTPConnection(host, timeout=60.0)
    try:
        connection.putrequest("GET", path, skip_host=True)
        for name, value in {"Host": host, **headers}.items():
            connection.putheader(name.replace("_", "-"), value)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, answer.read().decode(errors="replace")
    finally:
        connection.close()


@pytest.mark.parametrize(
    "path", ["/", "/index.html", "/wrong/", "/stop", "/wrong/stop", "/?token=x"]
)
def test_nothing_is_served_without_the_token(page: Page, path: str) -> None:
    assert get(page, path) == (403, "open the address that duoglide view printed, all of it")


def test_the_address_that_is_printed_is_served_with_its_own_stop(page: Page) -> None:
    _, home = parts(page)
    status, _ = get(page, home)
    assert status == 200
    assert get(page, home.rstrip("/"))[0] == 307
    assert get(page, home + "../../etc/passwd")[0] == 404


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Host": "evil.example"}, 421),  # a name that was pointed at this computer
        ({"Host": "evil.example:8080"}, 421),
        ({"Host": "127.0.0.1.evil.example"}, 421),
        ({"Host": "127.0.0.1:80.evil.example"}, 421),
        ({"Host": "192.168.0.9"}, 421),  # served on the loopback only
        ({"Host": ""}, 421),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": "http://127.0.0.1:1"}, 403),  # another program's page on this computer
    ],
)
def test_foreign_hosts_and_origins_are_refused(
    page: Page, robot: Robot, headers: dict[str, str], status: int
) -> None:
    _, home = parts(page)
    before = len(robot.stops)
    assert get(page, home, **headers)[0] == status
    assert get(page, home + "stop", Duoglide_Order="stop", **headers)[0] == status
    assert len(robot.stops) == before


def say(page: Page, text: str) -> str:
    """Send a request as it is written and return the first line of the answer; empty for none."""
    host, home = parts(page)
    name, port = host.split(":")
    with socket.create_connection((name, int(port)), timeout=60.0) as connection:
        request = text.replace("HOST", host).replace("HOME", home).replace("\n", "\r\n")
        connection.sendall(request.encode("latin-1") + b"\r\n\r\n")
        with connection.makefile("rb") as answer:
            try:
                return answer.readline().decode()[9:12]
            except ConnectionResetError:
                return ""


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        ("GET HOME HTTP/1.1\nHost: HOST\nHost: evil.example", "400"),
        ("GET HOME HTTP/1.1\nHost: HOST\nOrigin: http://HOST\nOrigin: http://evil.example", "400"),
        ("GET HOME HTTP/1.1\nHost: HOST\nUpgrade: websocket\nUpgrade: x", "400"),
        ("GET HOMEstop HTTP/1.1\nHost: HOST\nDuoglide-Order: stop\nDuoglide-Order: stop", "403"),
        ("GET HOMEstop HTTP/1.1\nHost: HOST\nDuoglide-Order: halt", "403"),
        ("POST HOMEstop HTTP/1.1\nHost: HOST\nDuoglide-Order: stop", ""),
        ("GET HOME HTTP/1.1", "421"),
        ("GET HOME HTTP/1.1\nHost: evil.example@HOST", "421"),
        ("GET HOME HTTP/1.1\nHost: \xff", "421"),
        ("GET HOME HTTP/1.1\nHost: [::1", "421"),
        ("GET /\xe9/ HTTP/1.1\nHost: HOST", "403"),
        ("GET http://HOSTHOME HTTP/1.1\nHost: HOST", "403"),
        ("GET HOME..%2f..%2fetc%2fpasswd HTTP/1.1\nHost: HOST", "404"),
        ("\x16\x03\x01 nonsense", ""),
        (f"GET /{'a' * 9000}/ HTTP/1.1\nHost: HOST", ""),
    ],
)
def test_nonsense_is_answered_as_such_and_written_nowhere(
    page: Page, robot: Robot, request_: str, answer: str, *, caplog: Any, capfd: Any
) -> None:
    before = len(robot.stops)
    with caplog.at_level(logging.DEBUG):
        assert say(page, request_) == answer
    assert len(robot.stops) == before
    assert page._door.gate.token not in caplog.text
    assert capfd.readouterr() == ("", "")


def test_a_tunnel_to_another_port_is_let_in() -> None:
    gate = Gate("127.0.0.1", "secret")
    headers = {"Host": "localhost:9000", "Origin": "http://localhost:9000", "Upgrade": "websocket"}
    assert gate.judge("/secret/", headers) == ""
    assert gate.judge("/secret/stop?x", {"Host": "[::1]:8080"}) == "stop"
    everywhere = Gate("0.0.0.0", "secret")
    assert everywhere.judge("/secret/", {"Host": "192.168.0.9:8080"}) == ""
    refused = everywhere.judge("/secret/", {"Host": "evil.example:8080"})
    assert isinstance(refused, Refusal)
    assert refused.status is HTTPStatus.MISDIRECTED_REQUEST
    assert Gate("cell.local", "secret").judge("/secret/", {"Host": "cell.local:80"}) == ""
    assert len({Gate("127.0.0.1").token for _ in range(9)}) == 9


@pytest.mark.parametrize("origin", [None, "http://evil.example", "http://127.0.0.1:1"])
def test_a_stream_begins_for_the_page_itself_only(page: Page, origin: str | None) -> None:
    host, home = parts(page)
    with pytest.raises(InvalidStatus):
        connect(f"ws://{host}{home}", origin=origin)  # type: ignore[arg-type]
    with pytest.raises(InvalidStatus):
        connect(f"ws://{host}/", origin=f"http://{host}")  # type: ignore[arg-type]
    with pytest.raises(InvalidStatus):
        connect(f"ws://{host}{home}", origin=f"http://{host}", additional_headers={"Host": "evil"})  # type: ignore[arg-type]
    with connect(f"ws://{host}{home}", origin=f"http://{host}"):  # type: ignore[arg-type]
        pass


def test_a_link_does_not_stop_but_the_button_does(page: Page, robot: Robot) -> None:
    _, home = parts(page)
    before = len(robot.stops)
    assert get(page, home + "stop")[0] == 403
    assert len(robot.stops) == before
    assert get(page, home + "stop", Duoglide_Order="stop") == (200, "stopped")
    assert len(robot.stops) == before + 1


def test_a_stop_waits_behind_no_order_that_is_stuck(page: Page, robot: Robot) -> None:
    _, home = parts(page)
    release = threading.Event()
    for _ in range(32):  # as many threads as viser has
        page._server._thread_executor.submit(release.wait)
    try:
        before = len(robot.stops)
        assert get(page, home + "stop", Duoglide_Order="stop")[0] == 200
        assert len(robot.stops) == before + 1
    finally:
        release.set()


def test_a_stop_that_fails_says_so(page: Page, robot: Robot, monkeypatch: Any) -> None:
    def broken() -> None:
        raise KeyError("no such run")

    _, home = parts(page)
    monkeypatch.setattr(robot, "stop", broken)
    status, words = get(page, home + "stop", Duoglide_Order="stop")
    assert (status, words) == (500, "KeyError: 'no such run'")


# One owner


def message(kind: str, uuid: str = "") -> Any:
    return type(kind, (), {"uuid": uuid})()


def test_one_page_gives_the_orders_and_the_others_watch() -> None:
    told: list[int] = []
    owner = Owner(lambda page, _: told.append(page), clock=lambda: 0.0)
    owner.allow_all(SimpleNamespace(_impl=SimpleNamespace(uuid="hold")))
    order = message("GuiUpdateMessage", "run")
    assert not owner.admits(0, order)  # nobody has come yet
    owner.come(0)
    owner.come(1)
    assert owner.admits(0, order)
    assert not owner.admits(1, order)
    assert told[-1] == 1
    assert owner.admits(1, message("GuiUpdateMessage", "hold"))
    assert owner.admits(1, message("ViewerCameraMessage"))
    assert not owner.admits(0, message("ShareUrlRequest"))
    owner.take_over(1)
    assert (owner.admits(0, order), owner.admits(1, order)) == (False, True)
    owner.go(1)
    assert owner.admits(0, order)
    owner.take_over(7)  # who is not there
    assert owner.page == 0


def test_a_watcher_that_hammers_is_told_once_a_second() -> None:
    now, told = [0.0], []
    owner = Owner(lambda page, _: told.append(page), clock=lambda: now[0])
    owner.come(0)
    owner.come(1)
    order = message("GuiUpdateMessage")
    assert not any(owner.admits(1, order) for _ in range(5000))
    now[0] = 1.0
    assert not owner.admits(1, order)
    assert told == [1, 1]


def test_a_value_that_is_none_is_told_and_raises_nowhere() -> None:
    async def handle(page: int, message: Any) -> None:
        raise ValueError("cannot convert float NaN to integer")

    told: list[str] = []
    inner = SimpleNamespace(_handle_incoming_message=handle)
    server = SimpleNamespace(
        _websock_server=inner, on_client_connect=print, on_client_disconnect=print
    )
    owner = Owner(lambda _, reason: told.append(reason), clock=lambda: 0.0)
    owner.guard(server)
    owner.come(0)
    asyncio.run(inner._handle_incoming_message(0, message("GuiUpdateMessage")))
    assert told == ["That is not understood: cannot convert float NaN to integer"]


def test_a_page_that_hammers_is_read_no_faster_than_anybody_clicks() -> None:
    waits: list[float] = []

    async def sleep(seconds: float) -> None:
        waits.append(seconds)

    async def recv(self: Any, decode: bool | None = None) -> bytes:
        return b""

    async def hear() -> None:
        connection = kind.__new__(kind)
        connection.loop = SimpleNamespace(time=lambda: 100.0)
        for _ in range(1000):
            await connection.recv()

    kind = door._calm()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ServerConnection, "recv", recv)
        patch.setattr(door.asyncio, "sleep", sleep)
        asyncio.run(hear())
    assert waits[99] < 1e-9  # half a second of them may come at once
    assert waits[-1] == pytest.approx(900 / 200)


def test_viser_asks_the_owner_before_it_hands_on(page: Page) -> None:
    handle = page._server._websock_server._handle_incoming_message
    assert handle.__qualname__.startswith("Owner.guard")


# Files


@pytest.mark.parametrize(
    "name", ["", " ", "..", "../x.mcap", "a/../../x.mcap", "/etc/passwd", "link/x.mcap", "a\0b"]
)
def test_files_are_below_one_folder(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "runs"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path)
    with pytest.raises(dg.InputError):
        inside(folder, name)
    assert inside(folder, "a/x.mcap") == folder / "a" / "x.mcap"


def test_a_run_is_recorded_in_a_place_that_is_free(page: Page, tmp_path: Path) -> None:
    panel = page._machine
    before = panel._folder, panel._log.value
    try:
        panel._folder = tmp_path
        (tmp_path / "run.mcap").write_text("precious")
        panel._log.value = "run.mcap"
        assert panel._log_file() == tmp_path / "run-2.mcap"
        for wrong in ("notes.txt", "../run.mcap"):
            panel._log.value = wrong
            with pytest.raises(dg.InputError):
                panel._log_file()
        panel._log.value = ""
        assert panel._log_file() is None
    finally:
        panel._folder, panel._log.value = before


# Errors and work


def test_whatever_goes_wrong_is_shown(page: Page) -> None:
    def mistake(*_: Any) -> Any:
        raise ZeroDivisionError("in a program")

    panel = page._machine
    panel._command(mistake)
    assert panel._words.content == "**ZeroDivisionError.** in a program"
    page._motion._attempt("Doing ...", mistake)
    assert page._motion._words.content == "**ZeroDivisionError.** in a program"


def test_plan_clicked_twice_is_planned_once(page: Page) -> None:
    motion: MotionPanel = page._motion
    begun, go_on = threading.Event(), threading.Event()
    done: list[int] = []

    def work() -> Any:
        begun.set()
        assert go_on.wait(60.0)
        done.append(1)
        raise dg.InputError("far enough")

    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(motion._attempt, "Planning ...", work)
        assert begun.wait(60.0)
        motion._attempt("Planning ...", work)  # returns at once
        assert not done
        go_on.set()
        first.result(60.0)
    assert done == [1]


def test_what_plans_is_another_process() -> None:
    import os

    planner = Planner()
    try:
        assert planner.do(os.getpid) != os.getpid()
        with pytest.raises(dg.InputError, match="ended before it was done"):
            planner.do(os._exit, 3)
        assert planner.do(os.getpid) != os.getpid()
    finally:
        planner.close()
