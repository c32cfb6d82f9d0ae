"""Three simulated drives in a process of their own, as whoever starts them holds it.

On the bus ``virtual`` that process also is the hub that joins everyone; its address is what other
programs connect to.
"""

from __future__ import annotations

import multiprocessing
import subprocess
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from duoglide.arrays import AXES
from duoglide.drives.bus.buses import parse_bus
from duoglide.drives.simulation.makers.imitation import CONTRACT, Imitation
from duoglide.drives.simulation.process import DISMISS, Job
from duoglide.drives.simulation.rack import STANDSTILL
from duoglide.errors import BusError, DriveTimeout

if TYPE_CHECKING:
    from duoglide.drives.simulation.faults import Injection
    from duoglide.drives.simulation.plant import PlantParameters
    from duoglide.drives.simulation.rack import DriveSnapshot
    from duoglide.machine import DriveSettings

_START_PATIENCE = 20.0  # how long the process may take to come up [s]
_ANSWER_PATIENCE = 5.0


class SimulatedDrives:
    """Three simulated drives in a process of their own; a context manager.

    The process ends with the handle, and soon after its parent if that dies without a word.

    Args:
        settings: The machine's drives.
        positions: Where the carriages stand [mm], three values.
        bus: ``virtual`` starts a hub; any other name is opened and served.
        plants: What hangs on each drive; three, or None for the default.
        standstill: For how long they stand still with a host that agrees to it; see ``build_rack``.
        imitations: In what each differs from the contract; three, or None for no difference.
    """

    def __init__(
        self,
        settings: DriveSettings,
        positions: Sequence[float],
        *,
        bus: str = "virtual",
        plants: Sequence[PlantParameters] | None = None,
        standstill: float = STANDSTILL,
        imitations: Sequence[Imitation] | None = None,
    ) -> None:
        parse_bus(bus)
        places = tuple(map(float, positions))
        differ = (CONTRACT,) * AXES if imitations is None else tuple(imitations)
        self._job = Job(settings, places, bus, plants, standstill, differ)
        self._address = ""
        self._one_at_a_time = threading.Lock()  # an answer is for who has asked

    def __enter__(self) -> SimulatedDrives:
        self._pipe, theirs = multiprocessing.Pipe()
        call = "from duoglide.drives.simulation.process import main; main(int(sys.argv[1]))"
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", f"import sys; {call}", str(theirs.fileno())],
            pass_fds=(theirs.fileno(),),
            stdin=subprocess.DEVNULL,
            start_new_session=True,  # keys at the terminal are for the parent alone
        )
        theirs.close()
        try:
            self._pipe.send(self._job)
            self._address = str(self._answer(_START_PATIENCE))
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def address(self) -> str:
        """The name of the bus that they are on, for ``open_bus``."""
        return self._address

    @property
    def pid(self) -> int:
        """The process."""
        return self._process.pid

    def inject(self, injection: Injection) -> None:
        """Make something happen to a drive; it has happened when this returns.

        Raises:
            DriveTimeout: The process does not answer.
        """
        self._ask(injection)

    def snapshot(self) -> tuple[DriveSnapshot, ...]:
        """Return what the drives really do, past the bus.

        Raises:
            DriveTimeout: The process does not answer.
        """
        answer: tuple[DriveSnapshot, ...] = self._ask("snapshot")  # type: ignore[assignment]
        return answer

    def _ask(self, what: object) -> object:
        with self._one_at_a_time:
            try:
                self._pipe.send(what)
            except OSError:
                raise BusError("the process of the simulated drives has ended") from None
            return self._answer(_ANSWER_PATIENCE)

    def _answer(self, patience: float) -> object:
        try:
            if not self._pipe.poll(patience):
                raise DriveTimeout(f"the simulated drives do not answer for {patience:g} s")
            answer: object = self._pipe.recv()
        except (EOFError, ConnectionResetError):
            raise BusError("the process of the simulated drives has ended") from None
        if isinstance(answer, Exception):
            raise answer
        return answer

    def close(self) -> None:
        """End the process."""
        with suppress(OSError):  # it may have ended by itself
            self._pipe.send(DISMISS)
        self._pipe.close()
        try:
            self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
