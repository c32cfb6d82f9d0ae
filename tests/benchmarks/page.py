"""How late the stream is with no page, one and three pages open, in one run, by turns.

A slow run shows on pages in a real browser, each with its strips; small ones, because a browser
without a graphics card draws with the processors that the stream needs too. A listener on the bus,
a process of its own, hears when SYNC comes; the run's log has the lateness of every cycle. Memory
of the process that streams and serves the pages is printed, too.

    python tests/benchmarks/page.py [turns] [seconds of each]
"""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import duoglide as dg
from duoglide.arrays import BoolArray, FloatArray
from duoglide.storage import Topic, read_log
from duoglide.viewer.page import Page

SETTLE = 1.0  # [s] left out after a browser has come or gone
PAGES = (0, 1, 3)
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
                heard.append(time.monotonic())
finally:
    heard.tofile(open(sys.argv[2], "wb"))
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


def open_pages(browser: Any, address: str, count: int) -> list[Any]:
    """Open so many tabs at once, each showing its strips; say when the slowest was there."""
    begin, tabs = time.monotonic(), []
    for _ in range(count):
        tab = browser.new_page(viewport={"width": 700, "height": 400})
        tab.set_default_timeout(120_000)
        tab.goto(address)
        tab.get_by_role("tab", name="Live").click()
        tabs.append(tab)
    if tabs:
        print(f"{count} pages are up after {time.monotonic() - begin:.1f} s", file=sys.stderr)
    return tabs


def take_turns(page: Page, turns: int, seconds: float) -> list[Turn]:
    """Open and close pages while the run goes on."""
    from playwright.sync_api import sync_playwright

    found = []
    with sync_playwright() as playwright:
        chromium = shutil.which("chromium")
        for _ in range(turns):
            for count in PAGES:
                browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
                open_pages(browser, page.address, count)
                time.sleep(SETTLE)
                begin = time.monotonic()
                time.sleep(seconds)
                found.append(Turn(count, begin, time.monotonic(), memory()))
                browser.close()
                time.sleep(SETTLE)
    return found


def memory() -> float:
    """Return what this process has in memory [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def measure(folder: Path, turns: int, seconds: float) -> list[Turn]:
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
            found = take_turns(page, turns, seconds)
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
    turns, seconds = sys.argv[1:] or ("3", "4")
    folder = Path(tempfile.mkdtemp())
    found = measure(folder, int(turns), float(seconds))
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
