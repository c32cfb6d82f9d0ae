"""Every inverse and every forward solution, with what is wrong with each."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, as_triples, read_only
from duoglide.errors import InputError, UnreachableError
from duoglide.kinematics.headroom.room import TOUCHING
from duoglide.kinematics.model import forward, inverse, reachable
from duoglide.kinematics.modes import AssemblyMode, WorkingMode
from duoglide.kinematics.singularity.margins import margins
from duoglide.machine import Geometry

SIGNS = (1, -1)


@dataclass(frozen=True, slots=True, eq=False)
class InverseSolution:
    """Carriages that hold the platform at a position.

    Attributes:
        mode: Which of the inverse solutions.
        carriages: Carriage positions [mm], shape (3,).
        realisable: Whether it can be built: carriage 2 stands beyond carriage 1. Where it does, the
            legs do not cross either, because C2 is beyond C1.
        singular: Whether the pose lies on a singular surface of this mode, edges of reach included:
            a margin is within 1e-7 mm of 0.
    """

    mode: WorkingMode
    carriages: FloatArray
    realisable: bool
    singular: bool


@dataclass(frozen=True, slots=True, eq=False)
class ForwardSolution:
    """A position at which the platform can be for given carriages.

    Attributes:
        mode: Which of the forward solutions.
        position: Platform centre O' [mm], shape (3,).
    """

    mode: AssemblyMode
    position: FloatArray


def inverse_all(geometry: Geometry, position: ArrayLike) -> list[InverseSolution]:
    """Find every real inverse solution of one position, in the order of Table 3.

    Args:
        geometry: Dimensions of the robot.
        position: Platform centre O' [mm], shape (3,).

    Returns:
        Up to 16 solutions (8 where only one sign of sin(beta) reaches), none beyond reach.

    Raises:
        InputError: Not three finite numbers.
    """
    pose = _one(position, "position")
    modes = (WorkingMode(*signs) for signs in product(SIGNS, repeat=4))
    return [
        _inverse_solution(geometry, pose, mode) for mode in modes if reachable(geometry, pose, mode)
    ]


def _inverse_solution(geometry: Geometry, pose: FloatArray, mode: WorkingMode) -> InverseSolution:
    carriages = read_only(inverse(geometry, pose, mode))
    return InverseSolution(
        mode=mode,
        carriages=carriages,
        realisable=bool(carriages[1] > carriages[0]),
        singular=bool(margins(geometry, pose, mode).least() <= TOUCHING),
    )


def forward_all(geometry: Geometry, carriages: ArrayLike) -> list[ForwardSolution]:
    """Find every real forward solution of one triple of carriages, in the order of Table 2.

    Args:
        geometry: Dimensions of the robot.
        carriages: Carriage positions [mm], shape (3,).

    Returns:
        Up to 4 solutions, none where the links do not close.

    Raises:
        InputError: Not three finite numbers.
        SingularityError: The solutions are not isolated: legs parallel, or two of them merge.
    """
    triple = _one(carriages, "carriages")
    solutions = []
    for signs in product(SIGNS, repeat=2):
        mode = AssemblyMode(*signs)
        try:
            position = read_only(forward(geometry, triple, mode))
        except UnreachableError:
            continue
        solutions.append(ForwardSolution(mode=mode, position=position))
    return solutions


def _one(value: ArrayLike, name: str) -> FloatArray:
    array = as_triples(value, name)
    if array.ndim != 1:
        raise InputError(f"{name} must be one triple, got shape {array.shape}")
    return array
