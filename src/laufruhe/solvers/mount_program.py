"""Mounts and unbalances together as one smooth program (E20-E24).

Variables are the open numbers of the mounts, the columns of the unbalances, and where
modes are asked for the modes themselves, held to be modes by

    V' V = 1,    V' A V = diag(l)                                                       (E21)

so that a natural frequency or a share of energy is an explicit, smooth expression. A
largest value is a variable that no sample exceeds (E22); a mean of lengths is softened
(N3); a band without natural frequencies is (l - a)(l - b) >= 0 (E23).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from laufruhe.errors import ModelError
from laufruhe.load_models.affine import AffineModel
from laufruhe.load_models.mount_loads import FixedThrows, Loads, MovedThrows
from laufruhe.load_models.mount_rows import PointResponse, sampled_rows
from laufruhe.load_models.mount_symbols import elimination, response, symbolic_mounts
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.load_models.uneven_model import UnevenModel
from laufruhe.numerics.mixed_norms import Norm
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.modes import weight_wrench
from laufruhe.physics.rigid_body import moved_wrench
from laufruhe.problem.measure import ON_MOUNTS, Quantity
from laufruhe.problem.mount_design import (
    MountLimit,
    MountMeasure,
    MountQuantity,
    mounting_in,
    torque_roll_rows,
)
from laufruhe.problem.mount_resonance import objective_size, off_resonance
from laufruhe.problem.problem import Problem
from laufruhe.solvers.gathered import Gathered
from laufruhe.solvers.nonlinear import NonlinearProgram, softened_lengths
from laufruhe.solvers.uneven_program import rides_of

Array = NDArray[np.float64]

SOFTNESS = (1e-2, 1e-4, 1e-7)
# bounds of a stiffness that are further apart leave a start no place between them
WIDE = 100.0
# orders that a complaint names
MOST_NAMED = 6
# a typical deviation of a throw [rad]
TURN = 0.1


class JointProgram:
    """The program of a problem, and the way between its variables and the problem's decisions.

    Parameters
    ----------
    problem
        On elastic mounts.
    margin
        Share by which limits on largest values are tightened, for they are kept at samples.
    moves
        Throws that may leave the star of the problem; none when left out.
    """

    def __init__(self, problem: Problem, margin: float = 0.0, moves: ThrowMoves | None = None) -> None:
        self.problem, self._margin, self.moves = problem, margin, moves
        # loads and unbalances alone are taken from it, whatever the mounts
        self.model = AffineModel(off_resonance(problem))
        self._mounting = mounting_in(problem.engine)
        design = problem.mount_design
        self._count = len(design.decisions)
        self.columns = sum(domain.width for domain in self.model.domains)
        self._by_ratio = np.array([d.is_stiffness and d.upper > WIDE * d.lower > 0.0 for d in design.decisions], bool)
        self._v, self._u = ca.MX.sym("mounts", self._count), ca.MX.sym("unbalances", self.columns)
        numbers = [ca.exp(self._v[k]) if wide else self._v[k] for k, wide in enumerate(self._by_ratio)]
        self._d = ca.vertcat(*numbers) if numbers else self._v
        self._t = ca.MX.sym("throws", 0 if moves is None else moves.size)
        self._loads = self._loads_of(moves)
        self._e = ca.MX.sym("softness")
        self._along, self._root = torque_roll_rows(self._mounting)
        self._mounts = symbolic_mounts(design, self._mounting.block, self._d)
        self._points = self._responses()
        self._held = Gathered()
        self._tops: list[tuple[Any, Any]] = []
        self._modal = any(
            limit.quantity.measure in (MountMeasure.FREQUENCIES, MountMeasure.DECOUPLING) for limit in design.limits
        )
        self._vectors, self._squares = ca.MX.sym("V", 36 * self._modal), ca.MX.sym("l", 6 * self._modal)
        self._square_unit = float(np.trace(self._root @ self._mounting.stiffness @ self._root.T)) / 6.0
        self._unit = objective_size(problem)
        self.program = self._built()

    def _loads_of(self, moves: ThrowMoves | None) -> Loads:
        fixed = FixedThrows(self.problem, self.model, self._u)
        if moves is None:
            return fixed
        model = UnevenModel(self.problem, moves.layout, rides_of(moves.phasing, moves.start))
        return MovedThrows(self.problem, fixed, moves, model, self._t, self._u)

    def _built(self) -> NonlinearProgram:
        problem, design = self.problem, self.problem.mount_design
        least = sum((term.weight * self._load(term.quantity) for term in problem.objective), ca.MX(0.0))
        least += sum((weight * self._measure(quantity) for quantity, weight in design.terms), ca.MX(0.0))
        for limit in problem.limits:
            tight = 1.0 - self._margin * (limit.quantity.norm is Norm.MAXIMUM)
            self._limit_load(limit.quantity, limit.maximum * tight, limit.name)
        if self._modal:
            self._hold_modes()
        for mount_limit in design.limits:
            self._limit_mounts(mount_limit)
        self._hold_unbalances()
        if self.moves is not None:
            rows, names = self.moves.firing(self._t)
            for row, name in zip(rows, names, strict=True):
                self._held.add(row, self.moves.intervals.least, self.moves.intervals.most, name)
        tops = ca.vertcat(*(top for top, _ in self._tops)) if self._tops else ca.MX(0, 1)
        lower, upper = self._bounds()
        constraints = ca.vertcat(*self._held.expressions) if self._held.expressions else None
        return NonlinearProgram(
            ca.vertcat(self._v, self._u, self._t, self._vectors, self._squares, tops),
            least,
            lower,
            upper,
            names=tuple(decision.name for decision in design.decisions),
            constraints=constraints,
            constraint_lower=np.array(self._held.lower),
            constraint_upper=np.array(self._held.upper),
            constraint_names=tuple(self._held.names),
            scales=self._scales(lower, upper),
            objective_scale=self._unit,
            parameters=self._e,
            stages=tuple((share,) for share in SOFTNESS),
            expand=True,
        )

    def _bounds(self) -> tuple[Array, Array]:
        decisions, domains = self.problem.mount_design.decisions, self.model.domains
        low = self._inner([d.lower for d in decisions]).tolist()
        high = self._inner([d.upper for d in decisions]).tolist()
        for domain in domains:
            most = domain.decision.upper
            low += [domain.decision.lower] if domain.width == 1 else [-most, -most]
            high += [most] * domain.width
        if self.moves is not None:
            low += self.moves.lower.tolist()
            high += self.moves.upper.tolist()
        modes = 42 * self._modal
        free = np.full(modes + len(self._tops), np.inf)
        below = -free
        below[modes:] = 0.0
        return np.concatenate([low, below]), np.concatenate([high, free])

    def _scales(self, lower: Array, upper: Array) -> Array:
        width = upper - lower
        scales = np.where(np.isfinite(width) & (width > 0.0), width, 1.0)
        scales[self._turned] = TURN
        return scales

    @property
    def _turned(self) -> slice:
        first = self._count + self.columns
        return slice(first, first + self._t.numel())

    # loads

    def _responses(self) -> list[PointResponse]:
        """Response to the orders that matter (E4)."""
        moved = self._root @ moved_wrench(NUMBERS, self._mounting.block.centre_of_gravity)
        return [
            PointResponse(point.name, point.weight, w.period, w.orders,
                   response(self._mounts, w.orders * point.speed, w.real, w.imaginary))
            for point, w in zip(self.problem.points, self._loads.wrenches(moved), strict=True)
        ]  # fmt: skip

    def _vectors_of(self, quantity: Quantity) -> tuple[Any, Array, Norm]:
        if quantity.subject in ON_MOUNTS:
            names = [mount.name for mount in self.problem.engine.mounts]
            return *sampled_rows(self._points, names, quantity), quantity.norm
        return *self._loads.rows(quantity), quantity.norm

    def _load(self, quantity: Quantity) -> Any:
        """A load quantity to be minimised, softened by a share of the objective (N3)."""
        rows, weights, norm = self._vectors_of(quantity)
        softness = self._e * self._unit
        if norm is Norm.SUM:
            return ca.dot(ca.DM(weights), softened_lengths(rows, softness))
        if norm is Norm.RMS:
            return ca.sqrt(ca.dot(ca.DM(weights), ca.sum2(rows * rows)) + softness**2) - softness
        top = self._top(ca.mmax(ca.sqrt(ca.sum2(rows * rows))) / self._unit)
        self._held.add(softened_lengths(rows / self._unit, self._e) - top, -np.inf, 0.0, quantity.name)
        return top * self._unit

    def _top(self, value: Any) -> Any:
        """A variable for a largest value (E22), and what it is at a given point."""
        top = ca.MX.sym(f"top{len(self._tops)}")
        self._tops.append((top, value))
        return top

    def _limit_load(self, quantity: Quantity, maximum: float, name: str) -> None:
        rows, weights, norm = self._vectors_of(quantity)
        unit = maximum or self._unit
        soft, most, slope = SOFTNESS[-1], maximum / unit, 1.0 / unit
        if norm is Norm.SUM:
            value = ca.dot(ca.DM(weights), softened_lengths(rows / unit, soft))
        elif norm is Norm.RMS:
            value = ca.sqrt(ca.dot(ca.DM(weights), ca.sum2(rows * rows)) / unit**2 + soft**2)
        else:
            value = ca.sum2(rows * rows) / unit**2
            most, slope = most * most, 2.0 * most / unit
        self._held.add(value, -np.inf, most, name, slope)

    def _hold_unbalances(self) -> None:
        """Discs and sectors of the unbalances (P4)."""
        for domain in self.model.domains:
            if domain.width == 1:
                continue
            own = self._u[domain.columns]
            self._held.add(ca.sumsqr(own) / domain.scale**2, -np.inf, 1.0, domain.decision.name)
            for sign, (x, y) in zip((1.0, -1.0), domain.edges, strict=False):
                self._held.add(sign * (x * own[1] - y * own[0]) / domain.scale, 0.0, np.inf, domain.decision.name)

    # mounts and modes

    def _measure(self, quantity: MountQuantity) -> Any:
        """A quantity of mounts and modes, where it is one expression."""
        mounts = self._mounts
        if quantity.measure is MountMeasure.SAG:
            weight = weight_wrench(self._mounting.block)
            load = ca.DM(self._root @ weight)
            settled, _ = elimination()(mounts.stiffness, ca.MX(6, 6), load, ca.DM.zeros(6))
            return ca.dot(load, settled) / -weight[2]
        if quantity.measure is MountMeasure.TORQUE_ROLL:
            square = (math.tau * quantity.frequency) ** 2
            rows = mounts.stiffness @ ca.DM(self._along) / square - ca.DM(self._along)
            return softened_lengths(rows.T, self._e)
        if quantity.measure is MountMeasure.TOTAL_STIFFNESS:
            numbers = self.problem.mount_design.numbers_at([self._d[k] for k in range(self._count)])
            return sum((k for row in numbers for k in row[:3]), ca.MX(0.0))
        pairs = self._transmitted(quantity)
        if not pairs:
            felt = sorted({float(order) for point in self._points for order in point.orders if order > 0.0})
            there = ", ".join(f"{order:g}" for order in felt[:MOST_NAMED]) or "none"
            raise ModelError(f"nothing is to be felt of {quantity.name}; name an order that is there: {there}")
        ratios = [ca.sqrt(force / firm) for force, firm in pairs]
        top = self._top(ca.mmax(ca.vertcat(*ratios)))
        for force, firm in pairs:
            self._held.add(force / firm - top * top, -np.inf, 0.0, quantity.name)
        return top

    def _transmitted(self, quantity: MountQuantity) -> list[tuple[Any, Any]]:
        """Squares of forces on elastic and on firm mounts, per point and order (E11)."""
        pairs = []
        for point in self._points:
            if quantity.points is not None and point.name not in quantity.points:
                continue
            groups = (
                [[k for k, order in enumerate(point.orders) if order > 0.0]]
                if quantity.orders is None
                else [[k for k, order in enumerate(point.orders) if abs(order - o) < 5e-4] for o in quantity.orders]
            )
            for group in groups:
                if group:
                    force, firm = point.response.force, point.response.firm
                    over, under = (sum(ca.sumsqr(part[:, group]) for part in parts) for parts in (force, firm))
                    pairs.append((over, under))
        return pairs

    def _hold_modes(self) -> None:
        """The modes are modes (E21)."""
        v = ca.reshape(self._vectors, 6, 6)
        unit = v.T @ v - ca.DM.eye(6)
        apart = v.T @ (self._mounts.stiffness / self._square_unit) @ v - ca.diag(self._squares)
        lower = [(j, k) for j in range(6) for k in range(j + 1)]
        for matrix in (unit, apart):
            self._held.add(ca.vertcat(*(matrix[j, k] for j, k in lower)), 0.0, 0.0, "modes")

    def _limit_mounts(self, limit: MountLimit) -> None:
        quantity = limit.quantity
        if quantity.measure is MountMeasure.FREQUENCIES:
            self._limit_frequencies(limit)
        elif quantity.measure is MountMeasure.DECOUPLING:
            # share of motion j in column j: the columns are set to their motions at the start (E24)
            v = ca.reshape(self._vectors, 6, 6)
            shapes, momenta = ca.DM(self._root.T) @ v, ca.DM(np.linalg.inv(self._root)) @ v
            for j in quantity.motion_indices:
                self._held.add(shapes[j, j] * momenta[j, j], limit.minimum or 0.0, np.inf, limit.name, 1.0)
        elif quantity.measure is MountMeasure.TRANSMISSIBILITY:
            most = limit.maximum or 0.0
            for force, firm in self._transmitted(quantity):
                self._held.add(ca.sqrt(force / firm), -np.inf, most, limit.name, 1.0)
        else:
            unit = limit.maximum or limit.minimum or 1.0
            low = -np.inf if limit.minimum is None else limit.minimum / unit
            high = np.inf if limit.maximum is None else limit.maximum / unit
            self._held.add(self._measure(quantity) / unit, low, high, limit.name, 1.0 / unit)

    def _limit_frequencies(self, limit: MountLimit) -> None:
        def scaled(frequency: float) -> float:
            return (math.tau * frequency) ** 2 / self._square_unit

        low = -np.inf if limit.minimum is None else scaled(limit.minimum)
        high = np.inf if limit.maximum is None else scaled(limit.maximum)
        if limit.minimum is not None or limit.maximum is not None:
            unit = high if np.isfinite(high) else low
            side = limit.minimum if limit.maximum is None else limit.maximum
            slope = 2.0 * math.tau**2 * (side or 0.0) / (self._square_unit * unit)
            self._held.add(self._squares / unit, low / unit, high / unit, limit.name, slope)
        if limit.outside is not None:
            a, b = (scaled(edge) for edge in limit.outside)
            self._held.add((self._squares - a) * (self._squares - b) / (b * b), 0.0, np.inf, limit.name)

    # between variables and decisions

    def price(self, name: str, multipliers: Array) -> float:
        """Fall of the objective per unit by which a limit is relaxed; 0 for a band of frequencies."""
        pairs = zip(self._held.names, self._held.slopes, multipliers, strict=True)
        return abs(float(sum(slope * m for other, slope, m in pairs if other == name)))

    def _inner(self, mounts: Sequence[float]) -> Array:
        """Decisions about mounts as the program has them: by ratio where bounds lie far apart."""
        values = np.asarray(mounts, dtype=float)
        return np.where(self._by_ratio, np.log(np.where(self._by_ratio, values, 1.0)), values)

    def split(self, x: Array) -> tuple[list[float], list[complex]]:
        """Decisions about mounts and about unbalances."""
        design = self.problem.mount_design
        inner = x[: self._count]
        outer = np.where(self._by_ratio, np.exp(np.where(self._by_ratio, inner, 0.0)), inner)
        mounts = [float(np.clip(v, d.lower, d.upper)) for v, d in zip(outer, design.decisions, strict=True)]
        columns = x[self._count : self._count + self.columns].copy()
        for domain in self.model.domains:
            columns[domain.columns] = domain.project(columns)
        return mounts, [domain.complex_value(columns) for domain in self.model.domains]

    def turns(self, x: Array) -> Array:
        """Deviations of the throws from their star [rad]."""
        return np.asarray(x[self._turned])

    def designed(self, x: Array) -> Problem:
        """The problem with its throws where they were moved to."""
        if self.moves is None:
            return self.problem
        given = self.problem
        own = self.moves.phasing.realise(self.moves.candidate(self.turns(x)))
        return replace(
            own, phasing=None, tolerance=given.tolerance, fidelity=given.fidelity, mount_design=given.mount_design
        )

    def start(self, mounts: Sequence[float], columns: Array, turns: Array | None = None) -> Array:
        """Variables at given decisions: modes and largest values follow from them."""
        turns = np.zeros(self._t.numel()) if turns is None else turns
        parts = [self._inner(mounts), columns, turns]
        if self._modal:
            parts += self._modes_at(mounts)
        if self._tops:
            given = [self._v, self._u, self._t]
            values = ca.Function("tops", given, [ca.vertcat(*(value for _, value in self._tops))])
            parts.append(1.05 * np.asarray(values(self._inner(mounts), columns, turns), dtype=float).reshape(-1))
        return np.concatenate(parts)

    def _modes_at(self, mounts: Sequence[float]) -> list[Array]:
        """Modes, each in the column of the motion that is most its own."""
        engine = self.problem.mount_design.applied(self.problem.engine, list(mounts))
        modes = mounting_in(engine).modes
        motions, columns = linear_sum_assignment(-modes.energy)
        order = columns[np.argsort(motions)]
        vectors = np.linalg.solve(self._root.T, modes.shapes)[:, order]
        return [vectors.T.reshape(-1), modes.squares[order] / self._square_unit]
