"""Smooth nonlinear programs with exact derivatives: CasADi and IPOPT from many starts (N1-N4).

What is solved, in units that make every variable and function of size one:

    least f(x, p)  with  l <= x <= u,  gl <= g(x, p) <= gu                              (N1)

IPOPT proposes points and multipliers. They are judged here, by derivatives taken anew:
with multipliers m of g and b of the bounds, positive where an upper side holds,

    grad f + J' m + b = 0,   m and b zero where no side is reached                       (N2)

and the largest violation of these and of the limits, each over its own scale, is the
KKT residual of a `LocalOptimum`. A length |v| has no gradient at v = 0, where a balanced
engine lies, so it is replaced by

    |v|_e = sqrt(|v|^2 + e^2) - e,    |v| - e <= |v|_e <= |v|                             (N3)

with e a parameter p that falls from stage to stage (N4), each stage started at the
optimum of the one before: smooth, convex where |v| is, exactly zero at zero, and never more
than the last e from the truth.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.budget import in_time, left, passed
from laufruhe.numerics.progress import telling
from laufruhe.numerics.workers import WORTH_PROCESSES, count_of, each, executor_for

Array = NDArray[np.float64]

_NEAR = 1e-6
WORTH_EXPANDING = 3
# seconds that a start has where time is over
SHORTEST = 0.5
_QUIET = {"print_time": False, "show_eval_warnings": False, "error_on_fail": False, "calc_lam_p": False}
_OPTIONS = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-10,
    "acceptable_tol": 1e-7,
    "mu_strategy": "adaptive",
    "bound_relax_factor": 1e-10,
}


class Ending(StrEnum):
    """How one start of a nonlinear program ended."""

    CONVERGED = "converged"
    ACCEPTABLE = "converged to a looser tolerance"
    INFEASIBLE = "no point near meets the limits"
    UNFINISHED = "stopped at the limit of iterations or time"
    FAILED = "a function could not be evaluated"


_ENDINGS = {
    "Solve_Succeeded": Ending.CONVERGED,
    "Feasible_Point_Found": Ending.CONVERGED,
    "Solved_To_Acceptable_Level": Ending.ACCEPTABLE,
    "Search_Direction_Becomes_Too_Small": Ending.ACCEPTABLE,
    "Infeasible_Problem_Detected": Ending.INFEASIBLE,
    "Restoration_Failed": Ending.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Ending.UNFINISHED,
    "Maximum_CpuTime_Exceeded": Ending.UNFINISHED,
    "Maximum_WallTime_Exceeded": Ending.UNFINISHED,
}


@dataclass(frozen=True, eq=False)
class NonlinearProgram:
    """A smooth program in CasADi symbols (N1).

    Attributes
    ----------
    x
        Column of variables, SX or MX, shape (n,).
    objective
        Scalar expression.
    lower, upper
        Bounds of the variables, shape (n,).
    names
        Of the variables.
    constraints
        Column of expressions, shape (m,).
    constraint_lower, constraint_upper
        Sides of the constraints, shape (m,); infinite where there is none.
    constraint_names
        As a report prints them.
    scales
        Typical sizes of the variables; the width of their bounds when left out.
    objective_scale, constraint_scales
        Typical sizes of objective and constraints.
    parameters, stages
        Symbols and their values, one row a stage (N4).
    expand
        Whether the expressions may be written out as scalars where several starts share
        the cost: three times as fast to evaluate, and slower to set up.
    """

    x: Any
    objective: Any
    lower: Array
    upper: Array
    names: tuple[str, ...] = ()
    constraints: Any = None
    constraint_lower: Array = field(default_factory=lambda: np.zeros(0))
    constraint_upper: Array = field(default_factory=lambda: np.zeros(0))
    constraint_names: tuple[str, ...] = ()
    scales: Array | None = None
    objective_scale: float = 1.0
    constraint_scales: Array | None = None
    parameters: Any = None
    stages: tuple[tuple[float, ...], ...] = ((),)
    expand: bool = False

    def __post_init__(self) -> None:
        n, m = self.x.numel(), 0 if self.constraints is None else self.constraints.numel()
        if len(self.lower) != n or len(self.upper) != n:
            raise ValueError(f"{n} variables need as many bounds")
        if len(self.constraint_lower) != m or len(self.constraint_upper) != m:
            raise ValueError(f"{m} constraints need as many sides")
        if np.any(self.lower > self.upper) or np.any(self.constraint_lower > self.constraint_upper):
            raise ValueError("a lower side lies above its upper one")

    @property
    def variable_scales(self) -> Array:
        """Typical sizes of the variables, none of them zero."""
        if self.scales is not None:
            return self.scales
        width = self.upper - self.lower
        return np.where(np.isfinite(width) & (width > 0.0), width, 1.0)


@dataclass(frozen=True, eq=False)
class LocalOptimum:
    """Where one start ended.

    Attributes
    ----------
    x
        Shape (n,), within the bounds.
    value
        Objective at the last stage's parameters.
    constraints
        Values, shape (m,).
    multipliers
        In the program's own units, positive where an upper side holds (N2).
    kkt_residual
        Largest violation of N2 and of the limits, each over its own scale.
    violation
        The part of it that the limits alone have.
    iterations, seconds
        Over all stages.
    ending
        In words.
    start
        Index of the start.
    """

    x: Array
    value: float
    constraints: Array
    multipliers: Array
    kkt_residual: float
    violation: float
    iterations: int
    seconds: float
    ending: Ending
    start: int

    @property
    def usable(self) -> bool:
        """Whether this is a local optimum to trust."""
        return self.ending in (Ending.CONVERGED, Ending.ACCEPTABLE) and self.violation <= _NEAR


@dataclass(frozen=True, eq=False)
class _Task:
    """A program in a form that another process can read."""

    oracle: str
    lower: Array
    upper: Array
    constraint_lower: Array
    constraint_upper: Array
    scales: Array
    objective_scale: float
    constraint_scales: Array
    stages: tuple[tuple[float, ...], ...]
    max_iterations: int
    max_seconds: float
    expand: bool


def solve_nonlinear(
    program: NonlinearProgram,
    starts: Sequence[Array] | Array,
    workers: int | None = None,
    max_iterations: int = 500,
    max_seconds: float = 60.0,
) -> tuple[LocalOptimum, ...]:
    """Local optima from every start, the best usable one first; `SolverError` where workers die again and again.

    Parameters
    ----------
    program
        What is to be least, and under what.
    starts
        Points, each of shape (n,); those outside the bounds are brought in.
    workers
        Workers at most; as many as processors when left out, and none where the work is over sooner.
    max_iterations, max_seconds
        Of every start and stage.
    """
    points = [(k, np.clip(np.asarray(s, dtype=float), program.lower, program.upper)) for k, s in enumerate(starts)]
    task = _task(program, max_iterations, max_seconds, len(points) >= WORTH_EXPANDING)
    # one start tells whether the others are worth processes of their own
    began = time.perf_counter()
    found, rest = _run((task, points[:1])), [] if passed() else points[1:]
    count = min(len(rest), workers if workers is not None else count_of())
    shared = count > 1 and (time.perf_counter() - began) * len(rest) > WORTH_PROCESSES
    found += _shared(task, rest, count) if shared else _run((task, rest))
    return tuple(sorted(found, key=lambda o: (not o.usable, o.value if o.usable else o.violation, o.start)))


def distinct(optima: Sequence[LocalOptimum], scale: float, tolerance: float = 1e-4) -> tuple[LocalOptimum, ...]:
    """One of every group of usable optima whose values agree to `tolerance` of `scale`, best first."""
    kept: list[LocalOptimum] = []
    for optimum in sorted((o for o in optima if o.usable), key=lambda o: o.value):
        if not kept or optimum.value - kept[-1].value > tolerance * scale:
            kept.append(optimum)
    return tuple(kept)


def _task(program: NonlinearProgram, max_iterations: int, max_seconds: float, many: bool) -> _Task:
    symbol = type(program.x)
    scales = program.variable_scales
    constraints = symbol(0, 1) if program.constraints is None else program.constraints
    heights = np.ones(constraints.numel()) if program.constraint_scales is None else program.constraint_scales
    parameters = symbol(0, 1) if program.parameters is None else program.parameters
    y = symbol.sym("y", program.x.numel())
    f, g = ca.substitute(
        [program.objective / program.objective_scale, constraints / ca.DM(heights)], [program.x], [y * ca.DM(scales)]
    )
    oracle = ca.Function("oracle", {"x": y, "p": parameters, "f": f, "g": g}, ["x", "p"], ["f", "g"])
    return _Task(
        oracle.serialize(), program.lower / scales, program.upper / scales, program.constraint_lower / heights,
        program.constraint_upper / heights, scales, program.objective_scale, heights, program.stages,
        max_iterations, max_seconds, program.expand and many,
    )  # fmt: skip


def _shared(task: _Task, points: Sequence[tuple[int, Array]], count: int) -> list[LocalOptimum]:
    """Optima of starts that `count` workers share. To set the program up costs as much as a start: once each."""
    shares = [(task, points[k::count]) for k in range(count)]
    with executor_for(count) as executor, closing(each(_run, shares, executor, patient=True)) as answers:
        return [optimum for _, some in answers for optimum in some]


def _run(share: tuple[_Task, Sequence[tuple[int, Array]]]) -> list[LocalOptimum]:
    task, points = share
    if not points:
        return []
    oracle = ca.Function.deserialize(task.oracle)
    if task.expand:
        oracle = oracle.expand()
    limits = {"max_iter": task.max_iterations, "max_wall_time": min(task.max_seconds, max(left(), SHORTEST))}
    options: dict[str, Any] = {**_QUIET, "ipopt": {**_OPTIONS, **limits}}
    solver = ca.nlpsol("solver", "ipopt", oracle, options)
    # derivatives of the judge's own making, not the solver's
    slopes = oracle.factory("slopes", ["x", "p"], ["f", "g", "grad:f:x", "jac:g:x"])
    return [_from_start(task, solver, slopes, k, point) for k, point in in_time(telling("starts", points))]


def _from_start(task: _Task, solver: Any, slopes: Any, k: int, point: Array) -> LocalOptimum:
    began = time.perf_counter()
    y, iterations, ending = point / task.scales, 0, Ending.FAILED
    sides = {"lbx": task.lower, "ubx": task.upper, "lbg": task.constraint_lower, "ubg": task.constraint_upper}
    m = b = np.zeros(0)
    for stage in task.stages:
        found = solver(x0=y, p=list(stage), **sides)
        stats = solver.stats()
        iterations += int(stats["iter_count"])
        ending = _ENDINGS.get(stats["return_status"], Ending.FAILED)
        y = np.clip(_flat(found["x"]), task.lower, task.upper)
        m, b = _flat(found["lam_g"]), _flat(found["lam_x"])
        if ending in (Ending.FAILED, Ending.INFEASIBLE):
            break
    f, g, gradient, jacobian = slopes(y, list(task.stages[-1]))
    with np.errstate(invalid="ignore"):
        # of a point without numbers nothing is a number, and that is all that is asked of it
        residual, violation = _judged(task, y, _flat(g), _flat(gradient), np.asarray(jacobian, dtype=float), m, b)
    if not np.isfinite(residual) or not np.isfinite(float(f)):
        ending, residual, violation = Ending.FAILED, np.inf, np.inf
    return LocalOptimum(
        x=y * task.scales,
        value=float(f) * task.objective_scale,
        constraints=_flat(g) * task.constraint_scales,
        multipliers=m * task.objective_scale / task.constraint_scales,
        kkt_residual=residual,
        violation=violation,
        iterations=iterations,
        seconds=time.perf_counter() - began,
        ending=ending,
        start=k,
    )


def _flat(value: Any) -> Array:
    return np.array(value, dtype=float).reshape(-1)


def _judged(
    task: _Task, y: Array, g: Array, gradient: Array, jacobian: Array, m: Array, b: Array
) -> tuple[float, float]:
    """KKT residual and violation of the limits (N2), everything of size one."""
    balance = gradient + jacobian.T @ m + b
    reach = max(1.0, float((np.abs(gradient) + np.abs(jacobian).T @ np.abs(m) + np.abs(b)).max(initial=0.0)))
    violation = max(_outside(g, task.constraint_lower, task.constraint_upper), _outside(y, task.lower, task.upper))
    slack = max(_slack(m, g, task.constraint_lower, task.constraint_upper), _slack(b, y, task.lower, task.upper))
    return max(float(np.abs(balance).max(initial=0.0)) / reach, violation, slack / reach), violation


def _outside(value: Array, lower: Array, upper: Array) -> float:
    return float(np.maximum(lower - value, value - upper).max(initial=0.0))


def _slack(multiplier: Array, value: Array, lower: Array, upper: Array) -> float:
    """Largest multiplier times distance from the side that it speaks of."""
    size = np.abs(multiplier)
    distance = np.abs(np.where(multiplier > 0.0, upper - value, value - lower))
    # a side at infinity can carry nothing: its multiplier itself is the violation
    return float((size * np.where(np.isfinite(distance), distance, 1.0)).max(initial=0.0))
