"""A machine that another process on this computer moves: watched, held and stopped from here."""

from __future__ import annotations

import json
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from duoglide.control.host.run.handle import RunStatus
from duoglide.control.host.trace import TraceEvent, TraceRow
from duoglide.errors import BusError
from duoglide.machine import Machine
from duoglide.viewer.look import Look
from duoglide.viewer.share import LONGEST, PATIENCE, meeting_place

_PATIENCE = 5.0  # [s] with a process on a busy computer
_NEVER = 1 << 62  # a number that no row and no event has


def find(pid: int | None = None) -> Path:
    """Find the socket of the process that shares a machine.

    Args:
        pid: Its process number; None where only one does.

    Raises:
        BusError: There is none, or more than one.
    """
    found = [path for path in sorted(meeting_place().glob("*.sock")) if _listens(path)]
    numbers = ", ".join(path.stem for path in found)
    if pid is not None:
        found = [path for path in found if path.stem == str(pid)]
    if not found:
        runs = "a duoglide stream, replay or demo does while it runs"
        known = f"these do: {numbers}" if numbers else runs
        who = f"process {pid} shares none" if pid is not None else "no process shares a machine"
        raise BusError(f"{who}; {known}")
    if len(found) > 1:
        raise BusError(f"several processes share a machine; say which: --pid {numbers}")
    return found[0]


@dataclass(frozen=True, slots=True)
class JoinedRun:
    """The run of a joined machine, as ``RunHandle`` shows and takes orders for one.

    Attributes:
        status: Where it is.
        path: The socket.
    """

    status: RunStatus
    path: Path

    def hold(self) -> None:
        """Come to rest on the path; ``resume`` goes on."""
        _ask(self.path, {"do": "hold"})

    def resume(self) -> None:
        """Go on after a hold."""
        _ask(self.path, {"do": "resume"})

    def set_override(self, override: float) -> None:
        """Run at this rate, 0 to 1."""
        _ask(self.path, {"do": "override", "value": override})


@dataclass(frozen=True, slots=True)
class JoinedTrace:
    """The trace of a joined machine, asked for as ``Trace`` is.

    Attributes:
        path: The socket.
    """

    path: Path

    def rows(self, after: int) -> list[TraceRow]:
        """Return the rows that are newer than one of that number, the oldest first."""
        rows = self._ask("rows", after, _NEVER)
        return [
            TraceRow(n, t, tuple(c), tuple(f), late, moving) for n, t, c, f, late, moving in rows
        ]

    def events(self, after: int) -> list[TraceEvent]:
        """Return the events that are newer than one of that number, the oldest first."""
        return [TraceEvent(*event) for event in self._ask("events", _NEVER, after)]

    def _ask(self, part: str, row: int, event: int) -> list[Any]:
        found: list[Any] = _ask(self.path, {"do": "trace", "row": row, "event": event})[part]
        return found


class JoinedRobot:
    """A machine that another process moves; as much of a ``Robot`` as others may touch.

    Args:
        path: The socket, from ``find``.

    Raises:
        BusError: Nobody answers there.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        met = _ask(path, {"do": "meet"})
        self.machine = Machine.from_dict(met["machine"])
        self.bus = str(met["bus"])

    def look(self) -> Look:
        """Look at the machine.

        Raises:
            BusError: Its owner has ended, or cannot see it.
        """
        return Look.from_dict(_ask(self._path, {"do": "look"}))

    @property
    def current_run(self) -> JoinedRun | None:
        """The run in progress."""
        status = self.look().run
        return JoinedRun(status, self._path) if status is not None else None

    @property
    def trace(self) -> JoinedTrace:
        """What the machine did in the last ten seconds, and what has happened to it."""
        return JoinedTrace(self._path)

    def stop(self) -> None:
        """Come to rest on the path and end the run."""
        _ask(self._path, {"do": "stop"})


def _ask(path: Path, request: dict[str, Any]) -> dict[str, Any]:
    """Send one request and return its answer.

    Raises:
        BusError: The process has ended, or says what is wrong.
    """
    try:
        with socket.socket(socket.AF_UNIX) as end:
            end.settimeout(_PATIENCE)
            end.connect(str(path))
            with end.makefile("rwb") as stream:
                stream.write(json.dumps(request).encode() + b"\n")
                stream.flush()
                answer = json.loads(stream.readline(LONGEST))
    except (OSError, ValueError) as error:
        raise BusError("the process that moves the machine has ended, or is stuck") from error
    if "error" in answer:
        raise BusError(str(answer["error"]))
    found: dict[str, Any] = answer
    return found


def _listens(path: Path) -> bool:
    """Whether somebody answers; what a killed process has left behind is taken away."""
    with socket.socket(socket.AF_UNIX) as end:
        end.settimeout(PATIENCE)
        try:
            end.connect(str(path))
        except ConnectionRefusedError:
            path.unlink(missing_ok=True)
            return False
        except OSError:
            return False
    return True
