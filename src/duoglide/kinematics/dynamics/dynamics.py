"""Forces from motion and motion from forces, energies and the mass matrix: one pose or many."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, as_floats, as_triples
from duoglide.errors import InputError, SingularityError
from duoglide.kinematics.batch import BLOCK, compiles, triple
from duoglide.kinematics.compiled import compiled, share
from duoglide.kinematics.constants import PoseConstants, pose_constants
from duoglide.kinematics.derivatives import root_rates
from duoglide.kinematics.dynamics import kernels
from duoglide.kinematics.dynamics.constants import KILOGRAM, MassConstants, mass_constants
from duoglide.kinematics.kernels import SINGULAR, in_numpy
from duoglide.kinematics.modes import WORKING
from duoglide.kinematics.reach import require_inside, require_reach
from duoglide.machine import Machine

_JOULE = 1e-3  # per N mm
_CARRIAGES = "(carriage 1, 2, 3)"

levers_columns = in_numpy(kernels.levers_pose)
_forces_columns = in_numpy(kernels.forces_pose, levers_pose=levers_columns)
_acceleration_columns = in_numpy(kernels.acceleration_pose, levers_pose=levers_columns)
_kinetic_columns = in_numpy(kernels.kinetic_pose, levers_pose=levers_columns)
_potential_columns = in_numpy(kernels.potential_pose, levers_pose=levers_columns)


class _Batch(NamedTuple):
    """Arguments of one call, each as rows: as many as there are poses, or one for all.

    Attributes:
        machine: Whose links and masses.
        shape: Of the batch, without the last axis.
        rows: Position, then what goes with it, (n, 3) or (1, 3) each.
        payload: [N s^2/mm], (n,) or (1,).
    """

    machine: Machine
    shape: tuple[int, ...]
    rows: tuple[FloatArray, ...]
    payload: FloatArray

    @classmethod
    def of(cls, machine: Machine, payload: ArrayLike | None, *triples: FloatArray) -> _Batch:
        """Bring arguments of shape (..., 3), and the payload, to one shape.

        Raises:
            InputError: No machine, a payload below zero, or shapes that do not fit each other.
        """
        if not isinstance(machine, Machine):
            raise InputError(f"machine must be a duoglide.Machine, got {machine!r:.80}")
        carried = as_floats(machine.masses.payload if payload is None else payload, "payload")
        if carried.size and carried.min() < 0.0:
            raise InputError(f"payload = {carried.min():g} kg: must be 0 or above")
        leading = [array.shape[:-1] for array in triples]
        try:
            shape = np.broadcast_shapes(*leading, carried.shape)
        except ValueError as error:
            told = ", ".join(str(array.shape) for array in (*triples, carried))
            raise InputError(f"shapes do not fit each other: {told}") from error
        rows = tuple(_as_rows(array, shape) for array in triples)
        return cls(machine, shape, rows, KILOGRAM * _as_rows(carried[..., None], shape)[:, 0])

    @property
    def constants(self) -> tuple[PoseConstants, MassConstants]:
        """The numbers of links and masses."""
        return constants_of(self.machine)

    def run(self, columns: Callable[..., Any], width: int) -> tuple[FloatArray, bool]:
        """Answer a block of rows at a time: what is between the steps stays in the cache.

        Args:
            columns: What to ask of each block: a kernel for arrays.
            width: Numbers that it gives for each pose; whether they are sure may follow.

        Returns:
            The answers, (..., width), and whether all of them are finite and sure.
        """
        count, (k, m) = int(np.prod(self.shape)), self.constants
        out, fine = np.empty((count, width)), True
        with np.errstate(all="ignore"):
            for block in _blocks(count):
                given = [tuple(part.T) for part in _cut(self.rows, block)]
                carried: Any = next(_cut((self.payload,), block))  # a column of floats
                answer = columns(*given, k, m._replace(payload=carried))
                answer = answer if isinstance(answer, tuple) else (answer,)
                for into, column in zip(out[block].T, answer[:width], strict=True):
                    into[:] = column
                fine = fine and all(np.all(sure) for sure in answer[width:])
                fine = fine and bool(np.isfinite(out[block]).all())
        return out.reshape(*self.shape, width), fine

    def refuse(self, what: str, *, singular: bool) -> None:
        """Say which pose has no answer, and why.

        Args:
            what: Was asked for, for an error that no pose explains.
            singular: Whether a parallel singularity is a reason.

        Raises:
            UnreachableError: A link is too short.
            SingularityError: On the edge of reach or at a parallel singularity.
            InputError: The numbers are too large.
        """
        position = self.rows[0].reshape(*(self.shape if len(self.rows[0]) > 1 else ()), 3)
        k, _ = self.constants
        require_inside(position, require_reach(position, k))
        if singular:
            at = levers_columns(position[..., 0], position[..., 2], k)
            wrong = np.argwhere(~np.asarray(kernels.sure_pose(at, k)))
            if len(wrong):
                index = tuple(int(i) for i in wrong[0])
                flat = bool(np.abs(at.h[index]) <= SINGULAR)
                raise _singularity(position[index], index, flat=flat)
        raise InputError(f"{what} are too large for a float: velocities are in mm/s, mm/s^2")


def carriage_forces(
    machine: Machine,
    position: ArrayLike,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    payload: ArrayLike | None = None,
) -> FloatArray:
    """Find the forces of the drives that move the platform as told: inverse dynamics.

    Closed form: in the seven lengths (x, y, z, yA1, yA2, yA3, h) the mass matrix of the whole robot
    is constant; see the docs, Forces. Bars are uniform and do not spin about their own axes. Of a
    carriage at rest no Coulomb friction is counted, as it may point either way.

    Args:
        machine: Geometry, and ``machine.masses``.
        position: Platform centre O' in the base frame [mm], shape (..., 3).
        velocity: Of the platform [mm/s], shape (..., 3).
        acceleration: Of the platform [mm/s^2], shape (..., 3).
        payload: What the platform carries [kg], shape (...); None: ``machine.masses.payload``.

    Returns:
        Forces on the carriages along +y [N], shape (..., 3).

    Raises:
        InputError: Not finite numbers of shapes that fit each other, or a payload below 0.
        UnreachableError: A link is too short.
        SingularityError: On the edge of reach, where carriages would move infinitely fast, or where
            no force of theirs holds the platform: legs flat, or arm and strut in line.
    """
    given = as_triples(position, "position"), as_triples(velocity, "velocity")
    batch = _Batch.of(machine, payload, *given, as_triples(acceleration, "acceleration"))
    if batch.shape == ():
        single, sure = _one_forces(batch)
        if not sure:
            batch.refuse("forces", singular=True)
        return triple(*single)
    count = int(np.prod(batch.shape))
    if compiles(np.broadcast_to(0.0, (count, 3))):
        out = np.empty((count, 3))
        flat = tuple(np.ascontiguousarray(part).reshape(-1) for part in batch.rows)
        steps = tuple(3 * (len(part) > 1) for part in batch.rows)
        last = np.ascontiguousarray(batch.payload), int(batch.payload.size > 1)
        k, m = batch.constants
        loop = _compiled_forces()
        failed = loop((*flat, last[0]), (*steps, last[1]), out.reshape(-1), tuple(k), tuple(m)[:-1])
        fine = failed == 0
        found = out.reshape(*batch.shape, 3)
    else:
        found, fine = batch.run(_forces_columns, 3)
    if not fine:
        batch.refuse("forces", singular=True)
    return found


def platform_acceleration(
    machine: Machine,
    position: ArrayLike,
    velocity: ArrayLike,
    forces: ArrayLike,
    payload: ArrayLike | None = None,
) -> FloatArray:
    """Find how the platform accelerates under forces of the drives: forward dynamics.

    The reverse of ``carriage_forces``, and as it is, without the friction that holds what rests.

    Args:
        machine: Geometry, and ``machine.masses``.
        position: Platform centre O' in the base frame [mm], shape (..., 3).
        velocity: Of the platform [mm/s], shape (..., 3).
        forces: On the carriages along +y [N], shape (..., 3).
        payload: What the platform carries [kg], shape (...); None: ``machine.masses.payload``.

    Returns:
        Acceleration of the platform [mm/s^2], shape (..., 3).

    Raises:
        InputError: Not finite numbers of shapes that fit each other, a payload below 0, or parts
            without any mass.
        UnreachableError: A link is too short.
        SingularityError: On the edge of reach.
    """
    given = as_triples(position, "position"), as_triples(velocity, "velocity")
    batch = _Batch.of(machine, payload, *given, as_triples(forces, "forces", _CARRIAGES))
    found, fine = batch.run(_acceleration_columns, 3)
    if not fine:
        batch.refuse("accelerations", singular=False)
    return found


def mass_matrix(
    machine: Machine, position: ArrayLike, payload: ArrayLike | None = None
) -> FloatArray:
    """Find the mass matrix of the whole robot, felt at the platform.

    The kinetic energy is 1/2 v^T M v with the platform's velocity v.

    Args:
        machine: Geometry, and ``machine.masses``.
        position: Platform centre O' in the base frame [mm], shape (..., 3).
        payload: What the platform carries [kg], shape (...); None: ``machine.masses.payload``.

    Returns:
        Symmetric matrices in (x, y, z) [kg], shape (..., 3, 3).

    Raises:
        InputError: Not finite numbers of shapes that fit each other, or a payload below 0.
        UnreachableError: A link is too short.
        SingularityError: On the edge of reach.
    """
    batch = _Batch.of(machine, payload, as_triples(position, "position"))
    found, fine = batch.run(_matrix_columns, 9)
    if not fine:
        batch.refuse("masses", singular=False)
    return found.reshape(*batch.shape, 3, 3)


def kinetic_energy(
    machine: Machine,
    position: ArrayLike,
    velocity: ArrayLike,
    payload: ArrayLike | None = None,
) -> FloatArray:
    """Find the kinetic energy of the whole robot, motors and payload included.

    Args:
        machine: Geometry, and ``machine.masses``.
        position: Platform centre O' in the base frame [mm], shape (..., 3).
        velocity: Of the platform [mm/s], shape (..., 3).
        payload: What the platform carries [kg], shape (...); None: ``machine.masses.payload``.

    Returns:
        Energy [J], shape (...).

    Raises:
        InputError: Not finite numbers of shapes that fit each other, or a payload below 0.
        UnreachableError: A link is too short.
        SingularityError: On the edge of reach.
    """
    given = as_triples(position, "position"), as_triples(velocity, "velocity")
    batch = _Batch.of(machine, payload, *given)
    found, fine = batch.run(_kinetic_columns, 1)
    if not fine:
        batch.refuse("energies", singular=False)
    energy: FloatArray = _JOULE * found[..., 0]
    return energy


def potential_energy(
    machine: Machine, position: ArrayLike, payload: ArrayLike | None = None
) -> FloatArray:
    """Find the potential energy of the whole robot, but for a constant of the machine.

    Args:
        machine: Geometry, and ``machine.masses``.
        position: Platform centre O' in the base frame [mm], shape (..., 3).
        payload: What the platform carries [kg], shape (...); None: ``machine.masses.payload``.

    Returns:
        Energy [J], shape (...).

    Raises:
        InputError: Not finite numbers of shapes that fit each other, or a payload below 0.
        UnreachableError: A link is too short.
        SingularityError: On the edge of reach.
    """
    batch = _Batch.of(machine, payload, as_triples(position, "position"))
    found, fine = batch.run(_potential_columns, 1)
    if not fine:
        batch.refuse("energies", singular=False)
    energy: FloatArray = _JOULE * found[..., 0]
    return energy


def constants_of(machine: Machine) -> tuple[PoseConstants, MassConstants]:
    """Return the numbers of links and masses."""
    return pose_constants(machine.geometry, WORKING), mass_constants(machine)


def _one_forces(batch: _Batch) -> tuple[tuple[float, float, float], bool]:
    """Return the forces of one pose, and whether they are finite and sure."""
    pose, velocity, acceleration = (tuple(part[0].tolist()) for part in batch.rows)
    k, m = batch.constants
    m = m._replace(payload=float(batch.payload[0]))
    try:
        f1, f2, f3, sure = kernels.forces_pose(pose, velocity, acceleration, k, m)
    except (ValueError, ZeroDivisionError):  # a square root or a quotient has failed
        return (0.0, 0.0, 0.0), False
    total = f1 + f2 + f3
    return (f1, f2, f3), sure and total - total == 0.0


def _matrix_columns(
    pose: Sequence[FloatArray], k: PoseConstants, m: MassConstants
) -> tuple[FloatArray, ...]:
    """Return the nine entries of the mass matrix, row by row [kg]."""
    at = levers_columns(pose[0], pose[2], k)
    found: Any = kernels.matrix_pose(at, k, m)  # columns of floats
    xx, yy, zz, xy, xz, yz = (entry / KILOGRAM for entry in found)
    return xx, xy, xz, xy, yy, yz, xz, yz, zz


def _as_rows(array: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return an array of shape (..., w) as rows, one where the same counts for every pose."""
    if array.ndim == 1 or array.shape[:-1] == shape:
        return array.reshape(-1, array.shape[-1])
    return np.broadcast_to(array, (*shape, array.shape[-1])).reshape(-1, array.shape[-1])


def _blocks(count: int) -> Iterator[slice]:
    for start in range(0, count, BLOCK):
        yield slice(start, min(start + BLOCK, count))


def _cut(arrays: tuple[FloatArray, ...], block: slice) -> Iterator[FloatArray]:
    """Yield the rows of a block; what counts for every pose as it is."""
    for rows in arrays:
        yield rows[block] if len(rows) > 1 else rows


def _singularity(pose: FloatArray, index: tuple[int, ...], *, flat: bool) -> SingularityError:
    x, y, z = pose.tolist()
    where = f"position[{', '.join(map(str, index))}]" if index else "position"
    family, told = (
        ("legs_flat", "the legs lie flat") if flat else ("arm_strut", "arm and strut are in line")
    )
    return SingularityError(
        f"{where} ({x:.6g}, {y:.6g}, {z:.6g}) mm: {told}, so that no force of the carriages holds"
        " the platform",
        index=index,
        family=family,
    )


@cache
def _compiled_forces() -> Any:
    """Compile the loop, or load it from numba's cache."""
    register_dynamics()
    return compiled(kernels.forces_loop, nogil=True)


@cache
def register_dynamics() -> None:
    """Let compiled code call the formulas, which stay plain functions for everyone else."""
    share(
        root_rates,
        kernels.levers_pose,
        kernels.sure_pose,
        kernels.carriage_rates,
        kernels.inertia_pose,
        kernels.weight_pose,
        kernels.distribute_pose,
        kernels.friction,
        kernels.forces_pose,
        inline=True,
    )
