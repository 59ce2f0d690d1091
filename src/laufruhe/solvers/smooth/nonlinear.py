"""Solve smooth nonlinear programs with exact derivatives: CasADi and IPOPT from many starts (N1-N4).

The program, with variables and functions scaled to size one:

    min f(x, p)  with  l <= x <= u,  gl <= g(x, p) <= gu                                (N1)

IPOPT proposes points and multipliers. Their residual is computed here: with multipliers m of g and b of the bounds,
positive at an upper bound,

    grad f + J' m + b = 0,   m and b zero at inactive bounds                             (N2)

and the largest relative violation of these and of the constraints is the KKT residual of a `LocalOptimum`. A length
|v| has no gradient at v = 0, the optimum of a balanced engine, so it is replaced by

    |v|_e = sqrt(|v|^2 + e^2) - e,    |v| - e <= |v|_e <= |v|                             (N3)

with e a parameter p that falls from stage to stage (N4). Each stage starts at the optimum of the one before. The
function is smooth, convex if |v| is, zero at zero, and differs from |v| by e at most.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from laufruhe.load_models.simulated import Peaks
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over
from laufruhe.numerics.workers import (
    WORTH_PROCESSES,
    executor_for,
    unordered_map,
    worker_count,
)
from laufruhe.solvers.smooth.ipopt import Task, run
from laufruhe.solvers.smooth.local_optimum import Ending, LocalOptimum

StopWhen: TypeAlias = Callable[[Sequence[LocalOptimum]], bool]
StartBatch: TypeAlias = tuple[Task, Sequence[tuple[int, Array]]]
RunStarts: TypeAlias = Callable[[StartBatch], list[LocalOptimum]]

# number of starts for which arrays are expanded to scalars: evaluation is three times as fast for short arrays, and
# compilation is slower
WORTH_EXPANDING = 3
# number of starts in one round
ROUND = 6
# two ends are equal within this relative difference of the objective, of its scale, and of every variable
SAME_END, MIN_SCALE, SAME_PLACE = 1e-7, 1e-3, 1e-4


@dataclass(frozen=True, eq=False)
class ExternalValues:
    """Values of an external model: their symbols, the arguments as an expression of the variables, and the model."""

    symbols: Any
    arguments: Any
    model: Peaks


@dataclass(frozen=True, eq=False)
class NonlinearProgram:
    """Smooth program in CasADi symbols (N1).

    Attributes
    ----------
    x
        Column of variables, SX or MX, shape (n,).
    lower, upper
        Bounds of the variables, shape (n,).
    constraints, constraint_lower, constraint_upper
        Column of expressions, shape (m,), and their bounds; infinite if there is none.
    scales
        Typical sizes of the variables, shape (n,); the width of their bounds if None.
    objective_scale
        Typical size of the objective; that of every constraint is one.
    parameters, stages
        Symbols and their values, one row for each stage (N4).
    external
        Values in the expressions that an external model computes.
    leading_variables
        Number of the leading variables that distinguish two optima; all if None. Shapes of modes follow from them,
        with either sign.
    """

    x: Any
    objective: Any
    lower: Array
    upper: Array
    constraints: Any = None
    constraint_lower: Array = field(default_factory=lambda: np.zeros(0))
    constraint_upper: Array = field(default_factory=lambda: np.zeros(0))
    constraint_names: tuple[str, ...] = ()
    scales: Array | None = None
    objective_scale: float = 1.0
    parameters: Any = None
    stages: tuple[tuple[float, ...], ...] = ((),)
    external: ExternalValues | None = None
    leading_variables: int | None = None

    @property
    def variable_scales(self) -> Array:
        """Typical sizes of the variables, none of them zero."""
        if self.scales is not None:
            return self.scales
        width = self.upper - self.lower
        return np.where(np.isfinite(width) & (width > 0.0), width, 1.0)


def solve_nonlinear(
    program: NonlinearProgram,
    starts: Sequence[Array] | Array,
    workers: int | None = None,
    max_iterations: int = 500,
    max_seconds: float = 60.0,
    stop_when: StopWhen | None = None,
) -> tuple[LocalOptimum, ...]:
    """Return the local optima of a multistart search, the best usable one first.

    With `stop_when`, all starts run the first stage. One start of each distinct end runs the later stages, if its
    objective is below that of the best final optimum. Later stages never lower the objective (N4). Without it, each
    start runs all stages, because one point may lead to several optima.

    Parameters
    ----------
    starts
        Start points, shape (n,) each, projected into the bounds.
    workers
        Largest number of worker processes; the number of processors if None. Short searches use none.
    max_iterations, max_seconds
        Limits of every start and stage.
    stop_when
        Return True if the ends of the first stage so far are sufficient; None runs all starts.

    Raises
    ------
    SolverError
        If worker processes die repeatedly.
    """
    points = [(k, np.clip(np.asarray(s, dtype=float), program.lower, program.upper)) for k, s in enumerate(starts)]
    task = _task(program, max_iterations, max_seconds, len(points) >= WORTH_EXPANDING)
    with ExitStack() as stack:
        if stop_when is None:
            optima = _run_first_stage(task, points, workers, None, stack)[0]
        else:
            first_stage = replace(task, stages=task.stages[:1])
            first_ends, run_starts = _run_first_stage(first_stage, points, workers, stop_when, stack)
            optima = _run_later_stages(task, _merge_equal(first_ends, task), run_starts)
    return tuple(sorted(optima, key=lambda o: (not o.usable, o.value if o.usable else o.violation, o.start)))


def _run_first_stage(
    task: Task, points: Sequence[tuple[int, Array]], workers: int | None, stop_when: StopWhen | None, stack: ExitStack
) -> tuple[list[LocalOptimum], RunStarts]:
    """Return the local optima of the first stage from all starts, and the function that runs further starts."""
    remaining = points[1:]
    count = min(len(remaining), workers if workers is not None else worker_count())
    # the duration of one start decides if the others run in processes
    started = time.process_time()
    optima = run((task, points[:1]))
    spent = sum(o.seconds for o in optima)
    pays = spent * len(remaining) > WORTH_PROCESSES + (time.process_time() - started - spent)
    run_starts: RunStarts = _SharedStarts(stack, count) if count > 1 and pays else run
    while remaining and not is_time_over() and not (stop_when is not None and stop_when(_merge_equal(optima, task))):
        batch, remaining = (remaining[:ROUND], remaining[ROUND:]) if stop_when is not None else (remaining, [])
        optima += run_starts((task, batch))
    return optima, run_starts


def run_all_starts(_: Sequence[LocalOptimum]) -> bool:
    """Return False: the first stage runs all starts."""
    return False


class _SharedStarts:
    """Worker processes with one equal share of the starts each, because compiling takes as long as a start."""

    def __init__(self, stack: ExitStack, count: int) -> None:
        self._count, self._executor = count, stack.enter_context(executor_for(count))

    def __call__(self, batch: StartBatch) -> list[LocalOptimum]:
        """Return the local optima of a program's starts, run on all workers, in the order of the starts."""
        task, points = batch
        shares = [(task, points[k :: self._count]) for k in range(min(self._count, len(points)))]
        with closing(unordered_map(run, shares, self._executor, patient=True)) as answers:
            return sorted((optimum for _, batch in answers for optimum in batch), key=lambda o: o.start)


def _merge_equal(optima: Sequence[LocalOptimum], task: Task) -> list[LocalOptimum]:
    """Return one optimum for each end point with its number of starts; unusable optima stay separate."""
    groups: list[LocalOptimum] = []
    place_tolerance = SAME_PLACE * task.scales[: task.leading_variables]
    for optimum in sorted((o for o in optima if o.usable), key=lambda o: (o.value, o.start)):
        for k, same in enumerate(groups):
            value_tolerance = SAME_END * max(abs(same.value), MIN_SCALE * task.objective_scale)
            is_near = np.abs(optimum.x - same.x)[: task.leading_variables] <= place_tolerance
            if optimum.value - same.value <= value_tolerance and is_near.all():
                groups[k] = replace(same, start=min(same.start, optimum.start), starts=same.starts + optimum.starts)
                break
        else:
            groups.append(optimum)
    return [*groups, *(o for o in optima if not o.usable)]


def _run_later_stages(task: Task, groups: Sequence[LocalOptimum], run_starts: RunStarts) -> list[LocalOptimum]:
    """Return the local optima of the later stages, started from the ends of the first stage.

    At the time limit an end of the first stage stays as it is.
    """
    if len(task.stages) < 2:
        return list(groups)
    if is_time_over():
        return [replace(optimum, ending=Ending.UNFINISHED) if optimum.usable else optimum for optimum in groups]
    minimum = min((optimum.value for optimum in groups if optimum.usable), default=math.inf)
    # an unconverged end that is worse than the best converged one goes no further
    candidates = [optimum for optimum in groups if optimum.ending not in (Ending.FAILED, Ending.INFEASIBLE)
             and (optimum.usable or optimum.value < minimum)]  # fmt: skip
    later_stages, ends = replace(task, stages=task.stages[1:]), dict[int, LocalOptimum]()
    # the best end first: less softening never lowers the objective of the others (N4)
    for batch in (candidates[:1], candidates[1:]):
        best = min((o.value for o in ends.values() if o.usable), default=math.inf)
        ends |= {o.start: o for o in run_starts((later_stages, [(o.start, o.x) for o in batch if o.value < best]))}
    results = []
    for optimum in groups:
        end = ends.get(optimum.start)
        if end is not None:
            totals = (optimum.iterations + end.iterations, optimum.seconds + end.seconds)
            results.append(replace(end, starts=optimum.starts, iterations=totals[0], seconds=totals[1]))
        else:
            results.append(replace(optimum, ending=Ending.UNFINISHED) if optimum.usable and is_time_over() else optimum)
    return results


def _task(program: NonlinearProgram, max_iterations: int, max_seconds: float, is_shared: bool) -> Task:
    symbol = type(program.x)
    scales = program.variable_scales
    constraints = symbol(0, 1) if program.constraints is None else program.constraints
    parameters = symbol(0, 1) if program.parameters is None else program.parameters
    y, external, external_model = symbol.sym("y", program.x.numel()), program.external, None
    f, g, arguments = ca.substitute(
        [program.objective / program.objective_scale, constraints,
         symbol(0, 1) if external is None else external.arguments], [program.x], [y * ca.DM(scales)]
    )  # fmt: skip
    inputs = {"x": y, "p": parameters}
    if external is not None:
        inputs["r"] = external.symbols
        external_model = ca.Function("asked", [y], [arguments]).serialize(), external.model
    oracle = ca.Function("oracle", {**inputs, "f": f, "g": g}, list(inputs), ["f", "g"])
    return Task(
        oracle.serialize(), program.lower / scales, program.upper / scales, program.constraint_lower,
        program.constraint_upper, scales, program.objective_scale, program.stages,
        max_iterations, max_seconds, is_shared, external_model, program.leading_variables,
    )  # fmt: skip
