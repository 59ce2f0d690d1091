"""A cone program in arrays for Clarabel: its blocks, rows and costs, what the solver is told, and what it answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from laufruhe.load_models.affine import AffineProblem, reach
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import left
from laufruhe.problem.decision import Domain
from laufruhe.prove.certificate import Multipliers
from laufruhe.solvers.cones.rows import Block, Rows, Sparse

LEAST_SHARE = 1e-7
"""Under which a sum is no part of the largest."""
SHORTEST = 0.05
"""Seconds that one attempt has where time is over."""


@dataclass(frozen=True, eq=False)
class ConicSolution:
    """What the cone solver returned; nothing in it is believed before it is evaluated.

    Attributes
    ----------
    x
        Decision vector; None where the limits cannot be met together.
    multipliers
        Dual rows of terms and limits.
    solver_seconds
        Spent inside the cone solver.
    shares
        Of every sum of terms in the largest of them, which add up to one; empty where there is one sum.
    prices
        Duals of the program's rows in the objective's unit, those of what was held first.
    """

    x: Array | None
    multipliers: Multipliers
    solver_seconds: float
    shares: Array = field(default_factory=lambda: np.zeros(0))
    prices: Array = field(default_factory=lambda: np.zeros(0))


def program_of(
    problem: AffineProblem, held: tuple[Array, Array] | None
) -> tuple[list[Block], list[int], Rows, Array]:  # fmt: skip
    """Blocks of the norms, their first rows, all rows, and the cost of every column."""
    import clarabel

    unit = reach(problem, [norm for _, norm in problem.terms])
    blocks: list[Block] = []
    columns = problem.size
    for norm, size in [
        *((norm, unit) for _, norm in problem.terms),
        *((norm, reach(problem, [norm])) for _, norm in problem.limits),
    ]:
        blocks.append(Block(norm, norm.norm.cones(norm.grid), size, columns))
        columns = int(blocks[-1].centres.max(initial=blocks[-1].heads.stop - 1)) + 1
    rows = Rows(columns)
    if held is not None:
        matrix, right = held
        rows.add(np.arange(len(right))[:, None], np.arange(problem.size), matrix * problem.units, right)
        rows.cones.append(clarabel.ZeroConeT(len(right)))
    for domain in problem.domains:
        _add_domain(rows, domain, float(problem.units[domain.start]))
    for (maximum, _), block in zip(problem.limits, blocks[len(problem.terms) :], strict=True):
        rows.add(0, np.arange(columns)[block.heads], block.cones.value, np.array([maximum / block.unit]))
        rows.cones.append(clarabel.NonnegativeConeT(1))
    for block in blocks:
        if block.cones.under is not None:
            at, heads, factors = block.cones.under
            rows.add(at, block.first + heads, factors, np.zeros(int(at.max()) + 1))
            rows.cones.append(clarabel.NonnegativeConeT(int(at.max()) + 1))
        if block.cones.squares is not None:
            # t_a^2 <= t_b t_c as |(t_b - t_c, 2 t_a)| <= t_b + t_c
            square, left_factor, right_factor = (block.first + heads for heads in block.cones.squares)
            top = 3 * np.arange(len(square))
            rows.add(
                np.concatenate([top, top, top + 1, top + 1, top + 2]),
                np.concatenate([left_factor, right_factor, left_factor, right_factor, square]),
                np.repeat([-1.0, -1.0, -1.0, 1.0, -2.0], len(square)),
                np.zeros(3 * len(square)),
            )
            rows.cones += [clarabel.SecondOrderConeT(3)] * len(square)
    starts = [_add_norm(rows, block, problem) for block in blocks]
    return blocks, starts, rows, _cost(problem, blocks, rows)


def _cost(problem: AffineProblem, blocks: Sequence[Block], rows: Rows) -> Array:
    """Of every column; of several sums the cost is a last column that none of them exceeds."""
    import clarabel

    sums = np.zeros((max(problem.groups, default=0) + 1, rows.columns))
    for k, ((weight, _), block) in enumerate(zip(problem.terms, blocks, strict=False)):
        sums[problem.groups[k] if problem.groups else 0, block.heads] = weight * block.cones.value
    if not problem.groups:
        return np.asarray(sums[0])
    group, column = np.nonzero(sums)
    last = np.arange(len(sums))
    rows.add(
        np.concatenate([group, last]),
        np.concatenate([column, np.full(len(sums), rows.columns)]),
        np.concatenate([sums[group, column], np.full(len(sums), -1.0)]),
        np.zeros(len(sums)),
    )
    rows.cones.append(clarabel.NonnegativeConeT(len(sums)))
    rows.columns += 1
    cost = np.zeros(rows.columns)
    cost[-1] = 1.0
    return cost


def told(rows: Rows, cost: Array, wanted: Mapping[str, Any], quadratic: Array | None = None) -> Any:
    """What the solver says of a program with these settings, and a quadratic part of the cost."""
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    for name, value in wanted.items():
        setattr(settings, name, value)
    settings.time_limit = max(left(), SHORTEST)
    bent = np.zeros((0, 0)) if quadratic is None else quadratic
    at, across = np.nonzero(bent)
    squares = Sparse.of(at, across, bent[at, across], (rows.columns, rows.columns))
    right = np.concatenate(rows.right)
    return clarabel.DefaultSolver(squares, cost, rows.matrix(), right, rows.cones, settings).solve()


def answered(problem: AffineProblem, blocks: list[Block], starts: list[int], found: Any) -> ConicSolution:
    """Decisions in their sets, and dual rows; zero where the solver has lost its numbers."""
    x = projected(problem, _numbers(found.x)[: problem.size] * problem.units)
    duals = _numbers(found.z)
    unit = blocks[0].unit if problem.terms else 1.0
    rows = [_dual_rows(block, duals, start, unit) for block, start in zip(blocks, starts, strict=True)]
    shares = np.ones(1)
    if problem.groups:
        # the last rows of the program are those of the sums
        shares = np.maximum(duals[len(duals) - max(problem.groups) - 1 :], 0.0)
        shares = shares / shares.sum() if shares.any() else np.full(len(shares), 1.0 / len(shares))
        shares = np.where(shares > LEAST_SHARE, shares, 0.0)
        shares = shares / shares.sum()
    of = [float(shares[group]) for group in problem.groups] or [1.0] * len(problem.terms)
    terms = tuple(z / (weight * share or 1.0) for z, (weight, _), share in zip(rows, problem.terms, of, strict=False))
    multipliers = Multipliers(terms, tuple(rows[len(terms) :]))
    own = shares if problem.groups else np.zeros(0)
    return ConicSolution(x, multipliers, float(found.solve_time), own, unit * duals)


def _numbers(values: Sequence[float]) -> Array:
    return np.asarray(np.nan_to_num(np.asarray(values, dtype=float), posinf=0.0, neginf=0.0))


def projected(problem: AffineProblem, x: Array) -> Array:
    """Every decision in its set."""
    for domain in problem.domains:
        x[domain.columns] = domain.project(x)
    return x


def _add_domain(rows: Rows, domain: Domain, unit: float) -> None:
    """The decision's own set, in units of a size (P4)."""
    import clarabel

    upper, lower = domain.set.upper / unit, domain.set.lower / unit
    if domain.width == 1:
        rows.add([0, 1], domain.start, [1.0, -1.0], np.array([upper, -lower]))
        rows.cones.append(clarabel.NonnegativeConeT(2))
        return
    if len(domain.set.edges):
        (ax, ay), (bx, by) = domain.set.edges
        across = np.array([domain.start, domain.start + 1])
        rows.add([[0], [1]], across, [[ay, -ax], [-by, bx]], np.zeros(2))
        rows.cones.append(clarabel.NonnegativeConeT(2))
    rows.add([1, 2], [domain.start, domain.start + 1], -1.0, np.array([upper, 0.0, 0.0]))
    rows.cones.append(clarabel.SecondOrderConeT(3))


def _add_norm(rows: Rows, block: Block, problem: AffineProblem) -> int:
    """V0 + B x in a cone a row, or in one cone for a root mean square; returns the first row."""
    import clarabel

    norm, cones, start = block.norm, block.cones, rows.count
    k, d = norm.constant.shape
    slope = norm.slope * (problem.units / block.unit) * cones.factors[:, None, None]
    constant = norm.constant / block.unit * cones.factors[:, None]
    # rows of the program in the order of its cones: a head, then what is under it
    width = k * d + 1 if cones.whole else d + 1
    heads = np.arange(len(cones.head)) * width
    under = (1 + np.arange(k * d).reshape(k, d)) if cones.whole else heads[:, None] + 1 + np.arange(d)
    right = np.zeros(width * len(heads))
    right[under] = constant
    places = np.broadcast_to(under[:, :, None], slope.shape)
    across = np.broadcast_to(np.arange(problem.size), slope.shape)
    centres = block.centres.ravel()
    rows.add(
        np.concatenate([heads, places.ravel(), under.ravel()[: len(centres)]]),
        np.concatenate([block.first + cones.head, across.ravel(), centres]),
        np.concatenate([np.full(len(heads), -1.0), -slope.ravel(), np.ones(len(centres))]),
        right,
    )
    rows.cones += [clarabel.SecondOrderConeT(width)] * len(heads)
    return start


def _dual_rows(block: Block, duals: Array, start: int, objective_unit: float) -> Array:
    """mu Z of the rows [SI] (P2), in the objective's own unit."""
    k, d = block.norm.constant.shape
    if block.cones.whole:
        z = -duals[start + 1 : start + 1 + k * d].reshape(k, d)
    else:
        z = -duals[start : start + k * (d + 1)].reshape(k, d + 1)[:, 1:]
    return np.asarray(z * block.cones.factors[:, None] * (objective_unit / block.unit))
