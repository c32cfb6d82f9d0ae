"""Drives that stop by themselves, the long way: each at its own time, and loops closed by hand.

Nothing of the certificate is used: where a carriage goes follows from the motion of a plan and the
ramp of a drive, and whether the links close from the lengths of the two loops.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import duoglide as dg


@dataclass(frozen=True)
class Stops:
    """Stops of three drives: when the first one leaves the plan, and what each does, (n, 3)."""

    begin: np.ndarray  # path time [s], (n,)
    start: np.ndarray  # how much later each drive leaves the plan [s]
    coast: np.ndarray  # how long it then goes on at its velocity [s]
    deceleration: np.ndarray  # [mm/s^2]

    def at(self, motion: dg.Trajectory, shares: np.ndarray) -> np.ndarray:
        """Return carriages after shares of the time until all stand, shape (n, k, 3)."""
        leave = np.minimum(self.begin[:, None] + self.start, motion.duration)
        q, v = np.empty((2, *leave.shape))
        for i in range(3):
            state = motion.at(leave[:, i])
            q[:, i], v[:, i] = state.carriages[:, i], state.velocity[:, i]
        slowing = np.abs(v) / self.deceleration
        lasting = (self.start + self.coast + slowing).max(axis=1)
        elapsed = lasting[:, None] * shares
        planned = motion.at(np.minimum(self.begin[:, None] + elapsed, motion.duration)).carriages
        since = elapsed[..., None] - self.start[:, None]
        straight = np.clip(since, 0.0, self.coast[:, None])
        braked = np.clip(since - self.coast[:, None], 0.0, slowing[:, None])
        ramp = np.sign(v) * self.deceleration
        gone = v[:, None] * (straight + braked) - 0.5 * ramp[:, None] * braked**2
        return np.where(since <= 0.0, planned, q[:, None] + gone)


def random_stops(motion: dg.Trajectory, count: int, rng: np.random.Generator) -> Stops:
    """Draw stops: any subset of the drives begins, the others follow, at any deceleration."""
    machine = motion.machine
    cycle, reaction = machine.drives.cycle, machine.reaction_cycles * machine.drives.cycle
    start = reaction * rng.choice([0.0, 1.0, np.nan], (count, 3), p=[0.4, 0.3, 0.3])
    start = np.where(np.isnan(start), rng.uniform(0.0, reaction, (count, 3)), start)
    start -= start.min(axis=1, keepdims=True)
    coast = cycle * rng.choice([0.0, 1.0], (count, 3)) * (start + cycle <= reaction + 1e-12)
    band = machine.drives.quick_stop_tolerance
    off = np.clip(rng.uniform(-1.5, 1.5, (count, 3)), -1.0, 1.0)
    nominal = np.array(machine.drives.quick_stop_deceleration)
    return Stops(
        rng.uniform(0.0, motion.duration, count), start, coast, nominal * (1.0 + band * off)
    )


def closes(geometry: dg.Geometry, carriages: np.ndarray) -> np.ndarray:
    """Tell where both loops close as in the working pose, from the lengths alone, shape (...)."""
    g = geometry
    one, two, three = np.moveaxis(carriages, -1, 0)
    apart = two - one - g.coupler_length  # the legs' feet, less the coupler between their heads
    rise = g.leg_length**2 - 0.25 * apart**2
    along = 0.5 * (one + two) - three
    strut = g.strut_length**2 - along**2
    foot_x = 2.0 * (g.rail_half_spacing - g.platform_half_width)
    foot_z = g.riser_height + g.arm_drop - g.strut_drop + np.sqrt(np.maximum(rise, 0.0))
    base, reach = np.hypot(foot_x, foot_z), np.sqrt(np.maximum(strut, 0.0))
    triangle = (reach < base + g.arm_length) & (reach > np.abs(base - g.arm_length))
    return (apart > 0.0) & (rise > 0.0) & (strut > 0.0) & triangle


def least_clearance(motion: dg.Trajectory, carriages: np.ndarray) -> float:
    """Return the least clearance at carriages (..., 3) [mm]; -inf where the links come apart."""
    machine = motion.machine
    flat = carriages.reshape(-1, 3)
    if not closes(machine.geometry, flat).all():
        return -np.inf
    return float(dg.clearance(machine.geometry, dg.forward(machine.geometry, flat)).min())


def least_carriage_margin(motion: dg.Trajectory, carriages: np.ndarray) -> float:
    """Return the least carriage margin at carriages (..., 3) [mm]; -inf where links come apart."""
    geometry, flat = motion.machine.geometry, carriages.reshape(-1, 3)
    if not closes(geometry, flat).all():
        return -np.inf
    return float(dg.carriage_margin(geometry, dg.forward(geometry, flat)).min())
