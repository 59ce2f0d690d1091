"""Build one smooth program of mounts, unbalances and throws (E20-E24, S20).

Variables are the open numbers of the mounts, the columns of the unbalances, and the deviations of the throws from a
crank star. For measures of modes the shapes V and squared frequencies l are variables too, with the constraints

    V' V = 1,    V' A V = diag(l)                                                       (E21)

so that natural frequencies and shares of energy are smooth expressions. A maximum is an epigraph variable (E22), a
mean of lengths is softened (N3), and a band without natural frequencies is (l - a)(l - b) >= 0 (E23).
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.affine import AffineModel
from laufruhe.load_models.block_loads import FixedCrankLoads, SymbolicLoads
from laufruhe.load_models.labelled_rows import column_names
from laufruhe.load_models.mount_symbols import (
    PointResponse,
    elimination,
    response,
    sampled_rows,
    symbolic_mounts,
    transmitted_squares,
)
from laufruhe.load_models.simulated import COARSE_STEP
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.load_models.uneven_model import UnevenModel
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.numerics.norms import Grid, softened_lengths
from laufruhe.physics.modes import weight_wrench
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.physics.rigid_body import moved_wrench
from laufruhe.problem import channels
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import Kind, domains_of
from laufruhe.problem.dependence import depends
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Limit, Measure, Side
from laufruhe.problem.mount_resonance import off_resonance
from laufruhe.problem.problem import Problem
from laufruhe.solvers.prices import Price
from laufruhe.solvers.smooth.constraint_collector import ConstraintCollector
from laufruhe.solvers.smooth.local_optimum import LocalOptimum
from laufruhe.solvers.smooth.nonlinear import NonlinearProgram
from laufruhe.solvers.smooth.variables import ModeVariables, SimulatedVariables, StaticCases

# softening of norms relative to their unit: in the first stages, and in the last one (N4)
SOFTNESS, SOFTEST = (1e-2, 1e-4), 1e-7
# a stiffness whose bounds have a larger ratio is replaced by its logarithm
WIDE = 100.0
# number of orders in an error message
MAX_NAMED = 6
SIDES = ("at least", "at most")
# a typical deviation of a throw [rad]
TURN = 0.1


class SmoothProgram:
    """Nonlinear program of a problem, with the maps between its variables and the decisions.

    Parameters
    ----------
    problem
        Problem with one crank star and one firing order.
    unit
        Typical size of the objective [SI].
    margin
        Share by which limits on loads are tightened, because the program has few samples.
    moves
        Open throws, which may leave the crank star of the problem; None if they are fixed.
    slack
        Share by which all limits are tightened.
    softest
        Softening of norms in the last stage, as a share of the objective (N4).
    coarser
        Time step of simulations relative to that of the final evaluation.
    """

    def __init__(
        self, problem: Problem, unit: float, margin: float = 0.0, moves: ThrowMoves | None = None,
        slack: float = 0.0, softest: float = SOFTEST, coarser: int = COARSE_STEP,
    ) -> None:  # fmt: skip
        self.problem, self.unit, self.moves = problem, unit, moves
        self._margin, self._slack, self._softest = margin, slack, softest
        self.domains = domains_of(problem.unbalances)
        self._decisions = problem.mount_decisions
        self._count = len(self._decisions)
        self.columns = sum(domain.width for domain in self.domains)
        self._is_logarithmic = np.array(
            [d.is_stiffness and d.upper > WIDE * d.lower > 0.0 for d in self._decisions], bool
        )
        self._mount_variables = ca.MX.sym("mounts", self._count)
        self._unbalance_columns = ca.MX.sym("unbalances", self.columns)
        numbers = [
            ca.exp(self._mount_variables[k]) if wide else self._mount_variables[k]
            for k, wide in enumerate(self._is_logarithmic)
        ]
        self._mount_numbers = ca.vertcat(*numbers) if numbers else self._mount_variables
        self._throw_deviations = ca.MX.sym("throws", 0 if moves is None else moves.size)
        self._loads: SymbolicLoads
        if moves is None:
            # the affine model gives loads and unbalances, which do not depend on the mounts
            affine = AffineModel(off_resonance(problem))
            self._loads = FixedCrankLoads(affine, self._unbalance_columns)
        else:
            self._loads = UnevenModel(problem, moves, self._throw_deviations, self._unbalance_columns)
        self._softness = ca.MX.sym("softness")
        self._constraints = ConstraintCollector()
        self._modes = ModeVariables(problem, self._constraints)
        self._simulated = SimulatedVariables(
            problem, ca.vertcat(self._mount_numbers, self._unbalance_columns), self._constraints, coarser
        )
        self._points: list[PointResponse] = []
        if problem.uses_mounts:
            self._mounting = mounting_in(problem.engine)
            self._root = mass_root(self._mounting.block)
            self._mounts = symbolic_mounts(problem, self._mounting.block, self._mount_numbers)
            self._cases = StaticCases(self._mounts, self._mounting, self._root, self._constraints)
            wrench_map = self._root @ moved_wrench(NUMBERS, self._mounting.block.centre_of_gravity)
            # response of the mounts at every operating point (E4)
            self._points = [
                response(self._mounts, point, wrench)
                for point, wrench in zip(problem.points, self._loads.wrenches(wrench_map), strict=True)
            ]
            self._modes.hold(self._mounts.stiffness, self._root, self._mounting)
        self.program = self._build()

    def _build(self) -> NonlinearProgram:
        minimum = ca.MX(0.0)
        for term in self.problem.objective:
            minimum += term.weight * self._minimum(term.measure, self.unit / (term.weight or 1.0))
        for limit in self.problem.limits:
            self._limit(limit)
        self._hold_unbalances()
        if self.moves is not None:
            rows, names = self.moves.firing_intervals(self._throw_deviations)
            for row, name in zip(rows, names, strict=True):
                self._constraints.add(row, self.moves.intervals.minimum, self.moves.intervals.maximum, name)
        largest = ca.vertcat(*(top for top, _ in self._constraints.heads)) if self._constraints.heads else ca.MX(0, 1)
        lower, upper = self._bounds()
        width = upper - lower
        scales = np.where(np.isfinite(width) & (width > 0.0), width, 1.0)
        scales[self._throw_columns] = TURN
        # N4: one stage if simulations are costly and no softened term is minimised
        is_costly = self._simulated.external is not None and not self.problem.load_terms
        constraints = ca.densify(ca.vertcat(*self._constraints.expressions)) if self._constraints.expressions else None
        return NonlinearProgram(
            ca.vertcat(
                self._mount_variables, self._unbalance_columns, self._throw_deviations, self._modes.symbols, largest
            ),
            minimum,
            lower,
            upper,
            constraints=constraints,
            constraint_lower=np.array(self._constraints.lower),
            constraint_upper=np.array(self._constraints.upper),
            constraint_names=tuple(self._constraints.names),
            scales=scales,
            objective_scale=self.unit,
            parameters=self._softness,
            stages=tuple((share,) for share in (*(() if is_costly else SOFTNESS), self._softest)),
            external=self._simulated.external,
            leading_variables=self._throw_columns.stop,
        )

    def _bounds(self) -> tuple[Array, Array]:
        low = self._to_variables([d.lower for d in self._decisions]).tolist()
        high = self._to_variables([d.upper for d in self._decisions]).tolist()
        for domain in self.domains:
            maximum = domain.set.upper
            low += [domain.set.lower] if domain.width == 1 else [-maximum, -maximum]
            high += [maximum] * domain.width
        if self.moves is not None:
            low += self.moves.lower.tolist()
            high += self.moves.upper.tolist()
        modes, floors = self._modes.symbols.numel(), self._constraints.floors
        low += [*[-math.inf] * modes, *floors]
        return np.array(low), np.array(high + [math.inf] * (modes + len(floors)))

    @property
    def variable_names(self) -> list[str]:
        """Name of every variable; "log" stands before a stiffness whose logarithm is the variable."""
        names = [
            f"log {d.name}" if log else d.name for d, log in zip(self._decisions, self._is_logarithmic, strict=True)
        ]
        names += column_names(self.domains)
        names += [f"throw {k + 1}" for k in range(self._throw_deviations.numel())]
        names += [f"mode {k + 1}" for k in range(self._modes.symbols.numel())]
        return names + [f"head {k + 1}" for k in range(self.program.x.numel() - len(names))]

    @property
    def _throw_columns(self) -> slice:
        first = self._count + self.columns
        return slice(first, first + self._throw_deviations.numel())

    def _rows(self, measure: Measure) -> tuple[Any, Grid]:
        if measure.on_mounts and self._points:
            names = [mount.name for mount in self.problem.engine.mounts]
            return sampled_rows(self._points, names, measure)
        return self._loads.rows(measure)

    def _minimum(self, measure: Measure, unit: float) -> Any:
        # N3: softened by a share of its unit; a constant if no decision affects it
        kinds = {d.kind for d in self.problem.decisions} | ({Kind.STAR} if self.moves is not None else set())
        if not depends(measure.channel, kinds, self.problem):
            return evaluate(off_resonance(self.problem)).value(measure)
        if measure.is_mounting:
            return self._mounting_expression(measure)
        if measure.channel.simulation:
            return self._simulated.minimum(measure)
        rows, grid = self._rows(measure)
        return measure.norm.smooth_expression(self._constraints.named(measure.name), grid, rows, unit, self._softness)

    def _limit(self, limit: Limit) -> None:
        measure = limit.measure
        if measure.is_mounting:
            self._limit_mounts(limit)
            return
        factor = 1.0 - self._slack - self._margin
        if measure.channel.simulation:
            self._simulated.limit(limit, factor)
            return
        rows, grid = self._rows(measure)
        unit = limit.maximum * factor or self.unit
        collector = self._constraints.named(limit.name)
        value, maximum, slope = measure.norm.smooth_limit(
            collector, grid, rows / unit, limit.maximum * factor / unit, self._softest
        )
        self._constraints.add(value, -np.inf, maximum, limit.name, maximum=((limit, "at most"), slope / unit))

    def _hold_unbalances(self) -> None:
        # sets of the unbalances (P4)
        for domain in self.domains:
            if domain.width == 1:
                continue
            unbalance = self._unbalance_columns[domain.columns]
            self._constraints.add(ca.sumsqr(unbalance) / domain.scale**2, -np.inf, 1.0, domain.decision.name)
            for sign, (x, y) in zip((1.0, -1.0), domain.set.edges, strict=False):
                self._constraints.add(
                    sign * (x * unbalance[1] - y * unbalance[0]) / domain.scale, 0.0, np.inf, domain.decision.name
                )

    def _mounting_expression(self, quantity: Measure) -> Any:
        """Return the CasADi expression of a measure of mounts or natural modes, such as sag."""
        mounts = self._mounts
        if quantity.channel is channels.SAG:
            weight = weight_wrench(self._mounting.block)
            load = ca.DM(self._root @ weight)
            deflection, _ = elimination()(mounts.stiffness, ca.MX(6, 6), load, ca.DM.zeros(6))
            return ca.dot(load, deflection) / -weight[2]
        if quantity.channel.axis_residual is not None:
            # residual of the torque-roll axis, relative to that of the initial mounts
            axis = quantity.channel.axis_residual(self._mounting.block, quantity.frequency)
            initial = axis.stiffness_part(self._root @ self._mounting.stiffness @ self._root.T)
            unit = float(np.linalg.norm(initial)) or 1.0
            answer, mass = ca.DM(axis.left) @ mounts.stiffness @ ca.DM(axis.right), ca.DM(axis.mass)
            best = ca.fmax(ca.dot(mass, answer) / ca.dot(mass, mass), axis.minimum)
            residual = answer - (ca.fmin(best, axis.maximum) if axis.maximum < math.inf else best) * mass
            return unit * softened_lengths(residual.T / unit, self._softness)
        if quantity.channel.case_vectors is not None:
            return self._cases.largest(quantity, self.problem.engine)
        if quantity.channel is channels.DECOUPLING_SHORTFALL:
            return self._modes.shortfall(quantity)
        if quantity.channel is channels.TOTAL_STIFFNESS:
            numbers = self.problem.numbers([self._mount_numbers[k] for k in range(self._count)], self._decisions)
            rows = numbers.mounts or [list(mount.stiffness) for mount in self._mounting.mounts]
            return sum((k for row in rows for k in row[:3]), ca.MX(0.0))
        pairs = transmitted_squares(self._points, quantity)
        if not pairs:
            orders = sorted({float(order) for point in self._points for order in point.force.orders if order > 0.0})
            names = ", ".join(f"{order:g}" for order in orders[:MAX_NAMED]) or "none"
            raise ModelError(
                f"{quantity.name} is zero for every design; name an order at which it is not zero: {names}"
            )
        ratios = [ca.sqrt(force / rigid) for force, rigid in pairs]
        largest = self._constraints.named(quantity.name).head(ca.mmax(ca.vertcat(*ratios)))
        for force, rigid in pairs:
            self._constraints.add(force / rigid - largest * largest, -np.inf, 0.0, quantity.name)
        return largest

    def _limit_mounts(self, limit: Limit) -> None:
        quantity = limit.measure
        if self._modes.limit(limit):
            return
        if quantity.channel is channels.TRANSMISSIBILITY:
            maximum = limit.maximum
            for force, rigid in transmitted_squares(self._points, quantity):
                self._constraints.add(
                    ca.sqrt(force / rigid), -np.inf, maximum, limit.name, maximum=((limit, "at most"), 1.0)
                )
        else:
            unit = (limit.maximum if limit.maximum < math.inf else limit.minimum) or 1.0
            low, high = limit.minimum / unit, limit.maximum / unit
            slopes = (((limit, side), 1.0 / unit) for side in SIDES)
            self._constraints.add(self._mounting_expression(quantity) / unit, low, high, limit.name, *slopes)

    def prices(self, optimum: LocalOptimum) -> dict[Side, Price]:
        """Return shadow prices by side of a limit, from the multipliers of an optimum."""
        prices_by_side: dict[Side, float] = defaultdict(float)
        for (minimum, maximum), m in zip(self._constraints.slopes, optimum.multipliers, strict=True):
            for slope, multiplier in ((minimum, max(-m, 0.0)), (maximum, max(m, 0.0))):
                if slope is not None:
                    prices_by_side[slope[0]] += float(slope[1] * multiplier)
        first, symbols = self._throw_columns.stop, self._modes.symbols.numel()
        prices_by_side |= self._modes.prices(optimum.x[first : first + symbols], optimum.multipliers)
        return {side: Price.both(price) for side, price in prices_by_side.items()}

    def _to_variables(self, mounts: Sequence[float]) -> Array:
        # logarithms for decisions whose bounds have a large ratio
        values = np.asarray(mounts, dtype=float)
        return np.where(self._is_logarithmic, np.log(np.where(self._is_logarithmic, values, 1.0)), values)

    def decision_values(self, x: Array) -> tuple[list[float], list[complex]]:
        """Return decision values of mounts and of unbalances from the variables, shape (n,)."""
        inner = x[: self._count]
        outer = np.where(self._is_logarithmic, np.exp(np.where(self._is_logarithmic, inner, 0.0)), inner)
        mounts = [float(np.clip(v, d.lower, d.upper)) for v, d in zip(outer, self._decisions, strict=True)]
        columns = x[self._count : self._count + self.columns].copy()
        for domain in self.domains:
            columns[domain.columns] = domain.project(columns)
        return mounts, [domain.complex_value(columns) for domain in self.domains]

    def throw_deviations(self, x: Array) -> Array:
        """Return the deviations of the throws from their crank star [rad], from the variables, shape (n,)."""
        return np.asarray(x[self._throw_columns])

    def problem_at(self, x: Array) -> Problem:
        """Return the problem with the throw angles of an optimum, from its variables x, shape (n,)."""
        if self.moves is None:
            return self.problem
        problem = self.problem
        moved = self.moves.phasing.problem_of(self.moves.candidate(self.throw_deviations(x)))
        return replace(
            moved, phasing=None, tolerance=problem.tolerance, fidelity=problem.fidelity, search=problem.search
        )

    def start(self, mounts: Sequence[float], columns: Array, throw_deviations: Array | None = None) -> Array:
        """Return a start point of the program, shape (n,), from numbers of mounts, unbalances and deviations of throws.

        Start values of modes and epigraph variables follow from these.
        """
        throw_deviations = np.zeros(self._throw_deviations.numel()) if throw_deviations is None else throw_deviations
        parts: list[Array] = [self._to_variables(mounts), columns, throw_deviations]
        if self._modes.has_modes:
            parts += self._modes.start(mounting_in(self.problem.design(list(mounts), self._decisions)))
        if self._constraints.heads:
            inputs = [self._mount_variables, self._unbalance_columns, self._throw_deviations, self._simulated.symbols]
            inputs.append(self._softness)
            values = ca.Function("tops", inputs, [ca.vertcat(*(value for _, value in self._constraints.heads))])
            peaks, softness = self._simulated.peaks_at(mounts, columns), self.program.stages[0]
            outputs = values(self._to_variables(mounts), columns, throw_deviations, peaks, *softness)
            parts.append(1.05 * np.asarray(outputs, dtype=float).reshape(-1))
        return np.concatenate(parts)
