"""Unbalances by Newton's method and in free columns, beside the same by cone programs of all rows and columns.

Writes results/benchmarks/cones.md. Both ways run in turns: the step from load rows to a proven optimum of all ready
problems in which only unbalances are open, and of engines with many counterweights, angles or operating points. Every
large engine has a process of its own for each way, whose memory is the most that it held above its load rows.
"""

from __future__ import annotations

import json
import math
import resource
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch

from bench_growth import scene
from pages import PAGES, ROOT, publish

from laufruhe import load
from laufruhe.load_models import affine
from laufruhe.load_models.affine import AffineModel
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import open_kinds
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.solvers.cones import conic, unbalances

OUT = PAGES / "cones.md"
WAYS = ("as solved", "cone programs of all rows and columns")
ROUNDS = 3
LARGE: dict[str, dict[str, Any]] = {
    "720 angles, 2 unbalances": {"counterweights": 1, "shafts": 1, "samples": 720},
    "720 angles, 25 unbalances": {"counterweights": 25, "shafts": 0, "samples": 720},
    "5760 angles, 25 unbalances": {"counterweights": 25, "shafts": 0, "samples": 5760},
    "720 angles, 2 unbalances, 30 points": {"counterweights": 1, "shafts": 1, "samples": 720, "points": 30},
}


@contextmanager
def way(name: str) -> Iterator[None]:
    """Solve in one of both ways."""
    if name == WAYS[0]:
        yield
        return
    with (
        patch.object(conic, "newton_solution", lambda _: None),
        patch.object(affine, "MANY_COLUMNS", sys.maxsize),
    ):
        yield


def decided(problem: Problem, model: AffineModel) -> tuple[float, float, float]:
    """Return the processor time [s] from a model to an optimum, its objective and its relative gap."""
    start = time.process_time()
    optimum, _ = unbalances._refine(problem, model, numerical_zero(problem), 0)
    spent = time.process_time() - start
    if optimum is None:
        return spent, math.nan, math.nan
    return spent, optimum.problem.objective(optimum.x), optimum.gap


def ready() -> list[tuple[Problem, AffineModel]]:
    """Return the ready problems with open unbalances alone, and their models."""
    paths = sorted((ROOT / "problems").glob("*.toml"))
    problems = [load(path) for path in paths if "study" not in tomllib.loads(path.read_text(encoding="utf-8"))]
    problems = [p for p in problems if open_kinds(p) == {Kind.UNBALANCE} and p.objective and not p.extras]
    return [(problem, AffineModel(problem)) for problem in problems]


def one_large(size: str, name: str) -> None:
    """Print time, objective, gap and memory [MiB] of one engine in one way."""
    problem = load(scene(**LARGE[size]))
    model = AffineModel(problem)
    import_module("clarabel")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with way(name):
        answer = decided(problem, model)
    print(json.dumps((*answer, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024.0)))


def main() -> None:
    """Measure and write the table."""
    lines = [
        "# Unbalances by Newton's method, beside cone programs",
        "",
        "Processor time from load rows to the proven optimum, least of three runs in turns. Memory is the most that",
        "the step held beside its model. The other way has neither Newton's method nor free columns.",
        "",
        "| what | s | other s | ratio | MiB | other MiB | gap | other gap | difference of objectives |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    # first, because a process is counted with the memory of the one that starts it
    for size in LARGE:
        runs = [[measured(size, name) for name in WAYS] for _ in range(ROUNDS)]
        a, b = (min((turn[k] for turn in runs), key=lambda run: run[0]) for k in (0, 1))
        lines.append(
            f"| {size} | {a[0]:.3f} | {b[0]:.3f} | {a[0] / b[0]:.2f} | {a[3]:.0f} | {b[3]:.0f} "
            f"| {a[2]:.0e} | {b[2]:.0e} | {abs(a[1] - b[1]) / b[1]:.0e} |"
        )
    count, package, other = ready_times()
    lines.append(f"| {count} ready problems | {package:.2f} | {other:.2f} | {package / other:.2f} | | | | | |")
    publish(OUT, "\n".join(lines) + "\n")


def ready_times() -> tuple[int, float, float]:
    """Return the number of ready problems and the processor time of both ways, each the least of several runs [s]."""
    problems = ready()
    best = [[math.inf] * len(problems) for _ in WAYS]
    for _ in range(ROUNDS):
        for k, (problem, model) in enumerate(problems):
            for times, name in zip(best, WAYS, strict=True):
                with way(name):
                    times[k] = min(times[k], decided(problem, model)[0])
    package, other = (sum(times) for times in best)
    return len(problems), package, other


def measured(size: str, name: str) -> list[float]:
    """Time, objective, gap and memory [MiB] of one engine in a process of its own."""
    command = [sys.executable, str(Path(__file__)), size, name]
    numbers: list[float] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return numbers


if __name__ == "__main__":
    if len(sys.argv) > 1:
        one_large(*sys.argv[1:])
    else:
        main()
