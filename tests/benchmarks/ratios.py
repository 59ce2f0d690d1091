"""Times of work over those of a neighbour, beside the ratio of the first measurement; for bench_speed.py."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from bench_cluster import timed
from bench_cones import LARGE, WAYS, measured, ready_times
from bench_fidelity import BATCHED, batch_times, solve_times
from bench_growth import two_stroke_star
from bench_solve import DRAWS, NAMES, PROBLEM, PROBLEMS, READS, in_turns, seconds
from bench_trade import AUTO, call_times, scene_time
from pages import processor_seconds, spent

import laufruhe
from laufruhe.numerics.cores import ONE_THREAD
from random_decisions import random_decisions
from studies import clusters

Row = tuple[str, str, str, str]
"""Work, its neighbour, and the ratio of their times at first and now."""
DESIGNS = 10_000
TURNS = 3
STAR_SECONDS = 300.0
"""Time limit on all processors [s]; 19 throws take 250 s of a processor."""
CLOSE = 0.2
THREADED = ("tractor-four-lanchester", "tractor-two")
# solves are repeated so often that a process lives long enough for its clock
SOLVES = """
import json, sys, time, laufruhe
def solved():
    started = time.process_time()
    laufruhe.solve(laufruhe.load(sys.argv[1]))
    return time.process_time() - started
solved()
print(json.dumps(min(solved() for _ in range(7))))
"""


def neighbours(forces: Mapping[str, float], designs: Mapping[str, float]) -> Iterator[Row]:
    """Yield all rows; `forces` and `designs` are the times of bench_speed.py by what computes them."""
    yield from _cones()
    plain = forces["NumPy, everything anew"]
    yield "forces with gas, new rods", "NumPy", "8", f"{forces['this package, new rods'] / plain:.2f}"
    yield "forces with gas, new speed", "NumPy", "3", f"{forces['this package, new speed'] / plain:.2f}"
    yield from _automatic()
    yield _trade()
    yield from _commands()
    yield from _threads()
    yield _robust()
    yield from _stars()
    yield _random_designs()
    batch, loop = (next(time for what, time in designs.items() if word in what) for word in ("evaluate_many", "loop"))
    yield "`with_values` and `evaluate` in a loop", "`evaluate_many`", "440", f"{loop / batch:.0f}"


def _cones() -> Iterator[Row]:
    rival = "cone programs of all rows and columns"
    count, package, other = ready_times()
    yield f"cone step of {count} ready problems with open unbalances alone", rival, "1", f"{package / other:.2f}"
    for size in LARGE:
        package, other = (min(run[0] for run in runs) for runs in zip(*_large(size), strict=True))
        yield f"the same of {size}", rival, "1", f"{package / other:.2f}"


def _large(size: str) -> Iterator[list[list[float]]]:
    for _ in range(TURNS):
        yield [measured(size, name) for name in WAYS]


def _automatic() -> Iterator[Row]:
    ratios = [auto / exact for _, exact, auto in solve_times()]
    largest = f"median {statistics.median(ratios):.2f}, largest {max(ratios):.2f}"
    yield f"`auto` at 1e-3, one solve of {len(ratios)} problems", "exact", "median 1.7, largest 4.4", largest
    problems = [laufruhe.load(PROBLEMS / f"{name}.toml") for name in BATCHED]
    times = [batch_times(problem, random_decisions(problem, DESIGNS)) for problem in problems]
    ratio = statistics.median(auto / exact for exact, auto in times)
    yield f"`auto` at 1e-3, {DESIGNS:,} designs of {len(times)} problems", "exact", "-", f"median {ratio:.2f}"
    ratios = []
    for problem in problems:
        turns = [(scene_time(problem, AUTO), scene_time(problem, {"kinematics": "exact"})) for _ in range(TURNS)]
        auto, exact = (min(times) for times in zip(*turns, strict=True))
        ratios.append(auto / exact)
    yield (
        f"`auto` at 1e-3, scene of a sweep of {len(ratios)} problems",
        "exact",
        "-",
        (f"median {statistics.median(ratios):.2f}, largest {max(ratios):.2f}"),
    )


def _trade() -> Row:
    ratios = [price / alone for *_, price, alone in call_times()]
    close = sum(abs(ratio - 1.0) <= CLOSE for ratio in ratios)
    text = f"{min(ratios):.2f} to {max(ratios):.2f}; {close} of {len(ratios)} within {100.0 * CLOSE:.0f} %"
    return "times that `trade` shows", "the same calls alone", "0.01 (one solve)", text


def _commands() -> Iterator[Row]:
    commands = (("check", READS, "2.6"), ("solve", DRAWS, "3.9"))
    with TemporaryDirectory() as compiled:
        for command, imports, first in commands:
            package, other = in_turns(
                partial(seconds, [sys.executable, "-m", "laufruhe", command, str(PROBLEM)], compiled),
                partial(seconds, [sys.executable, "-c", imports], compiled),
                5,
            )
            what = f"`laufruhe {command}`" + (" with pictures" if command == "solve" else "")
            yield f"{what}, {PROBLEM.stem}", NAMES[imports], first, f"{package[0] / other[0]:.2f}"


def _threads() -> Iterator[Row]:
    free = {name: value for name, value in os.environ.items() if name not in ONE_THREAD}
    for name in THREADED:
        command = [sys.executable, "-c", SOLVES, str(PROBLEMS / f"{name}.toml")]
        package, one = (
            json.loads(subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout)
            for environment in (free, free | ONE_THREAD)
        )
        yield f"`laufruhe.solve` from Python, {name}", "one BLAS thread", "1.6 to 3.3", f"{package / one:.2f}"


def _robust() -> Row:
    problem = laufruhe.load(PROBLEMS / "tractor-four-robust.toml")
    return f"`{problem.name}`, one process", "-", "17.5 s", f"{spent(lambda: laufruhe.solve(problem)):.1f} s"


def _stars() -> Iterator[Row]:
    for throws in (17, 18, 19):
        problem, started = laufruhe.load(two_stroke_star(throws)), processor_seconds()
        proof = laufruhe.solve(problem, time_limit=STAR_SECONDS).certificate
        took = processor_seconds() - started
        assert proof is not None
        now = f"{proof.kind}, gap {proof.gap:.0e} after {took:.1f} s"
        yield f"star of {throws} two-stroke throws", "-", "gap 1.0 after 1.5 s", now


def _random_designs() -> Row:
    with TemporaryDirectory() as folder:
        studies = [
            clusters.prepared(Path(folder) / f"{draws}", draws=draws, chunk=10_000, scenes=1, points=2)
            for draws in (100_000, 200_000)
        ]
        short, many = (timed(study, "--jobs", "1")[1] for study in studies)
    return "study of 100,000 random designs", "of 200,000", "3.1", f"{short / many:.2f}"
