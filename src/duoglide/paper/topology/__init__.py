"""Topology as computation: POC sets, DOF and coupling degree (Section 2.2 of [Shen2021]_).

A mechanism is data: links by name, joints with the directions of their axes. All else follows
from union and intersection of position and orientation characteristics (POC) over exact rational
subspaces; no number is a constant of the code.
"""

from duoglide.paper.topology.analysis import Topology, analyse
from duoglide.paper.topology.catalogue import (
    crr3,
    delta,
    duoglide_robot,
    orthoglide,
    rrc3,
    upu3,
)
from duoglide.paper.topology.mechanism import Joint, JointKind, Mechanism
from duoglide.paper.topology.network import poc_between
from duoglide.paper.topology.poc import Poc
from duoglide.paper.topology.screws import ScrewMobility, screw_mobility
from duoglide.paper.topology.soc import Decomposition, Soc, decompositions
from duoglide.paper.topology.subspace import Directions

__all__ = [
    "Decomposition",
    "Directions",
    "Joint",
    "JointKind",
    "Mechanism",
    "Poc",
    "ScrewMobility",
    "Soc",
    "Topology",
    "analyse",
    "crr3",
    "decompositions",
    "delta",
    "duoglide_robot",
    "orthoglide",
    "poc_between",
    "rrc3",
    "screw_mobility",
    "upu3",
]
