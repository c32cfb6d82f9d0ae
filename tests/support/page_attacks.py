"""What a web page, a program or a person can do to the live page, over real connections.

Every attack returns in words what became of it, or raises ``LetInError`` where it got what it
wanted.
"""

from __future__ import annotations

import contextlib
import http.client
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import msgspec
import viser
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from duoglide.viewer.page import Page

PATIENCE = 30.0  # [s]
_HAMMER = Path(__file__).parents[1] / "benchmarks" / "page_orders.py"
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (1.0, 1.0, 1.0),
    "fov": 1.0, "near": 0.1, "far": 100.0, "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0), "image_height": 100, "image_width": 100,
}  # fmt: skip
GARBAGE = (
    b"", b"\xff" * 50, b"\xc1", b"{}", b"[" * 10_000, msgspec.msgpack.encode([1, 2]),
    msgspec.msgpack.encode({"type": "NoSuchMessage"}),
    msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": 7, "updates": 1}),
    msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": "none", "updates": {"value": 1}}),
    msgspec.msgpack.encode({"type": "ViewerCameraMessage", "wxyz": "x"}),
)  # fmt: skip


class LetInError(AssertionError):
    """An attack got what it wanted."""


@dataclass(frozen=True, slots=True)
class Target:
    """A page, and a text of the user's beside what the page may write.

    Attributes:
        page: It is served.
        folder: Of the page's files; what it must not touch is above it.
    """

    page: Page
    folder: Path

    @property
    def host(self) -> str:
        """Name and port."""
        return self.page.address.split("/")[2]

    @property
    def home(self) -> str:
        """The path with the token."""
        return f"/{self.page.address.split('/')[3]}/"

    def get(self, path: str, **headers: str) -> tuple[int, str]:
        """Ask for a path and return the status and the text of the answer."""
        connection = http.client.HTTPConnection(self.host, timeout=PATIENCE)
        try:
            connection.putrequest("GET", path, skip_host=True)
            for name, value in {"Host": self.host, **headers}.items():
                connection.putheader(name.replace("_", "-"), value)
            connection.endheaders()
            answer = connection.getresponse()
            return answer.status, answer.read().decode(errors="replace")
        finally:
            connection.close()

    def stop(self) -> str:
        """Do what the button and the space bar of the page do."""
        begin = time.monotonic()
        answer = self.get(self.home + "stop", Duoglide_Order="stop", Origin=f"http://{self.host}")
        if answer != (200, "stopped"):
            raise LetInError(f"Stop was answered {answer}")
        return f"Stop took {1e3 * (time.monotonic() - begin):.1f} ms"

    def stream(self, origin: str | None = None, **headers: str) -> ClientConnection:
        """Begin a stream as a browser's page does."""
        return connect(
            f"ws://{self.host}{self.home}",
            origin=origin or f"http://{self.host}",  # type: ignore[arg-type]
            additional_headers=headers,
            subprotocols=[f"viser-v{viser.__version__}"],  # type: ignore[list-item]
            max_size=None,
        )

    @contextmanager
    def visitor(self) -> Iterator[Callable[[object], None]]:
        """Open the page without a browser; yields what sends it messages."""
        known = self.pages()
        with self.stream() as stream:
            threading.Thread(target=_drain, args=(stream,), daemon=True).start()
            stream.send(msgspec.msgpack.encode(CAMERA))
            wait_until(lambda: bool(self.pages() - known))
            yield lambda message: stream.send(msgspec.msgpack.encode(message))

    def pages(self) -> set[int]:
        """Return the numbers of the pages that are open, whoever gives the orders."""
        return set(self.page._machine._owner._pages)

    def element(self, label: str) -> str:
        """Return the name of an element of the page by what is written on it."""
        handles = self.page._server.gui._gui_input_handle_from_uuid
        return next(k for k, handle in handles.items() if handle._impl.props.label == label)

    def update(self, label: str, value: object) -> dict[str, object]:
        """Return the message by which a page changes an element, or clicks it."""
        uuid = self.element(label)
        return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}


def _drain(stream: ClientConnection) -> None:
    with contextlib.suppress(ConnectionClosed):
        for _ in stream:
            pass


def wait_until(true: Callable[[], bool]) -> None:
    """Wait for something that happens soon."""
    deadline = time.monotonic() + PATIENCE
    while not true():
        if time.monotonic() > deadline:
            raise LetInError("the page does not react")
        time.sleep(0.002)


def _refused(target: Target, status: int, path: str = "", **headers: str) -> str:
    """Ask for the page, for Stop and for a stream, none of which may be had."""
    path = path or target.home
    words = ""
    for wanted in (path, path + "stop"):
        got, words = target.get(wanted, **headers)
        if got != status:
            raise LetInError(f"{wanted} with {headers} was answered {got}")
    return f"{status} {words}"


def foreign_origin(target: Target) -> str:
    """Be a page of another site, which knows the token even."""
    for origin in ("http://evil.example", "null", "http://127.0.0.1:1"):
        words = _refused(target, 403, Origin=origin, Duoglide_Order="stop")
        _no_stream(target, lambda origin=origin: target.stream(origin))
    return words


def foreign_host(target: Target) -> str:
    """Be a name that was pointed at this computer after the page had come: DNS rebinding."""
    for host in ("evil.example", f"{target.host}.evil.example", "192.168.0.9", "x@127.0.0.1"):
        words = _refused(target, 421, Host=host, Duoglide_Order="stop")
    return words


def wrong_token(target: Target) -> str:
    """Guess."""
    for path in ("/", "/wrong/", f"{target.home[:-2]}/", target.home[1:].upper()):
        words = _refused(target, 403, path, Duoglide_Order="stop")
    return words


def no_origin(target: Target) -> str:
    """Begin a stream as no browser does."""
    status, words = target.get(
        target.home,
        Upgrade="websocket",
        Connection="Upgrade",
        Sec_WebSocket_Version="13",
        Sec_WebSocket_Key="dGhlIHNhbXBsZSBub25jZQ==",
    )
    if status != 403:
        raise LetInError(f"a stream without an Origin was answered {status}")
    return f"403 {words}"


def a_link(target: Target) -> str:
    """Have somebody follow a link to Stop, or an image show it."""
    status, words = target.get(target.home + "stop")
    if status != 403:
        raise LetInError(f"it was answered {status}")
    return f"403 {words}"


def _no_stream(target: Target, begin: Callable[[], ClientConnection]) -> None:
    try:
        stream = begin()
    except InvalidStatus:
        return
    stream.close()
    raise LetInError("the stream began")


def outside(target: Target) -> str:
    """Open and record what is not below the page's folder."""
    above = target.folder.parent
    (target.folder / "link").symlink_to(above)
    words, doing = target.page._machine._words, target.page._motion._words
    with target.visitor() as send:
        for name in (f"{above}/x.mcap", "../x.mcap", "link/x.mcap", "a/../../x.mcap"):
            for field, button, says in (("Log", "Run", words), ("File", "Open", doing)):
                says.content = ""
                send(target.update(field, name))
                send(target.update(button, True))
                wait_until(lambda says=says: "is not below" in says.content)
    if (above / "x.mcap").exists():
        raise LetInError("a file was written there")
    return "is not below the page's folder"


def overwrite(target: Target) -> str:
    """Record in the place of what is there."""
    precious = {}
    for name in ("notes.txt", "notes.mcap"):
        precious[name] = (target.folder / name).write_text("precious")
    words = target.page._machine._words
    with target.visitor() as send:
        for name in precious:
            words.content = ""
            send(target.update("Log", name))
            send(target.update("Run", True))
            wait_until(lambda: bool(words.content) and "Running" not in words.content)
    if any((target.folder / name).read_text() != "precious" for name in precious):
        raise LetInError("it is gone")
    return "what was there is there"


_THEIRS = 3  # [%]: an override that nobody else gives


def second_owner(target: Target) -> str:
    """Give orders from a second page: slower, and a click on Resume."""
    override = target.page._machine._override
    with target.visitor(), target.visitor() as send:
        for _ in range(20):
            send(target.update("Override [%]", _THEIRS))
            send(target.update("Resume", True))
            send({"type": "ShareUrlRequest"})
        time.sleep(0.05)
        if override.value == _THEIRS:
            raise LetInError("the override is the watcher's")
    return "another page gives the orders"


def nonsense(target: Target) -> str:
    """Send what no page sends, and numbers that are none."""
    for garbage in GARBAGE:
        with contextlib.suppress(ConnectionClosed), target.stream() as stream:
            stream.send(msgspec.msgpack.encode(CAMERA))
            stream.send(garbage)
    with target.visitor() as send:
        for value in ("fast", None, [], -5, 1e308, float("nan"), float("inf"), 2**63 - 1):
            send(target.update("Override [%]", value))
        time.sleep(0.05)
    status, _ = target.get(target.home)
    if status != 200:
        raise LetInError(f"the page answers {status} from then on")
    return "the page is served as before"


def stop_while_hammered(target: Target) -> str:
    """Stop, while another page, of another process, sends as many orders as it can."""
    order = target.element("Lift [mm]")
    known = target.pages()
    command = [sys.executable, str(_HAMMER), "hammer", target.page.address, order]
    with subprocess.Popen(command) as page:
        try:
            wait_until(lambda: bool(target.pages() - known))
            time.sleep(0.2)
            return target.stop()
        finally:
            page.kill()


def stop_while_planning(target: Target) -> str:
    """Stop, while the page plans."""
    planning = threading.Thread(target=target.page._motion._plan)
    planning.start()
    wait_until(target.page._motion._one.locked)
    try:
        return target.stop()
    finally:
        planning.join()


def stop_while_stuck(target: Target) -> str:
    """Stop, under an open dialog and while every order of the page waits for something."""
    release = threading.Event()
    for _ in range(32):  # as many threads as viser has
        target.page._server._thread_executor.submit(release.wait)
    try:
        with target.page._server.gui.add_modal("Dialog"):
            return target.stop()
    finally:
        release.set()


REFUSED: dict[str, Callable[[Target], str]] = {
    "page: foreign Origin, token known": foreign_origin,
    "page: foreign Host (DNS rebinding)": foreign_host,
    "page: wrong token": wrong_token,
    "page: stream without an Origin": no_origin,
    "page: a link to Stop": a_link,
    "page: orders of a second owner": second_owner,
    "page: messages that are none": nonsense,
    "page: files outside the folder": outside,
    "page: a file that is there": overwrite,
}
STOPS: dict[str, Callable[[Target], str]] = {
    "page: Stop under a hammering page": stop_while_hammered,
    "page: Stop while it plans": stop_while_planning,
    "page: Stop, dialog open, orders stuck": stop_while_stuck,
}
