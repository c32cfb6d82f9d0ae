"""All topological characteristics of a mechanism in one value."""

from __future__ import annotations

from dataclasses import dataclass

from duoglide.errors import InputError
from duoglide.paper.topology.mechanism import Mechanism
from duoglide.paper.topology.network import poc_between
from duoglide.paper.topology.poc import Poc
from duoglide.paper.topology.screws import screw_mobility
from duoglide.paper.topology.soc import Decomposition, decompositions


@dataclass(frozen=True, slots=True)
class Topology:
    """What Section 2.2 of [Shen2021]_ finds for a mechanism.

    Attributes:
        poc: What the platform can do relative to the base.
        dof: F of Eq. 3.
        decomposition: The decomposition into single-opened chains that reaches the coupling degree.
        coupling_degree: kappa of Eq. 7, least over all decompositions.
    """

    poc: Poc
    dof: int
    decomposition: Decomposition
    coupling_degree: float

    @property
    def closes(self) -> bool:
        """Eq. 6: the constraint degrees add to zero, so the motors are as many as the freedoms."""
        return sum(self.decomposition.constraint_degrees) == 0


def analyse(mechanism: Mechanism) -> Topology:
    """Compute POC set, DOF, constraint degrees and coupling degree of ``mechanism``.

    Of the decompositions with the least coupling the first in the order of the data is kept.

    Raises:
        InputError: The joints are not a series-parallel network between base and platform, have no
            loop, or move in a way that POC sets cannot represent: their translations come with
            rotations (3-RPS), or their mobility rests on distances (Bennett).
    """
    best = min(decompositions(mechanism), key=lambda candidate: candidate.kappa, default=None)
    if best is None:
        raise InputError(
            f"{mechanism.name} has no loop, and so no coupling degree; poc_between finds what its"
            " platform can do"
        )
    found = Topology(
        poc=poc_between(mechanism.joints, mechanism.base, mechanism.platform),
        dof=best.dof,
        decomposition=best,
        coupling_degree=best.kappa,
    )
    _require_witness(mechanism, found)
    return found


def _require_witness(mechanism: Mechanism, found: Topology) -> None:
    """Refuse what screws at a random placement do not confirm.

    A pair of subspaces cannot say that a translation comes only together with a rotation (3-RPS),
    nor can directions alone that axes meet or have special distances (Bennett).
    """
    witness = screw_mobility(mechanism)
    rotations = found.poc.rotations.dimension
    if (found.poc.dimension, rotations, found.dof) != (
        witness.platform, witness.rotations, witness.dof,
    ):  # fmt: skip
        raise InputError(
            f"{mechanism.name}: directions of axes give {found.poc} and F = {found.dof}, screws at"
            f" a random placement (t{witness.platform - witness.rotations}, r{witness.rotations})"
            f" and F = {witness.dof}; POC sets cannot represent this mechanism, see screw_mobility"
        )
