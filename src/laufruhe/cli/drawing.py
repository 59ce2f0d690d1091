"""Pictures, drawn by a process that imports matplotlib while the problem is read and solved."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from laufruhe.cli.screen import Ask, loudness, speak
from laufruhe.numerics.cores import processors
from laufruhe.numerics.processes import Processes, call_by_name

if TYPE_CHECKING:
    from laufruhe.solvers.result import Result

SELDOM = 200_000
"""Number of new objects after which a process collects garbage; drawing makes many objects and little garbage."""


@contextmanager
def artist(kinds: Sequence[str]) -> Iterator[Ask]:
    """Yield the function that requests pictures of these kinds: from another process, or from this one on one core."""
    is_other = bool(kinds) and processors() > 1
    with Processes(1) as workers:
        if is_other:
            workers.submit(gc.set_threshold, SELDOM)
            workers.submit(speak, loudness())
            workers.submit(call_by_name, "laufruhe.plots:get_ready")
        yield partial(_request, workers if is_other else None)


def _request(workers: Processes | None, name: str, *args: Any) -> Callable[[], Any]:
    call = partial(call_by_name, name, *args)
    if workers is None:
        return call
    try:
        future = workers.submit(call_by_name, name, *args)
    except (AttributeError, TypeError, ValueError):
        # classes of a user may have no pickle
        return call

    def result() -> Any:
        with suppress(BrokenExecutor):
            return future.result()
        return call()

    return result


def drawing(ask: Ask, result: Result, folder: Path, kinds: Sequence[str]) -> Callable[[], dict[str, str]]:
    """Start to draw the pictures of a result into a folder; return a function that waits for them.

    That function returns the pictures as SVG, by their names.
    """
    if not kinds:
        return dict
    from laufruhe.present.measures import evaluations_with_loads, places_of
    from laufruhe.problem.evaluation import place_measures

    # both processes need these measures, and the copy has what is computed
    for load in places_of(result):
        for design in evaluations_with_loads(result):
            for k in range(len(design.loads)):
                place_measures(design, k, load)
    # functions that read and solve have no pickle
    problem = replace(result.problem, origin=None)
    if problem.phasing is not None:
        problem = replace(problem, phasing=replace(problem.phasing, layout=_no_design, problem_of=_no_design))
    drawn = replace(result, problem=problem, error=float)
    return ask("laufruhe.plots:draw_and_show", drawn, folder, kinds)


def _no_design(*_: Any) -> NoReturn:
    raise NotImplementedError("a problem that is drawn makes no other designs")
