"""Sets of directions as exact rational subspaces of three-space."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

Vector: TypeAlias = tuple[Fraction, Fraction, Fraction]


def vector(values: Sequence[int | Fraction]) -> Vector:
    """Return three rationals."""
    x, y, z = (Fraction(value) for value in values)
    return x, y, z


def cross(u: Vector, w: Vector) -> Vector:
    """Return the cross product."""
    return (
        u[1] * w[2] - u[2] * w[1],
        u[2] * w[0] - u[0] * w[2],
        u[0] * w[1] - u[1] * w[0],
    )


def _reduced(vectors: Iterable[Vector]) -> tuple[Vector, ...]:
    """Return the reduced row echelon form without its zero rows."""
    rows = [list(row) for row in vectors]
    done = 0
    for column in range(3):
        pivot = next((i for i in range(done, len(rows)) if rows[i][column] != 0), None)
        if pivot is None:
            continue
        rows[done], rows[pivot] = rows[pivot], rows[done]
        lead = rows[done][column]
        rows[done] = [value / lead for value in rows[done]]
        for i, row in enumerate(rows):
            if i != done and row[column] != 0:
                factor = row[column]
                rows[i] = [a - factor * b for a, b in zip(row, rows[done], strict=True)]
        done += 1
    return tuple(vector(row) for row in rows[:done])


@dataclass(frozen=True, slots=True)
class Directions:
    """A subspace of directions; equal subspaces compare equal.

    Attributes:
        basis: Its reduced row echelon basis, none to three vectors.
    """

    basis: tuple[Vector, ...] = ()

    @classmethod
    def span(cls, *vectors: Sequence[int | Fraction]) -> Directions:
        """Return the span of ``vectors``."""
        return cls(_reduced(vector(values) for values in vectors))

    @property
    def dimension(self) -> int:
        """How many independent directions."""
        return len(self.basis)

    def __or__(self, other: Directions) -> Directions:
        """Return the smallest subspace that holds both."""
        return Directions(_reduced((*self.basis, *other.basis)))

    def __and__(self, other: Directions) -> Directions:
        """Return the directions in both."""
        return (self.perpendicular() | other.perpendicular()).perpendicular()

    def __le__(self, other: Directions) -> bool:
        """Whether every direction of this subspace is in ``other``."""
        return (self | other) == other

    def perpendicular(self) -> Directions:
        """Return the orthogonal complement."""
        if self.dimension == 0:
            return ALL
        if self.dimension == 1:
            return Directions(_reduced(cross(self.basis[0], axis) for axis in ALL.basis))
        if self.dimension == 2:
            return Directions(_reduced([cross(*self.basis)]))
        return NONE


NONE = Directions()
ALL = Directions.span((1, 0, 0), (0, 1, 0), (0, 0, 1))
