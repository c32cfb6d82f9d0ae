"""The mechanism as a model for other programs: MuJoCo with every loop closed."""

from duoglide.kinematics.export.mjcf import to_mjcf
from duoglide.kinematics.export.tree import Bar, Body, Closure, Tree, build_tree

__all__ = ["Bar", "Body", "Closure", "Tree", "build_tree", "to_mjcf"]
