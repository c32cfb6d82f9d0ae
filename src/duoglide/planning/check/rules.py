"""What the check speaks of: a machine's rules along a curve, and parts of the curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from duoglide.arrays import BoolArray, FloatArray, IndexArray
from duoglide.kinematics.constants import PoseConstants, pose_constants
from duoglide.kinematics.headroom.room import SURE, TOUCHING
from duoglide.kinematics.modes import WORKING
from duoglide.machine import Machine
from duoglide.motion.curve.bounds import CurveBounds, bound_curve
from duoglide.motion.curve.curve import Curve

CLEARANCE, CARRIAGE_MARGIN = 0, 1  # places of them among the families
BASE_FAMILIES = ("clearance", "carriage_margin", "travel_1", "travel_2", "travel_3", "order")


@dataclass(frozen=True, slots=True, eq=False)
class Rules:
    """A machine's rules along a curve.

    Attributes:
        machine: The machine.
        curve: Where its platform's centre goes, in the base frame.
        bounds: Bounds on the derivatives of the curve.
        constants: The kinematics' constants.
        required: What each margin must be at least [mm].
    """

    machine: Machine
    curve: Curve
    bounds: CurveBounds
    constants: PoseConstants
    required: FloatArray

    @classmethod
    def of(cls, machine: Machine, curve: Curve) -> Rules:
        """Collect what the rules need."""
        boxes = [0.0] * len(machine.keep_out)
        margins = machine.clearance, machine.carriage_margin
        required = [*margins, 0.0, 0.0, 0.0, machine.carriage_width, *boxes]
        constants = pose_constants(machine.geometry, WORKING)
        return cls(machine, curve, bound_curve(curve), constants, np.array(required))

    @property
    def families(self) -> tuple[str, ...]:
        """Names of the rules, in the order of the columns of margins."""
        return (*BASE_FAMILIES, *(f"keep_out {box.name}" for box in self.machine.keep_out))


@dataclass(frozen=True, slots=True, eq=False)
class Intervals:
    """Parts of a curve: each within one piece, around a sample.

    Attributes:
        piece: Which piece, shape (n,).
        middle: Sigma of the sample [mm].
        half: Half of the interval's length [mm].
    """

    piece: IndexArray
    middle: FloatArray
    half: FloatArray

    def split(self, parts: int) -> Intervals:
        """Cut every interval into equal parts."""
        offsets = (2.0 * np.arange(parts) + 1.0) / parts - 1.0
        middle = (self.middle[:, None] + self.half[:, None] * offsets).ravel()
        return Intervals(np.repeat(self.piece, parts), middle, np.repeat(self.half / parts, parts))

    def __getitem__(self, rows: IndexArray | BoolArray | slice) -> Intervals:
        return Intervals(self.piece[rows], self.middle[rows], self.half[rows])


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """Parts of a curve, each about its middle.

    Attributes:
        states: Position and three derivatives in the middle, shape (n, 4, 3).
        half: Half the length in sigma [mm], shape (n,).
        first: Bound on the components of p' on the whole part, shape (n, 3).
        second: Bound on those of p'' [1/mm].
    """

    states: FloatArray
    half: FloatArray
    first: FloatArray
    second: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What is known about intervals.

    Attributes:
        margins: Margins at the samples, minus what is required [mm], shape (n, families); minus
            infinity out of reach.
        lowest: Lower bounds of the same on the whole intervals.
    """

    margins: FloatArray
    lowest: FloatArray

    @property
    def failed(self) -> BoolArray:
        """Where a sample breaks a rule, or touches."""
        mask: BoolArray = self.margins.min(axis=1) < TOUCHING
        return mask

    @property
    def certified(self) -> BoolArray:
        """Where the whole interval keeps every rule."""
        mask: BoolArray = self.lowest.min(axis=1) >= SURE
        return mask
