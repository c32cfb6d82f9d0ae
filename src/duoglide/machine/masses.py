"""What the moving parts weigh, what their rails rub, and where down is.

No masses of the prototype have been published. Whatever a machine file leaves out is an
assumption: bars of one round section over the lengths of the geometry.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi
from typing import Any

from duoglide.machine import rules
from duoglide.machine.geometry import Geometry
from duoglide.machine.meaning import documented, setting, unit_of

_JOINTS = 0.1  # [kg], of the platform beyond its bars
_CUBIC_MILLIMETRES = 1e9  # in a cubic metre
_PER_CARRIAGE = ("carriage", "drive", "coulomb_friction", "viscous_friction")
_PARTS = ("leg", "coupler", "riser", "arm", "strut", "platform")


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Masses:
    """Masses, friction and gravity: what forces come from.

    A mass that is left out is an assumption, made of the geometry's lengths: see ``complete``.

    Raises:
        ConfigError: Not a finite number, or below zero.
    """

    carriage: tuple[float, float, float] = setting(
        (0.4, 0.4, 0.4), "mass of a carriage with its post, one for all or one for each", "kg"
    )
    drive: tuple[float, float, float] = setting(
        (0.1, 0.1, 0.1),
        "mass that resists the carriage's acceleration as motor and transmission do, and does not "
        "weigh on it, likewise",
        "kg",
    )
    leg: float | None = setting(
        None, "mass of one leg; left out, of its bar: section, density and length", "kg"
    )
    coupler: float | None = setting(None, "mass of the coupler; left out, of its bar", "kg")
    riser: float | None = setting(None, "mass of the riser; left out, of its bar", "kg")
    arm: float | None = setting(
        None, "mass of the arm, both bars of parallelogram 1; left out, of these bars", "kg"
    )
    strut: float | None = setting(
        None, "mass of the strut, both bars of parallelogram 2; left out, of these bars", "kg"
    )
    platform: float | None = setting(
        None,
        "mass of the platform with its drops and its tool; left out, of their bars and 0.1 kg",
        "kg",
    )
    payload: float = setting(0.0, "mass that the platform carries", "kg")
    coulomb_friction: tuple[float, float, float] = setting(
        (3.0, 3.0, 3.0), "friction of a rail at any speed, one for all or one for each", "N"
    )
    viscous_friction: tuple[float, float, float] = setting(
        (0.002, 0.002, 0.002), "friction of a rail that grows with speed, likewise", "N s/mm"
    )
    gravity: tuple[float, float, float] = setting(
        (0.0, 0.0, -9806.65), "acceleration of free fall in the base frame", "mm/s^2"
    )
    bar_diameter: float = setting(
        10.0, "diameter of the round bars that masses left out are made of", "mm"
    )
    bar_density: float = setting(2700.0, "their density, by default that of aluminium", "kg/m^3")

    def __post_init__(self) -> None:
        store = object.__setattr__
        for key in _PER_CARRIAGE:
            unit = unit_of(Masses, key)
            store(self, key, rules.any_per_carriage(key, getattr(self, key), unit))
            for value in getattr(self, key):
                rules.not_negative(key, value, unit)
        for key in ("payload", *_PARTS):
            if key == "payload" or getattr(self, key) is not None:
                store(self, key, rules.not_negative(key, getattr(self, key), "kg"))
        for key in ("bar_diameter", "bar_density"):
            store(self, key, rules.positive(key, getattr(self, key), unit_of(Masses, key)))
        store(self, "gravity", rules.triple("gravity", self.gravity, "mm/s^2"))

    @property
    def assumed(self) -> tuple[str, ...]:
        """Names of the masses that nobody has given."""
        return tuple(key for key in _PARTS if getattr(self, key) is None)

    def complete(self, geometry: Geometry) -> Masses:
        """Return these masses with an assumption for each that is left out [kg].

        Args:
            geometry: Whose lengths the bars have [mm]. Arm and strut have two of them.
        """
        g = geometry
        section = pi / 4.0 * self.bar_diameter**2
        per_length = self.bar_density / _CUBIC_MILLIMETRES * section  # [kg/mm]
        lengths = {
            "leg": g.leg_length,
            "coupler": g.coupler_length,
            "riser": abs(g.riser_height),
            "arm": 2.0 * g.arm_length,
            "strut": 2.0 * g.strut_length,
            "platform": 2.0 * abs(g.platform_half_width) + abs(g.arm_drop) + abs(g.strut_drop),
        }
        made: dict[str, Any] = {key: per_length * lengths[key] for key in self.assumed}
        if "platform" in made:
            made["platform"] += _JOINTS
        return replace(self, **made)
