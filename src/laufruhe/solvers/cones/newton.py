"""Newton's method for sums of smooth norms, within the sets of the decisions and limits (P10).

It starts from least squares. Terms and limits of few rows, such as masses, are cones of each step, and so are the rows
near a limited peak; other limits are linear there. The lower bound of its own dual rows proves the optimum; without
that proof a cone program of all rows follows. If the loads of an optimum are not unique, that program chooses them too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import AffineNorm, AffineProblem, typical_size
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import MEAN, NORMS, Grid
from laufruhe.prove.certificate import ROUNDING, Multipliers, flatten_interior, lower_bound, minorant
from laufruhe.solvers.cones.cone_program import (
    TIGHT,
    build_program,
    project_on_sets,
    read_solution,
    restrict_rows,
    rows_near,
    run_clarabel,
)

MAX_STEPS = 15
"""Largest number of Newton steps."""
SHARES = (1.0, 0.5, 0.25, 0.1, 0.03)
"""Shares of a step that are tried until the objective falls."""
TARGET, PROVEN = 1e-9, 1e-8
"""Relative gap at which the steps end, and largest gap of an optimum that needs no cone program."""
FEW_ROWS = 64
"""Largest number of rows of a term or limit that is a cone of each step as a whole."""
NEAR_LIMIT = 0.9
"""Share of a limit on a peak from which rows are cones of a step."""
EXCESS = 1e-8
"""Largest relative excess over a limit that is a rounding error of the solver."""
DAMPING = 1e-10
"""Relative increase of the diagonal of a curvature; x stays in directions that do not change the objective."""
MOVING, CURVED = 1e-14, 1e-7
"""Relative curvature of least squares from which a direction changes loads, and smallest curvature of the objective in
such directions, relative to that of least squares."""
SAME = 1e-10
"""Relative rise of the objective that counts as none, because the solver ends steps with cones."""
SMALL = 1e-6
"""Objective relative to a typical load from which loads do not cancel."""
WORTHWHILE = 0.1
"""Largest ratio of gaps before and after a step that does not lower the objective."""

Step = tuple[Array, Multipliers]
"""Decision vector, shape (n,), and dual rows there."""


def newton_solution(problem: AffineProblem) -> Step | None:
    """Return the optimum and its dual rows if their lower bound proves it to the last digits, else None."""
    program = NewtonProgram.of(problem)
    if program is None:
        return None
    typical = typical_size(problem, [norm for _, norm in problem.terms])
    x = project_on_sets(problem, problem.start.copy())
    # of loads that cancel, the first least squares leave rounding errors
    for _ in range(2):
        gradient, squares = program.least_squares(x)
        first = program.minimise(gradient, squares, x)
        if first is None:
            return None
        x = first[0]
        if problem.objective(x) > SMALL * typical:
            break
    if problem.objective(x) <= ROUNDING * typical:
        return x, program.multipliers(x, program.no_cones)
    directions = program.directions(squares)
    step = None if directions is None else program.steps(x, directions)
    if step is None:
        return None
    x, multipliers = step
    value, bound = problem.objective(x), lower_bound(problem, multipliers)
    if value - bound.value > PROVEN * value:
        bound = lower_bound(problem, flatten_interior(problem, x, bound))
    is_proven = value - bound.value <= PROVEN * value and problem.violation(x) <= EXCESS
    return (x, bound.multipliers) if is_proven else None


@dataclass(frozen=True, eq=False)
class NewtonProgram:
    """Smooth terms of a problem, and its other terms and limits, which are cones.

    Attributes
    ----------
    smooth
        Indices of the smooth terms.
    cones
        Problem of the other terms and all limits.
    """

    problem: AffineProblem
    smooth: tuple[int, ...]
    cones: AffineProblem

    @classmethod
    def of(cls, problem: AffineProblem) -> NewtonProgram | None:
        """Return the parts of a problem; None if a term of many rows is not smooth, or all have few rows."""
        smooth = tuple(k for k, (_, norm) in enumerate(problem.terms) if len(norm.grid.weights) > FEW_ROWS)
        if problem.groups or not smooth or not all(_is_curved(problem.terms[k][1]) for k in smooth):
            return None
        others = tuple(term for k, term in enumerate(problem.terms) if k not in smooth)
        return cls(problem, smooth, replace(problem, terms=others))

    @property
    def terms(self) -> list[tuple[float, AffineNorm]]:
        """Smooth terms with their weights."""
        return [self.problem.terms[k] for k in self.smooth]

    def steps(self, x: Array, directions: Array) -> Step | None:
        """Return the end of Newton steps from x, shape (n,), and dual rows there; None if no step lowers the objective.

        Parameters
        ----------
        directions
            Directions in which the smooth terms have to be curved, shape (n, m); without curvature the result is None.
        """
        problem, end, last = self.problem, None, math.inf
        cones = self.no_cones
        for _ in range(MAX_STEPS):
            gradient, curvature = self.derivatives(x)
            if _smallest(directions.T @ curvature @ directions) <= CURVED:
                return None
            prices = cones.shadow_prices(problem)
            for price, (_, norm) in zip(prices, problem.limits, strict=True):
                if price > 0.0 and len(norm.grid.weights) > FEW_ROWS and norm.norm.is_smooth:
                    curvature += price * _derivatives(norm, x)[1]
            step = self.minimise(gradient, curvature, x)
            if step is None:
                break
            value, (target, cones) = problem.objective(x), step
            improvement = self._improvement(gradient, x, cones)
            if improvement <= TARGET * value:
                return x, self.multipliers(x, cones)
            if improvement >= last:
                break
            penalties = [2.0 * price for price in cones.shadow_prices(problem)]
            merit = self._merit(x, penalties)
            candidates = (
                (y, merit - self._merit(y, penalties)) for y in (x + share * (target - x) for share in SHARES)
            )
            y, fall = next(((y, fall) for y, fall in candidates if fall >= -SAME * merit), (x, -math.inf))
            if fall == -math.inf:
                break
            # without a fall of the objective, dual rows have to improve
            last = WORTHWHILE * improvement if fall <= ROUNDING * value else math.inf
            x, end = y, (y, cones)
        return None if end is None else (end[0], self.multipliers(*end))

    @property
    def no_cones(self) -> Multipliers:
        """Dual rows of zero of the cones."""
        terms, limits = (
            tuple(np.zeros_like(norm.constant) for _, norm in part) for part in (self.cones.terms, self.cones.limits)
        )
        return Multipliers(terms, limits)

    def multipliers(self, x: Array, cones: Multipliers) -> Multipliers:
        """Return the subgradients of the smooth terms at x, shape (n,), with the dual rows of the cones."""
        others = iter(cones.terms)
        terms = tuple(
            norm.subgradient(x) if k in self.smooth else next(others) for k, (_, norm) in enumerate(self.problem.terms)
        )
        return Multipliers(terms, cones.limits)

    def _merit(self, x: Array, penalties: Sequence[float]) -> float:
        excesses = (max(norm.value(x) - maximum, 0.0) for maximum, norm in self.problem.limits)
        return self.problem.objective(x) + sum(p * excess for p, excess in zip(penalties, excesses, strict=True))

    def _improvement(self, gradient: Array, x: Array, cones: Multipliers) -> float:
        # upper bound of the fall of the objective from x, by its gradient and dual rows
        affine = minorant(self.cones, cones)
        minimum = sum(domain.minimum(gradient + affine.gradient) for domain in self.problem.domains)
        return float(self.cones.objective(x) + gradient @ x - affine.constant - minimum)

    def derivatives(self, x: Array) -> tuple[Array, Array]:
        """Return gradient and curvature of the smooth terms at x, shapes (n,) and (n, n) (P10)."""
        gradient, curvature = np.zeros(len(x)), np.zeros((len(x), len(x)))
        for weight, norm in self.terms:
            first, second = _derivatives(norm, x)
            gradient += weight * first
            curvature += weight * second
        return gradient, curvature

    def least_squares(self, x: Array) -> tuple[Array, Array]:
        """Return gradient and curvature of mean squares of the smooth terms, each relative to its root at x."""
        gradient, curvature = np.zeros(len(x)), np.zeros((len(x), len(x)))
        for weight, norm in self.terms:
            rows = norm.rows(x)
            size = NORMS["rms"].value(norm.grid, rows) or 1.0
            weights = weight / size * norm.grid.weights
            gradient += norm.pullback(weights[:, None] * rows)
            curvature += _curvature(norm, weights, rows)
        return gradient, curvature

    def directions(self, squares: Array) -> Array | None:
        """Return the directions in which loads change, orthonormal in least squares `squares`, shape (n, r).

        The result is None if a direction changes limits or cones alone, because its choice needs another rule.
        """
        limits = [norm for _, norm in self.cones.limits if len(norm.grid.weights) > FEW_ROWS]
        moved = squares + sum(_curvature(norm, norm.grid.weights) for norm in limits)
        (values, vectors), (all_values, _) = _moving(squares), _moving(moved)
        if len(all_values) > len(values) or (self.cones.terms and len(values) < len(squares)):
            return None
        return vectors / np.sqrt(values)

    def minimise(self, gradient: Array, curvature: Array, x: Array) -> Step | None:
        """Minimise gradient . (y - x) + (y - x)' curvature (y - x) / 2 and the cones over designs y in sets and limits.

        Parameters
        ----------
        gradient, curvature, x
            Shapes (n,), (n, n) and (n,).

        Returns
        -------
        y, shape (n,), and the dual rows of the cones; None if Clarabel does not confirm a solution.
        """
        problem, n = self.problem, len(x)
        if not self.cones.terms:
            sizes = np.sqrt(np.maximum(np.diag(curvature), 0.0))
            units = 1.0 / np.where(sizes > 0.0, sizes, 1.0)
            matrix = curvature * np.outer(units, units) + DAMPING * np.eye(n)
            y = x - units * np.linalg.solve(matrix, gradient * units)
            if np.array_equal(project_on_sets(problem, y.copy()), y) and problem.violation(y) <= 0.0:
                return y, self.no_cones
        parts = [part for maximum, norm in problem.limits if (part := _LimitPart.of(maximum, norm, x)) is not None]
        if len(parts) < len(problem.limits):
            return None
        limits = tuple((maximum, part.norm) for (maximum, _), part in zip(problem.limits, parts, strict=True))
        problem = replace(self.cones, limits=limits)
        blocks, starts, rows, cost = build_program(problem, None)
        units = problem.units
        size = max(float(np.abs(gradient * units).max(initial=0.0)), self.problem.objective(x)) or 1.0
        scale = (blocks[0].unit if problem.terms else 1.0) / size
        scaled = curvature * np.outer(units, units) / size
        scaled += DAMPING * np.diag(np.diag(scaled))
        quadratic = np.zeros((rows.columns, rows.columns))
        quadratic[:n, :n] = np.triu(scaled)
        cost *= scale
        cost[:n] += gradient * units / size - scaled @ (x / units)
        raws = (run_clarabel(rows, cost, options, quadratic) for options in (TIGHT, {}))
        raw = next((raw for raw in raws if str(raw.status) == "Solved"), None)
        if raw is None:
            return None
        solution = read_solution(problem, blocks, starts, raw)
        assert solution.x is not None
        duals = solution.multipliers
        rows_of_limits = (part.spread(z / scale) for part, z in zip(parts, duals.limits, strict=True))
        return solution.x, Multipliers(tuple(z / scale for z in duals.terms), tuple(rows_of_limits))


@dataclass(frozen=True, eq=False)
class _LimitPart:
    """Limit as a cone of a step, and its dual rows from those of the cone."""

    norm: AffineNorm
    spread: Callable[[Array], Array]

    @classmethod
    def of(cls, maximum: float, norm: AffineNorm, x: Array) -> _LimitPart | None:
        """Return the cone of a limit near x, shape (n,); None if its norm has none."""
        if len(norm.grid.weights) <= FEW_ROWS:
            return cls(norm, lambda z: z)
        if norm.norm.is_largest:
            rows = np.union1d(0, rows_near(maximum, norm, x, NEAR_LIMIT))

            def spread(z: Array) -> Array:
                placed = np.zeros_like(norm.constant)
                placed[rows] = z
                return placed

            return cls(restrict_rows(norm, rows), spread)
        if not norm.norm.is_smooth:
            return None
        subgradient = norm.subgradient(x)
        slope = norm.pullback(subgradient)
        tangent = np.array([[norm.value(x) - slope @ x]])
        grid = Grid(np.ones(1), 1)
        return cls(AffineNorm(MEAN, tangent, slope[None, None], grid), lambda z: float(z[0, 0]) * subgradient)


def _derivatives(norm: AffineNorm, x: Array) -> tuple[Array, Array]:
    rows = norm.rows(x)
    across, along, outward = norm.norm.second_derivative(norm.grid, rows)
    gradient = norm.pullback(norm.norm.subgradient(norm.grid, rows))
    return gradient, _curvature(norm, across, rows, along) - outward * np.outer(gradient, gradient)


def _is_curved(norm: AffineNorm) -> bool:
    # a sum of absolute values is linear between its kinks
    return norm.norm.is_smooth and not (norm.norm.sums_lengths and norm.constant.shape[1] == 1)


def _smallest(matrix: Array) -> float:
    return float(np.linalg.eigvalsh(matrix).min(initial=1.0))


def _moving(squares: Array) -> tuple[Array, Array]:
    # curvatures of least squares that count, and their directions, shapes (r,) and (n, r)
    sizes = np.sqrt(np.diag(squares))
    units = 1.0 / np.where(sizes > 0.0, sizes, 1.0)
    values, vectors = np.linalg.eigh(squares * np.outer(units, units))
    is_moving = values > MOVING * values[-1]
    return values[is_moving], units[:, None] * vectors[:, is_moving]


def _curvature(norm: AffineNorm, across: Array, rows: Array | None = None, along: Array | None = None) -> Array:
    """Return sum_k a_k B_k' B_k + b_k (B_k' v_k) (B_k' v_k)', shape (n, n), with a `across` and b `along` rows v_k."""
    slope, basis = norm.free_slope
    total, radial = np.zeros((len(basis), len(basis))), np.zeros((len(slope), len(basis)))
    for component in range(slope.shape[1]):
        part = slope[:, component]
        total += part.T @ (across[:, None] * part)
        if rows is not None:
            radial += rows[:, component, None] * part
    if along is not None:
        total += radial.T @ (along[:, None] * radial)
    return np.asarray(basis.T @ total @ basis)
