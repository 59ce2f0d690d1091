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

import math
import time
from collections.abc import Callable, Hashable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import passed
from laufruhe.numerics.processes import Processes
from laufruhe.numerics.workers import (
    WORTH_PROCESSES,
    current_executor,
    executor_for,
    speculation,
    unordered_map,
    worker_count,
)
from laufruhe.solvers.smooth.ipopt import ExternalModel, SerializedExternal, Task, run
from laufruhe.solvers.smooth.local_optimum import Ending, LocalOptimum

StopWhen: TypeAlias = Callable[[Sequence[LocalOptimum]], bool]
Share: TypeAlias = tuple[Task, Sequence[tuple[int, Array]]]
Several: TypeAlias = Callable[[Share], list[LocalOptimum]]

WORTH_EXPANDING = 3
# starts of one round
ROUND = 6
# share of the value, or of this share of its scale, and of every variable's scale, within which two ends are the same
SAME_END, LEAST_SCALE, SAME_PLACE = 1e-7, 1e-3, 1e-4


@dataclass(frozen=True, eq=False)
class ExternalNumbers:
    """Column of symbols, what a teller is asked for them as an expression of the variables, and who tells."""

    symbols: Any
    asked: Any
    model: ExternalModel


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
    constraints
        Column of expressions, shape (m,).
    constraint_lower, constraint_upper
        Sides of the constraints, shape (m,); infinite where there is none.
    constraint_names
        As a report prints them.
    scales
        Typical sizes of the variables; the width of their bounds when left out.
    objective_scale
        Typical size of the objective; that of every constraint is one.
    parameters, stages
        Symbols and their values, one row a stage (N4).
    expand
        Whether the expressions may be written out as scalars where several starts share
        the cost and arrays are short: three times as fast to evaluate, and slower to set up.
    external
        Numbers in the expressions that a model outside tells.
    deciding
        How many of the first variables tell two ends apart: all when None. Shapes of modes, that
        follow from the rest, may have either sign.
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
    expand: bool = False
    external: ExternalNumbers | None = None
    deciding: int | None = None

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


def solve_nonlinear(
    program: NonlinearProgram,
    starts: Sequence[Array] | Array,
    workers: int | None = None,
    max_iterations: int = 500,
    max_seconds: float = 60.0,
    stop_when: StopWhen | None = None,
    known: int = 0,
) -> tuple[LocalOptimum, ...]:
    """Local optima that the starts lead to, the best usable one first.

    A search of many starts, which `stop_when` may end, takes all through the first stage; of those that end there at
    one point, one goes on, and none that is worse there than the best is in the end: what softens norms less makes no
    end better (N4). Else each goes through all stages: from one point a solver may come to several optima.

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
    stop_when
        Whether the ends of the first stage so far tell all; all starts are tried when left out.
    known
        Starts that the program has had before, for which it was built.

    Raises
    ------
    SolverError
        Where workers die again and again.
    """
    points = [(k, np.clip(np.asarray(s, dtype=float), program.lower, program.upper)) for k, s in enumerate(starts)]
    task = _task(program, max_iterations, max_seconds, known + len(points) >= WORTH_EXPANDING)
    with ExitStack() as stack:
        if stop_when is None:
            optima = _first_ends(task, points, workers, None, stack)[0]
        else:
            first = replace(task, stages=task.stages[:1])
            found, several = _first_ends(first, points, workers, stop_when, stack)
            optima = _polished(task, _grouped(found, task), several)
    return tuple(sorted(optima, key=lambda o: (not o.usable, o.value if o.usable else o.violation, o.start)))


def _first_ends(
    task: Task, points: Sequence[tuple[int, Array]], workers: int | None, stop_when: StopWhen | None, stack: ExitStack
) -> tuple[list[LocalOptimum], Several]:
    """Return the optima that the starts end at, and the function that ran them."""
    rest = points[1:]
    count = min(len(rest), workers if workers is not None else worker_count())
    # threads would share a linear solver that knows of one alone
    at_hand = _AtHand(stack, count) if count > 1 and isinstance(current_executor(), Processes) else None
    if at_hand is not None:
        at_hand.begin((task, rest[:ROUND] if stop_when is not None else rest))
    # one start tells whether the others are worth processes of their own
    began = time.process_time()
    found = run((task, points[:1]))
    spent = sum(o.seconds for o in found)
    pays = spent * len(rest) > WORTH_PROCESSES + (time.process_time() - began - spent)
    several: Several = at_hand or (_Shared(stack, count) if count > 1 and pays else run)
    while rest and not passed() and not (stop_when is not None and stop_when(_grouped(found, task))):
        some, rest = (rest[:ROUND], rest[ROUND:]) if stop_when is not None else (rest, [])
        found += several((task, some))
    return found, several


def try_all(_: Sequence[LocalOptimum]) -> bool:
    """Never enough: all starts are tried, and one of those that end alike goes on."""
    return False


class _Shared:
    """Workers that share starts: to set the program up costs as much as a start, so each has its own share of all."""

    def __init__(self, stack: ExitStack, count: int) -> None:
        self._count, self._executor = count, stack.enter_context(executor_for(count))

    def __call__(self, share: Share) -> list[LocalOptimum]:
        """Run a share of starts on all workers, as `run` does."""
        task, points = share
        shares = [(task, points[k :: self._count]) for k in range(min(self._count, len(points)))]
        with closing(unordered_map(run, shares, self._executor, patient=True)) as answers:
            return sorted((optimum for _, some in answers for optimum in some), key=lambda o: o.start)


class _AtHand:
    """Workers that are there before they are asked, and so may begin before it is known that they will be."""

    def __init__(self, stack: ExitStack, count: int) -> None:
        self._count, self._ahead = count, stack.enter_context(speculation(run))

    def begin(self, share: Share) -> None:
        """Submit starts that are likely to be needed."""
        self._ahead.prefetch(self._shares(share))

    def __call__(self, share: Share) -> list[LocalOptimum]:
        """Run a share of starts as `run` does; a single start runs in this process."""
        if len(share[1]) == 1:
            return run(share)
        self.begin(share)
        found = [optimum for key, own in self._shares(share) for optimum in self._ahead.result(key, own)]
        return sorted(found, key=lambda o: o.start)

    def _shares(self, share: Share) -> list[tuple[Hashable, Share]]:
        task, points = share
        shares = [points[k :: self._count] for k in range(min(self._count, len(points)))]
        return [((task.stages, tuple(number for number, _ in own)), (task, own)) for own in shares]


def _grouped(found: Sequence[LocalOptimum], task: Task) -> list[LocalOptimum]:
    """Return one optimum per end point with its number of starts; unusable optima stay separate."""
    groups: list[LocalOptimum] = []
    for end in sorted((o for o in found if o.usable), key=lambda o: (o.value, o.start)):
        number = next((k for k, known in enumerate(groups) if _is_same(end, known, task)), None)
        if number is None:
            groups.append(end)
        else:
            known = groups[number]
            groups[number] = replace(known, start=min(known.start, end.start), starts=known.starts + end.starts)
    return [*groups, *(o for o in found if not o.usable)]


def _is_same(end: LocalOptimum, known: LocalOptimum, task: Task) -> bool:
    near = SAME_END * max(abs(known.value), LEAST_SCALE * task.objective_scale)
    apart = np.abs(end.x - known.x)[: task.deciding] > SAME_PLACE * task.scales[: task.deciding]
    return end.value - known.value <= near and not apart.any()


def _polished(task: Task, groups: Sequence[LocalOptimum], several: Several) -> list[LocalOptimum]:
    """Through the other stages; where time is over, an end stays where it is."""
    if len(task.stages) < 2:
        return list(groups)
    if passed():
        return [replace(end, ending=Ending.UNFINISHED) if end.usable else end for end in groups]
    minimum = min((end.value for end in groups if end.usable), default=math.inf)
    # what is not there yet and worse than what is goes no further
    going = [end for end in groups if end.ending not in (Ending.FAILED, Ending.INFEASIBLE)
             and (end.usable or end.value < minimum)]  # fmt: skip
    further, later = replace(task, stages=task.stages[1:]), dict[int, LocalOptimum]()
    # the best first: what is worse where norms are softened more is so where they are softened less (N4)
    for some in (going[:1], going[1:]):
        best = min((o.value for o in later.values() if o.usable), default=math.inf)
        later |= {o.start: o for o in several((further, [(o.start, o.x) for o in some if o.value < best]))}
    found = []
    for end in groups:
        own = later.get(end.start)
        if own is not None:
            spent = (end.iterations + own.iterations, end.seconds + own.seconds)
            found.append(replace(own, starts=end.starts, iterations=spent[0], seconds=spent[1]))
        else:
            found.append(replace(end, ending=Ending.UNFINISHED) if end.usable and passed() else end)
    return found


def _task(program: NonlinearProgram, max_iterations: int, max_seconds: float, many: bool) -> Task:
    symbol = type(program.x)
    scales = program.variable_scales
    constraints = symbol(0, 1) if program.constraints is None else program.constraints
    parameters = symbol(0, 1) if program.parameters is None else program.parameters
    y, external, outside = symbol.sym("y", program.x.numel()), program.external, None
    f, g, asked = ca.substitute(
        [program.objective / program.objective_scale, constraints,
         symbol(0, 1) if external is None else external.asked], [program.x], [y * ca.DM(scales)]
    )  # fmt: skip
    inputs = {"x": y, "p": parameters}
    if external is not None:
        inputs["r"] = external.symbols
        outside = SerializedExternal(
            ca.Function("asked", [y], [asked]).serialize(), external.model, external.symbols.numel()
        )
    oracle = ca.Function("oracle", {**inputs, "f": f, "g": g}, list(inputs), ["f", "g"])
    return Task(
        oracle.serialize(), program.lower / scales, program.upper / scales, program.constraint_lower,
        program.constraint_upper, scales, program.objective_scale, program.stages,
        max_iterations, max_seconds, program.expand and many, outside, program.deciding,
    )  # fmt: skip
