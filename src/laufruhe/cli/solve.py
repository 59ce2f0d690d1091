"""Commands `solve` and `evaluate`: read a problem, write and show its result."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import typer

from laufruhe.cli.check import warn
from laufruhe.cli.drawing import drawing
from laufruhe.cli.screen import DONE, FAILED, Request, Watched, complain, json_file, progress, share_below_one, timed
from laufruhe.errors import SolverError, counted, printed
from laufruhe.files.reader import load
from laufruhe.numerics.progress import Listener
from laufruhe.problem.problem import Problem
from laufruhe.report import files
from laufruhe.solvers.result import Result, Status

# endings of the results folders, by command
_SUFFIX = {"solve": "", "evaluate": "-initial"}

Answer = Callable[[Problem, Listener], Result]


def run(request: Request, answer: Answer) -> None:
    """Read a problem, write and show its result, and exit with its status."""
    seconds: dict[str, float] = {}
    with progress() as say, ExitStack() as places:
        say("reading the problem")
        with timed(seconds, "load"):
            problem = load(request.problem)
            if request.tolerance is not None:
                problem = replace(problem, tolerance=share_below_one("--tolerance", request.tolerance))
            if request.solver is not None:
                from laufruhe.solvers.methods import by_solver

                problem = by_solver(problem, request.solver)
        warn(problem, request.problem)
        # a file called '...toml' would name the folder above
        name = (problem.name.strip(".") or "problem") + _SUFFIX[request.verb]
        option, folder = ("results", Path("results") / name) if request.out is None else ("--out", request.out)
        stage = places.enter_context(files.staged(files.FileSet(folder, option, request.verb)))
        copy = json_file(request.json, [request.problem], places)
        open_numbers = len(problem.decisions)
        what = "stars and firing orders" if problem.phasing is not None else counted(open_numbers, "open number")
        what = " and ".join(name for extra in problem.extras for name in extra.open_names) or what
        say(f"deciding {what}" if problem.open_names else "evaluating")
        result = answer(problem, Watched(say, problem.objective_unit or ""))
        wait_for_pictures = drawing(request.ask, result, stage, request.kinds)
        # imported while pictures are drawn
        from laufruhe.cli.results import show, write_results

        result = replace(result, timing={**result.timing, **seconds})
        write_results(request, result, stage, copy, wait_for_pictures, say)
    show(request, result, folder)
    raise typer.Exit(DONE if result.status.has_design else FAILED)


def designed(problem: Problem, path: Path, initial: bool, say: Callable[[str], None]) -> Result:
    """Return the decided design, or the initial one; complain and exit if there is none."""
    result = (evaluate if initial else solve)(problem, Watched(say, problem.objective_unit or ""))
    if not result.status.has_design:
        complain(f"{printed(str(path))}: {result.status}: {result.message}")
        raise typer.Exit(FAILED)
    return result


def evaluate(problem: Problem, _: Listener) -> Result:
    """Return the result of the initial design."""
    from laufruhe.solvers import evaluate_only

    return evaluate_only(problem)


def solve(problem: Problem, listener: Listener) -> Result:
    """Return the solver's result, or a failed result with its message."""
    import laufruhe.solvers as solvers

    try:
        return solvers.solve(problem, listener, diagnose=True)
    except SolverError as error:
        return replace(solvers.evaluate_only(problem, allow_resonance=True), status=Status.FAILED, message=str(error))
