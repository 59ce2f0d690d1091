"""What no elastic mounting within the bounds transmits less of (E29-E34).

Coordinates are those in which the mass is one. Of an order with load r the mounts
carry t = r + W^2 y in all, y being the motion (Newton), and

    y* (A + i B - W^2) y = y* r,    so    y* (L - W^2) y <= Re y* r                     (E30)

for every design whose stiffness A is not under L and whose damping B takes energy. In
t this is one quadratic inequality, and least mount forces under it are bounded from
below by duality (E33): the multipliers come from a solver, the bound from them does not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from laufruhe.load_models.affine import AffineModel
from laufruhe.machine.dynamic import Dynamic
from laufruhe.machine.mount import every_spring
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.numerics.norms import Norm
from laufruhe.numerics.spectrum import common_base
from laufruhe.physics.modes import weight_wrench
from laufruhe.physics.rigid_body import carried, moved_wrench, point_motion
from laufruhe.problem import channels
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import POSITION, STIFFNESS, TURNED, Domain
from laufruhe.problem.measure import Measure
from laufruhe.problem.mount_resonance import off_resonance
from laufruhe.problem.problem import Problem
from laufruhe.prove.quadratics import Quadratic, best_prices, covering

# designs are taken as feasible when they break a limit by less
SLACK = 1e-6
ROUNDS = 2
# share of a square that is spent on the arms of mounts whose places are open
STRETCH = 0.2
ASIDE = 5e-2


@dataclass(frozen=True, eq=False)
class Softest:
    """What every design allowed has in common (E31, E32).

    Attributes
    ----------
    floors
        Matrices L that the stiffness A of no design goes under, shape (n, 6, 6).
    squares
        Matrices that G' G of no mount goes over, in coordinates in which the mass is one,
        shape (mounts, 6, 6).
    load
        From a wrench about the origin to r, shape (6, 6).
    dynamic
        Springs whose stiffness depends on frequency, each with what it acts along, shape (6, 6), and whether that is
        known or only not over it (E50).
    """

    floors: Array
    squares: Array
    load: Array
    dynamic: tuple[tuple[Dynamic, Array, bool], ...] = ()

    def floors_at(self, omega: float) -> Array:
        """L at an angular frequency: what such springs have over their stiffness at rest, or lack."""
        total = np.zeros((6, 6))
        for law, along, is_known in self.dynamic:
            added = float(law.at(np.array([omega])).real[0]) - law.static
            total += (added if is_known else min(added, 0.0)) * along
        return np.asarray(self.floors + total)

    def metric(self, norm: Norm, loads: ComplexArray) -> Array:
        """P of E32: for squares of forces their sum, for the forces themselves a matrix that covers each."""
        if not norm.sums_lengths:
            return np.asarray(self.squares.sum(axis=0))
        # tight along the load, for what is transmitted points mostly the same way
        felt = np.real(np.outer(loads[0], loads[0].conj()))
        size = float(np.trace(felt))
        return covering(list(self.squares), felt / size + ASIDE * np.eye(6) if size > 0.0 else np.eye(6))


def transmitted_bound(problem: Problem) -> float:
    """What the objective of no design allowed goes under; zero where nothing is known (E34).

    Means, maxima and root mean squares of mount forces are bounded, all mounts counted;
    whatever else is minimised counts as zero, which no norm goes under.
    """
    bounded = [(term.weight, term.measure) for term in problem.objective if _is_bounded(term.measure)]
    if not bounded or not problem.points:
        return 0.0
    softest, model = softest_of(problem), AffineModel(off_resonance(problem))
    return sum(weight * _of_quantity(problem, quantity, softest, model) for weight, quantity in bounded)


def _is_bounded(quantity: Measure) -> bool:
    return quantity.channel is channels.MOUNT_FORCE and quantity.at is None


def softest_of(problem: Problem) -> Softest:
    """The least stiffness and the longest arms that the bounds of the decisions leave (E31, E32)."""
    mounting = mounting_in(problem.engine)
    root = np.linalg.inv(np.linalg.cholesky(mounting.block.mass_matrix))
    least, most = number_ranges(problem)
    floors, arms, dynamic = [np.zeros((6, 6))], list[Array](), list[tuple[Dynamic, Array, bool]]()
    for (place, spring), low, high in zip(every_spring(mounting.mounts), least, most, strict=True):
        middle = 0.5 * (low[POSITION] + high[POSITION])
        reach = float(np.linalg.norm(0.5 * (high[POSITION] - low[POSITION])))
        root_motion = point_motion(NUMBERS, middle - np.array(mounting.block.centre_of_gravity)) @ root.T
        square = root_motion.T @ root_motion
        turned = np.any(low[TURNED] < high[TURNED])
        if reach == 0.0:
            soft = np.maximum(low[STIFFNESS], 0.0)
            axes = np.array(spring.orientation)
            held = soft.min() * np.eye(3) if turned else axes.T @ np.diag(soft) @ axes
            floors[0] += carried(root_motion, held)
        else:
            turning = root[:, 3:] @ root[:, 3:].T
            square = (1.0 + STRETCH) * square + (1.0 + 1.0 / STRETCH) * reach**2 * turning
        for law in spring.dynamic:
            is_known = reach == 0.0 and not turned
            row = np.array(spring.orientation)[law.axis] @ root_motion
            dynamic.append((law, np.outer(row, row) if is_known else square, is_known))
            floors[0] += law.static * np.outer(row, row) if is_known else 0.0
        # springs that are joined stand in one place
        arms += [square] if place == len(arms) else []
    floors += limited_stiffness(problem, root)[0]
    return Softest(
        (1.0 - SLACK) * np.array(floors),
        np.array(arms),
        root @ moved_wrench(NUMBERS, mounting.block.centre_of_gravity),
        tuple(dynamic),
    )


def number_ranges(problem: Problem, lower: Array | None = None, upper: Array | None = None) -> tuple[Array, Array]:
    """Least and largest values of the numbers of every spring, shape (springs, 14) each.

    Parameters
    ----------
    lower, upper
        Of the open numbers of the mounts; their bounds when left out.
    """
    low = np.array(problem.mount_numbers, dtype=float)
    high = low.copy()
    decisions = problem.mount_decisions
    sides = [
        [getattr(d, side) for d in decisions] if given is None else given.tolist()
        for side, given in (("lower", lower), ("upper", upper))
    ]
    for decision, *edges in zip(decisions, *sides, strict=True):
        for drive in decision.mount_drives:
            ends = [drive.gain * (edge - decision.start_number) for edge in edges]
            low[drive.mount, drive.number] += min(ends)
            high[drive.mount, drive.number] += max(ends)
    return low, high


Band: TypeAlias = tuple[float, float]


def limited_stiffness(problem: Problem, root: Array) -> tuple[list[Array], list[Array], list[Band]]:
    """L that A is not under, by least frequency and largest sag (E31), U that it is not over (E43), and bands (E53).

    Bands are of squares of angular frequencies, less what a limit may be broken by.
    """
    floors, ceilings, bands = [], [], []
    weight = weight_wrench(mounting_in(problem.engine).block)
    for limit in problem.mount_limits:
        if limit.measure.channel is channels.FREQUENCIES:
            floors += [(math.tau * limit.minimum) ** 2 * np.eye(6)] if limit.minimum > 0.0 else []
            ceilings += [(math.tau * limit.maximum) ** 2 * np.eye(6)] if limit.maximum < math.inf else []
            for low, high in [limit.outside] if limit.outside is not None else []:
                bands.append(((math.tau * low * (1.0 + SLACK)) ** 2, (math.tau * high * (1.0 - SLACK)) ** 2))
        if limit.measure.channel is channels.SAG and 0.0 < limit.maximum < math.inf:
            pull = root @ weight
            floors.append(np.outer(pull, pull) / (limit.maximum * -weight[2]))
    return floors, ceilings, bands


def _of_quantity(problem: Problem, quantity: Measure, softest: Softest, model: AffineModel) -> float:
    chosen = [
        (point, spectra)
        for point, spectra in zip(problem.points, model.wrenches(), strict=True)
        if quantity.points is None or point.name in quantity.points
    ]
    # no direction counts less than the least weight
    least = min(quantity.direction_weights or (1.0,))
    whole = sum(point.weight for point, _ in chosen)
    squares: list[dict[float, float]] = []
    roots: list[dict[float, float]] = []
    for point, (bare, slopes) in chosen:
        base = common_base([bare.base, *(slope.base for slope in slopes)])
        coefficients = [s.rebased(base).coefficients for s in (bare, *slopes)]
        squares.append({})
        roots.append({})
        for k in np.flatnonzero(quantity.counted([k * float(base) for k in range(max(len(c) for c in coefficients))])):
            loads = np.array([softest.load @ c[k] if k < len(c) else np.zeros(6) for c in coefficients])
            if not np.any(loads):
                # what nothing excites transmits nothing
                continue
            half = 0.5 if k else 1.0
            metric = softest.metric(quantity.norm, loads)
            order = k * float(base)
            least_square = least_transmitted(
                loads, order * point.speed, metric, softest.floors_at(order * point.speed), model.domains
            )
            squares[-1][order] = half * least_square / len(softest.squares)
            roots[-1][order] = half * math.sqrt(least_square) / len(softest.squares)
    shares = np.array([point.weight / whole for point, _ in chosen])
    return least * quantity.norm.least_of_orders(squares, roots, shares)


def least_transmitted(
    loads: ComplexArray, omega: float, metric: Array, floors: Array, domains: Sequence[Domain] = ()
) -> float:
    """What t* metric^-1 t of no design is under (E33).

    Parameters
    ----------
    loads
        r of the bare design and of one unit of every column of the unbalances, in
        coordinates in which the mass is one, shape (1 + columns, 6).
    omega
        Angular frequency [rad/s].
    metric
        Shape (6, 6).
    floors
        Matrices L, shape (n, 6, 6).
    domains
        Of the unbalances.
    """
    reach = np.concatenate([np.full(d.width, d.scale) for d in domains] or [np.zeros(0)])
    size = float(np.linalg.norm(loads, axis=1) @ np.concatenate([[1.0], reach]))
    if size == 0.0:
        return 0.0
    real = np.concatenate([loads.real, loads.imag], axis=1).T
    given, slopes = real[:, 0], real[:, 1:]
    inverse = _twice(np.asarray(np.linalg.inv(metric), dtype=np.float64))
    if omega == 0.0:
        return _least(_steady(given, slopes, inverse), _disc_limits(domains, 0), reach)
    objective = Quadratic(np.pad(inverse, (0, len(reach))), np.zeros(12 + len(reach)), 0.0)
    held = [_energy(_twice(floor) / omega**2, given, slopes) for floor in floors] + _disc_limits(domains, 12)
    stiffest = np.linalg.eigvalsh(floors.sum(axis=0)).max() / omega**2
    carried_load, best = size * min(max(stiffest, 1e-8), 1.0), 0.0
    for _ in range(ROUNDS):
        found = _least(objective, held, np.concatenate([np.full(12, carried_load), reach]))
        best = max(best, found)
        # a solver works best where the answer is of size one
        carried_load = math.sqrt(best * float(np.linalg.eigvalsh(metric)[-1])) or carried_load
    return best


def _least(objective: Quadratic, held: Sequence[Quadratic], scales: Array) -> float:
    """A lower bound of a function under others that may not exceed zero; none of them takes it under zero (E33)."""
    if not len(scales):
        return objective.constant
    total, unit = _scaled(objective, scales)
    sized = [_scaled(each, scales)[0] for each in held]
    for each, price in zip(sized, best_prices(total, sized), strict=True):
        total = total.plus(each, max(float(price), 0.0))
    return max(unit * total.least, 0.0)


def _twice(matrix: Array) -> Array:
    """For the real and for the imaginary part."""
    return np.asarray(np.kron(np.eye(2), matrix), dtype=np.float64)


def _steady(given: Array, slopes: Array, inverse: Array) -> Quadratic:
    """At rest the mounts carry the load itself: t = r."""
    return Quadratic(slopes.T @ inverse @ slopes, slopes.T @ inverse @ given, float(given @ inverse @ given))


def _energy(floor: Array, given: Array, slopes: Array) -> Quadratic:
    """E30 in t and the columns: (t - r)' (L / W^2 - 1) (t - r) <= (t - r)' r, r = given + slopes x."""
    one = np.eye(12)
    across = 0.5 * (one - 2.0 * floor)
    matrix = np.block([[floor - one, across @ slopes], [slopes.T @ across, slopes.T @ floor @ slopes]])
    vector = np.concatenate([across @ given, slopes.T @ floor @ given])
    return Quadratic(matrix, vector, float(given @ floor @ given))


def _disc_limits(domains: Sequence[Domain], before: int) -> list[Quadratic]:
    """Where the unbalances lie: |u| at most its largest size, a real one between its bounds."""
    size = before + sum(domain.width for domain in domains)
    found = []
    for domain in domains:
        matrix, vector = np.zeros((size, size)), np.zeros(size)
        own = np.arange(size)[before:][domain.columns]
        matrix[own, own] = 1.0
        constant = -(domain.scale**2)
        if domain.width == 1:
            low, high = domain.set.lower, domain.set.upper
            vector[own], constant = -0.5 * (low + high), low * high
        found.append(Quadratic(matrix, vector, constant))
    return found


def _scaled(function: Quadratic, scales: Array) -> tuple[Quadratic, float]:
    """In variables of size one, and divided by its own size; that size."""
    matrix, vector = function.matrix * np.outer(scales, scales), function.vector * scales
    size = max(np.abs(matrix).max(initial=0.0), np.abs(vector).max(initial=0.0), abs(function.constant)) or 1.0
    return Quadratic(matrix / size, vector / size, function.constant / size), float(size)
