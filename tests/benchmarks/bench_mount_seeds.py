"""Ready problems on elastic mounts from ten seeds each. Writes results/benchmarks/mount-seeds.md."""

from __future__ import annotations

import sys
import time
from dataclasses import replace

from pages import PAGES, publish

from laufruhe.files.reader import load
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve
from laufruhe.solvers.mounts.convex import is_convex
from problem_files import ELASTIC

SEEDS = range(10)
# of an open star; all of them are looked at by the ready problem itself
STARS = 12


def elastic_problems() -> list[Problem]:
    """Ready problems that leave mounts open."""
    return [problem for problem in map(load, ELASTIC) if problem.mount_decisions]


def row_of(problem: Problem) -> str:
    """One line of the table."""
    values, seconds = [], []
    if problem.phasing is not None:
        problem = replace(problem, phasing=replace(problem.phasing, best=STARS))
    for seed in SEEDS:
        seeded = replace(problem, search=replace(problem.search, seed=seed))
        started = time.perf_counter()
        result = solve(seeded)
        seconds.append(time.perf_counter() - started)
        assert result.objective is not None
        values.append(result.objective.value)
        print(problem.name, seed, values[-1], f"{seconds[-1]:.1f} s", file=sys.stderr, flush=True)
    # where all seeds leave nothing there is no share of it
    spread = max(values) / min(values) - 1.0 if min(values) > 0.0 else max(values)
    starts = "cone program, no starts" if is_convex(problem) else f"{problem.search.starts}"
    return (
        f"| `{problem.name}` | {starts} | {min(values):.8g} | {max(values):.8g} | {spread:.0e} | {max(seconds):.1f} |"
    )


def main() -> None:
    lines = [
        "# Ready problems on elastic mounts from ten seeds",
        "",
        "Objective in SI units; the spread is that of the worst seed above the best,",
        "as a share of it where it is not zero.",
        "",
        "| problem | starts | best | worst | spread | longest [s] |",
        "| --- | --- | ---: | ---: | ---: | ---: |",
        *(row_of(problem) for problem in elastic_problems()),
    ]
    publish(PAGES / "mount-seeds.md", "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
