"""Derivation and elimination with sympy (Sections 3.2 and 3.3 of [Shen2021]_).

``loop_equations`` states the loops from the coordinates of the joints; ``singularities`` finds the
families as factors of two Jacobian determinants; ``surfaces`` eliminates, and gives the implicit
polynomial of every family in the workspace and in the space of the carriages, with spurious factors
taken out and named. Needs the optional extra ``duoglide[symbolic]``.
"""

from duoglide.paper.elimination.dimensions import Dimensions
from duoglide.paper.elimination.families import Determinants, Family, singularities
from duoglide.paper.elimination.loops import LoopEquations, loop_equations
from duoglide.paper.elimination.ring import Space
from duoglide.paper.elimination.surfaces import SpuriousFactor, Surface, surfaces

__all__ = [
    "Determinants",
    "Dimensions",
    "Family",
    "LoopEquations",
    "Space",
    "SpuriousFactor",
    "Surface",
    "loop_equations",
    "singularities",
    "surfaces",
]
