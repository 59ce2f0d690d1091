"""Laufruhe: optimisation-driven balance design of piston engines, with proofs (docs/reference/python.md).

>>> import laufruhe
>>> problem = laufruhe.load("problems/tractor-four-lanchester.toml")
>>> laufruhe.solve(problem)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeAlias, TypeVar, Union

from laufruhe.errors import (
    InputError,
    LaufruheError,
    ModelError,
    SolverError,
    check_integer,
    optional_libraries,
    wrong_call,
)
from laufruhe.version import __version__

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from numpy.typing import ArrayLike

    from laufruhe import machine as machine
    from laufruhe import plots as plots
    from laufruhe.extensions.own_measures.measures import own_measure
    from laufruhe.machine import Engine, OperatingPoint
    from laufruhe.problem.number_types import open_number as open
    from laufruhe.problem.problem import Problem
    from laufruhe.python import tables as tables
    from laufruhe.python.draft import EngineDraft
    from laufruhe.python.layouts import (
        boxer,
        delta,
        engine,
        inline,
        opposed_piston,
        parts,
        radial,
        rotary,
        vee,
        x_engine,
    )  # fmt: skip
    from laufruhe.python.lists import engines, examples
    from laufruhe.python.results import Result
    from laufruhe.python.watch import Callback, Progress, ProgressLine
    from laufruhe.report.saved_result import SavedResult, read_result, write_result

_LAYOUTS = ("boxer", "delta", "engine", "inline", "opposed_piston", "parts", "radial", "rotary", "vee", "x_engine")
# imported at first use, so that import laufruhe is quick
_ELSEWHERE = {
    "EngineDraft": "laufruhe.python.draft",
    "own_measure": "laufruhe.extensions.own_measures.measures",
    "Problem": "laufruhe.python.draft",
    "Result": "laufruhe.python.results",
    **dict.fromkeys(("Progress", "ProgressLine"), "laufruhe.python.watch"),
    **dict.fromkeys(_LAYOUTS, "laufruhe.python.layouts"),
    **dict.fromkeys(("engines", "examples"), "laufruhe.python.lists"),
    **dict.fromkeys(("SavedResult", "read_result", "write_result"), "laufruhe.report.saved_result"),
}
_MODULES = {"machine": "laufruhe.machine", "plots": "laufruhe.plots", "tables": "laufruhe.python.tables"}

__all__ = [
    "EngineDraft",
    "InputError",
    "LaufruheError",
    "ModelError",
    "Problem",
    "Progress",
    "ProgressLine",
    "Result",
    "SavedResult",
    "SolverError",
    "__version__",
    "boxer",
    "certify",
    "delta",
    "engine",
    "engines",
    "evaluate",
    "evaluate_many",
    "examples",
    "identify",
    "inline",
    "load",
    "machine",
    "open",
    "opposed_piston",
    "own_measure",
    "parts",
    "plots",
    "radial",
    "read_result",
    "rotary",
    "solve",
    "study",
    "tables",
    "vee",
    "write_result",
    "x_engine",
]

P = ParamSpec("P")
T = TypeVar("T")
Source: TypeAlias = Union[str, Path, Mapping[str, Any]]  # noqa: UP007
"""Path of a file, its text, or its tables."""


if not TYPE_CHECKING:
    # type checkers should still find misspelt names
    def __getattr__(name: str) -> Any:
        if name == "open":
            return import_module("laufruhe.problem.number_types").open_number
        if name in _MODULES:
            return import_module(_MODULES[name])
        if name not in _ELSEWHERE:
            raise AttributeError(f"module 'laufruhe' has no attribute '{name}'")
        from laufruhe.extension import object_at

        return object_at(f"{_ELSEWHERE[name]}:{name}")


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted(__all__)


def _on_one_thread(call: Callable[P, T]) -> Callable[P, T]:
    """Return the call with linear algebra on one thread, as commands have it."""

    @wraps(call)
    def limited(*args: P.args, **kwargs: P.kwargs) -> T:
        from laufruhe.numerics.cores import one_thread

        with one_thread(), optional_libraries():
            return call(*args, **kwargs)

    return limited


def load(source: Source) -> Problem:
    """Read and check a problem.

    Parameters
    ----------
    source
        Path of a problem file, its text, or its tables as a dictionary.

    Raises
    ------
    InputError
        With one line for everything wrong: file, key, value, rule, remedy.
    """
    from laufruhe.files.reader import load as read
    from laufruhe.python.draft import EngineDraft

    if isinstance(source, EngineDraft):
        remedy = 'give its problem, such as engine.problem("2500 rpm", minimise="mean mount force")'
        raise wrong_call("problem", source, "is an engine without operating points", remedy)
    return read(source)


@_on_one_thread
def solve(
    problem: Problem | Source, time_limit: float | None = None, callback: Callback | None = None,
    solver: str | None = None,
) -> Result:  # fmt: skip
    """Solve a problem; the result includes its proof.

    Parameters
    ----------
    problem
        Problem, or an argument of `load`.
    time_limit
        Seconds after which the search ends with its best design and bound.
    callback
        Function of the `Progress` of the search; if it returns True, the search ends with its best design and bound.
        `ProgressLine()` shows the progress.
    solver
        Solver of cvxpy that proposes unbalances, such as "SCS", in place of those of this package. The proof is the
        same.

    Raises
    ------
    InputError
        If the problem is wrong.
    ModelError
        If the engine cannot be evaluated as given.
    SolverError
        If a solver stops without a result.
    """
    from numbers import Real

    from laufruhe.python.results import watched
    from laufruhe.solvers import solve as decide

    if time_limit is not None and not (isinstance(time_limit, Real) and time_limit > 0.0):
        raise wrong_call("time_limit", time_limit, "must be a number of seconds above zero", "try 60")
    checked = _problem(problem)
    if solver is not None:
        from laufruhe.solvers.methods import by_solver

        checked = by_solver(checked, solver)
    return watched(checked, callback, lambda watch: decide(checked, watch, time_limit, diagnose=True))


@_on_one_thread
def evaluate(
    design: Problem | Engine | Source, points: Sequence[OperatingPoint] = (), values: Mapping[str, Any] | None = None
) -> Result:
    """Evaluate a design as given.

    Parameters
    ----------
    design
        Problem, argument of `load`, or engine.
    points
        Operating points; required when `design` is an Engine.
    values
        Other values of numbers, as `Problem.with_values` takes them.

    Raises
    ------
    InputError
        If the problem is wrong.
    ModelError
        If the engine cannot be evaluated, or has no operating point.
    """
    from laufruhe.machine import Engine
    from laufruhe.python.results import python_result
    from laufruhe.solvers import evaluate_only

    if isinstance(design, Engine):
        return python_result(evaluate_only(_engine_problem(design, points)))
    if len(points):
        rule, remedy = "stand beside a problem, which has its own", "leave them out, or give the problem's engine"
        raise wrong_call("points", points, rule, remedy)
    problem = _problem(design)
    return python_result(evaluate_only(problem if values is None else problem.with_values(values)))


@_on_one_thread
def certify(
    problem: Problem | Source, values: Mapping[str, Any], multipliers: Mapping[str, ArrayLike] | None = None
) -> Result:
    """Prove how good a design is that someone else found.

    Parameters
    ----------
    problem
        Problem, or an argument of `load`.
    values
        Values of open numbers by their names in results, as `evaluate_many` takes them for one design.
    multipliers
        Multipliers of terms and limits by name: dual rows as `to_cvxpy().multipliers` has them, or one number, the
        price of a limit. Any multipliers give a valid bound. By default a solve finds the bound.

    Returns
    -------
    Result with the exact value, lower bound and gap of this design, and the kind of its proof. A proof is "global" or
    "global within gap"; it is "none" if the bound is not known to reach the optimum.

    Raises
    ------
    InputError
        If a value is outside of its bounds, or the design violates a limit.
    ModelError
        If the engine cannot be evaluated, or multipliers are given for other open numbers than unbalances.
    """
    from laufruhe.python.results import python_result
    from laufruhe.solvers.certify import certify as prove

    return python_result(prove(_problem(problem), values, multipliers))


def _engine_problem(design: Engine, points: Sequence[OperatingPoint]) -> Problem:
    """Return a problem of the mount forces of an engine, or of its shaking force without mounts."""
    from laufruhe.machine import OperatingPoint
    from laufruhe.problem import channels
    from laufruhe.problem.measure import Measure, Term
    from laufruhe.problem.problem import Problem

    listed: Sequence[object] = points
    strange = next((point for point in listed if not isinstance(point, OperatingPoint)), None)
    if strange is not None:
        raise wrong_call("points", strange, "is no operating point", "give a list of laufruhe.machine.OperatingPoint")
    if not points:
        raise ModelError(f"'{design.name}' has no operating point; give points")
    channel = channels.MOUNT_FORCE if design.mounts else channels.SHAKING_FORCE
    return Problem(design.name, design.name, design, tuple(points), objective=(Term(Measure(channel)),))


@_on_one_thread
def evaluate_many(
    problem: Problem | Source,
    designs: Mapping[str, ArrayLike] | Sequence[Mapping[str, str | float]] | pd.DataFrame | xr.Dataset,
    jobs: int = 1,
) -> Any:
    """Evaluate many designs of one problem, and return a table with a row for each.

    Designs that differ in unbalances share one model, and take some 10 to 30 microseconds each. Others are evaluated
    one by one.

    Parameters
    ----------
    problem
        Problem, or an argument of `load`.
    designs
        Values of open numbers by their names in results: arrays by name, a mapping for each design, a table, or an
        xarray dataset, whose variables are broadcast. Numbers are in SI units, angles in radians; texts have a unit. A
        number that is missing has its start value.
    jobs
        Largest number of processes for designs that are evaluated one by one, and of threads for the others.

    Returns
    -------
    Columns: the given numbers, `objective`, each term by the name of its measure, each limit by its name (all in SI
    units, which `attrs["units"]` names), `feasible` (limits and bounds are kept), and `message`, empty or the reason
    why a design cannot be evaluated. The table is a pandas DataFrame, or a dataset with the dimensions of the designs
    if these are one.

    Raises
    ------
    InputError
        If the problem is wrong, or a name or a value.
    ModelError
        If throws or firing order are open.
    """
    from laufruhe.solvers.many import evaluate_many as tabulate

    check_integer("jobs", jobs, 1)
    return tabulate(_problem(problem), designs, jobs)


@_on_one_thread
def identify(problem: Problem | Source) -> Any:
    """Estimate the open numbers of a built engine from its measured orders, as the command `identify` does.

    Parameters
    ----------
    problem
        Problem with [[measurements]], or an argument of `load`.

    Returns
    -------
    Object with `numbers` (a table of estimates with their intervals), `unexplained` (the share of each measurement),
    `identified` (the problem with its numbers fixed), and `to_json`.

    Raises
    ------
    InputError
        If the problem or a measurement is wrong.
    """
    from laufruhe.extension import object_at

    return object_at("laufruhe.extensions.identification.report:identify")(_problem(problem))


@_on_one_thread
def study(source: Source, jobs: int = 1) -> dict[str, xr.Dataset]:
    """Run the sweeps and comparisons of a study, and return one dataset a part by its name.

    Parameters
    ----------
    source
        Path of a study file, its text, or its tables. Its problems are in the same folder, or in the working folder.
    jobs
        Largest number of processes.

    Raises
    ------
    InputError
        If the study or one of its problems is wrong.
    """
    from tempfile import TemporaryDirectory

    from laufruhe.files.reader import tables_and_path
    from laufruhe.studies.reader import load_study
    from laufruhe.studies.runner import run
    from laufruhe.studies.stores import FINISHED_POINTS

    check_integer("jobs", jobs, 1)
    _, path = tables_and_path(source)
    with TemporaryDirectory() as folder:
        datasets, _ = run(load_study(source), path.parent, Path(folder) / FINISHED_POINTS, jobs=jobs)
    return datasets


def _problem(problem: Problem | Source) -> Problem:
    from laufruhe.problem.problem import Problem

    return problem if isinstance(problem, Problem) else load(problem)
