"""What the planner's process is told, and the parts of a program that it hands over."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from duoglide.control.channel.setpoints import Fence, PreparedSetpoints
from duoglide.control.host.run.fitness import LimitUse, require_lines, sample_limit_use
from duoglide.control.host.run.prepare import prepare_part
from duoglide.planning.programs.planner import plan_program

if TYPE_CHECKING:
    from duoglide.machine import Machine, Timing
    from duoglide.motion.path.path import Path
    from duoglide.planning.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class ProgramOrder:
    """How a program is to be planned; see ``plan_program``.

    Attributes:
        machine: The machine.
        tolerance: See ``plan_program``.
        brake_safe: See ``plan``.
        timing: See ``plan``.
        planned: Whether it is planned already, and comes as trajectories.
    """

    machine: Machine
    tolerance: float = 0.0
    brake_safe: bool = True
    timing: Timing | str | None = None
    planned: bool = False


@dataclass(frozen=True, slots=True)
class PlannedPart:
    """A part of a program, ready for the streamer.

    Attributes:
        prepared: Its setpoints, numbered from 1 in the program.
        document: Its trajectory, for the log: JSON.
        limit_use: How much of the machine's limits it uses.
        paths: How many paths of the program are done at its end.
        after: Number of the setpoints that it goes on from; None: the newest.
    """

    prepared: PreparedSetpoints
    document: bytes
    limit_use: LimitUse
    paths: int
    after: int | None = None


def plan_parts(order: ProgramOrder, paths: Iterable[Path]) -> Iterator[PlannedPart]:
    """Plan a program part by part.

    Raises:
        PathError: What ``plan_program`` raises, after all that comes before it.
        DriveError: It sets outputs of a drive that has none, or waits for inputs of one.
    """
    done = 0

    def count(paths_done: int, _: float) -> None:
        nonlocal done
        done = paths_done

    parts = plan_program(
        order.machine,
        paths,
        order.brake_safe,
        count,
        tolerance=order.tolerance,
        timing=order.timing,
    )
    for part in prepare_parts(order.machine, parts):
        yield replace(part, paths=done)


def prepare_parts(machine: Machine, parts: Iterable[Trajectory]) -> Iterator[PlannedPart]:
    """Prepare the parts of a program, each of which counts as a path.

    Raises:
        DriveError: One sets outputs of a drive that has none, or waits for inputs of one.
    """
    fence, before = Fence.of(machine), None
    for number, part in enumerate(parts, start=1):
        yield prepare_planned(part, fence, number, before)
        before = part


def prepare_planned(
    part: Trajectory, fence: Fence, number: int, before: Trajectory | None
) -> PlannedPart:
    """Prepare one part; see ``prepare_part``.

    Raises:
        DriveError: It sets outputs of a drive that has none, or waits for inputs of one.
    """
    require_lines(part.whole or part, part.machine)
    prepared = prepare_part(part, fence, number, before)
    document = json.dumps(part.to_document(), allow_nan=False).encode()
    return PlannedPart(prepared, document, sample_limit_use(part), number)
