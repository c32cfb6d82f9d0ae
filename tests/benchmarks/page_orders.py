"""How long Stop takes from a request to the machine while another page hammers and one plans.

Stop is asked for by a process of its own, over a connection each as a browser does; another process
is the owner's page gone mad, with as many orders as it can send; the page plans all the while. The
time is from before the connection is opened until the order is given to the machine.

    python tests/benchmarks/page_orders.py [COUNT]
"""

from __future__ import annotations

import http.client
import platform
import subprocess
import sys
import threading
import time
from typing import Any

import numpy as np

import duoglide as dg
from duoglide.viewer.page import Page

CYCLE = 0.002  # [s]
APART = 0.02  # [s] between two stops


class Robot:
    """A machine that notes when it is stopped, and is asked for much by the page."""

    machine = dg.Machine.default()
    bus, homed, states, carriages, current_run = "virtual", False, (), (), None

    def __init__(self) -> None:
        self.stops: list[float] = []

    def stop(self) -> None:
        self.stops.append(time.monotonic())


def ask(address: str, count: int) -> None:
    """Ask for Stop so many times, and print when [s]."""
    _, _, host, token, _ = address.split("/")
    for _ in range(count):
        begin = time.monotonic()
        connection = http.client.HTTPConnection(host, timeout=30.0)
        headers = {"Duoglide-Order": "stop", "Origin": f"http://{host}"}
        connection.request("GET", f"/{token}/stop", headers=headers)
        assert connection.getresponse().status == 200
        connection.close()
        print(begin, flush=True)
        time.sleep(APART)


def hammer(address: str, uuid: str) -> None:
    """Send orders as quickly as they go."""
    import msgspec
    import viser
    from websockets.sync.client import connect

    _, _, host, token, _ = address.split("/")
    camera = {
        "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (1.0, 1.0, 1.0),
        "fov": 1.0, "near": 0.1, "far": 100.0, "look_at": (0.0, 0.0, 0.0),
        "up_direction": (0.0, 0.0, 1.0), "image_height": 100, "image_width": 100,
    }  # fmt: skip
    with connect(
        f"ws://{host}/{token}/",
        origin=f"http://{host}",  # type: ignore[arg-type]
        subprotocols=[f"viser-v{viser.__version__}"],  # type: ignore[list-item]
        max_size=None,
    ) as stream:
        threading.Thread(target=lambda: [None for _ in stream], daemon=True).start()
        stream.send(msgspec.msgpack.encode(camera))
        number = 0
        while True:
            number += 1
            update = {"value": number % 100}
            order = {"type": "GuiUpdateMessage", "uuid": uuid, "updates": update}
            stream.send(msgspec.msgpack.encode(order))


def measure(name: str, page: Page, robot: Robot, count: int, *, mad: bool, planning: bool) -> None:
    """Print how long Stop takes."""
    robot.stops.clear()
    others: list[subprocess.Popen[Any]] = []
    done = threading.Event()

    def plan() -> None:
        while not done.is_set():
            page._motion._plan()

    planner = threading.Thread(target=plan)
    if mad:
        uuid = page._machine._override._impl.uuid
        others.append(subprocess.Popen([sys.executable, __file__, "hammer", page.address, uuid]))
    if planning:
        planner.start()
    time.sleep(2.0)
    command = [sys.executable, __file__, "ask", page.address, str(count)]
    asked = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    done.set()
    for other in others:
        assert other.poll() is None, "it went away"
        other.kill()
        other.wait()
    if planning:
        planner.join()
    cycles = (np.array(robot.stops) - np.array(asked, dtype=float)) / CYCLE
    print(
        f"{name:<28} median {np.median(cycles):5.2f}  99 % {np.percentile(cycles, 99):5.2f}"
        f"  worst {cycles.max():5.2f} cycles of 2 ms",
        flush=True,
    )


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 300
    print(f"{count} stops each, Python {platform.python_version()}, {platform.machine()}")
    robot: Any = Robot()
    with Page(robot.machine, drives=robot, port=0) as page:
        measure("alone", page, robot, count, mad=False, planning=False)
        measure("while it plans", page, robot, count, mad=False, planning=True)
        measure("under a hammering page", page, robot, count, mad=True, planning=False)
        measure("hammering and planning", page, robot, count, mad=True, planning=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["ask"]:
        ask(sys.argv[2], int(sys.argv[3]))
    elif sys.argv[1:2] == ["hammer"]:
        hammer(sys.argv[2], sys.argv[3])
    else:
        main()
