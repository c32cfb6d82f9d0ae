"""All topological characteristics of a mechanism in one value."""

from __future__ import annotations

from dataclasses import dataclass

from duoglide.paper.topology.mechanism import Mechanism
from duoglide.paper.topology.network import poc_between
from duoglide.paper.topology.poc import Poc
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
        InputError: The joints are not a series-parallel network between base and platform.
    """
    best = min(decompositions(mechanism), key=lambda candidate: candidate.kappa)
    return Topology(
        poc=poc_between(mechanism.joints, mechanism.base, mechanism.platform),
        dof=best.dof,
        decomposition=best,
        coupling_degree=best.kappa,
    )
