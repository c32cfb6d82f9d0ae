"""Duoglide: from a published parallel robot to a running machine.

Names load when they are first used, so that ``import duoglide`` stays quick.

[Shen2021]: H. Shen, Y. Zhao, J. Li, G. Wu, D. Chablat, A Novel Partially-decoupled Translational
Parallel Manipulator with Symbolic Kinematics, Singularity Identification and Workspace
Determination.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from duoglide.control.host.robot import Robot as Robot
    from duoglide.control.host.run.report import RunReport as RunReport
    from duoglide.errors import BusError as BusError
    from duoglide.errors import ConfigError as ConfigError
    from duoglide.errors import DriveError as DriveError
    from duoglide.errors import DriveFault as DriveFault
    from duoglide.errors import DriveTimeout as DriveTimeout
    from duoglide.errors import DuoglideError as DuoglideError
    from duoglide.errors import FollowingError as FollowingError
    from duoglide.errors import InputError as InputError
    from duoglide.errors import LimitError as LimitError
    from duoglide.errors import LogError as LogError
    from duoglide.errors import NotHomedError as NotHomedError
    from duoglide.errors import PathError as PathError
    from duoglide.errors import SingularityError as SingularityError
    from duoglide.errors import UnreachableError as UnreachableError
    from duoglide.kinematics.carriage_margin import carriage_margin as carriage_margin
    from duoglide.kinematics.dynamics.dynamics import carriage_forces as carriage_forces
    from duoglide.kinematics.dynamics.dynamics import kinetic_energy as kinetic_energy
    from duoglide.kinematics.dynamics.dynamics import mass_matrix as mass_matrix
    from duoglide.kinematics.dynamics.dynamics import platform_acceleration as platform_acceleration
    from duoglide.kinematics.dynamics.dynamics import potential_energy as potential_energy
    from duoglide.kinematics.export import to_mjcf as to_mjcf
    from duoglide.kinematics.model import forward as forward
    from duoglide.kinematics.model import inverse as inverse
    from duoglide.kinematics.model import jacobian as jacobian
    from duoglide.kinematics.model import reachable as reachable
    from duoglide.kinematics.modes import AssemblyMode as AssemblyMode
    from duoglide.kinematics.modes import WorkingMode as WorkingMode
    from duoglide.kinematics.singularity.margins import Margins as Margins
    from duoglide.kinematics.singularity.margins import clearance as clearance
    from duoglide.kinematics.singularity.margins import clearance_gradient as clearance_gradient
    from duoglide.kinematics.singularity.margins import margins as margins
    from duoglide.kinematics.solutions import ForwardSolution as ForwardSolution
    from duoglide.kinematics.solutions import InverseSolution as InverseSolution
    from duoglide.kinematics.solutions import forward_all as forward_all
    from duoglide.kinematics.solutions import inverse_all as inverse_all
    from duoglide.machine import Box as Box
    from duoglide.machine import CarriageLimits as CarriageLimits
    from duoglide.machine import DriveSettings as DriveSettings
    from duoglide.machine import Geometry as Geometry
    from duoglide.machine import Machine as Machine
    from duoglide.machine import Masses as Masses
    from duoglide.machine import Timing as Timing
    from duoglide.motion.motion import State as State
    from duoglide.motion.path.actions import Dwell as Dwell
    from duoglide.motion.path.actions import SetOutput as SetOutput
    from duoglide.motion.path.actions import WaitInput as WaitInput
    from duoglide.motion.path.checked import CheckedPath as CheckedPath
    from duoglide.motion.path.path import Path as Path
    from duoglide.motion.rounding.blend import Blend as Blend
    from duoglide.planning.check.check import check_path as check_path
    from duoglide.planning.plan import plan as plan
    from duoglide.planning.programs.pick_and_place import chain as chain
    from duoglide.planning.programs.pick_and_place import pick_and_place as pick_and_place
    from duoglide.planning.programs.pick_and_place import picks as picks
    from duoglide.planning.programs.planner import plan_program as plan_program
    from duoglide.planning.programs.read import read_program as read_program
    from duoglide.planning.trajectory import Trajectory as Trajectory
    from duoglide.planning.transfer.jog import Jog as Jog
    from duoglide.planning.transfer.jog import JogLimits as JogLimits
    from duoglide.planning.transfer.recover import recover as recover
    from duoglide.planning.transfer.transfer import transfer as transfer
    from duoglide.playback.replay import replay as replay

__version__ = "0.1.0"

_HOMES = {
    "control.host.run.report": ("RunReport",),
    "control.host.robot": ("Robot",),
    "errors": (
        "BusError",
        "ConfigError",
        "DriveError",
        "DriveFault",
        "DriveTimeout",
        "DuoglideError",
        "FollowingError",
        "InputError",
        "LimitError",
        "LogError",
        "NotHomedError",
        "PathError",
        "SingularityError",
        "UnreachableError",
    ),
    "kinematics.carriage_margin": ("carriage_margin",),
    "kinematics.dynamics.dynamics": (
        "carriage_forces",
        "kinetic_energy",
        "mass_matrix",
        "platform_acceleration",
        "potential_energy",
    ),
    "kinematics.export": ("to_mjcf",),
    "kinematics.model": ("forward", "inverse", "jacobian", "reachable"),
    "kinematics.modes": ("AssemblyMode", "WorkingMode"),
    "kinematics.singularity.margins": ("Margins", "clearance", "clearance_gradient", "margins"),
    "kinematics.solutions": (
        "ForwardSolution",
        "InverseSolution",
        "forward_all",
        "inverse_all",
    ),
    "machine": (
        "Box",
        "CarriageLimits",
        "DriveSettings",
        "Geometry",
        "Machine",
        "Masses",
        "Timing",
    ),
    "motion.path.actions": ("Dwell", "SetOutput", "WaitInput"),
    "motion.rounding.blend": ("Blend",),
    "motion.path.checked": ("CheckedPath",),
    "motion.motion": ("State",),
    "motion.path.path": ("Path",),
    "planning.trajectory": ("Trajectory",),
    "planning.check.check": ("check_path",),
    "planning.transfer.jog": ("Jog", "JogLimits"),
    "planning.programs.pick_and_place": ("chain", "pick_and_place", "picks"),
    "planning.plan": ("plan",),
    "planning.programs.planner": ("plan_program",),
    "planning.programs.read": ("read_program",),
    "planning.transfer.recover": ("recover",),
    "planning.transfer.transfer": ("transfer",),
    "playback.replay": ("replay",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = sorted(_HOME_OF)  # noqa: PLE0605  # computed, so that it cannot drift


def __getattr__(name: str) -> Any:
    home = _HOME_OF.get(name)
    if home is None:
        raise AttributeError(f"module 'duoglide' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"duoglide.{home}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
