"""Stars, shafts and unbalances in one mixed-integer second-order cone program (S16).

A throw k on step p is a binary Y[k, p]; rows are affine in Y and the unbalances, an
optional shaft's unbalance is at most its largest times a binary. SCIP solves it; its
dual bound is read even when it stops early, and its design is evaluated anew by whoever
asked for it.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.star_model import StarNorm, StarProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import left
from laufruhe.numerics.norms import Cones
from laufruhe.numerics.progress import tell
from laufruhe.physics.star_space import StarSpace
from laufruhe.problem.decision import Domain, scales_of
from laufruhe.problem.phasing import ShaftChoice

# what SCIP's own feasibility tolerance may hide of the objective
TRUST = 1e-6
NO_SHAFTS = ShaftChoice()


@dataclass(frozen=True, eq=False)
class ProgramFound:
    """What SCIP returned; the design in it has to be evaluated anew.

    Attributes
    ----------
    star
        Steps of the throws; None without a feasible point.
    built
        Sets of optional shafts that are built.
    bound
        Dual bound of the program's own rows, less what tolerances may hide.
    status
        SCIP's own word: "optimal", "timelimit", "infeasible" ...
    """

    star: tuple[int, ...] | None
    built: tuple[int, ...]
    bound: float
    status: str


def solve_program(
    problem: StarProblem,
    space: StarSpace,
    owners: Sequence[int] = (),
    shafts: ShaftChoice = NO_SHAFTS,
    time_limit: float = 600.0,
) -> ProgramFound:
    """Solve the program of every star and set of shafts at once.

    Parameters
    ----------
    problem
        Rows at few samples; where all norms are root mean squares they are exact.
    space
        Stars allowed.
    owners
        The set of shafts that each decision belongs to, -1 for none.
    shafts
        Optional ones, and the limits on their number and mass.
    time_limit
        [s].
    """
    if problem.is_bilinear:
        raise ModelError("unbalances that are counted from a throw make the program bilinear")
    steps = cp.Variable((space.throws, space.phases), boolean=True)
    scales = scales_of(problem.domains)
    size = len(scales)
    y = cp.Variable(max(size, 1))
    built = cp.Variable(max(len(shafts.optional), 1), boolean=True)
    held = [*_stars(steps, space), *_shafts(built, shafts)]
    for domain, own in zip(problem.domains, owners, strict=True):
        held += _membership(domain, y[domain.columns], domain.scale, 1.0 if own < 0 else built[own])
    if not size:
        held.append(y == 0.0)
    unit = max((_reach(norm) for _, norm in problem.terms), default=0.0) or 1.0
    objective, cones = _weighed(problem, _Rows(steps, y, scales, size), unit)
    program = cp.Problem(cp.Minimize(objective), [*held, *cones])
    return _answer(program, steps, built, unit, bool(shafts.optional), time_limit)


def _weighed(problem: StarProblem, rows: _Rows, unit: float) -> tuple[Any, list[Any]]:
    """The objective in units of `unit`, and the cones of it and of the limits."""
    terms = [(weight, *rows.value(norm, unit)) for weight, norm in problem.terms]
    held = [cones for _, _, cones in terms]
    for maximum, norm in problem.limits:
        own = _reach(norm) or 1.0
        value, cones = rows.value(norm, own)
        held += [cones, value <= maximum / own]
    return sum(weight * value for weight, value, _ in terms), held


def _answer(program: Any, steps: Any, built: Any, unit: float, choosing: bool, time_limit: float) -> ProgramFound:
    if cp.SCIP not in cp.installed_solvers():
        raise ModuleNotFoundError("SCIP is not installed", name="pyscipopt")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        seconds = min(time_limit, max(left(), 1.0))
        tell(f"mixed-integer program, for {seconds:.0f} s at most" if seconds < 1e6 else "mixed-integer program")
        try:
            program.solve(solver=cp.SCIP, scip_params={"limits/time": seconds, "limits/gap": 1e-7})
        except cp.error.SolverError:
            return ProgramFound(None, (), 0.0, "no feasible point")
    stats = program.solver_stats
    model = stats.extra_stats["model"]
    status = str(stats.extra_stats["scip_status"])
    if status == "infeasible":
        return ProgramFound(None, (), float("inf"), status)
    if steps.value is None:
        return ProgramFound(None, (), 0.0, status)
    star = tuple(int(p) for p in np.argmax(np.asarray(steps.value), axis=1))
    chosen = tuple(k for k, on in enumerate(built.value) if on > 0.5) if choosing else ()
    bound = max(0.0, (float(model.getDualbound()) - TRUST) * unit)
    return ProgramFound(star, chosen, bound, status)


class _Rows:
    """Norms of rows that are affine in steps and unbalances."""

    def __init__(self, steps: Any, y: Any, scales: Array, size: int) -> None:
        self._steps, self._y, self._scales, self._size = cp.vec(steps, order="C"), y, scales, size

    def value(self, norm: StarNorm, unit: float) -> tuple[Any, Any]:
        """The norm in units of `unit`, and the cones that hold it."""
        k, d = norm.constant.shape
        moves = norm.moves.reshape(-1, k * d).T / unit
        flat = norm.constant.reshape(-1) / unit + moves @ self._steps
        if self._size:
            flat = flat + (norm.slope * (self._scales / unit)).reshape(k * d, -1) @ self._y
        return _held_norm(norm.norm.cones(norm.grid), cp.reshape(flat, (k, d), order="C"), norm.grid.steps)


def _held_norm(cones: Cones, rows: Any, steps: int) -> tuple[Any, Any]:
    """A norm of rows (k, d), signals of `steps` rows, as a linear expression, and the cones that hold it (P1)."""
    heads = cp.Variable(len(cones.value))
    if cones.centred:
        k, d = rows.shape
        centres = cp.Variable((k // steps, d))
        rows = rows - np.kron(np.eye(k // steps), np.ones((steps, 1))) @ centres
    if cones.whole:
        return heads[0], cp.SOC(heads[0], cp.vec(cp.multiply(cones.factors[:, None], rows), order="C"))
    tops = heads if len(cones.value) == len(cones.head) else heads[cones.head]
    return cones.value @ heads, cp.SOC(tops, rows, axis=1)


def _membership(domain: Domain, y: Any, unit: float, on: Any = 1.0) -> list[Any]:
    """The decision's own set, in units of a size (P4), shrunk to nothing where `on` is zero (S10)."""
    low, high = domain.set.lower / unit, domain.set.upper / unit
    if domain.width == 1:
        return [y >= low * on, y <= high * on]
    inside: list[Any] = [cp.SOC(high * cp.Constant(1.0) * on, y)]
    if len(domain.set.edges):
        (ax, ay), (bx, by) = domain.set.edges
        inside += [ax * y[1] - ay * y[0] >= 0.0, bx * y[1] - by * y[0] <= 0.0]
    return inside


def _stars(steps: Any, space: StarSpace) -> list[Any]:
    """Every throw on one step, the steps filled as one of the patterns says; images left out (S2)."""
    patterns = np.array(space.patterns, dtype=float)
    held = [cp.sum(steps, axis=1) == 1, steps[0, 0] == 1]
    if len(patterns) == 1:
        held.append(cp.sum(steps, axis=0) == patterns[0])
    else:
        chosen = cp.Variable(len(patterns), boolean=True)
        held += [cp.sum(chosen) == 1, cp.sum(steps, axis=0) == patterns.T @ chosen]
    if space.reflect and space.throws > 1:
        # the star that turns the other way has its last throw on the other side
        held += [steps[space.throws - 1, p] == 0 for p in range(space.phases // 2 + 1, space.phases)]
    return held


def _shafts(built: Any, shafts: ShaftChoice) -> list[Any]:
    if not shafts.optional:
        return [built == 0]
    held = []
    if np.isfinite(shafts.most):
        held.append(np.array([len(names) for names in shafts.optional], dtype=float) @ built <= shafts.most)
    if np.isfinite(shafts.most_mass):
        held.append(np.array(shafts.masses) @ built <= shafts.most_mass)
    held += [sum(built[k] for k in clash) <= len(clash) - 1 for clash in shafts.clashes]
    return held


def _reach(norm: StarNorm) -> float:
    """A size of the norm that is not zero: what one throw, or one unbalance, can make of it."""
    parts = [norm.constant, *norm.moves.reshape(-1, *norm.constant.shape)]
    parts += [norm.slope[..., j] for j in range(norm.slope.shape[-1])]
    return max(norm.norm.value(norm.grid, rows) for rows in parts)
