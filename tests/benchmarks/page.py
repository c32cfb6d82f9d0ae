"""How late the stream is with no page, one and three pages open, in one run, by turns.

Pages are clients that take all that the server sends and ask for its banner, in a process of their
own, as browsers on another computer are; with ``browser`` they are real ones, small, because a
browser without a graphics card draws with the processors that the stream needs too. A listener on
the bus, a process of its own, hears when SYNC comes; the run's log has the lateness of every cycle.
Memory of the process that streams and serves the pages is printed, too.

    python tests/benchmarks/page.py [turns] [seconds of each] [browser]
"""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

import duoglide as dg
from duoglide.arrays import BoolArray, FloatArray
from duoglide.storage import Topic, read_log
from duoglide.viewer.page import Page

SETTLE = 2.0  # [s] left out after pages have come or gone
PAGES = (0, 1, 3)
Opener: TypeAlias = Callable[[str, int], AbstractContextManager[None]]
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (1.0, 1.0, 1.0),
    "fov": 1.0, "near": 0.1, "far": 100.0, "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0), "image_height": 100, "image_width": 100,
}  # fmt: skip
FLAGS = ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking"]
FLAGS += ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
LISTENER = """
import signal, sys, time
from array import array
from duoglide.drives.bus.buses import open_bus
heard = array("d")
signal.signal(signal.SIGTERM, lambda *_: sys.exit())
try:
    with open_bus(sys.argv[1]) as bus:
        while True:
            message = bus.recv(1.0)
            if message is not None and message.arbitration_id == 0x80:
                heard.append(message.timestamp - time.time() + time.monotonic())
finally:
    heard.tofile(open(sys.argv[2], "wb"))
"""
CLIENTS = """
import sys, threading, urllib.request
import msgspec, viser
from websockets.sync.client import connect
address, count, camera = sys.argv[1], int(sys.argv[2]), eval(sys.argv[3])
host = address.split("/")[2]
def ask():
    seen = ""
    while True:
        request = urllib.request.Request(address + "state", headers={"Duoglide-Seen": seen})
        with urllib.request.urlopen(request) as answer:
            seen = str(msgspec.json.decode(answer.read())["number"])
def open_page():
    stream = connect(address.replace("http", "ws"), origin="http://" + host, max_size=None,
                     subprotocols=["viser-v" + viser.__version__])
    stream.send(msgspec.msgpack.encode(camera))
    for _ in stream:
        pass
for work in (ask, open_page) * count:
    threading.Thread(target=work).start()
"""


class Turn(NamedTuple):
    """A stretch of time with so many pages open [monotonic s]."""

    pages: int
    begin: float
    end: float
    memory: float  # of the process that serves the pages, at the end [MB]


@contextmanager
def listen(bus: str, file: Path) -> Iterator[None]:
    """Note when SYNC comes, in a process of its own."""
    process = subprocess.Popen([sys.executable, "-c", LISTENER, bus, str(file)])
    try:
        yield
    finally:
        process.terminate()
        process.wait(10.0)


@contextmanager
def open_clients(address: str, count: int) -> Iterator[None]:
    """Open pages without a browser."""
    arguments = [address, str(count), repr(CAMERA)]
    process = subprocess.Popen([sys.executable, "-c", CLIENTS, *arguments])
    try:
        yield
    finally:
        process.kill()
        process.wait(10.0)


@contextmanager
def open_browser(address: str, count: int) -> Iterator[None]:
    """Open tabs, each showing its strips; say when the slowest was there."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        begin = time.monotonic()
        for _ in range(count):
            tab = browser.new_page(viewport={"width": 700, "height": 400})
            tab.set_default_timeout(120_000)
            tab.goto(address)
            tab.get_by_role("tab", name="Live").click()
        print(f"{count} pages are up after {time.monotonic() - begin:.1f} s", file=sys.stderr)
        yield
        browser.close()


def take_turns(page: Page, turns: int, seconds: float, open_pages: Opener) -> list[Turn]:
    """Open and close pages while the run goes on."""
    found = []
    for _ in range(turns):
        for count in PAGES:
            with open_pages(page.address, count):
                time.sleep(SETTLE)
                begin = time.monotonic()
                time.sleep(seconds)
                found.append(Turn(count, begin, time.monotonic(), memory()))
            time.sleep(SETTLE)
    return found


def memory() -> float:
    """Return what this process has in memory [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def measure(folder: Path, turns: int, seconds: float, open_pages: Opener) -> list[Turn]:
    """Run slowly for as long as it takes, with pages coming and going."""
    machine = dg.Machine.default()
    with dg.Robot.connect(machine) as robot:
        robot.enable()
        robot.home()
        here = robot.position
        way = dg.transfer(machine, here, here + np.array([0.0, 150.0, 0.0]))
        with (
            Page(machine, drives=robot, port=0) as page,
            listen(robot.bus, folder / "heard"),
        ):
            run = robot.start(way, log=folder / "run.mcap", override=1e-4)
            found = take_turns(page, turns, seconds, open_pages)
            run.stop()
            run.wait(60.0)
    return found


def inside(times: FloatArray, turns: list[Turn], pages: int) -> BoolArray:
    """Return which times are in turns with so many pages."""
    which = np.zeros(len(times), dtype=bool)
    for turn in turns:
        if turn.pages == pages:
            which |= (times >= turn.begin) & (times <= turn.end)
    return which


def main() -> None:
    turns, seconds, *others = sys.argv[1:] or ("3", "4")
    open_pages = open_browser if others else open_clients
    folder = Path(tempfile.mkdtemp())
    found = measure(folder, int(turns), float(seconds), open_pages)
    cycles = list(read_log(folder / "run.mcap").records(Topic.CYCLE))
    times = np.array([t for t, _ in cycles])
    late = np.array([record.lateness for _, record in cycles], dtype=np.float64)
    heard = np.fromfile(folder / "heard")
    apart = np.abs(np.diff(heard) * 1e6 - 2000.0)
    print(f"{platform.machine()}, {platform.python_version()}, {len(cycles)} cycles at 500 Hz")
    print("| pages | cycles | lateness us: median | p99 | worst |", end="")
    print(" SYNC off its 2 ms on the bus us: median | p99 | worst | memory MB |")
    print("|---|---|---|---|---|---|---|---|---|")
    for pages in PAGES:
        own = late[inside(times, found, pages)]
        bus = apart[inside(heard[1:], found, pages)]
        figures = (*np.quantile(own, (0.5, 0.99, 1.0)), *np.quantile(bus, (0.5, 0.99, 1.0)))
        shown = " | ".join(f"{figure:.0f}" for figure in figures)
        most = max(turn.memory for turn in found if turn.pages == pages)
        print(f"| {pages} | {len(own)} | {shown} | {most:.0f} |")


if __name__ == "__main__":
    main()
