"""Run IPOPT from start points, and compute the KKT residual of its solutions (N2)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.load_models.simulated import Peaks
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over, seconds_left, until_time_limit
from laufruhe.numerics.progress import report_progress, with_progress
from laufruhe.solvers.smooth.local_optimum import Ending, LocalOptimum

# largest KKT residual (N2) of a local optimum
ACCEPTABLE = 1e-7
# smallest time limit of a start [s]
SHORTEST = 0.25
# tolerance for programs with finite differences of an external model
LOOSER = 1e-8
# mean array length above which second derivatives of arrays are faster than those of scalars
LONG = 100
# number of programs in the cache
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
# a small barrier that does not push the start away from its bounds
_NEAR = {"mu_strategy": "monotone", "mu_init": 1e-4} | dict.fromkeys(
    ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac"), 1e-6
)
# relative rise of the objective from start to end that calls for a small barrier, and largest violation of that start:
# norms are softened less from stage to stage, so the end of one stage may violate constraints of the next
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


@dataclass(frozen=True, eq=False)
class Task:
    """Nonlinear program that can be pickled, in scaled variables.

    `program_text` is its serialized CasADi function, from variables and parameters to objective and constraints (N1).
    `stages` has the parameters of every stage (N4). Values of an external model are the input r of that function.
    `external_model` has the serialized function from the variables to the arguments of the model, and the model.
    """

    program_text: str
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
    external_model: tuple[str, Peaks] | None = None
    leading_variables: int | None = None


def run(batch: tuple[Task, Sequence[tuple[int, Array]]]) -> list[LocalOptimum]:
    """Return the local optima from numbered start points of a program; `batch` has the program and these points."""
    task, points = batch
    if not points:
        return []
    report_progress("derivatives of the smooth program")
    program = _compile_task(task)
    return [_from_start(task, program, k, point) for k, point in until_time_limit(with_progress("starts", points))]


class _Callback(ca.Callback):
    """CasADi function that Python computes, from columns of `sizes` to a dense matrix of `shape`."""

    def __init__(self, sizes: tuple[int, ...], shape: tuple[int, int] = (1, 1)) -> None:
        ca.Callback.__init__(self)
        self._sizes, self._shape = sizes, shape

    def get_n_in(self) -> int:
        """Return the number of input columns."""
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


class _Clock(_Callback):
    """Iteration callback that stops IPOPT at a deadline.

    The time limit of IPOPT itself would be fixed in the cached program.
    """

    def __init__(self, sizes: dict[str, int]) -> None:
        # the inputs are the outputs of a CasADi NLP solver
        super().__init__(tuple(sizes[ca.nlpsol_out(k)] for k in range(ca.nlpsol_n_out())))
        self.until = math.inf
        self.construct("clock", {})

    def eval(self, _: Any) -> list[float]:
        """Return 1.0 if time is over, else 0.0."""
        return [float(time.monotonic() > self.until)]


class _ExternalFunction(_Callback):
    """CasADi function whose values (`answer`) and derivatives (`slopes`) Python computes."""

    def __init__(self, name: str, sizes: tuple[int, ...], shape: tuple[int, int], answer: Any, slopes: Any) -> None:
        super().__init__(sizes, shape)
        self._answer, self._slopes = answer, slopes
        self._derivative: Any = None
        self.construct(name, {})

    def eval(self, external: Any) -> list[Any]:
        """Return the output at the first input; a function of derivatives ignores its second input, the values."""
        return [ca.DM(self._answer(_flat(external[0])))]

    def has_jacobian(self, *_: Any) -> bool:
        """Return True if derivatives are available."""
        return self._slopes is not None

    def get_jacobian(self, name: str, *_: Any) -> Any:
        """Return the function of derivatives, and keep a reference, because CasADi keeps none."""
        count = self._shape[0]
        self._derivative = _ExternalFunction(name, (*self._sizes, count), (count, self._sizes[0]), self._slopes, None)
        return self._derivative


@dataclass(frozen=True, eq=False)
class _Program:
    """Compiled solver of a program, its clock, and a reference to its external function."""

    solver: Any
    clock: _Clock
    memory: Any = None

    def value(self, y: Array, parameters: Sequence[float]) -> float:
        """Return the objective at scaled variables y and the parameters of a stage."""
        return float(self.solver.get_function("nlp_f")(y, list(parameters)))

    def slopes(self, y: Array, parameters: Sequence[float]) -> tuple[float, Array, Array, Array]:
        """Return objective, constraints, gradient and Jacobian at scaled variables y and the parameters of a stage."""
        f, gradient = self.solver.get_function("nlp_grad_f")(y, list(parameters))
        g, jacobian = self.solver.get_function("nlp_jac_g")(y, list(parameters))
        return float(f), _flat(g), _flat(gradient), np.asarray(jacobian, dtype=float)


@lru_cache(maxsize=_BUILT)
def _compiled_program(
    program_text: str,
    expand: bool,
    max_iterations: int,
    external_model: tuple[str, Peaks] | None,
    stay_near: bool = False,
) -> _Program:
    """Return the compiled IPOPT solver of a serialised CasADi program; compiling takes as long as several starts.

    See `Task` for `program_text` and `external_model`. If `expand` is True, arrays become scalars where that is faster.
    `stay_near` starts with a small barrier.
    """
    function, external = ca.Function.deserialize(program_text), None
    if expand:
        scalars = function.expand()
        if scalars.n_instructions() <= LONG * function.n_instructions():
            function = scalars
    solver = {**_OPTIONS, **(_NEAR if stay_near else {}), "max_iter": max_iterations}
    if external_model is not None:
        arguments, model = ca.Function.deserialize(external_model[0]), external_model[1]
        shape = sum(model.counts), 1
        external = _ExternalFunction("told", (arguments.size1_out(0),), shape, model.values, model.slopes)
        x, p = (ca.MX.sym(name, function.size1_in(name)) for name in ("x", "p"))
        outputs = function(x=x, p=p, r=external(arguments(x)))
        function = ca.Function(
            "program_text", {"x": x, "p": p, "f": outputs["f"], "g": outputs["g"]}, ["x", "p"], ["f", "g"]
        )
        # an external model has first derivatives only
        solver |= {"hessian_approximation": "limited-memory", "tol": LOOSER}
    n, m = function.size1_in("x"), function.size1_out("g")
    clock = _Clock({"x": n, "f": 1, "g": m, "lam_x": n, "lam_g": m, "lam_p": function.size1_in("p")})
    options: dict[str, Any] = {**_QUIET, "ipopt": solver, "iteration_callback": clock}
    return _Program(ca.nlpsol("solver", "ipopt", function, options), clock, external)


def _from_start(task: Task, program: _Program, k: int, point: Array) -> LocalOptimum:
    started = time.process_time()
    y, iterations, ending, stages_run = point / task.scales, 0, Ending.FAILED, 0
    m = b = np.zeros(0)
    for number, stage in enumerate(task.stages):
        if number and is_time_over():
            ending = Ending.UNFINISHED
            break
        stage_end, stages_run = _run_stage(task, program, y, stage), number + 1
        iterations += stage_end.iterations
        if _is_worse_than_start(task, program, y, stage_end, stage):
            retry = _run_stage(task, _compile_task(task, stay_near=True), y, stage)
            iterations += retry.iterations
            is_converged = retry.ending in (Ending.CONVERGED, Ending.ACCEPTABLE)
            if is_converged and program.value(retry.y, stage) < program.value(stage_end.y, stage):
                stage_end = retry
        y, m, b, ending = stage_end.y, stage_end.m, stage_end.b, stage_end.ending
        if ending in (Ending.FAILED, Ending.INFEASIBLE):
            break
    f, g, gradient, jacobian = program.slopes(y, task.stages[-1])
    with np.errstate(invalid="ignore"):
        # the residual of a point with NaN is NaN
        residual, violation = _kkt_residual(task, y, g, gradient, jacobian, m, b)
    if not np.isfinite(residual) or not np.isfinite(f):
        ending, residual, violation = Ending.FAILED, np.inf, np.inf
    elif ending is Ending.UNFINISHED and stages_run == len(task.stages) and residual <= ACCEPTABLE:
        ending = Ending.ACCEPTABLE
    return LocalOptimum(
        x=y * task.scales,
        value=f * task.objective_scale,
        constraints=g,
        multipliers=m * task.objective_scale,
        kkt_residual=residual,
        violation=violation,
        iterations=iterations,
        seconds=time.process_time() - started,
        ending=ending,
        start=k,
    )


@dataclass(frozen=True, eq=False)
class _End:
    """End point y of a stage, with multipliers m of the constraints and b of the bounds."""

    y: Array
    m: Array
    b: Array
    ending: Ending
    iterations: int


def _compile_task(task: Task, stay_near: bool = False) -> _Program:
    return _compiled_program(task.program_text, task.expand, task.max_iterations, task.external_model, stay_near)


def _run_stage(task: Task, program: _Program, y: Array, stage: Sequence[float]) -> _End:
    # run one stage from a point
    program.clock.until = time.monotonic() + min(task.max_seconds, max(seconds_left(), SHORTEST))
    solution = program.solver(
        x0=y, p=list(stage), lbx=task.lower, ubx=task.upper, lbg=task.constraint_lower, ubg=task.constraint_upper
    )
    stats = program.solver.stats()
    ending = _ENDINGS.get(stats["return_status"], Ending.FAILED)
    end = np.clip(_flat(solution["x"]), task.lower, task.upper)
    return _End(end, _flat(solution["lam_g"]), _flat(solution["lam_x"]), ending, int(stats["iter_count"]))


def _is_worse_than_start(task: Task, program: _Program, start: Array, stage_end: _End, stage: Sequence[float]) -> bool:
    # True if a feasible start has a lower objective than the end point, because of the barrier.
    # Programs with an external model are not checked, because its evaluation is slow.
    if task.external_model is not None or is_time_over():
        return False
    end_value, start_value, g, *_ = program.value(stage_end.y, stage), *program.slopes(start, stage)
    violation = max(
        _violation(g, task.constraint_lower, task.constraint_upper), _violation(start, task.lower, task.upper)
    )
    return bool(violation <= SOFTENED and start_value + violation < end_value - STRAYED * abs(end_value))


def _flat(value: Any) -> Array:
    return np.array(value, dtype=float).reshape(-1)


def _kkt_residual(
    task: Task, y: Array, g: Array, gradient: Array, jacobian: Array, m: Array, b: Array
) -> tuple[float, float]:
    # N2: relative KKT residual, and violation of the limits
    residual = gradient + jacobian.T @ m + b
    scale = max(1.0, float((np.abs(gradient) + np.abs(jacobian).T @ np.abs(m) + np.abs(b)).max(initial=0.0)))
    violation = max(_violation(g, task.constraint_lower, task.constraint_upper), _violation(y, task.lower, task.upper))
    slack = max(
        _complementarity(m, g, task.constraint_lower, task.constraint_upper),
        _complementarity(b, y, task.lower, task.upper),
    )
    return max(float(np.abs(residual).max(initial=0.0)) / scale, violation, slack / scale), violation


def _violation(value: Array, lower: Array, upper: Array) -> float:
    return float(np.maximum(lower - value, value - upper).max(initial=0.0))


def _complementarity(multiplier: Array, value: Array, lower: Array, upper: Array) -> float:
    # largest product of multiplier and distance to its side
    size = np.abs(multiplier)
    distance = np.abs(np.where(multiplier > 0.0, upper - value, value - lower))
    # an infinite bound has no multiplier: any multiplier is a violation
    return float((size * np.where(np.isfinite(distance), distance, 1.0)).max(initial=0.0))
