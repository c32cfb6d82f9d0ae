"""The planner's process: ``python -m duoglide.control.host.planner PARTS PATHS``.

Started by ``control.host.run.feed`` with two inherited sockets; not for people.
"""

from __future__ import annotations

import os
import signal
import socket
import sys
from collections.abc import Iterator
from contextlib import suppress
from typing import TypeVar

from duoglide.control.channel.orders import pack_object, receive_object
from duoglide.control.host.run.parts import PlannedPart, ProgramOrder, plan_parts, prepare_parts
from duoglide.errors import DuoglideError
from duoglide.motion.path.path import Path
from duoglide.planning.trajectory import Trajectory

T = TypeVar("T")
_NICE = 10  # below the streamer, the bus and the host


def ask_for_paths(host: socket.socket, kind: type[T]) -> Iterator[T]:
    """Yield the host's paths, or trajectories, one for each time it is asked."""
    while True:
        host.sendall(b"?")
        path = receive_object(host)
        if not isinstance(path, kind):
            return
        yield path


def plan(order: ProgramOrder, paths: socket.socket) -> Iterator[PlannedPart]:
    """Plan a program part by part, or prepare one that is planned."""
    if order.planned:
        return prepare_parts(order.machine, ask_for_paths(paths, Trajectory))
    return plan_parts(order, ask_for_paths(paths, Path))


def main(arguments: list[str]) -> int:
    """Plan a program for the host, part by part, until it ends or the host is gone."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the host hears them too, and ends this process
    with suppress(OSError):
        os.nice(_NICE)
    parts, paths = (socket.socket(fileno=int(number)) for number in arguments)
    order = receive_object(parts)
    if not isinstance(order, ProgramOrder):
        return 2
    end: DuoglideError | None = None
    try:
        for part in plan(order, paths):
            parts.sendall(pack_object(part))
    except DuoglideError as error:
        end = error
    except (OSError, EOFError):
        raise
    except Exception as error:  # whatever it is, the host has to hear of it, and say it
        end = DuoglideError(f"the program cannot be planned on: {type(error).__name__}: {error}")
    parts.sendall(pack_object(end))
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except (OSError, EOFError):
        sys.exit(1)  # the host is gone
