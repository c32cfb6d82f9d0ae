"""The mechanism as a model for other programs: MuJoCo with every loop closed, URDF, body poses."""

from duoglide.kinematics.export.mjcf import to_mjcf
from duoglide.kinematics.export.poses import body_poses, joint_values
from duoglide.kinematics.export.tree import Bar, Body, Closure, Tree, build_tree
from duoglide.kinematics.export.urdf import COLOURS, RADIUS, to_urdf

__all__ = [
    "COLOURS",
    "RADIUS",
    "Bar",
    "Body",
    "Closure",
    "Tree",
    "body_poses",
    "build_tree",
    "joint_values",
    "to_mjcf",
    "to_urdf",
]
