"""Laufruhe: the balance of piston engines, designed by optimisation and proven.

>>> import laufruhe
>>> problem = laufruhe.load("problems/tractor-four-lanchester.toml")
>>> laufruhe.solve(problem)
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from laufruhe.machine import Engine, OperatingPoint
    from laufruhe.problem.problem import Problem
    from laufruhe.solvers.result import Result

__version__ = "0.1.0"
__all__ = ["__version__", "evaluate", "load", "solve"]


def load(path: str | Path) -> Problem:
    """Read and check a problem file.

    Raises
    ------
    laufruhe.errors.InputError
        With one line for everything wrong: file, key, value, rule, remedy.
    """
    from laufruhe.files.reader import load as read

    return read(path)


def solve(problem: Problem, time_limit: float | None = None) -> Result:
    """Decide what a problem leaves open; the result says what of it is proven.

    Parameters
    ----------
    problem
        As `load` reads it.
    time_limit
        Seconds after which the search ends with the best design that it has, and with its bound.
    """
    from laufruhe.solvers import solve as decide

    return decide(problem, time_limit=time_limit)


def evaluate(design: Problem | Engine, points: Sequence[OperatingPoint] = ()) -> Result:
    """Evaluate a design as given.

    Parameters
    ----------
    design
        A problem, or an engine with the operating points beside it.
    points
        Of an engine that stands in no problem.
    """
    from laufruhe.problem import channels
    from laufruhe.problem.measure import Measure, Term
    from laufruhe.problem.problem import Problem
    from laufruhe.solvers import state

    if isinstance(design, Problem):
        return state(design)
    channel = channels.MOUNT_FORCE if design.mounts else channels.SHAKING_FORCE
    wanted = (Term(Measure(channel)),)
    return state(Problem(design.name, design.name, design, tuple(points), objective=wanted))
