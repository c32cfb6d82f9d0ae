"""The page in a real browser: Debian's chromium, headless, drawing in software."""

from __future__ import annotations

import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.control.channel.events import RunState
from duoglide.control.host.run.handle import RunStatus
from duoglide.control.host.trace import Trace
from duoglide.drives.cia402 import State
from duoglide.viewer.join import JoinedRobot
from duoglide.viewer.page import Page
from duoglide.viewer.share import share

CHROMIUM = shutil.which("chromium")
FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
]
SIZE: Any = {"width": 1400, "height": 1000}
TYPED = "input:visible:not([type=checkbox])"  # of the fields of a tab
PATIENCE = 300_000  # [ms]: a browser without a graphics card takes its time on a busy computer
PATIENT = dg.Machine(  # a browser that draws in software starves everybody else
    drives=dg.DriveSettings(
        late_cycles=250,
        missing_frames=250,
        setpoint_timeout=0.5,
        heartbeat_timeout=2.0,
        following_error_window=50.0,
    )
)

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="needs Debian's chromium"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning"),
]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def browser_page(browser: Any) -> Iterator[Any]:
    with (
        tempfile.TemporaryDirectory() as folder,
        Page(PATIENT, port=0, folder=Path(folder)) as page,
    ):
        tab = visit(browser, page)
        tab.folder = Path(folder)
        yield tab
        tab.close()


def standing(**changes: Any) -> Any:
    """A machine of somebody else that stands still."""
    robot = {
        "machine": PATIENT, "bus": "virtual", "homed": False, "why_not_homed": "as this test says",
        "enabled": False, "latched": (), "states": (State.SWITCH_ON_DISABLED,) * 3,
        "carriages": np.zeros(3), "current_run": None, "trace": Trace(PATIENT.drives),
        "stop": lambda: None,
    }  # fmt: skip
    return SimpleNamespace(**robot | changes)


def visit(browser: Any, page: Page) -> Any:
    tab = browser.new_page(viewport=SIZE)
    tab.set_default_timeout(PATIENCE)
    tab.goto(page.address)
    tab.get_by_role("button", name="Hold").wait_for()
    return tab


def open_tab(tab: Any, name: str) -> None:
    tab.get_by_role("tab", name=name).click()


def banner_says(tab: Any, word: str, more: str) -> None:
    tab.locator("#duoglide-word").get_by_text(word, exact=True).wait_for()
    tab.locator("#duoglide-says").get_by_text(more).wait_for()


def wait_for(tab: Any, text: str) -> None:
    tab.get_by_text(text).first.wait_for()


def test_the_page_is_served_to_this_machine_only(browser_page: Any) -> None:
    assert browser_page.url.startswith("http://127.0.0.1:")


def test_the_page_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with Page(PATIENT, port=0):
        pass
    assert capsys.readouterr().out == "", "results are printed there, as JSON perhaps"


def test_a_typed_position_is_answered_by_the_inverse_kinematics(browser_page: Any) -> None:
    open_tab(browser_page, "Pose")
    height = browser_page.locator("input:visible").nth(2)
    height.fill("310")
    height.press("Enter")
    first = dg.inverse(dg.Geometry(), (-41.0, 0.0, 310.0))[0]
    wait_for(browser_page, f"Carriages {first:.2f}")
    height.fill("500")
    height.press("Enter")
    wait_for(browser_page, "Out of reach.")


def test_a_pick_is_planned_run_held_and_stopped_on_the_space_bar(
    browser_page: Any, tmp_path: Path
) -> None:
    tab = browser_page
    open_tab(tab, "Motion")
    tab.get_by_role("button", name="Plan", exact=True).click()
    wait_for(tab, "least carriage margin")
    open_tab(tab, "Machine")
    tab.get_by_role("button", name="Connect").click()
    wait_for(tab, "the drives have no power yet")
    banner_says(tab, "No power", "Press Enable and home")
    tab.get_by_role("button", name="Enable and home").click()
    wait_for(tab, "Under power and homed")
    banner_says(tab, "Ready", "Press Run")
    log = tab.folder / "run.mcap"
    inputs = tab.locator(TYPED)  # bus and log in the panel, override beside Stop
    inputs.nth(1).fill("run.mcap")
    override = inputs.last
    override.fill("1")  # slow, so that there is time to hold and to stop
    override.press("Enter")
    tab.get_by_role("button", name="Run", exact=True).click()
    wait_for(tab, "running at")  # not the browser's word that WebGL is running in software
    banner_says(tab, "Running", "speed 1 %")
    assert tab.get_by_role("button", name="Disable").is_disabled()
    tab.get_by_role("button", name="Hold").click()
    banner_says(tab, "Held", "Press Resume")
    tab.get_by_role("button", name="Resume").click()
    wait_for(tab, "running at")
    tab.mouse.click(700, 900)  # away from every control
    tab.keyboard.press("Space")
    wait_for(tab, "stopped on the ")  # path, or on the approach to it
    banner_says(tab, "Stopped", "Press Run")
    assert log.stat().st_size > 1000
    open_tab(tab, "Live")
    wait_for(tab, "approach started")
    titles = tab.locator(".u-title:visible").all_text_contents()
    assert [title.partition(" [")[0] for title in titles] == [
        "Following error", "Velocity", "Carriage margin", "Lateness of cycles",
    ]  # fmt: skip
    points = "Object.values(__viserTestpoints.uplots).map(one => one.chart.data[0].length)"
    assert min(tab.evaluate(points)) > 50
    tab.screenshot(path=str(tmp_path / "page.png"))


@pytest.fixture(scope="module")
def stopping(browser: Any) -> Iterator[tuple[Any, list[float]]]:
    """A page beside a machine of somebody else, and when it was stopped."""
    stops: list[float] = []
    robot = standing(stop=lambda: stops.append(time.monotonic()))
    with Page(PATIENT, drives=robot, port=0) as page:
        tab = visit(browser, page)
        tab.gui = page._server.gui
        yield tab, stops
        tab.close()


def stops_by(stopping: tuple[Any, list[float]], act: Callable[[], object]) -> int:
    """Do something in the browser, and return how often the machine was stopped for it."""
    tab, stops = stopping
    before = len(stops)
    with tab.expect_response(lambda answer: answer.url.endswith("/stop") and answer.ok):
        act()
    return len(stops) - before


def test_the_button_stops_once(stopping: Any) -> None:
    tab, _ = stopping
    assert stops_by(stopping, tab.locator("#duoglide-stop").click) == 1


def test_space_stops_while_a_text_has_the_focus_and_is_not_typed(stopping: Any) -> None:
    tab, _ = stopping
    open_tab(tab, "Machine")
    field = tab.locator(TYPED).nth(1)
    field.fill("run")
    field.press("End")
    assert stops_by(stopping, lambda: tab.keyboard.press("Space")) == 1
    assert field.input_value() == "run"


def test_space_stops_while_a_button_has_the_focus_and_does_not_press_it(stopping: Any) -> None:
    tab, _ = stopping
    open_tab(tab, "Motion")
    tab.get_by_role("button", name="Plan", exact=True).focus()
    assert stops_by(stopping, lambda: tab.keyboard.press("Space")) == 1
    wait_for(tab, "Nothing is loaded.")
    assert not tab.get_by_text("Planning").count(), "Plan says that, if it is pressed"


def test_stop_and_space_work_under_an_open_dialog(stopping: Any) -> None:
    tab, _ = stopping
    with tab.gui.add_modal("Dialog") as dialog:
        tab.gui.add_text("In the dialog", "")
    field = tab.get_by_label("In the dialog").or_(tab.locator("[role=dialog] input")).first
    field.wait_for()
    tab.wait_for_timeout(500)  # [ms]; it moves in, and takes the focus
    assert stops_by(stopping, tab.locator("#duoglide-stop").click) == 1
    assert tab.get_by_role("dialog").count(), "Stop does not answer the dialog"
    field.focus()
    assert stops_by(stopping, lambda: tab.keyboard.press("Space")) == 1
    dialog.close()
    tab.get_by_role("dialog").wait_for(state="detached")


def test_stop_stays_when_every_panel_is_minimised(stopping: Any) -> None:
    tab, _ = stopping
    while (minimise := tab.locator(".tabler-icon-minus:visible")).count():
        minimise.first.click()
    tab.get_by_role("button", name="Hold").wait_for(state="hidden")
    assert stops_by(stopping, tab.locator("#duoglide-stop").click) == 1
    assert stops_by(stopping, lambda: tab.keyboard.press("Space")) == 1


def test_a_stop_that_did_not_arrive_is_told(stopping: Any) -> None:
    tab, stops = stopping
    before = len(stops)
    tab.route("**/stop", lambda route: route.abort())
    tab.keyboard.press("Space")
    tab.get_by_text("STOP DID NOT ARRIVE").wait_for()
    tab.unroute("**/stop")
    assert len(stops) == before
    assert stops_by(stopping, lambda: tab.keyboard.press("Space")) == 1
    tab.get_by_text("STOP DID NOT ARRIVE").wait_for(state="hidden")


@pytest.mark.parametrize("size", [(900, 600), (390, 844), (1920, 1080)])
def test_banner_and_stop_are_in_sight_at_every_size(
    stopping: tuple[Any, list[float]], size: tuple[int, int]
) -> None:
    tab, _ = stopping
    tab.set_viewport_size({"width": size[0], "height": size[1]})
    for name in ("duoglide-stop", "duoglide-word", "duoglide-advice", "duoglide-power"):
        box = tab.locator(f"#{name}").bounding_box()
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        at = "([x, y]) => document.elementFromPoint(x, y).id"
        assert tab.evaluate(at, middle) == name, "and nothing covers it"
    assert stops_by(stopping, tab.locator("#duoglide-stop").click) == 1


def test_the_page_is_dark_where_the_browser_is(stopping: tuple[Any, list[float]]) -> None:
    tab, _ = stopping
    tab.set_viewport_size({"width": 600, "height": 400})  # quick to draw
    tab.emulate_media(color_scheme="dark")
    tab.wait_for_function("document.documentElement.dataset.mantineColorScheme == 'dark'")
    tab.get_by_role("tab", name="Motion").wait_for()
    assert tab.title() == "Duoglide"


def test_there_is_no_button_to_share_with_the_public(stopping: Any) -> None:
    tab, _ = stopping
    assert not tab.locator(".tabler-icon-share").count()


def test_another_tab_watches_and_takes_over(browser: Any, browser_page: Any) -> None:
    watcher = browser.new_page(viewport=SIZE)
    watcher.set_default_timeout(PATIENCE)
    watcher.goto(browser_page.url)
    watcher.get_by_role("button", name="Take over").wait_for()
    open_tab(watcher, "Motion")
    watcher.get_by_role("button", name="Plan", exact=True).click()
    wait_for(watcher, "Another page gives the orders. Stop")
    watcher.get_by_role("button", name="Take over").click()
    wait_for(watcher, "Another page gives the orders now")
    watcher.get_by_role("button", name="Plan", exact=True).click()
    wait_for(watcher, "least clearance")
    watcher.close()


def test_the_override_is_the_one_that_another_page_has_chosen(browser: Any) -> None:
    status = RunStatus(RunState.RUNNING, 0.1, 0.5, (0.0, 1.0, 2.0), (0.0, 0.0, 0.0), 9.0, 0.5)
    run = SimpleNamespace(status=status)
    robot = standing(states=(State.OPERATION_ENABLED,) * 3, enabled=True, current_run=run)
    with share(robot) as path, Page(PATIENT, drives=JoinedRobot(path), port=0) as page:
        tab = visit(browser, page)
        slider = tab.locator("input:visible").last.element_handle()
        for percent in (50, 20):
            run.status = replace(status, override=0.01 * percent)
            tab.wait_for_function("([input, text]) => input.value == text", arg=[slider, percent])
        tab.close()


@pytest.fixture(scope="module")
def jogging(browser: Any) -> Iterator[tuple[Any, Any]]:
    """A page beside a machine that is homed, and remembers its steps; each waits to be let go."""
    place = np.array([-41.0, 0.0, 302.0])
    robot = standing(
        states=(State.OPERATION_ENABLED,) * 3, enabled=True, homed=True, position=place,
        carriages=dg.inverse(dg.Geometry(), place), steps=[], go_on=threading.Event(),
    )  # fmt: skip
    creeping = RunStatus(RunState.RUNNING, 0.1, 0.1, (0.0,) * 3, (0.0,) * 3, 9.0, 0.1)

    def jog(step: Any) -> None:
        robot.current_run = SimpleNamespace(status=creeping)
        robot.steps.append(step.tolist())
        assert robot.go_on.wait(PATIENCE / 1000)
        robot.current_run = None

    robot.jog = jog
    with Page(PATIENT, drives=robot, port=0) as page:
        tab = visit(browser, page)
        yield tab, robot
        tab.close()


def test_a_jog_leaves_the_override_of_the_next_run_alone(jogging: tuple[Any, Any]) -> None:
    tab, robot = jogging
    robot.go_on.clear()
    open_tab(tab, "Jog")
    wait_for(tab, "At x -41.00, y 0.00, z 302.00 mm")
    tab.get_by_role("button", name="+x").click()
    open_tab(tab, "Operator")
    wait_for(tab, "running at")
    robot.go_on.set()
    wait_for(tab, "At (-41.00, 0.00, 302.00) mm.")
    assert tab.locator("input:visible").last.input_value() == "100"
    assert robot.steps == [[1.0, 0.0, 0.0]]


def test_a_held_button_and_arrow_keys_go_on_by_steps_until_they_are_let_go(
    jogging: tuple[Any, Any],
) -> None:
    tab, robot = jogging
    robot.go_on.set()
    open_tab(tab, "Jog")
    tab.get_by_role("button", name="0.1", exact=True).click()
    wait_for(tab, "Step: 0.1 mm")
    robot.steps.clear()
    tab.get_by_role("button", name="-z").hover()
    tab.mouse.down()
    wait_until(lambda: len(robot.steps) > 2)
    tab.mouse.up()
    settle(tab)
    assert set(map(tuple, robot.steps)) == {(0.0, 0.0, -0.1)}
    robot.steps.clear()
    tab.wait_for_timeout(300)
    assert not robot.steps, "nothing holds the button any more"
    tab.keyboard.press("ArrowRight")
    wait_until(lambda: robot.steps == [[0.0, 0.1, 0.0]])


def test_what_is_held_when_the_machine_is_stopped_moves_it_no_more(
    jogging: tuple[Any, Any],
) -> None:
    tab, robot = jogging
    robot.go_on.set()
    open_tab(tab, "Jog")
    tab.get_by_role("button", name="+z").hover()
    tab.mouse.down()
    wait_until(lambda: bool(robot.steps))
    with tab.expect_response(lambda answer: answer.url.endswith("/stop")):
        tab.keyboard.press("Space")
    settle(tab)
    robot.steps.clear()
    tab.wait_for_timeout(300)
    assert not robot.steps
    tab.mouse.up()


def wait_until(come: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE / 1000
    while not come():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def settle(tab: Any) -> None:
    """Wait until what the page has sent has arrived: its messages come in order."""
    tab.get_by_role("button", name="1", exact=True).click()
    wait_for(tab, "Step: 1 mm")
    tab.get_by_role("button", name="0.1", exact=True).click()
    wait_for(tab, "Step: 0.1 mm")


def test_a_run_that_somebody_else_started_is_stopped_from_the_page() -> None:
    trajectory = dg.transfer(PATIENT, (-41.0, 0.0, 302.0), (-41.0, 100.0, 302.0))
    with dg.Robot.connect(PATIENT) as robot:
        robot.enable()
        robot.home()
        with share(robot) as path, Page(PATIENT, drives=JoinedRobot(path), port=0) as page:
            run = robot.start(trajectory, override=0.01)
            page.stop()
            report = run.wait(60.0)
        assert not report.completed
        assert robot.enabled  # the page is gone; the robot is still its owner's
