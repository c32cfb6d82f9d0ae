"""A host in a process of its own, which can be killed, frozen, or told to end.

Run as a program it homes the drives on a bus, goes to the start of a plan, runs it as anybody's
script would, and prints the number of its streamer's process once the run has come so far::

    python host_process.py BUS PLAN LOG PATH_TIME HOW

``HOW`` is ``run``; or ``stuck``: then its main thread is from there on in a library's call that
does not return; or ``locked``: likewise, and no other thread of its interpreter goes on either.
"""

from __future__ import annotations

import ctypes
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path


class HostProcess:
    """A host that runs a plan; a context manager, entered once the run has come so far.

    Args:
        bus: Where its drives are.
        plan: File of what it runs.
        log: File that it writes.
        path_time: How far the run shall have come [s].
        how: See above.

    Attributes:
        streamer: Number of its streamer's process.
    """

    def __init__(self, bus: str, plan: Path, log: Path, path_time: float, how: str = "run") -> None:
        self._command = [sys.executable, __file__, bus, str(plan), str(log), str(path_time), how]
        self.streamer = 0

    def __enter__(self) -> HostProcess:
        self._process = subprocess.Popen(
            self._command,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            _, errors = self._process.communicate()
            raise RuntimeError(f"the host has not come to its run: {errors[-500:]}")
        self.streamer = int(line)
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()

    def send(self, number: signal.Signals) -> None:
        """Send it a signal."""
        self._process.send_signal(number)

    def wait(self, seconds: float) -> int | None:
        """Wait for its end; return its exit code, None where it lives on."""
        try:
            return self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            return None


def main(bus: str, plan: str, log: str, path_time: str, how: str) -> None:
    """Be the host."""
    import duoglide as dg
    from duoglide.control.host.interrupt import endings_interrupt
    from duoglide.control.host.run.handle import wait_to_the_end

    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background ignores it
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    trajectory = dg.Trajectory.load(plan)
    with dg.Robot.connect(trajectory.machine, bus=bus) as robot:
        robot.enable()
        robot.home()
        here = dg.forward(robot.machine.geometry, robot.held)
        robot.run(dg.transfer(robot.machine, here, trajectory.position_at(0.0)))
        handle = robot.start(trajectory, log=log)

        def tell() -> None:
            while handle.status.path_time < float(path_time) and not handle.done:
                time.sleep(0.0005)
            print(robot._connection.process.pid, flush=True)

        if how == "run":
            threading.Thread(target=tell, daemon=True).start()
            wait_to_the_end(handle)
        else:
            with endings_interrupt():
                tell()
                never_return(ctypes.PyDLL if how == "locked" else ctypes.CDLL)


def never_return(kind: type[ctypes.CDLL]) -> None:
    """Call a library that waits for what never comes; signals do not end that."""
    library, mutex = kind(None), ctypes.create_string_buffer(64)
    library.pthread_mutex_lock(mutex)
    library.pthread_mutex_lock(mutex)


if __name__ == "__main__":
    main(*sys.argv[1:])
