"""Joints, links and loops of a mechanism, as data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction

from duoglide.errors import InputError
from duoglide.paper.topology.poc import Poc, levers
from duoglide.paper.topology.subspace import (
    ALL,
    NONE,
    Directions,
    Vector,
    cross,
    vector,
)


class JointKind(Enum):
    """Kinds of joints; the value is the number of freedoms and of axes that describe it."""

    REVOLUTE = ("R", 1, 1)
    PRISMATIC = ("P", 1, 1)
    CYLINDRICAL = ("C", 2, 1)
    UNIVERSAL = ("U", 2, 2)
    SPHERICAL = ("S", 3, 0)
    PARALLELOGRAM = ("Pa", 1, 1)

    @property
    def letter(self) -> str:
        """Its letter in the literature."""
        return self.value[0]

    @property
    def freedoms(self) -> int:
        """f_i of Eq. 3."""
        return self.value[1]

    @property
    def axes(self) -> int:
        """How many directions describe it."""
        return self.value[2]


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint between two links.

    Attributes:
        kind: What it is. A parallelogram counts as one joint that translates in a circle; its axis
            is that of its four revolutes.
        links: Names of the two links.
        axes: Directions of its axes, whole numbers or fractions.
        actuated: Whether a motor drives one of its freedoms.

    Raises:
        InputError: The wrong number of axes, a zero axis, or parallel axes of a universal joint.
    """

    kind: JointKind
    links: tuple[str, str]
    axes: tuple[Vector, ...] = ()
    actuated: bool = False

    def __post_init__(self) -> None:
        if len(self.axes) != self.kind.axes:
            raise InputError(
                f"joint {self.kind.letter} {self.links}: needs {self.kind.axes} axes,"
                f" got {len(self.axes)}"
            )
        if Directions.span(*self.axes).dimension != self.kind.axes:
            raise InputError(f"joint {self.kind.letter} {self.links}: axes {self.axes} depend")

    @classmethod
    def of(
        cls,
        kind: JointKind,
        links: tuple[str, str],
        *axes: Sequence[int | Fraction],
        actuated: bool = False,
    ) -> Joint:
        """Build a joint from plain numbers."""
        return cls(kind, links, tuple(vector(axis) for axis in axes), actuated)

    @property
    def poc(self) -> Poc:
        """Its POC set M_J of Eq. 1."""
        along = Directions.span(*self.axes)
        match self.kind:
            case JointKind.PRISMATIC:
                return Poc(along, NONE)
            case JointKind.CYLINDRICAL:
                return Poc(along, along)
            case JointKind.SPHERICAL:
                return Poc(NONE, ALL)
            case JointKind.PARALLELOGRAM:
                return Poc(Directions.span(circular_direction(self.axes[0])), NONE)
            case _:
                return Poc(NONE, along)


def circular_direction(axis: Vector) -> Vector:
    """Return a representative in general position of the directions perpendicular to ``axis``."""
    return cross(axis, next(levers()))


@dataclass(frozen=True, slots=True)
class Mechanism:
    """A mechanism: a graph of links and joints with a base and a platform.

    Attributes:
        name: Its name in the literature.
        joints: Its joints; the links are those that they name.
        base: The fixed link.
        platform: The link whose motion matters.

    Raises:
        InputError: Base or platform is named by no joint.
    """

    name: str
    joints: tuple[Joint, ...]
    base: str = "base"
    platform: str = "platform"

    def __post_init__(self) -> None:
        for link in (self.base, self.platform):
            if link not in self.links:
                raise InputError(f"{self.name}: no joint names the link {link!r}")

    @property
    def links(self) -> tuple[str, ...]:
        """Names of the links, parallelograms counted as one joint."""
        return tuple(dict.fromkeys(link for joint in self.joints for link in joint.links))

    @property
    def loop_count(self) -> int:
        """Number of independent loops, v = m - n + 1."""
        return len(self.joints) - len(self.links) + 1

    @property
    def parallelograms(self) -> int:
        """How many parallelograms it has."""
        return sum(joint.kind is JointKind.PARALLELOGRAM for joint in self.joints)

    @property
    def physical_joints(self) -> int:
        """Joints a workshop counts: a parallelogram has four."""
        return len(self.joints) + 3 * self.parallelograms

    @property
    def physical_links(self) -> int:
        """Links a workshop counts: a parallelogram adds its two long bars."""
        return len(self.links) + 2 * self.parallelograms
