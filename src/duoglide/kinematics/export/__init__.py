"""The mechanism as a model for other programs: MuJoCo with every loop closed, URDF as a tree."""

from duoglide.kinematics.export.mjcf import to_mjcf
from duoglide.kinematics.export.tree import Bar, Body, Closure, Tree, build_tree
from duoglide.kinematics.export.urdf import to_urdf

__all__ = ["Bar", "Body", "Closure", "Tree", "build_tree", "to_mjcf", "to_urdf"]
