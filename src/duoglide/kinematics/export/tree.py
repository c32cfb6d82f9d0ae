"""The mechanism as a tree of bodies plus closures, at a reference pose where the loops close.

Every body's frame is aligned with the base frame at the reference pose and stands on the body's own
joint. The parallelograms have both of their long bars; nothing is taken from the closed forms but
the reference pose.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, as_triples
from duoglide.errors import ConfigError, InputError
from duoglide.kinematics.constants import Plane
from duoglide.kinematics.home import home_position
from duoglide.kinematics.model import reachable
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.kinematics.singularity.margins import clearance, margins
from duoglide.kinematics.skeleton import joints
from duoglide.machine import Geometry, Machine, Masses

Point: TypeAlias = tuple[float, float, float]

HALF_WIDTH = 15.0  # [mm], half of a parallelogram's short side
END_BAR = 0.05  # of the mass of carriage 3 or platform: the end bar of parallelogram 2 there
X, Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


class Motion(Enum):
    """What a body's joint lets it do relative to its parent."""

    SLIDE = "slide"
    HINGE = "hinge"


@dataclass(frozen=True, slots=True)
class Bar:
    """A straight piece of a body, for pictures and mass, from ``start`` to ``end`` [mm]."""

    start: Point
    end: Point


@dataclass(frozen=True, slots=True)
class Body:
    """A link of the tree.

    Attributes:
        name: Its name.
        parent: Name of its parent; "base" for the fixed base.
        motion: What its joint is.
        axis: Direction of its joint in the base frame.
        origin: Centre of its joint at the reference pose, in the base frame [mm].
        bars: What it looks like, in the base frame at the reference pose.
        value: What its joint reads at the reference pose: a carriage's position [mm], else 0.
        mass: What it weighs [kg].
        slender: Whether its mass is spread evenly along its first bar; else it never turns, or
            about its bar alone.
    """

    name: str
    parent: str
    motion: Motion
    axis: Point
    origin: Point
    bars: tuple[Bar, ...]
    value: float = 0.0
    mass: float = 0.0
    slender: bool = False

    @property
    def centre(self) -> Point:
        """Centre of its bars' lengths, in the base frame at the reference pose [mm]."""
        ends = np.array([(bar.start, bar.end) for bar in self.bars])
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1)
        return _point(lengths @ ends.mean(axis=1) / lengths.sum())


@dataclass(frozen=True, slots=True)
class Closure:
    """A point that two bodies share, in the base frame at the reference pose [mm]."""

    first: str
    second: str
    point: Point


@dataclass(frozen=True, slots=True)
class Tree:
    """The whole mechanism.

    Attributes:
        bodies: Parents before children.
        closures: What makes the tree a closed mechanism.
        platform_offset: From the platform body's origin to O' [mm].
        travel: The carriages stay within +-travel [mm].
        masses: Masses, friction and gravity, none of them left out.
    """

    bodies: tuple[Body, ...]
    closures: tuple[Closure, ...]
    platform_offset: Point
    travel: float
    masses: Masses


def build_tree(
    machine: Machine | Geometry,
    position: ArrayLike | None = None,
    mode: WorkingMode = WORKING,
) -> Tree:
    """Describe the mechanism of ``machine`` at its reference pose.

    Args:
        machine: A machine, or a geometry alone.
        position: The reference pose [mm], shape (3,). None: the machine's home; of a geometry
            alone, the deepest pose of a coarse grid.
        mode: Which of the inverse solutions stands at the reference pose.

    Raises:
        ConfigError: No pose closes the links, or the machine's own home is not allowed.
        InputError: The position is not three finite numbers.
        UnreachableError: The position is beyond reach.
    """
    given = machine.masses if isinstance(machine, Machine) else Masses()
    geometry = machine.geometry if isinstance(machine, Machine) else machine
    masses = given.complete(geometry)
    pose = _reference_pose(machine) if position is None else as_triples(position, "position")
    if pose.ndim != 1:
        raise InputError(f"position must be one triple, got shape {pose.shape}")
    at = joints(geometry, pose, mode)
    platform = at["E2"] + _along(X)
    bodies = (*_first_chain(at), *_second_chain(at))
    weights = _weigh(masses)
    return Tree(
        bodies=tuple(_with_mass(body, weights[body.name]) for body in bodies),
        closures=_closures(at),
        platform_offset=_point(at["O"] - platform),
        travel=geometry.rail_half_length,
        masses=masses,
    )


def _weigh(masses: Masses) -> dict[str, float]:
    """Return the mass of each body [kg].

    The end bars of parallelogram 2 move with carriage 3 and with the platform, and take a small
    part of their masses: a body without any cannot be simulated.
    """
    parts = (masses.leg, masses.coupler, masses.riser, masses.arm, masses.strut, masses.platform)
    leg, coupler, riser, arm, strut, platform = (part or 0.0 for part in parts)
    platform += masses.payload
    first, second, third = masses.carriage
    return {
        "carriage_1": first,
        "carriage_2": second,
        "carriage_3": (1.0 - END_BAR) * third,
        "leg_1": leg,
        "leg_2": leg,
        "coupler": coupler + riser,
        "arm_near": 0.5 * arm,
        "arm_far": 0.5 * arm,
        "platform": (1.0 - END_BAR) * platform,
        "lower_bar": END_BAR * third,
        "strut_near": 0.5 * strut,
        "strut_far": 0.5 * strut,
        "upper_bar": END_BAR * platform,
    }


def _with_mass(body: Body, mass: float) -> Body:
    slender = body.name.startswith(("leg_", "arm_", "strut_"))
    return replace(body, mass=mass, slender=slender)


def _first_chain(at: dict[str, FloatArray]) -> tuple[Body, ...]:
    """Carriages 1 and 2, their legs, the coupler, parallelogram 1 and the platform."""
    near, far = _along(X), -_along(X)
    return (
        _carriage(1, at),
        _carriage(2, at),
        _body("leg_1", "carriage_1", X, at["B1"], (at["B1"], at["C1"])),
        _body("leg_2", "carriage_2", X, at["B2"], (at["B2"], at["C2"])),
        _body(
            "coupler",
            "leg_1",
            X,
            at["C1"],
            (at["C1"], at["C2"]),
            (at["D1"], at["D2"]),
            (at["D2"] + near, at["D2"] + far),
        ),
        _body("arm_near", "coupler", Y, at["D2"] + near, (at["D2"] + near, at["E2"] + near)),
        _body("arm_far", "coupler", Y, at["D2"] + far, (at["D2"] + far, at["E2"] + far)),
        _body(
            "platform",
            "arm_near",
            Y,
            at["E2"] + near,
            (at["E2"] + near, at["E2"] + far),
            (at["E2"], at["S"]),
            (at["S"], at["T"]),
            (at["T"], at["C3"]),
        ),
    )


def _second_chain(at: dict[str, FloatArray]) -> tuple[Body, ...]:
    """Carriage 3 and parallelogram 2 between the revolutes R32 and R33, which are parallel to y.

    Parallel to x, as R13 is, they would leave the platform a rotation about x.
    """
    strut = at["C3"] - at["B3"]
    axis = np.array([strut[2], 0.0, -strut[0]])
    across = _point(axis / np.linalg.norm(axis))
    foot_near, foot_far = at["B3"] + _along(Y), at["B3"] - _along(Y)
    top_near, top_far = at["C3"] + _along(Y), at["C3"] - _along(Y)
    return (
        _carriage(3, at),
        _body("lower_bar", "carriage_3", Y, at["B3"], (foot_near, foot_far)),
        _body("strut_near", "lower_bar", across, foot_near, (foot_near, top_near)),
        _body("strut_far", "lower_bar", across, foot_far, (foot_far, top_far)),
        _body("upper_bar", "strut_near", across, top_near, (top_near, top_far)),
    )


def _closures(at: dict[str, FloatArray]) -> tuple[Closure, ...]:
    """Four loops: the six-bar, the parallelograms, and the platform on the strut.

    A revolute joint that closes a loop of bodies in one plane needs one common point. That at C3
    needs two on its axis: one alone would be a ball joint.
    """
    return (
        Closure("leg_2", "coupler", _point(at["C2"])),
        Closure("arm_far", "platform", _point(at["E2"] - _along(X))),
        Closure("strut_far", "upper_bar", _point(at["C3"] - _along(Y))),
        Closure("upper_bar", "platform", _point(at["C3"] + _along(Y))),
        Closure("upper_bar", "platform", _point(at["C3"] - _along(Y))),
    )


def _carriage(number: int, at: dict[str, FloatArray]) -> Body:
    foot = at[f"A{number}"]
    return Body(
        name=f"carriage_{number}",
        parent="base",
        motion=Motion.SLIDE,
        axis=Y,
        origin=_point(foot),
        bars=(Bar(_point(foot), _point(at[f"B{number}"])),),
        value=float(foot[1]),
    )


def _body(
    name: str,
    parent: str,
    axis: Point,
    origin: FloatArray,
    *bars: tuple[FloatArray, FloatArray],
) -> Body:
    drawn = tuple(Bar(_point(start), _point(end)) for start, end in bars)
    return Body(name, parent, Motion.HINGE, axis, _point(origin), drawn)


def _along(axis: Point) -> FloatArray:
    return HALF_WIDTH * np.array(axis)


def _point(values: FloatArray) -> Point:
    x, y, z = values.tolist()
    return x, y, z


def _reference_pose(machine: Machine | Geometry) -> FloatArray:
    """Return a pose with room around it."""
    if isinstance(machine, Machine):
        return home_position(machine)
    return _deepest_of_grid(machine)


def _deepest_of_grid(geometry: Geometry) -> FloatArray:
    """Find the pose with the most clearance on a grid over the reach of arm and strut."""
    g = geometry
    plane = Plane.of(g)
    x = plane.cx + g.arm_length * np.linspace(-0.99, 0.99, 81)
    z = plane.zb + g.strut_length * np.linspace(-0.99, 0.99, 81)
    grid = np.stack(np.meshgrid(x, [0.0], z, indexing="ij"), axis=-1).reshape(-1, 3)
    grid = grid[reachable(g, grid)]
    sides = margins(g, grid)
    grid = grid[(sides.legs_flat > 0.0) & (sides.arm_strut > 0.0)]
    if not len(grid):
        raise ConfigError("no pose of the assembly mode (+1, +1) closes the links")
    deepest: FloatArray = grid[clearance(g, grid).argmax()]
    return deepest
