"""The workspace (Section 4 of [Shen2021]_), exactly where it can be, on a grid where it must be.

Everything but the length of the rails is the same all along y: a constraint is a region of the xz
plane, and the rails cut every line along y to one interval. ``columns`` evaluates such lines;
``section`` gives the boundary of a cross-section as arcs and one quartic; ``analyse`` puts the
figures together.
"""

from duoglide.kinematics.workspace.analysis import WorkspaceReport, analyse
from duoglide.kinematics.workspace.columns import Columns, admissible, columns
from duoglide.kinematics.workspace.constraints import Constraints, Range
from duoglide.kinematics.workspace.cuboids import Cuboid, along_rails, largest_cuboid
from duoglide.kinematics.workspace.curves import Curve, CurveKind
from duoglide.kinematics.workspace.grid import Grid, count_poses, grid_over_reach
from duoglide.kinematics.workspace.interference import interference_gap
from duoglide.kinematics.workspace.rectangles import Rectangle, largest_rectangle
from duoglide.kinematics.workspace.section import Piece, Section, section, volume

__all__ = [
    "Columns",
    "Constraints",
    "Cuboid",
    "Curve",
    "CurveKind",
    "Grid",
    "Piece",
    "Range",
    "Rectangle",
    "Section",
    "WorkspaceReport",
    "admissible",
    "along_rails",
    "analyse",
    "columns",
    "count_poses",
    "grid_over_reach",
    "interference_gap",
    "largest_cuboid",
    "largest_rectangle",
    "section",
    "volume",
]
