"""Solve for mount stiffness by a cone program, if objective and limits are convex in it (E16-E19, E46).

The stiffness matrix A, in coordinates with unit mass, is affine in the stiffnesses. With the weight w of the block, its
torque-roll axis t, and the mass matrix M, each convex measure f has a cone that is affine in stiffness and f:

    [f, w'; w, A] >= 0          sag w' A^-1 w                                    (E16)
    f - A >= 0, A - f >= 0      squares of the highest and of the lowest natural angular frequency (E17, E18)
    |A t / W2 - t| <= f         torque-roll residual                             (E19)
    |K q - s M q| <= f          the same in raw coordinates, s open              (E46)

Multipliers z in the dual cones of the slacks b - R x bound the objective q' x by (q + R' z)' x - b' z. All x are within
bounds, except measures f in the objective. Their coefficients are not negative after all z are scaled down.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from laufruhe.machine.mount import every_spring
from laufruhe.numerics.arrays import Array
from laufruhe.physics.modes import weight_wrench
from laufruhe.physics.mount_numbers import mass_root, total_stiffness
from laufruhe.problem import channels
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import real_bounds
from laufruhe.problem.measure import Limit, Measure, Side, Term
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import ProofStrength
from laufruhe.prove.mounts.dual_cones import LENGTH, MATRIX, SIDES, ZERO, column, in_dual_cones
from laufruhe.solvers.conclusion import (
    ProofData,
    build_result,
    evaluate_design,
    infeasible_result,
    smallest_conflict,
)
from laufruhe.solvers.cones.cone_program import ConeRows, run_clarabel
from laufruhe.solvers.cones.conic import ATTEMPTS
from laufruhe.solvers.prices import Price, bounds_of
from laufruhe.solvers.result import Result

CONVEX = (channels.SAG, channels.TORQUE_ROLL, channels.RAW_TORQUE_ROLL, channels.TOTAL_STIFFNESS)
# a bound from the duals of a matrix inequality has these tolerances
TIGHT: Mapping[str, Any] = {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11}
# share of the sizes of multipliers and limits from which limits contradict each other
CONTRADICTION = 1e-6


def is_convex(problem: Problem) -> bool:
    """Return True if only stiffnesses are open, and objective and limits are convex in them."""
    if problem.load_terms or problem.load_limits or not problem.objective:
        return False
    if not all(decision.is_stiffness for decision in problem.decisions):
        return False
    terms = all(term.measure.channel in CONVEX for term in problem.objective)
    return terms and all(_is_convex_limit(limit) for limit in problem.limits)


def _is_convex_limit(limit: Limit) -> bool:
    channel = limit.measure.channel
    if channel is channels.FREQUENCIES:
        return limit.outside is None
    if channel is channels.TOTAL_STIFFNESS:
        return True
    return channel in CONVEX and limit.minimum == -math.inf


@dataclass(frozen=True, eq=False)
class Block:
    """Rows in a cone: constant + slopes' y + top f + free s, shapes (k,), (n, k), (k,) and (k,).

    Attributes
    ----------
    size
        Unit of the measure f [SI].
    span
        Bounds of the number s.
    """

    kind: str
    constant: Array
    slopes: Array
    top: Array
    size: float
    free: Array
    span: tuple[float, float] = (0.0, 0.0)


def clarabel_cone(kind: str, count: int) -> Any:
    """Return Clarabel's cone of a kind, by its count of rows."""
    import clarabel

    if kind == MATRIX:
        return clarabel.PSDTriangleConeT(math.isqrt(2 * count))
    kinds = {ZERO: clarabel.ZeroConeT, SIDES: clarabel.NonnegativeConeT, LENGTH: clarabel.SecondOrderConeT}
    return kinds[kind](count)


class ConvexProgram:
    """Cone program of stiffnesses between bounds: minimise a weighted sum of measures under limits.

    The variables are the stiffnesses y from -1 to 1, the measure f of each term, and a number s of each block.
    """

    def __init__(self, problem: Problem, objective: Sequence[Term], limits: Sequence[Limit]) -> None:
        self.problem, decisions = problem, problem.decisions
        lower, upper = real_bounds(decisions)
        self.centre, self.half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        self._mounting = mounting = mounting_in(problem.design(self.centre.tolist()))
        self._root, springs = mass_root(mounting.block), every_spring(mounting.mounts)
        slopes = np.zeros((len(decisions), 6, 6))
        for slope, decision in zip(slopes, decisions, strict=True):
            # derivative of the stiffness matrix (E3)
            for drive in decision.mount_drives:
                place, spring = springs[drive.mount]
                row = self._root @ (np.array(spring.orientation)[drive.number] @ mounting.motions[place])
                slope += drive.gain * np.outer(row, row)
        matrices = np.array([self._root @ mounting.stiffness @ self._root.T, *(self.half[:, None, None] * slopes)])
        self._unit = float(np.trace(matrices[0])) / 6.0 or 1.0
        self._matrices = matrices / self._unit
        self.terms = [(term.weight, self._block(term.measure)) for term in objective]
        # blocks of limits, with the change of their rows by the limit
        self.limits = [(limit, *part) for limit in limits for part in self._limited(limit)]
        blocks = [block for _, block in self.terms] + [block for _, _, block, _ in self.limits]
        n, terms = len(decisions), len(self.terms)
        heads = np.zeros((terms, sum(len(block.constant) for block in blocks)))
        free, first = np.zeros((len(blocks), heads.shape[1])), 0
        for k, block in enumerate(blocks):
            part = slice(first, first + len(block.constant))
            if k < terms:
                heads[k, part] = block.top
            free[k, part], first = block.free, part.stop
        self._cones = [(block.kind, len(block.constant)) for block in blocks]
        self._right = np.concatenate([np.zeros(0), *(block.constant for block in blocks)])
        slopes_of_rows = np.concatenate([np.zeros((n, 0)), *(block.slopes for block in blocks)], axis=1)
        self._rows = -np.concatenate([slopes_of_rows, heads, free])
        spans = np.array([block.span for block in blocks]).reshape(-1, 2)
        self._cost = np.concatenate([np.zeros(n), [w * block.size for w, block in self.terms], np.zeros(len(blocks))])
        self._low = np.concatenate([-np.ones(n), np.zeros(terms), spans[:, 0]])
        self._high = np.concatenate([np.ones(n), np.zeros(terms), spans[:, 1]])

    def _block(self, measure: Measure) -> Block:
        matrices, n = self._matrices, len(self.half)
        if measure.channel is channels.SAG:
            weight = weight_wrench(self._mounting.block)
            pull = self._root @ weight / math.sqrt(-weight[2] * self._unit)
            solvable = np.linalg.eigvalsh(matrices[0])[0] > 0.0
            size = float(pull @ np.linalg.solve(matrices[0], pull)) if solvable else 1.0
            bordered = np.pad(matrices, [(0, 0), (1, 0), (1, 0)])
            bordered[0, 0, 1:] = bordered[0, 1:, 0] = pull / math.sqrt(size)
            rows, top = column(bordered), column(np.diag([1.0, *np.zeros(6)]))
            return Block(MATRIX, rows[0], rows[1:], top, size, np.zeros_like(top))
        if measure.channel.axis_residual is not None:
            axis = measure.channel.axis_residual(self._mounting.block, measure.frequency)
            parts = np.array([axis.stiffness_part(matrix * self._unit) for matrix in matrices])
            size, mass = float(np.linalg.norm(parts[0])) or 1.0, float(np.linalg.norm(axis.mass))
            # the best s is at most |L A q| / |m|
            reach = max(float(np.linalg.norm(parts, axis=1).sum()) / mass, axis.minimum)
            rows = np.pad(parts / size, [(0, 0), (1, 0)])
            top, free = np.eye(7)[0], np.append(0.0, -axis.mass / mass)
            span = axis.minimum * mass / size, min(axis.maximum, reach) * mass / size
            return Block(LENGTH, rows[0], rows[1:], top, size, free, span)
        gains = np.array([sum(drive.gain for drive in d.mount_drives) for d in self.problem.decisions])
        total = total_stiffness(self._mounting.mounts)
        size = abs(total) or 1.0
        slopes = -(gains * self.half / size).reshape(n, 1)
        return Block(SIDES, np.array([-total / size]), slopes, np.ones(1), size, np.zeros(1))

    def _limited(self, limit: Limit) -> list[tuple[str, Block, Array]]:
        sides: list[tuple[str, float, float]] = [("at most", limit.maximum, 1.0), ("at least", limit.minimum, -1.0)]
        parts: list[tuple[str, Block, Array]] = []
        if limit.measure.channel is channels.FREQUENCIES:
            rows, unit = column(self._matrices), column(np.eye(6)) / self._unit
            for side, edge, sign in sides:
                if math.isfinite(edge):
                    # the largest entry is about one, so that a remote limit does not spoil the others
                    size = max((math.tau * edge) ** 2 / self._unit, 1.0)
                    constant = sign * (unit * (math.tau * edge) ** 2 - rows[0]) / size
                    block = Block(MATRIX, constant, -sign * rows[1:] / size, unit, 1.0, np.zeros_like(unit))
                    # rows change by the square of 2 pi f
                    parts.append((side, block, unit * 2.0 * math.tau**2 * edge / size))
            return parts
        plain = self._block(limit.measure)
        for side, edge, sign in sides:
            if math.isfinite(edge):
                constant = sign * (plain.constant + plain.top * edge / plain.size)
                block = Block(plain.kind, constant, sign * plain.slopes, plain.top, plain.size, plain.free, plain.span)
                parts.append((side, block, plain.top / plain.size))
        return parts

    def solve(self) -> tuple[Array, Array] | None:
        """Return stiffnesses [N/m], shape (n,), and multipliers; None if these prove that the limits contradict."""
        rows, count, n = ConeRows(len(self._cost)), len(self._right), len(self.half)
        rows.add(np.arange(count), np.arange(len(self._cost))[:, None], self._rows, self._right)
        bounded = np.delete(np.arange(len(self._cost)), np.s_[n : n + len(self.terms)])
        for sign, edges in ((1.0, self._high), (-1.0, -self._low)):
            rows.add(np.arange(len(bounded)), bounded, sign, edges[bounded])
        rows.cones += [clarabel_cone(*cone) for cone in (*self._cones, (SIDES, 2 * len(bounded)))]
        for settings in (TIGHT, *ATTEMPTS):
            raw = run_clarabel(rows, self._cost, settings)
            x, z = (np.nan_to_num(np.array(part)) for part in (raw.x, raw.z))
            if "Infeasible" in str(raw.status) and self.excludes(z[:count]):
                return None
            if "Solved" in str(raw.status):
                break
        return self.centre + self.half * np.clip(x[:n], -1.0, 1.0), z[:count]

    def excludes(self, z: Array) -> bool:
        """Return True if multipliers of the limits prove that no stiffnesses keep all limits."""
        z = in_dual_cones(z, self._cones)
        z[: sum(count for _, count in self._cones[: len(self.terms)])] = 0.0
        proof, _ = self._minimum(np.zeros_like(self._cost), z)
        return proof > CONTRADICTION * float(np.abs(self._right) @ np.abs(z))

    def bound(self, z: Array) -> tuple[float, Array]:
        """Return the lower bound of the objective that multipliers prove, for any multipliers, and its gradient.

        The gradient is that of the linear bound by the stiffnesses, shape (n,).
        """
        z = in_dual_cones(z, self._cones)
        heads = slice(len(self.half), len(self.half) + len(self.terms))
        prices = -self._rows[heads] @ z
        z = z * float(np.min(np.where(prices > self._cost[heads], self._cost[heads] / np.maximum(prices, 1e-300), 1.0)))
        return self._minimum(self._cost, z)

    def _minimum(self, cost: Array, z: Array) -> tuple[float, Array]:
        remainder = cost + self._rows @ z
        minimum = np.minimum(remainder * self._low, remainder * self._high).sum() - self._right @ z
        return float(minimum), remainder[: len(self.half)] / np.where(self.half > 0.0, self.half, np.inf)

    def prices(self, z: Array) -> dict[Side, Price]:
        """Return the decrease of the objective per unit of each side of the limits."""
        parts = np.split(in_dual_cones(z, self._cones), np.cumsum([count for _, count in self._cones])[:-1])
        priced = zip(self.limits, parts[len(self.terms) :], strict=True)
        return {(limit, side): Price.both(float(change @ part)) for (limit, side, _, change), part in priced}


def solve_convex_mounts(problem: Problem) -> Result:
    """Return the global optimum of a problem that `is_convex` accepts, with its certificate."""
    started = time.perf_counter()
    program = ConvexProgram(problem, problem.objective, problem.limits)
    initial = evaluate_start(problem)
    model_time = time.perf_counter()
    solution = program.solve()
    solved = time.perf_counter()
    timing = {"model": model_time - started, "solve": solved - model_time}
    if solution is None:

        def is_infeasible(subset: Sequence[Limit]) -> bool:
            return ConvexProgram(problem, (), subset).solve() is None

        return infeasible_result(problem, initial, smallest_conflict(problem.limits, is_infeasible), timing)
    x, z = solution
    bound, gradient = program.bound(z)
    design = evaluate_design(problem, x.tolist())
    proof = ProofData(
        bound=bound,
        strength=ProofStrength.EXACT,
        # the gap of a feasible design bounds stationarity and complementarity
        kkt_residual=max(design.violation, (design.value - bound) / (abs(design.value) or 1.0), 0.0),
        method="linear matrix inequalities, dual bound over the box of stiffnesses",
        prices=program.prices(z),
        bounds={
            name: price
            for k, (decision, value) in enumerate(zip(problem.decisions, x.tolist(), strict=True))
            for name, price in bounds_of(decision, np.array([value]), gradient[k : k + 1]).items()
        },
    )
    return build_result(design, initial, proof, {**timing, "evaluate": time.perf_counter() - solved})
