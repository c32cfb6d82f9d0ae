"""The quickest motion along a curve, by a method that shares nothing with the planner.

Direct collocation with casadi and IPOPT. The curve is cut at its breaks, and each piece is passed
in a time of its own, which is free, in even steps. d3 sigma/dt3 is linear in each step and may jump
between two; position, speed and acceleration follow from it exactly. Limits hold at both ends and
in the middle of each step. The closed form of the mechanism and its derivatives are casadi's own,
from the curve's polynomials. The search begins with a slow motion, and is repeated on more steps.

What is found is slowed until thousands of samples keep every limit, so that it is a motion that a
machine could run. It is a local optimum: IPOPT promises no more.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import comb
from typing import TypeAlias

import casadi as ca
import numpy as np

import duoglide as dg
from duoglide.arrays import FloatArray
from duoglide.motion.curve.curve import Curve

STEPS = (125, 250, 500)
GAIN = 1e-4  # of the duration: what an optimum on twice the steps gains at least, to go on
LEAST = 6  # steps of a piece
SAMPLES = 20  # of a step
SCALE = 100.0  # of the duration, beside which the solver's tolerances are small
IPOPT = {"print_level": 0, "sb": "yes", "max_iter": 150, "tol": 1e-7, "acceptable_iter": 0}
NEAR = {"mu_init": 1e-2, "bound_push": 1e-4, "bound_frac": 1e-4}
NEAR |= {"slack_bound_push": 1e-4, "slack_bound_frac": 1e-4}
WAYS = (IPOPT | NEAR, IPOPT)  # from near the solution, else as IPOPT begins by itself


Jet: TypeAlias = list[ca.SX]  # a value and three derivatives by sigma


@dataclass(frozen=True)
class Piece:
    """A part of the curve between two breaks.

    Attributes:
        length: In sigma [mm].
        carriages: s to carriages and three derivatives, (12,), s from its start.
    """

    length: float
    carriages: ca.Function


@dataclass(frozen=True)
class Course:
    """What a step of the search knows: states at the nodes of every piece.

    Attributes:
        seconds: That each piece takes [s].
        states: s, v, a at the nodes of each, (n + 1, 3) [mm, s].
        jerks: At both ends of each step, (n, 2).
    """

    seconds: list[float]
    states: list[FloatArray]
    jerks: list[FloatArray]


def pieces_of(geometry: dg.Geometry, curve: Curve) -> list[Piece]:
    """Cut a curve at its breaks."""
    if curve.rates.any():
        raise ValueError("this witness knows lines and polynomials, no arcs")
    found = []
    for span, rows in zip(curve.spans.tolist(), curve.coefficients, strict=True):
        s = ca.SX.sym("s")
        jets = [differentiate(column / span ** np.arange(len(column)), s) for column in rows.T]
        found.append(Piece(span, ca.Function("q", [s], [carriages(geometry, *jets)])))
    return found


def differentiate(coefficients: FloatArray, s: ca.SX) -> Jet:
    """Return a polynomial and its three derivatives."""
    polynomial, jet = np.polynomial.Polynomial(coefficients), []
    for _ in range(4):
        value = ca.SX(0)
        for c in reversed(polynomial.coef.tolist()):
            value = value * s + c
        jet.append(value)
        polynomial = polynomial.deriv()
    return jet


def root(length: float, *sides: Jet) -> Jet:
    """Return the root of the square of a length less those of the sides, with three derivatives.

    Each derivative follows from r r^(n) = -(the rest of Leibniz' rule on the sum of squares) / 2.
    """
    jet = [ca.sqrt(length**2 - sum(side[0] ** 2 for side in sides))]
    for n in range(1, 4):
        total = sum(comb(n, k) * a[k] * a[n - k] for a in sides for k in range(n + 1))
        total += sum(comb(n, k) * jet[k] * jet[n - k] for k in range(1, n))
        jet.append(-total / (2.0 * jet[0]))
    return jet


def carriages(g: dg.Geometry, x: Jet, y: Jet, z: Jet) -> ca.SX:
    """Carriages by Eqs. 13-15 in the usual working mode, and three derivatives, (12,)."""
    offset = g.rail_half_spacing - g.platform_half_width
    arm = root(g.arm_length, [x[0] - offset, *x[1:]])
    rise = [a - b for a, b in zip(z, arm, strict=True)]
    rise[0] -= g.carriage_height + g.riser_height + g.arm_drop
    p = root(g.leg_length, rise)
    up = [z[0] - g.carriage_height - g.strut_drop, *z[1:]]
    q = root(g.strut_length, [x[0] + offset, *x[1:]], up)
    half = [0.5 * g.coupler_length, 0.0, 0.0, 0.0]
    rows = [(y[k] - half[k] - p[k], y[k] + half[k] + p[k], y[k] + q[k]) for k in range(4)]
    return ca.vertcat(*(value for row in rows for value in row))


def motion_of(piece: Piece, s: ca.SX, v: ca.SX, a: ca.SX, j: ca.SX) -> ca.SX:
    """Velocity, acceleration and jerk of the carriages, (9,)."""
    q = piece.carriages(s)
    first, second, third = q[3:6], q[6:9], q[9:12]
    return ca.vertcat(
        first * v,
        first * a + second * v**2,
        first * j + 3.0 * second * v * a + third * v**3,
    )


def advance(state: ca.SX, j0: ca.SX, j1: ca.SX, h: ca.SX) -> ca.SX:
    """Return the state after the time ``h``, in which the jerk goes evenly from j0 to j1."""
    s, v, a = state[0], state[1], state[2]
    return ca.vertcat(
        s + h * v + h**2 / 2.0 * a + h**3 * (3.0 * j0 + j1) / 24.0,
        v + h * a + h**2 * (2.0 * j0 + j1) / 6.0,
        a + h * (j0 + j1) / 2.0,
    )


def step_function(piece: Piece, limits: FloatArray) -> ca.Function:
    """Return what takes states at both ends, jerks and length of a step to defects and uses."""
    one, two = ca.SX.sym("one", 3), ca.SX.sym("two", 3)
    j, h = ca.SX.sym("j", 2), ca.SX.sym("h")
    half = 0.5 * (j[0] + j[1])
    middle = advance(one, j[0], half, 0.5 * h)
    uses = [  # twice the same would leave the multipliers open
        motion_of(piece, one[0], one[1], one[2], j[0]) / limits.ravel(),
        motion_of(piece, middle[0], middle[1], middle[2], half)[3:] / limits[1:].ravel(),
        motion_of(piece, two[0], two[1], two[2], j[1])[6:] / limits[2],
    ]
    defects = advance(one, j[0], j[1], h) - two
    shares = ca.vertcat(*uses)
    return ca.Function("step", [one, two, j, h], [defects, shares])


def solve(pieces: list[Piece], limits: FloatArray, start: Course) -> Course:
    """Find the quickest motion near ``start``, on its steps."""
    unknowns, guess, low, high = [], [], [], []
    equal, within, total, last = [], [], ca.MX(0), None
    for index, piece in enumerate(pieces):
        count = len(start.jerks[index])
        seconds = ca.MX.sym("T")
        states, jerks = ca.MX.sym("x", 3, count + 1), ca.MX.sym("j", 2, count)
        step = step_function(piece, limits).map(count)
        defects, shares = step(
            states[:, :-1], states[:, 1:], jerks, ca.repmat(seconds / count, 1, count)
        )
        equal += [ca.vec(defects), states[0, 0], states[0, -1] - piece.length]
        equal.append(states[1:, 0] if last is None else states[1:, 0] - last)
        within.append(ca.vec(shares))
        last, total = states[1:, -1], total + seconds
        unknowns += [seconds, ca.vec(states), ca.vec(jerks)]
        guess += [[start.seconds[index]], start.states[index].ravel(), start.jerks[index].ravel()]
        floor = np.full(states.shape[1] * 3, -np.inf).reshape(-1, 3)
        floor[:, 1] = 0.0
        low += [[1e-3 * start.seconds[index]], floor.ravel(), np.full(2 * count, -np.inf)]
        high += [np.full(1 + floor.size + 2 * count, np.inf)]
    equal.append(last)
    g = ca.vertcat(*equal, *within)
    zeros = sum(e.shape[0] for e in equal)
    bound = np.concatenate([np.zeros(zeros), np.ones(g.shape[0] - zeros)])
    problem = {"x": ca.vertcat(*unknowns), "f": SCALE * total, "g": g}
    within_bounds = {
        "lbx": np.concatenate(low),
        "ubx": np.concatenate(high),
        "lbg": -bound,
        "ubg": bound,
    }
    for way in WAYS:
        solver = ca.nlpsol("witness", "ipopt", problem, {"print_time": False, "ipopt": way})
        found = solver(x0=np.concatenate(guess), **within_bounds)
        if solver.stats()["success"]:
            break
    else:
        raise ArithmeticError(solver.stats()["return_status"])
    return unpack(np.array(found["x"]).ravel(), [len(j) for j in start.jerks])


def unpack(x: FloatArray, counts: list[int]) -> Course:
    """Read a course off the unknowns."""
    seconds, states, jerks, at = [], [], [], 0
    for count in counts:
        seconds.append(float(x[at]))
        states.append(x[at + 1 : at + 1 + 3 * (count + 1)].reshape(-1, 3))
        at += 1 + 3 * (count + 1)
        jerks.append(x[at : at + 2 * count].reshape(-1, 2))
        at += 2 * count
    return Course(seconds, states, jerks)


def sample(
    piece: Piece, seconds: float, states: FloatArray, jerks: FloatArray, u: FloatArray
) -> FloatArray:
    """Return s, v, a, j at shares ``u`` of every step of a piece, (n * u.size, 4)."""
    h = seconds / len(jerks)
    t = h * u
    s, v, a = (states[:-1, k, None] for k in range(3))
    j0, rate = jerks[:, :1], (jerks[:, 1:] - jerks[:, :1]) / h
    found = np.stack(
        [
            s + t * (v + t * (a / 2.0 + t * (j0 / 6.0 + t * rate / 24.0))),
            v + t * (a + t * (j0 / 2.0 + t * rate / 6.0)),
            a + t * (j0 + t * rate / 2.0),
            j0 + t * rate,
        ],
        axis=-1,
    )
    return found.reshape(-1, 4)


def worst_factor(pieces: list[Piece], limits: FloatArray, course: Course) -> float:
    """Return by which factor of time samples of a course keep every limit."""
    factor = 0.0
    u = np.linspace(0.0, 1.0, SAMPLES + 1)
    for piece, *part in zip(pieces, course.seconds, course.states, course.jerks, strict=True):
        s, v, a, j = sample(piece, *part, u).T
        q = np.array(piece.carriages.map(s.size)(s[None])).reshape(4, 3, -1)
        motion = q[1] * v, q[1] * a + q[2] * v**2, q[1] * j + 3.0 * q[2] * v * a + q[3] * v**3
        for order, (values, limit) in enumerate(zip(motion, limits, strict=True), start=1):
            factor = max(factor, float((np.abs(values) / limit[:, None]).max()) ** (1.0 / order))
    return factor


def slow_start(pieces: list[Piece], limits: FloatArray, steps: int) -> Course:
    """Return a smooth motion from rest to rest, slow enough for every limit, on even steps."""
    ends = np.cumsum([0.0, *(piece.length for piece in pieces)])
    tau = np.linspace(0.0, 1.0, 20001)
    rise = ends[-1] * tau**4 * (35.0 - 84.0 * tau + 70.0 * tau**2 - 20.0 * tau**3)
    shares = np.interp(ends, rise, tau)
    shares[[0, -1]] = 0.0, 1.0
    polynomial = ends[-1] * np.polynomial.Polynomial([0, 0, 0, 0, 35.0, -84.0, 70.0, -20.0])
    seconds, states, jerks = [], [], []
    for begin, (low, high) in zip(ends, pairwise(shares), strict=False):
        count = max(LEAST, round(steps * (high - low)))
        t = np.linspace(low, high, count + 1)
        columns = [polynomial.deriv(k)(t) if k else polynomial(t) - begin for k in range(3)]
        third = polynomial.deriv(3)(t)
        seconds.append(high - low)
        states.append(np.stack(columns, axis=-1))
        jerks.append(np.stack([third[:-1], third[1:]], axis=-1))
    unit = Course(seconds, states, jerks)
    return stretch(unit, worst_factor(pieces, limits, unit))


def stretch(course: Course, factor: float) -> Course:
    """Return a course with every time multiplied."""
    powers = factor ** -np.arange(3.0)
    return Course(
        [factor * s for s in course.seconds],
        [state * powers for state in course.states],
        [jerk / factor**3 for jerk in course.jerks],
    )


def refine(pieces: list[Piece], course: Course, steps: int) -> Course:
    """Return the same motion on other steps, as many in each piece as its time asks for."""
    total = sum(course.seconds)
    states, jerks = [], []
    for piece, *part in zip(pieces, course.seconds, course.states, course.jerks, strict=True):
        count = max(LEAST, round(steps * part[0] / total))
        at = np.linspace(0.0, len(part[2]), count + 1)
        cell = np.minimum(at.astype(int), len(part[2]) - 1)
        fine = sample(piece, *part, np.linspace(0.0, 1.0, 65)).reshape(len(part[2]), 65, 4)
        rows = fine[cell, np.minimum(np.round(64 * (at - cell)).astype(int), 64)]
        states.append(rows[:, :3])
        jerks.append(np.stack([rows[:-1, 3], rows[1:, 3]], axis=-1))
    return Course(course.seconds, states, jerks)


def witness(geometry: dg.Geometry, limits: dg.CarriageLimits, curve: Curve) -> tuple[float, int]:
    """Find the quickest motion from rest to rest.

    Returns:
        Its duration [s], infinite where IPOPT finds none, and the number of its steps.
    """
    pieces = pieces_of(geometry, curve)
    table = np.array(
        [np.broadcast_to(v, 3) for v in (limits.velocity, limits.acceleration, limits.jerk)]
    )
    course = slow_start(pieces, table, STEPS[0])
    unit = sum(course.seconds)  # so that everything takes about 1
    table = table * (unit ** np.arange(1.0, 4.0))[:, None]
    course, best = stretch(course, 1.0 / unit), np.inf
    used = 0
    for steps in STEPS:
        try:
            course = solve(pieces, table, refine(pieces, course, steps))
        except ArithmeticError:  # the motion on fewer steps is a motion all the same
            break
        used, before = steps, best
        best = min(best, sum(course.seconds) * worst_factor(pieces, table, course))
        if best > (1.0 - GAIN) * before:
            break
    return unit * best, used
