"""Ready problems on elastic mounts from several seeds each.

Writes results/benchmarks/mount-seeds.md. `--seeds 10` takes ten minutes of a processor.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

from pages import PAGES, processor_seconds, publish

from laufruhe.files.reader import load
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve
from laufruhe.solvers.mounts.convex import is_convex
from problem_files import ELASTIC

# number of starts of an open star; the ready problem itself takes all of them
STARS = 12


def elastic_problems() -> list[Problem]:
    """Return the ready problems that leave mounts open."""
    return [problem for problem in map(load, ELASTIC) if problem.mount_decisions]


def row_of(problem: Problem, seeds: int) -> str:
    """Return the row of one problem over several seeds."""
    values, seconds = [], []
    if problem.phasing is not None:
        problem = replace(problem, phasing=replace(problem.phasing, best=STARS))
    for seed in range(seeds):
        seeded = replace(problem, search=replace(problem.search, seed=seed))
        started = processor_seconds()
        result = solve(seeded)
        seconds.append(processor_seconds() - started)
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
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    seeds = parser.parse_args().seeds
    lines = [
        "# Ready problems on elastic mounts from several seeds",
        "",
        f"Each from {seeds} seeds: objective in SI units, what its worst seed is above the best as a share of that",
        "(the worst itself where the best is zero), and seconds of processors. Of stars that are open the search looks",
        f"at the best {STARS} alone.",
        "",
        "| problem | starts | best | worst | spread | longest [s] |",
        "| --- | --- | ---: | ---: | ---: | ---: |",
        *(row_of(problem, seeds) for problem in elastic_problems()),
    ]
    publish(PAGES / "mount-seeds.md", "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
