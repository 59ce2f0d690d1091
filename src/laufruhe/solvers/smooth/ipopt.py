"""IPOPT from given points, its ends judged by derivatives taken anew (N2)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import casadi as ca
import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import in_time, left, passed
from laufruhe.numerics.progress import report_progress, with_progress
from laufruhe.solvers.smooth.local_optimum import Ending, LocalOptimum

# residual (N2) of what counts as a local optimum, however the solver ended there
ACCEPTABLE = 1e-7
# seconds that a start has where time is over
SHORTEST = 0.25
# of a program whose numbers are differences of a model outside
LOOSER = 1e-8
# numbers of an array, on average, above which whole arrays have their second derivatives sooner than their numbers
LONG = 100
# programs that are kept built
_BUILT = 4
_QUIET = {"print_time": False, "show_eval_warnings": False, "error_on_fail": False, "calc_lam_p": False}
_OPTIONS = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-10,
    "acceptable_tol": ACCEPTABLE,
    "mu_strategy": "adaptive",
    "bound_relax_factor": 1e-10,
}
# a barrier so small that a start is not pushed away from where it stands
_NEAR = {"mu_strategy": "monotone", "mu_init": 1e-4} | dict.fromkeys(
    ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac"), 1e-6
)
# share by which an end is worse than its start that is followed again by such a barrier, and what that start may break:
# norms are softened less from stage to stage, so that the end of one breaks the next by as much
STRAYED, SOFTENED = 1e-3, 2e-2

_ENDINGS = {
    "Solve_Succeeded": Ending.CONVERGED,
    "Feasible_Point_Found": Ending.CONVERGED,
    "Solved_To_Acceptable_Level": Ending.ACCEPTABLE,
    "Search_Direction_Becomes_Too_Small": Ending.ACCEPTABLE,
    "Infeasible_Problem_Detected": Ending.INFEASIBLE,
    "Restoration_Failed": Ending.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Ending.UNFINISHED,
    "User_Requested_Stop": Ending.UNFINISHED,
}


class ExternalModel(Protocol):
    """A model outside a program, that another process can read."""

    def values(self, asked: Array) -> Array:
        """Return the values at the arguments; not a number where the evaluation fails."""

    def slopes(self, asked: Array) -> Array:
        """Return the derivatives of the values by the arguments, shape (values, asked)."""


@dataclass(frozen=True, eq=False)
class SerializedExternal:
    """Numbers that a teller gives, of a serialized function of the variables; the oracle has them as its input r."""

    asked: str
    model: ExternalModel
    count: int


@dataclass(frozen=True, eq=False)
class Task:
    """A program in a form that another process can read."""

    oracle: str
    lower: Array
    upper: Array
    constraint_lower: Array
    constraint_upper: Array
    scales: Array
    objective_scale: float
    stages: tuple[tuple[float, ...], ...]
    max_iterations: int
    max_seconds: float
    expand: bool
    outside: SerializedExternal | None = None
    deciding: int | None = None


def run(share: tuple[Task, Sequence[tuple[int, Array]]]) -> list[LocalOptimum]:
    """Optima from some points of a program, with their numbers."""
    task, points = share
    if not points:
        return []
    report_progress("derivatives of the smooth program")
    built = _of_task(task)
    return [_from_start(task, built, k, point) for k, point in in_time(with_progress("starts", points))]


class _Clock(ca.Callback):
    """Asked by IPOPT after every iteration whether time is over; a limit of its own would be built into the program."""

    def __init__(self, sizes: dict[str, int]) -> None:
        ca.Callback.__init__(self)
        self._sizes, self._until = sizes, math.inf
        self.construct("clock", {})

    def start(self, seconds: float) -> None:
        """Set the deadline to a number of seconds [s] from now."""
        self._until = time.monotonic() + seconds

    def get_n_in(self) -> int:
        """Return the number of inputs, equal to the number of outputs of a CasADi NLP solver."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Return 1: the single output ends the search if it is not zero."""
        return 1

    def get_sparsity_in(self, k: int) -> Any:
        """Shape of what IPOPT tells."""
        return ca.Sparsity.dense(self._sizes[ca.nlpsol_out(k)], 1)

    def eval(self, _: Any) -> list[float]:
        """Return 1.0 if time is over, else 0.0."""
        return [float(time.monotonic() > self._until)]


class _ExternalFunction(ca.Callback):
    """A function of columns that Python answers; its derivative is another one."""

    def __init__(self, name: str, sizes: tuple[int, ...], shape: tuple[int, int], answer: Any, slopes: Any) -> None:
        ca.Callback.__init__(self)
        self._sizes, self._shape, self._answer, self._slopes = sizes, shape, answer, slopes
        self._derivative: Any = None
        self.construct(name, {})

    def get_n_in(self) -> int:
        """Columns."""
        return len(self._sizes)

    def get_n_out(self) -> int:
        """Return 1: the single output is a matrix."""
        return 1

    def get_sparsity_in(self, k: int) -> Any:
        """Return the sparsity of an input: a dense column."""
        return ca.Sparsity.dense(self._sizes[k], 1)

    def get_sparsity_out(self, _: int) -> Any:
        """Return the sparsity of the output: a dense matrix."""
        return ca.Sparsity.dense(*self._shape)

    def eval(self, external: Any) -> list[Any]:
        """Return the answer at the first input; a derivative also receives the values, and ignores them."""
        return [ca.DM(self._answer(_flat(external[0])))]

    def has_jacobian(self, *_: Any) -> bool:
        """Tell if derivatives are available."""
        return self._slopes is not None

    def get_jacobian(self, name: str, *_: Any) -> Any:
        """Kept, for CasADi does not."""
        count = self._shape[0]
        self._derivative = _ExternalFunction(name, (*self._sizes, count), (count, self._sizes[0]), self._slopes, None)
        return self._derivative


@dataclass(frozen=True, eq=False)
class _Program:
    """The solver of a program, its clock, and what has to be kept for it."""

    solver: Any
    clock: _Clock
    kept: Any = None

    def value(self, y: Array, parameters: Sequence[float]) -> float:
        """Objective at a point."""
        return float(self.solver.get_function("nlp_f")(y, list(parameters)))

    def slopes(self, y: Array, parameters: Sequence[float]) -> tuple[float, Array, Array, Array]:
        """Objective, constraints, gradient and Jacobian at a point, evaluated anew."""
        f, gradient = self.solver.get_function("nlp_grad_f")(y, list(parameters))
        g, jacobian = self.solver.get_function("nlp_jac_g")(y, list(parameters))
        return float(f), _flat(g), _flat(gradient), np.asarray(jacobian, dtype=float)


@lru_cache(maxsize=_BUILT)
def _built(
    oracle: str, expand: bool, max_iterations: int, outside: SerializedExternal | None, near: bool = False
) -> _Program:
    """A program that can be solved, and stays `near` its start: to build it costs as much as some starts."""
    function, external = ca.Function.deserialize(oracle), None
    if expand:
        scalars = function.expand()
        if scalars.n_instructions() <= LONG * function.n_instructions():
            function = scalars
    solver = {**_OPTIONS, **(_NEAR if near else {}), "max_iter": max_iterations}
    if outside is not None:
        function, external = _with_outside(function, outside)
        # slopes are told, and no bends
        solver |= {"hessian_approximation": "limited-memory", "tol": LOOSER}
    n, m = function.size1_in("x"), function.size1_out("g")
    clock = _Clock({"x": n, "f": 1, "g": m, "lam_x": n, "lam_g": m, "lam_p": function.size1_in("p")})
    options: dict[str, Any] = {**_QUIET, "ipopt": solver, "iteration_callback": clock}
    return _Program(ca.nlpsol("solver", "ipopt", function, options), clock, external)


def _with_outside(function: Any, outside: SerializedExternal) -> tuple[Any, _ExternalFunction]:
    asked, model, count = ca.Function.deserialize(outside.asked), outside.model, outside.count
    external = _ExternalFunction("told", (asked.size1_out(0),), (count, 1), model.values, model.slopes)
    x, p = (ca.MX.sym(name, function.size1_in(name)) for name in ("x", "p"))
    found = function(x=x, p=p, r=external(asked(x)))
    return ca.Function("oracle", {"x": x, "p": p, "f": found["f"], "g": found["g"]}, ["x", "p"], ["f", "g"]), external


def _from_start(task: Task, built: _Program, k: int, point: Array) -> LocalOptimum:
    began = time.process_time()
    y, iterations, ending, begun = point / task.scales, 0, Ending.FAILED, 0
    m = b = np.zeros(0)
    for number, stage in enumerate(task.stages):
        if number and passed():
            ending = Ending.UNFINISHED
            break
        end, begun = _ended(task, built, y, stage), number + 1
        iterations += end.iterations
        if _strayed(task, built, y, end, stage):
            again = _ended(task, _of_task(task, near=True), y, stage)
            iterations += again.iterations
            found = again.ending in (Ending.CONVERGED, Ending.ACCEPTABLE)
            end = again if found and built.value(again.y, stage) < built.value(end.y, stage) else end
        y, m, b, ending = end.y, end.m, end.b, end.ending
        if ending in (Ending.FAILED, Ending.INFEASIBLE):
            break
    f, g, gradient, jacobian = built.slopes(y, task.stages[-1])
    with np.errstate(invalid="ignore"):
        # of a point without numbers nothing is a number, and that is all that is asked of it
        residual, violation = _judged(task, y, g, gradient, jacobian, m, b)
    if not np.isfinite(residual) or not np.isfinite(f):
        ending, residual, violation = Ending.FAILED, np.inf, np.inf
    elif ending is Ending.UNFINISHED and begun == len(task.stages) and residual <= ACCEPTABLE:
        ending = Ending.ACCEPTABLE
    return LocalOptimum(
        x=y * task.scales,
        value=f * task.objective_scale,
        constraints=g,
        multipliers=m * task.objective_scale,
        kkt_residual=residual,
        violation=violation,
        iterations=iterations,
        seconds=time.process_time() - began,
        ending=ending,
        start=k,
    )


@dataclass(frozen=True, eq=False)
class _End:
    """End point of a stage, with its multipliers of constraints and bounds."""

    y: Array
    m: Array
    b: Array
    ending: Ending
    iterations: int


def _of_task(task: Task, near: bool = False) -> _Program:
    return _built(task.oracle, task.expand, task.max_iterations, task.outside, near)


def _ended(task: Task, built: _Program, y: Array, stage: Sequence[float]) -> _End:
    # run one stage from a point
    built.clock.start(min(task.max_seconds, max(left(), SHORTEST)))
    found = built.solver(
        x0=y, p=list(stage), lbx=task.lower, ubx=task.upper, lbg=task.constraint_lower, ubg=task.constraint_upper
    )
    stats = built.solver.stats()
    ending = _ENDINGS.get(stats["return_status"], Ending.FAILED)
    end = np.clip(_flat(found["x"]), task.lower, task.upper)
    return _End(end, _flat(found["lam_g"]), _flat(found["lam_x"]), ending, int(stats["iter_count"]))


def _strayed(task: Task, built: _Program, start: Array, end: _End, stage: Sequence[float]) -> bool:
    """Tell if a feasible start is better than the end point: the barrier led the search away.

    Programs that are told numbers from outside are taken as they are, for each look costs.
    """
    if task.outside is not None or passed():
        return False
    last, first, g, *_ = built.value(end.y, stage), *built.slopes(start, stage)
    over = max(_outside(g, task.constraint_lower, task.constraint_upper), _outside(start, task.lower, task.upper))
    return bool(over <= SOFTENED and first + over < last - STRAYED * abs(last))


def _flat(value: Any) -> Array:
    return np.array(value, dtype=float).reshape(-1)


def _judged(
    task: Task, y: Array, g: Array, gradient: Array, jacobian: Array, m: Array, b: Array
) -> tuple[float, float]:
    # N2: relative KKT residual, and violation of the limits
    balance = gradient + jacobian.T @ m + b
    reach = max(1.0, float((np.abs(gradient) + np.abs(jacobian).T @ np.abs(m) + np.abs(b)).max(initial=0.0)))
    violation = max(_outside(g, task.constraint_lower, task.constraint_upper), _outside(y, task.lower, task.upper))
    slack = max(_slack(m, g, task.constraint_lower, task.constraint_upper), _slack(b, y, task.lower, task.upper))
    return max(float(np.abs(balance).max(initial=0.0)) / reach, violation, slack / reach), violation


def _outside(value: Array, lower: Array, upper: Array) -> float:
    return float(np.maximum(lower - value, value - upper).max(initial=0.0))


def _slack(multiplier: Array, value: Array, lower: Array, upper: Array) -> float:
    # largest product of multiplier and distance to its side
    size = np.abs(multiplier)
    distance = np.abs(np.where(multiplier > 0.0, upper - value, value - lower))
    # a side at infinity can carry nothing: its multiplier itself is the violation
    return float((size * np.where(np.isfinite(distance), distance, 1.0)).max(initial=0.0))
