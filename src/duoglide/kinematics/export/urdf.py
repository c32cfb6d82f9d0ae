"""The mechanism as URDF, for ROS, Foxglove and whatever else shows robots.

URDF knows trees only: the loops are open, and whoever moves the model gives every joint its value
(``joint_values``), as logs exported for ROS do. Links have no mass and nothing to collide with:
the model is for showing.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree as Xml

import numpy as np
from numpy.typing import ArrayLike

from duoglide.kinematics.export.tree import Bar, Body, Motion, Tree, build_tree
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.machine import Geometry, Machine

METRE = 1e-3  # one millimetre
RADIUS = 5.0  # [mm], of the bars
COLOURS = {  # by what moves a body: carriages 1 to 3 are blue, orange and green everywhere
    "carriage_1": (0.0, 0.447, 0.698),
    "leg_1": (0.0, 0.447, 0.698),
    "carriage_2": (0.835, 0.369, 0.0),
    "leg_2": (0.835, 0.369, 0.0),
    "carriage_3": (0.0, 0.620, 0.451),
    "lower_bar": (0.0, 0.620, 0.451),
    "strut_near": (0.0, 0.620, 0.451),
    "strut_far": (0.0, 0.620, 0.451),
    "upper_bar": (0.0, 0.620, 0.451),
    "arm_near": (0.8, 0.475, 0.655),
    "arm_far": (0.8, 0.475, 0.655),
    "coupler": (0.353, 0.373, 0.412),
    "platform": (0.235, 0.235, 0.275),
}
"""Body to red, green and blue, 0 to 1."""


def to_urdf(
    machine: Machine | Geometry,
    position: ArrayLike | None = None,
    mode: WorkingMode = WORKING,
) -> str:
    """Export the mechanism as URDF (in metres), with its loops open.

    Joints and links have the names of the bodies (``build_tree``). A carriage's joint reads its
    position along the rail; a hinge reads zero at the reference pose.

    Args:
        machine: A machine, or a geometry alone.
        position: The reference pose [mm], shape (3,); as for ``build_tree``.
        mode: Which of the inverse solutions stands there.

    Returns:
        XML text.

    Raises:
        ConfigError: No pose closes the links, or the machine's own home is not allowed.
        InputError: The position is not three finite numbers.
        UnreachableError: The position is beyond reach.
    """
    tree = build_tree(machine, position, mode)
    root = Xml.Element("robot", name="duoglide")
    Xml.SubElement(root, "link", name="base")
    origins = {"base": (0.0, 0.0, 0.0)}
    for body in tree.bodies:
        link = Xml.SubElement(root, "link", name=body.name)
        for bar in body.bars:
            _add_bar(link, body, bar)
        _add_joint(root, body, tree, np.subtract(body.origin, origins[body.parent]).tolist())
        origins[body.name] = body.origin
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode")


def _add_bar(link: Xml.Element, body: Body, bar: Bar) -> None:
    """Draw a bar as a cylinder in the body's frame."""
    way = np.subtract(bar.end, bar.start)
    length = float(np.linalg.norm(way))
    if length == 0.0:
        return
    centre = np.add(bar.start, bar.end) / 2.0 - body.origin
    visual = Xml.SubElement(link, "visual")
    x, y, z = way.tolist()  # a cylinder stands along z: it is tilted about y, then turned about z
    rpy = f"0 {math.atan2(math.hypot(x, y), z)!r} {math.atan2(y, x)!r}"
    Xml.SubElement(visual, "origin", xyz=_text(centre.tolist()), rpy=rpy)
    shape = Xml.SubElement(visual, "geometry")
    Xml.SubElement(
        shape, "cylinder", radius=repr(RADIUS * METRE), length=repr(float(length * METRE))
    )
    material = Xml.SubElement(visual, "material", name=body.name)
    rgba = " ".join(repr(share) for share in (*COLOURS[body.name], 1.0))
    Xml.SubElement(material, "color", rgba=rgba)


def _add_joint(root: Xml.Element, body: Body, tree: Tree, offset: list[float]) -> None:
    """Join a body to its parent."""
    slides = body.motion is Motion.SLIDE
    joint = Xml.SubElement(
        root, "joint", name=body.name, type="prismatic" if slides else "continuous"
    )
    if slides:
        offset = (np.array(offset) - body.value * np.array(body.axis)).tolist()
        travel = repr(tree.travel * METRE)
        Xml.SubElement(joint, "limit", lower="-" + travel, upper=travel, effort="0", velocity="0")
    Xml.SubElement(joint, "origin", xyz=_text(offset), rpy="0 0 0")
    Xml.SubElement(joint, "parent", link=body.parent)
    Xml.SubElement(joint, "child", link=body.name)
    Xml.SubElement(joint, "axis", xyz=" ".join(repr(float(part)) for part in body.axis))


def _text(lengths: list[float]) -> str:
    """Write lengths [mm] in metres."""
    return " ".join(repr(float(value) * METRE) for value in lengths)
