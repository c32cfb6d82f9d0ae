"""Position and orientation characteristics: what a link can do, as two sets of directions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from random import Random

from duoglide.paper.topology.subspace import NONE, Directions, Vector, cross


@dataclass(frozen=True, slots=True)
class Poc:
    """The POC set [t; r] of a link: its free translations and rotations.

    A translation that is only known to be perpendicular to an axis, such as t1(perpendicular R),
    stands for a pencil of directions that turns with the mechanism. The algebra carries one
    rational representative of the pencil in general position, so that dimensions come out right.

    Attributes:
        translations: Directions in which the link can translate.
        rotations: Directions about which it can turn.
    """

    translations: Directions = NONE
    rotations: Directions = NONE

    @property
    def dimension(self) -> int:
        """Number of independent motions."""
        return self.translations.dimension + self.rotations.dimension

    def __and__(self, other: Poc) -> Poc:
        """Intersect, as Eq. 2 does for branches that hold the same link."""
        return Poc(self.translations & other.translations, self.rotations & other.rotations)

    def joined(self, other: Poc, lever: Vector) -> Poc:
        """Unite with the motion of the next joint or chain in series, Eq. 1.

        Two rotations about parallel axes that do not coincide add a translation: the axis times
        the lever between the axes. That one rule yields {R|R} = [t1(perpendicular R); r1],
        {R|R|R} = [t2; r1] and {SS} = [t2; r3].

        Args:
            other: What follows in series.
            lever: A representative of the vector between the two, in general position.
        """
        shared = self.rotations & other.rotations
        swung = Directions.span(*(cross(axis, lever) for axis in shared.basis))
        return Poc(
            self.translations | other.translations | swung,
            self.rotations | other.rotations,
        )

    def __str__(self) -> str:
        return f"(t{self.translations.dimension}, r{self.rotations.dimension})"


def levers() -> Iterator[Vector]:
    """Yield rational vectors in general position, always the same ones.

    Their numbers are large and drawn at random, so that no axis that somebody writes down is
    perpendicular to one of them, or parallel, by chance; (1, 1, 1) would be to many.
    """
    draw = Random(20211)
    while True:
        x, y, z = (Fraction(draw.randrange(10**8, 10**9)) for _ in range(3))
        yield x, y, z


def chain_poc(pocs: Iterable[Poc]) -> Poc:
    """Unite the POC sets of joints in series, Eq. 1.

    The axes of different joints are taken not to meet in one point; axes that do are described as
    one universal or spherical joint.
    """
    arms = levers()
    return reduce(lambda done, following: done.joined(following, next(arms)), pocs, Poc())
