"""What lets other processes of the same user on this computer watch a machine, and stop it.

A process that moves a machine opens a socket beside its stream; a page of another one joins it.
Each request is a connection of its own, one line of JSON there and one back, so that a stop waits
behind nothing. Nothing here is seen by the streamer's process but the orders themselves.
"""

from __future__ import annotations

import contextlib
import json
import os
import socketserver
import stat
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from duoglide.errors import BusError, DuoglideError
from duoglide.viewer.look import Look

if TYPE_CHECKING:
    from duoglide.control.host.robot import Robot
    from duoglide.control.host.run.handle import RunHandle

LONGEST = 1 << 20  # [bytes] of a request or an answer
PATIENCE = 2.0  # [s]


@contextmanager
def share(robot: Robot) -> Iterator[Path]:
    """Let others of the same user watch, hold and stop ``robot`` while the block runs.

    Args:
        robot: A connected machine; it stays its owner's in everything else.

    Yields:
        The socket.

    Raises:
        BusError: There is no place for the socket that is the user's alone.
    """
    path = meeting_place() / f"{os.getpid()}.sock"
    path.unlink(missing_ok=True)
    try:
        server = _Server(str(path), _Request)
    except OSError as error:
        raise BusError(f"cannot share the machine at {path}: {error}") from error
    server.answer = _answers(robot)
    thread = threading.Thread(target=server.serve_forever, args=(0.1,), name="share", daemon=True)
    thread.start()
    try:
        yield path
    finally:
        server.shutdown()
        server.server_close()
        path.unlink(missing_ok=True)


def meeting_place() -> Path:
    """Return the folder of the sockets, which nobody but the user can enter.

    That is in ``XDG_RUNTIME_DIR``, or beside other temporary files where there is no such folder,
    as in many containers.

    Raises:
        BusError: It cannot be made, or it is somebody else's.
    """
    own = os.environ.get("XDG_RUNTIME_DIR", "")
    folder = Path(tempfile.gettempdir()) / f"duoglide-{os.getuid()}"
    if own and Path(own).is_dir():
        folder = Path(own) / "duoglide"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError as error:
        raise BusError(f"cannot share machines in {folder}: {error.strerror}") from error
    if found.st_uid != os.getuid() or not stat.S_ISDIR(found.st_mode) or found.st_mode & 0o077:
        raise BusError(f"cannot share machines in {folder}: it must be a folder of yours alone")
    return folder


def _answers(robot: Robot) -> Callable[[dict[str, Any]], object]:
    """Return what turns a request into an answer."""
    described = robot.machine.to_dict()

    def answer(request: dict[str, Any]) -> object:
        what, run = request["do"], robot.current_run
        if what == "meet":
            return {"machine": described, "bus": robot.bus}
        if what == "look":
            return Look.at(robot).to_dict()
        if what == "trace":
            return _trace(robot, request)
        if what == "stop":
            robot.stop()
        elif run is not None:
            _order(run, what, request)
        return {}

    return answer


def _order(run: RunHandle, what: str, request: dict[str, Any]) -> None:
    if what == "hold":
        run.hold()
    elif what == "resume":
        run.resume()
    elif what == "override":
        run.set_override(request["value"])
    else:
        raise ValueError(f"nobody knows how to {what}")


def _trace(robot: Robot, request: dict[str, Any]) -> dict[str, Any]:
    trace = robot.trace
    return {"rows": trace.rows(request["row"]), "events": trace.events(request["event"])}


class _Server(socketserver.ThreadingUnixStreamServer):
    daemon_threads = True
    answer: Callable[[dict[str, Any]], object]


class _Request(socketserver.StreamRequestHandler):
    timeout = PATIENCE
    server: _Server

    def handle(self) -> None:
        """Answer one request; whoever asks for nonsense or goes away does no harm."""
        try:
            answer = self.server.answer(json.loads(self.rfile.readline(LONGEST)))
        except DuoglideError as error:
            answer = {"error": str(error)}
        except OSError:  # nothing came
            return
        except (ValueError, KeyError, TypeError) as error:
            answer = {"error": f"not understood: {error!r}"}
        with contextlib.suppress(OSError):  # nobody waits any more
            self.wfile.write(json.dumps(answer).encode() + b"\n")
