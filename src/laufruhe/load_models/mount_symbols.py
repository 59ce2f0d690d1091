"""Response of the mounted block as CasADi expressions, by the same kernels as the numeric model (E1-E5, E20).

The motion of the block is q = R' y, with coordinates y in which the mass matrix is the unit matrix. R is the inverse
square root of the mass matrix, and the stiffness matrix K becomes R K R'. One complex symmetric system for each order
and operating point is solved in closed form, so that its derivatives are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.load_models.symbolic_spectrum import SymbolicSpectrum, cosines_and_sines
from laufruhe.machine import OperatingPoint
from laufruhe.machine.block import Block
from laufruhe.machine.dynamic import Dynamic
from laufruhe.machine.mount import every_spring
from laufruhe.numerics.namespaces import symbols
from laufruhe.numerics.norms import Grid
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.physics.rigid_body import along_axes, carried, point_motion, turned_axes
from laufruhe.problem import channels
from laufruhe.problem.decision import DAMPING, LAG, LOSS, POSITION, STIFFNESS, TURNED
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class SymbolicMounts:
    """Matrices of the mounts as expressions of the decisions.

    Attributes
    ----------
    stiffness, loss, damping
        Stiffness K, loss H and damping C in coordinates with unit mass, R K R', R H R', R C R', shape (6, 6) (E3).
    travels
        Deflection of the mounts per motion y, G R' with the map G from q to deflections, shape (3 mounts, 6) (E1).
    springs, losses, dampers
        Mount forces of stiffness, loss and damping per motion y, shape (3 mounts, 6) (E5).
    rows, directions
        For n springs whose stiffness depends on frequency: deflection per motion y, shape (n, 6), and direction of the
        force, shape (3 mounts, n) (E50).
    spring_travels
        Deflection of every spring along its own axes per motion y, shape (3 springs, 6) (E55).
    laws
        Stiffness laws of the springs whose stiffness depends on frequency.
    """

    stiffness: Any
    loss: Any
    damping: Any
    travels: Any
    springs: Any
    losses: Any
    dampers: Any
    rows: Any
    directions: Any
    spring_travels: Any
    laws: tuple[Dynamic, ...] = ()


def mount_matrices(problem: Problem, block: Block) -> Any:
    """Return a CasADi function from the mount decisions to the matrices of a block on mounts.

    Its outputs are the matrices of `SymbolicMounts`, in their order.
    """
    lib = symbols()
    decisions = ca.SX.sym("mounts", len(problem.mount_decisions))
    root = ca.DM(mass_root(block))
    totals = [ca.SX(6, 6) for _ in range(3)]
    maps: list[list[Any]] = [[], [], [], []]
    fixed = problem.numbers([decisions[k] for k in range(len(problem.mount_decisions))], problem.mount_decisions)
    rows, directions, spring_travels, mounts = [], [], [], len(problem.engine.mounts)
    springs = every_spring(problem.engine.mounts)
    for (place, spring), numbers in zip(springs, fixed.mounts or problem.mount_numbers, strict=True):
        axes = turned_axes(lib, numbers[TURNED])
        arm = [p - c for p, c in zip(numbers[POSITION], block.centre_of_gravity, strict=True)]
        motion = ca.SX(point_motion(lib, arm))
        stiffness = along_axes(lib, axes, numbers[STIFFNESS])
        total = stiffness
        spring_travels.append(ca.SX(axes) @ motion @ root.T)
        for law in spring.dynamic:
            axis = ca.SX(axes)[law.axis, :]
            total = total + law.static * (axis.T @ axis)
            rows.append(axis @ motion @ root.T)
            directions.append(ca.vertcat(ca.SX(3 * place, 1), axis.T, ca.SX(3 * (mounts - place - 1), 1)))
        drag = along_axes(lib, axes, numbers[DAMPING]) + numbers[LAG] * stiffness
        if place == len(maps[0]):
            maps[0].append(motion @ root.T)
        for k, matrix in enumerate((total, numbers[LOSS] * stiffness, drag)):
            totals[k] += carried(motion, matrix)
            force = matrix @ motion @ root.T
            # joined springs act at one place, so their forces add up
            maps[k + 1][place:] = [sum(maps[k + 1][place:], force)]
    stacked = [ca.vertcat(*parts) for parts in maps]
    dynamic = [ca.vertcat(*rows) if rows else ca.SX(0, 6), ca.horzcat(*directions) if rows else ca.SX(3 * mounts, 0)]
    return ca.Function(
        "mounts",
        [decisions],
        [*(root @ total @ root.T for total in totals), *stacked, *dynamic, ca.vertcat(*spring_travels)],
    )


def symbolic_mounts(problem: Problem, block: Block, decisions: Any) -> SymbolicMounts:
    """Return the matrices of the mounts at symbolic values of the mount decisions."""
    laws = tuple(law for _, spring in every_spring(problem.engine.mounts) for law in spring.dynamic)
    matrices = mount_matrices(problem, block)(decisions)
    return replace(SymbolicMounts(*matrices), laws=laws)


def elimination() -> Any:
    """Return a CasADi function that solves (A + i B) y = r + i s for the complex motion y of a block (E20).

    The inputs are A and B of shape (6, 6), r and s of shape (6,); the outputs are the real and imaginary parts of y.
    Elimination has no pivoting. Loss or damping keeps every pivot from zero. Without both, a pivot is zero only at
    single frequencies, where the result is not a number and a search steps aside.
    """
    a, b, r, s = ca.SX.sym("A", 6, 6), ca.SX.sym("B", 6, 6), ca.SX.sym("r", 6), ca.SX.sym("s", 6)
    rows = [[(a[j, k], b[j, k]) for k in range(6)] + [(r[j], s[j])] for j in range(6)]
    for p in range(6):
        inverse = _inverse(rows[p][p])
        for j in range(p + 1, 6):
            # every step keeps the matrix symmetric, so the lower half is not used
            factor = _times(rows[p][j], inverse)
            for k in range(j, 7):
                rows[j][k] = _minus(rows[j][k], _times(factor, rows[p][k]))
    y: list[tuple[Any, Any]] = [(0.0, 0.0)] * 6
    for p in reversed(range(6)):
        right = rows[p][6]
        for k in range(p + 1, 6):
            right = _minus(right, _times(rows[p][k], y[k]))
        y[p] = _times(right, _inverse(rows[p][p]))
    return ca.Function("eliminate", [a, b, r, s], [ca.vertcat(*(v[0] for v in y)), ca.vertcat(*(v[1] for v in y))])


def _times(a: tuple[Any, Any], b: tuple[Any, Any]) -> tuple[Any, Any]:
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def _minus(a: tuple[Any, Any], b: tuple[Any, Any]) -> tuple[Any, Any]:
    return a[0] - b[0], a[1] - b[1]


def _inverse(a: tuple[Any, Any]) -> tuple[Any, Any]:
    size = a[0] * a[0] + a[1] * a[1]
    return a[0] / size, -a[1] / size


@dataclass(frozen=True, eq=False)
class PointResponse:
    """Response of the mounted block at one operating point (E4, E5).

    Attributes
    ----------
    force, travel
        Mount forces [N] and deflections [m], with components of all mounts, shape (3 mounts, n).
    rigid_force
        Forces on rigid mounts [N] (E11).
    """

    point: OperatingPoint
    force: SymbolicSpectrum
    travel: SymbolicSpectrum
    rigid_force: SymbolicSpectrum


def response(mounts: SymbolicMounts, point: OperatingPoint, wrench: SymbolicSpectrum) -> PointResponse:
    """Return the motion of the mounted block and its mount forces at one operating point, as CasADi expressions.

    `wrench` is the wrench of the loads in coordinates with unit mass: R times the wrench about the centre of gravity,
    with the inverse square root R of the mass matrix.
    """
    real, imaginary, omegas = wrench.real, wrench.imaginary, wrench.orders * point.speed
    count, unit = len(omegas), ca.DM.eye(6)
    # complex stiffness at each frequency less the static stiffness
    increases = np.array([law.at(omegas) - law.static for law in mounts.laws], dtype=complex).reshape(
        len(mounts.laws), count
    )
    added_stiffness, added_drag = ca.DM(increases.real.copy()), ca.DM(increases.imag.copy())
    is_moving = [float(w > 0.0) for w in omegas]
    reactances = [mounts.stiffness - float(w) ** 2 * unit for w in omegas]
    resistances = [moves * mounts.loss + float(w) * mounts.damping for moves, w in zip(is_moving, omegas, strict=True)]
    if mounts.laws:
        for k in range(count):
            reactances[k] += mounts.rows.T @ ca.diag(added_stiffness[:, k]) @ mounts.rows
            resistances[k] += mounts.rows.T @ ca.diag(added_drag[:, k]) @ mounts.rows
    reactance, resistance = ca.horzcat(*reactances), ca.horzcat(*resistances)
    eliminate = elimination().map(count)
    yr, yi = eliminate(reactance, resistance, real, imaginary)
    rigid = eliminate(ca.repmat(mounts.stiffness, 1, count), ca.MX(6, 6 * count), real, imaginary)
    moving, speeds = ca.DM(np.tile(is_moving, (6, 1))), ca.DM(np.tile(omegas, (6, 1)))
    force_real = mounts.springs @ yr - mounts.losses @ (yi * moving) - mounts.dampers @ (yi * speeds)
    force_imaginary = mounts.springs @ yi + mounts.losses @ (yr * moving) + mounts.dampers @ (yr * speeds)
    if mounts.laws:
        real_travel, imaginary_travel = mounts.rows @ yr, mounts.rows @ yi
        force_real += mounts.directions @ (added_stiffness * real_travel - added_drag * imaginary_travel)
        force_imaginary += mounts.directions @ (added_stiffness * imaginary_travel + added_drag * real_travel)
    force, travel, rigid_force = (
        SymbolicSpectrum(wrench.orders, *parts)
        for parts in (
            (force_real, force_imaginary),
            (mounts.travels @ yr, mounts.travels @ yi),
            (mounts.springs @ rigid[0], mounts.springs @ rigid[1]),
        )
    )
    return PointResponse(point, force, travel, rigid_force)


MIN_SAMPLES = 32
SAMPLES_PER_ORDER = 4
"""Number of samples per period of the highest order."""


def sampled_rows(points: Sequence[PointResponse], names: Sequence[str], measure: Measure) -> tuple[Any, Grid]:
    """Return the vectors (rows) whose norm is a measure of mount forces or deflections, as CasADi expressions (P1).

    Rows are values at samples, or coefficients of orders for a root mean square (Parseval); their expression has the
    shape (k, 3). `points` are the responses at the operating points, and `names` the names of the mounts in them.
    """
    chosen = [response for response in points if measure.includes_point(response.point)]
    signals = [one.force if measure.channel is channels.MOUNT_FORCE else one.travel for one in chosen]
    mounts = measure.places(names)
    total_weight = sum(response.point.weight for response in chosen)
    blocks: list[Any] = []
    weights: list[float] = []
    # orders differ between points: all have the samples that the highest order needs
    highest = max(float(signal.orders.max(initial=0.0)) / signal.base for signal in signals)
    samples = max(MIN_SAMPLES, int(SAMPLES_PER_ORDER * highest))
    for response, signal in zip(chosen, signals, strict=True):
        part = signal.select(np.flatnonzero(measure.counted(signal.orders)))
        if measure.norm.is_euclidean:
            is_mean = part.orders == 0.0
            values, steps = ca.horzcat(part.real, part.imaginary), np.append(0.5 + 0.5 * is_mean, 0.5 - 0.5 * is_mean)
        else:
            cosine, sine = cosines_and_sines(part.orders.tolist(), signal.base, samples)
            values, steps = part.real @ cosine - part.imaginary @ sine, np.full(samples, 1.0 / samples)
        for k in mounts:
            rows = values[3 * k : 3 * k + 3, :].T
            if measure.direction_weights is not None:
                rows = rows @ ca.diag(ca.DM(list(measure.direction_weights)))
            blocks.append(rows)
            weights += [*(response.point.weight / total_weight / len(mounts) * steps)]
    return ca.vertcat(*blocks), Grid(np.array(weights), samples, points=len(chosen))


def transmitted_squares(points: Sequence[PointResponse], measure: Measure) -> list[tuple[Any, Any]]:
    """Return sums of squared mount forces on elastic and on rigid mounts, whose ratio is a transmissibility (E11).

    The list has a pair for each operating point and order.

    If the measure names no orders, all orders above zero count together.
    """
    pairs = []
    counted = [measure.orders] if measure.orders is None else [(order,) for order in measure.orders]
    for response in points:
        for orders in counted if measure.includes_point(response.point) else ():
            all_orders = response.force.orders
            group = np.flatnonzero((all_orders > 0.0) & replace(measure, orders=orders).counted(all_orders))
            if len(group):
                forces = (response.force.select(group), response.rigid_force.select(group))
                elastic, rigid = (ca.sumsqr(force.real) + ca.sumsqr(force.imaginary) for force in forces)
                pairs.append((elastic, rigid))
    return pairs
