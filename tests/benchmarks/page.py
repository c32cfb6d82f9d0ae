"""How late the cycles are with the live page open and closed, in one run, by turns.

The run is started from the page, in a real browser, at one percent of its speed. The browser is
then closed and opened again every few seconds; the run's own log has the lateness of every cycle.

    python tests/benchmarks/page.py
"""

from __future__ import annotations

import platform
import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import duoglide as dg
from duoglide.storage import Topic, read_log
from duoglide.viewer.page import Page

TURNS = 3
SECONDS = 4.0  # [s] of each turn
SETTLE = 1.0  # [s] left out after the browser has come or gone
FLAGS = ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking"]
FLAGS += ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


def start_run(browser: Any, address: str, log: Path) -> Any:
    """Plan, connect, home and run, by clicking; return the tab."""
    tab = browser.new_page(viewport={"width": 1400, "height": 1000})
    tab.set_default_timeout(120_000)
    tab.goto(address)
    tab.get_by_role("tab", name="Motion").click()
    tab.get_by_role("button", name="Plan", exact=True).click()
    tab.get_by_text("least clearance").first.wait_for()
    tab.get_by_role("tab", name="Machine").click()
    tab.get_by_role("button", name="Connect").click()
    tab.get_by_text("no power yet").first.wait_for()
    tab.get_by_role("button", name="Enable and home").click()
    tab.get_by_text("Under power and homed").first.wait_for()
    inputs = tab.locator("input:visible")
    inputs.nth(1).fill(str(log))
    inputs.last.fill("1")
    inputs.last.press("Enter")
    time.sleep(0.5)
    tab.get_by_role("button", name="Run", exact=True).click()
    tab.get_by_text("running").first.wait_for()
    return tab


def measure(log: Path) -> dict[str, list[tuple[float, float]]]:
    """Run, and return when the page was open and when it was closed [monotonic s]."""
    from playwright.sync_api import sync_playwright

    turns: dict[str, list[tuple[float, float]]] = {"open": [], "closed": []}
    with Page(dg.Machine.default(), port=0) as page, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        tab = start_run(browser, page.address, log)
        for turn in range(TURNS):
            for state in ("open", "closed"):
                if state == "closed":
                    tab.close()
                elif turn > 0:
                    tab = browser.new_page(viewport={"width": 1400, "height": 1000})
                    tab.goto(page.address)
                time.sleep(SETTLE)
                begin = time.monotonic()
                time.sleep(SECONDS)
                turns[state].append((begin, time.monotonic()))
        browser.close()
    return turns


def main() -> None:
    log = Path(tempfile.mkdtemp()) / "run.mcap"
    turns = measure(log)
    cycles = list(read_log(log).records(Topic.CYCLE))
    times = np.array([t for t, _ in cycles])
    lateness = np.array([record.lateness for _, record in cycles])
    print(f"{platform.machine()}, {platform.python_version()}, {len(cycles)} cycles at 500 Hz")
    print("| page | cycles | median us | p99 us | worst us |\n|---|---|---|---|---|")
    for state, spans in turns.items():
        inside = np.zeros(len(times), dtype=bool)
        for begin, end in spans:
            inside |= (times >= begin) & (times <= end)
        late = lateness[inside]
        if len(late):
            p50, p99, worst = np.quantile(late, (0.5, 0.99, 1.0))
            print(f"| {state} | {len(late)} | {p50:.0f} | {p99:.0f} | {worst:.0f} |")


if __name__ == "__main__":
    main()
