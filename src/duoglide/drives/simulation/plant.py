"""What hangs on a drive: servo loop, motor, carriage, encoder. Parameters are data."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, pi

from duoglide.errors import ConfigError
from duoglide.machine import rules

_MOST_BANDWIDTH = 400.0  # what the integration stands, with room [Hz]
_STEP = 0.00025  # longest step of the integration [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantParameters:
    """A closed position loop as a second-order system.

    x'' = (2 pi f)^2 (r - x) + 2 zeta 2 pi f (k r' - x'), bounded by what the motor can do.

    Attributes:
        bandwidth: f, natural frequency of the position loop [Hz].
        damping: zeta.
        velocity_feedforward: k; below 1 the carriage lags behind a moving demand.
        greatest_acceleration: What motor and current limit allow [mm/s^2].
        coasting_deceleration: Friction that stops the carriage without power [mm/s^2].
        brake_deceleration: What the holding brake adds [mm/s^2].
        encoder_step: What the encoder can tell apart [mm]; 0: one increment of the drive.
        limit_switches: Where the limit switches are [mm]; on at and beyond them.

    Raises:
        ConfigError: Names the key, the value and the rule.
    """

    bandwidth: float = 80.0
    damping: float = 0.9
    velocity_feedforward: float = 0.98
    greatest_acceleration: float = 200e3
    coasting_deceleration: float = 5e3
    brake_deceleration: float = 20e3
    encoder_step: float = 0.0
    limit_switches: tuple[float, float] = (-1e6, 1e6)

    def __post_init__(self) -> None:
        for key, unit in (
            ("bandwidth", "Hz"),
            ("damping", "1"),
            ("greatest_acceleration", "mm/s^2"),
            ("coasting_deceleration", "mm/s^2"),
        ):
            rules.positive(key, getattr(self, key), unit)
        for key, unit in (
            ("velocity_feedforward", "1"),
            ("brake_deceleration", "mm/s^2"),
            ("encoder_step", "mm"),
        ):
            rules.not_negative(key, getattr(self, key), unit)
        if self.bandwidth > _MOST_BANDWIDTH:
            raise ConfigError(
                f"bandwidth = {self.bandwidth:g}: must be at most {_MOST_BANDWIDTH:g} [Hz]"
            )
        self._check_switches()

    def _check_switches(self) -> None:
        pair = self.limit_switches
        if not isinstance(pair, list | tuple) or len(pair) != 2:
            raise ConfigError(f"limit_switches = {pair!r}: must be two places [mm]")
        low, high = (rules.number(f"limit_switches[{i}]", v) for i, v in enumerate(pair))
        if low >= high:
            raise ConfigError(f"limit_switches = {list(pair)}: the first must be below the second")
        object.__setattr__(self, "limit_switches", (low, high))


class Plant:
    """One carriage. Positions in mm along +y."""

    __slots__ = ("jammed", "parameters", "position", "velocity")

    def __init__(self, parameters: PlantParameters | None = None) -> None:
        self.parameters = parameters or PlantParameters()
        self.position = 0.0
        self.velocity = 0.0
        self.jammed = False

    def drive(self, demand: float, speed: float, seconds: float) -> None:
        """Let the servo pull towards a demand [mm] that moves at ``speed`` [mm/s]."""
        if self._stuck():
            return
        p = self.parameters
        rate = 2.0 * pi * p.bandwidth
        stiffness, friction = rate * rate, 2.0 * p.damping * rate
        steps = max(1, -int(-seconds // _STEP))
        dt = seconds / steps
        most = p.greatest_acceleration
        wanted = p.velocity_feedforward * speed
        position, velocity = self.position, self.velocity
        for _ in range(steps):
            pull = stiffness * (demand - position) + friction * (wanted - velocity)
            velocity += (most if pull > most else max(pull, -most)) * dt
            position += velocity * dt
            demand += speed * dt
        self.position, self.velocity = position, velocity

    @property
    def measured(self) -> float:
        """Where the encoder sees the carriage [mm]."""
        step = self.parameters.encoder_step
        return floor(self.position / step + 0.5) * step if step else self.position

    @property
    def switches(self) -> tuple[bool, bool]:
        """Whether the limit switches at the low and the high end are on."""
        low, high = self.parameters.limit_switches
        return self.position <= low, self.position >= high

    def coast(self, brake_set: bool, seconds: float) -> None:
        """Let the carriage run out without power."""
        if self._stuck():
            return
        p = self.parameters
        loss = p.coasting_deceleration + (p.brake_deceleration if brake_set else 0.0)
        before = self.velocity
        if abs(before) <= loss * seconds:
            self.position += before * abs(before) / (2.0 * loss)
            self.velocity = 0.0
        else:
            self.velocity -= loss * seconds if before > 0.0 else -loss * seconds
            self.position += 0.5 * (before + self.velocity) * seconds

    def _stuck(self) -> bool:
        """Whether something stands in the way; then the carriage stands too."""
        if self.jammed:
            self.velocity = 0.0
        return self.jammed
