"""Where the machine starts: a pose with room on every side."""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray, read_only
from duoglide.errors import ConfigError
from duoglide.kinematics.constants import Plane
from duoglide.kinematics.headroom.room import room_at
from duoglide.kinematics.model import inverse, reachable
from duoglide.machine import Machine

DEEPEST = (-41.0, 0.0, 302.0)  # of Table 1's workspace, in whole millimetres
COLUMNS = 41
ROUNDS = 5  # each four times finer
ZOOM = 4.0
# Shares of the way along y that are tried beside keep-out boxes.
SHIFTS = (0.0, -0.2, 0.2, -0.4, 0.4, -0.6, 0.6, -0.8, 0.8)


def home_position(machine: Machine) -> FloatArray:
    """Find the platform position at which the machine is homed and its simulated drives start.

    The machine's own ``home_position`` where it has one; else (-41, 0, 302), the deepest point for
    Table 1, where that is allowed; else the pose with the most room, found by search.

    Args:
        machine: The machine.

    Returns:
        Platform centre O' in the base frame [mm], shape (3,).

    Raises:
        ConfigError: The machine's own home is not allowed, or no pose is.
    """
    if machine.home_position is not None:
        own = read_only(np.array(machine.home_position))
        if not _depth(machine, own) > 0.0:
            raise ConfigError(
                f"home_position = {list(machine.home_position)}: must be within reach, travel and"
                f" carriage order, out of keep_out, {machine.clearance:g} mm clear of every"
                f" singularity, and with a carriage margin of {machine.carriage_margin:g} mm"
            )
        return own
    usual = np.array(DEEPEST)
    return read_only(usual if _depth(machine, usual) > 0.0 else _deepest(machine))


def home_carriages(machine: Machine) -> FloatArray:
    """Find the carriage positions of ``home_position`` [mm], shape (3,).

    Raises:
        ConfigError: The machine's own home is not allowed, or no pose is.
    """
    return read_only(inverse(machine.geometry, home_position(machine)))


def _depth(machine: Machine, position: FloatArray) -> FloatArray:
    """Measure the least of what is left of clearance, travel and carriage order.

    Keep-out boxes and the carriage margin say no more than yes or no, so that neither moves the
    home while there is enough.

    Args:
        machine: The machine.
        position: Finite positions of the platform [mm], shape (..., 3).

    Returns:
        Room [mm], shape (...); negative or zero where the machine must not stand.
    """
    found = room_at(machine, position)
    least = np.minimum(np.minimum(found.clearance, found.travel), found.order)
    allowed = np.minimum(found.keep_out, found.carriage_margin) > 0.0
    return np.where(allowed, least, -np.inf)


def _deepest(machine: Machine) -> FloatArray:
    """Search the xz plane on ever finer grids; y puts the carriages amid their travel."""
    g = machine.geometry
    plane = Plane.of(g)
    centre = np.array([plane.cx, plane.zb])
    half = np.array([g.arm_length, g.strut_length])
    best, most = np.zeros(3), -np.inf
    for _ in range(ROUNDS):
        x = centre[0] + half[0] * np.linspace(-1.0, 1.0, COLUMNS)
        z = centre[1] + half[1] * np.linspace(-1.0, 1.0, COLUMNS)
        grid = np.stack(np.meshgrid(x, [0.0], z, indexing="ij"), axis=-1).reshape(-1, 3)
        poses = _spread_along_rails(machine, grid[reachable(g, grid)])
        left = _depth(machine, poses)
        if left.size and left.max() > most:
            best, most = poses[left.argmax()], left.max()
            centre = best[[0, 2]]
        half = half / ZOOM
    if most <= 0.0:
        raise ConfigError(
            "no pose is within reach, travel and carriage order with"
            f" {machine.clearance:g} mm clearance and a carriage margin of"
            f" {machine.carriage_margin:g} mm; lower clearance, carriage_margin or carriage_width"
        )
    return best


def _spread_along_rails(machine: Machine, poses: FloatArray) -> FloatArray:
    """Give every pose one y or several with its carriages on their rails, shape (n, 3)."""
    offsets = inverse(machine.geometry, poses)
    low, high = offsets.min(axis=-1), offsets.max(axis=-1)
    way = np.maximum(machine.geometry.rail_half_length - 0.5 * (high - low), 0.0)
    shifts = np.array(SHIFTS if machine.keep_out else SHIFTS[:1])
    spread = np.repeat(poses[:, None, :], shifts.size, axis=1)
    spread[..., 1] = -0.5 * (low + high)[:, None] + way[:, None] * shifts
    return spread.reshape(-1, 3)
