"""Automatic against exact, batches beside the machine's matrix products, and what cost grows with, in one run.

Writes results/benchmarks/fidelity.md and fidelity.png. Ratios are what counts; the times are this machine's.
Set OMP_NUM_THREADS=1: every figure is per core.
"""

from __future__ import annotations

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    # before NumPy starts its threads
    os.environ.setdefault(name, "1")

import importlib
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from pages import PAGES, ROOT, publish, spent

from laufruhe import load
from laufruhe.files.fidelity import DEFAULT_TOLERANCE
from laufruhe.load_models.batch import prepare
from laufruhe.machine import Cycle, Engine, Mount, OperatingPoint
from laufruhe.machine.layouts import build, inline
from laufruhe.numerics.norms import NORMS
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import forget
from laufruhe.problem import channels
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve
from mechanisms import mechanism_of
from random_decisions import random_decisions

OUT = PAGES / "fidelity.md"
DESIGNS = 100_000
BATCHED = ("tractor-four-lanchester", "tractor-six", "vee-two-90", "inline-five-shafts")
SOLVED = (
    "tractor-single", "tractor-two", "tractor-three", "tractor-four-lanchester", "tractor-six", "inline-five-shafts",
    "vee-two-90", "vee-six-60", "vee-six-90", "vee-eight-cross", "vee-eight-flat", "twin-parallel-180",
    "twin-parallel-270", "twin-parallel-360", "twin-boxer", "flat-four", "flat-twelve", "inline-eight", "inline-ten",
    "inline-five-open", "two-stroke-two", "two-stroke-three", "two-stroke-five", "geared-twin",
    "opposed-pistons-masses", "single-counter-shaft", "two-machines", "radial-seven", "vee-eight-open",
    "tractor-four-shaft-heights",
)  # fmt: skip


def seconds(work: Callable[[], object], repeats: int = 5) -> float:
    """Return the least of a few calls, after one that warms caches: others may use the machine too."""
    work()
    return min(spent(work) for _ in range(repeats))


def product_rate() -> float:
    """Return the additions and multiplications a second of a large matrix product on one core."""
    a = np.random.default_rng(0).normal(size=(1200, 1200))
    return 2.0 * 1200**3 / seconds(lambda: a @ a, 12)


def automatic(problem: Problem) -> Problem:
    """Return the problem at fidelity `auto` with its default tolerance."""
    return problem.at(replace(problem.fidelity, tolerance=DEFAULT_TOLERANCE))


def solves() -> list[str]:
    """Time a solve with its error estimate, exact and automatic in turns, for quick ready problems."""
    lines = [
        "## One solve, automatic at 1e-3 against exact",
        "",
        "`laufruhe.solve` and its error estimate, exact and automatic in turns, the least of 5 each.",
        "",
        "| problem | exact | auto | ratio |",
        "| --- | ---: | ---: | ---: |",
    ]
    for name, exact, auto in solve_times():
        lines.append(f"| {name} | {1e3 * exact:.0f} ms | {1e3 * auto:.0f} ms | {auto / exact:.2f} |")
    return [*lines, ""]


def solve_times() -> Iterator[tuple[str, float, float]]:
    """Yield the name of each problem, and the processor time of an exact and of an automatic solve [s]."""
    for name in SOLVED:
        problem = load(ROOT / "problems" / f"{name}.toml")
        pair = [problem, automatic(problem)]
        times = [[_solve_time(one) for one in pair] for _ in range(6)][1:]
        exact, auto = (min(column) for column in zip(*times, strict=True))
        yield name, exact, auto


def _solve_time(problem: Problem) -> float:
    forget()
    return spent(lambda: solve(problem).error_estimate)


def batches() -> list[str]:
    """Return the rows of batches of random designs, exact and automatic in turns."""
    lines = [
        "## Many designs, automatic at 1e-3 against exact",
        "",
        "Random designs in one call, with all preparation. The error is the largest of all designs.",
        "",
        "| problem | designs | exact | auto | ratio | largest error |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for name in BATCHED:
        problem = load(ROOT / "problems" / f"{name}.toml")
        for count in (1000, 10_000, DESIGNS):
            values = random_decisions(problem, count)
            exact, auto = batch_times(problem, values)
            answers, truth = (prepare(variant).objective(values) for variant in (automatic(problem), problem))
            error = float(np.abs(answers / truth - 1.0).max())
            lines.append(
                f"| {name} | {count:,} | {1e3 * exact:.1f} ms | {1e3 * auto:.1f} ms | {auto / exact:.2f} "
                f"| {error:.1e} |"
            )
    designs, rate = prepare(automatic(load(ROOT / "problems" / f"{BATCHED[0]}.toml"))), product_rate()
    values = random_decisions(designs.model.problem, DESIGNS)
    one, both = (seconds(lambda t=t: designs.objective(values, t), 5) for t in (1, 2))
    return [
        *lines,
        "",
        f"`{BATCHED[0]}` once prepared: {DESIGNS / one / 1e6:.2f} million designs a second on one core, beside a "
        f"large matrix product of {rate / 1e9:.1f} billion operations. Two threads: {one / both:.2f} times as fast.",
        "",
    ]


def batch_times(problem: Problem, values: np.ndarray) -> tuple[float, float]:
    """Return the processor time of many designs with all preparation, exact and automatic [s]."""
    exact, auto = (
        min(spent(lambda variant=variant: prepare(variant).objective(values)) for _ in range(3))
        for variant in (problem, automatic(problem))
    )
    return exact, auto


def _mean() -> Term:
    return Term(Measure(channels.MOUNT_FORCE, NORMS["mean"]))


def _mounts(count: int) -> tuple[Mount, ...]:
    angles = [2.0 * math.pi * k / count for k in range(count)]
    return tuple(Mount(f"m{k}", (math.cos(a), 0.3 * math.sin(a), 0.0), (1.0, 1.0, 1.0)) for k, a in enumerate(angles))


def _row(cylinders: int, mounts: int, samples: int, orders: int | None) -> Callable[[], object]:
    throws = [2.0 * math.pi * k * 0.37 for k in range(cylinders)]
    parts, _ = build(Cycle.FOUR_STROKE, inline(cylinders, 0.1), mechanism_of(0.04, 0.11, 0.5), throws)
    engine = Engine("row", Cycle.FOUR_STROKE, parts, (), _mounts(mounts))
    problem = Problem("row", "row", engine, (OperatingPoint("p", 300.0),), objective=(_mean(),),
                      fidelity=Fidelity(samples=samples, orders=orders))  # fmt: skip

    def work() -> object:
        forget()
        return objective_value(problem, evaluate(problem))

    return work


def growth() -> tuple[list[str], list[tuple[str, Sequence[int], list[float], float]]]:
    """Time of one evaluation from nothing, by what it grows with, and its exponent at the large end."""
    sweeps: list[tuple[str, Sequence[int], Callable[[int], Callable[[], object]]]] = [
        ("cylinders", (1, 3, 6, 12, 24, 48), lambda n: _row(n, 4, 720, None)),
        ("orders kept", (2, 4, 8, 16, 32), lambda n: _row(4, 4, 720, n)),
        ("mounts", (4, 8, 16, 32, 64, 128), lambda n: _row(4, n, 720, None)),
        ("samples", (360, 720, 1440, 2880, 5760, 11520), lambda n: _row(4, 4, n, None)),
    ]
    lines = [
        "## What cost grows with",
        "",
        "| with | from | to | time | exponent at the large end |",
        "| --- | ---: | ---: | ---: | ---: |",
    ]
    rows = []
    for name, sizes, make in sweeps:
        works = [make(n) for n in sizes]
        # in turns, so that a busy minute of the machine slows all sizes
        rounds = [[seconds(work, 3) for work in works] for _ in range(20)]
        times = [min(column) for column in zip(*rounds, strict=True)]
        exponent = math.log(times[-1] / times[-3]) / math.log(sizes[-1] / sizes[-3])
        rows.append((name, sizes, times, exponent))
        lines.append(
            f"| {name} | {sizes[0]} | {sizes[-1]} | {1e3 * times[0]:.2f} to {1e3 * times[-1]:.2f} ms | {exponent:.2f} |"
        )
    return [*lines, "", "![Time against cylinders, orders, mounts and samples](fidelity.png)"], rows


def draw(rows: list[tuple[str, Sequence[int], list[float], float]], path: Path) -> None:
    """Draw four lines on one panel, sizes over the smallest of each."""
    style = importlib.import_module("laufruhe.plots.style")
    from matplotlib.ticker import FuncFormatter, LogLocator

    drawn = style.page(1, 1, (6.4, 3.8))
    axes = drawn.panels[0]
    for (name, sizes, times, exponent), colour in zip(rows, ("#0072B2", "#D55E00", "#009E73", "#555555"), strict=True):
        axes.plot([n / sizes[0] for n in sizes], [1e3 * t for t in times], "o-", color=colour, lw=1.3, ms=4)
        axes.annotate(f"{name}, {exponent:.2f}", (sizes[-1] / sizes[0], 1e3 * times[-1]), xytext=(6, 0),
                      textcoords="offset points", va="center", fontsize=8, color=colour)  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel="size over the smallest", ylabel="one evaluation [ms]")
    axes.set_xlim(0.9, 160.0)
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0)))
    plain = FuncFormatter(lambda value, _: f"{value:g}")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(plain)
        axis.set_minor_formatter(FuncFormatter(lambda *_: ""))
    text = "One evaluation from nothing; beside each line its exponent."
    style.heading(drawn, "What cost grows with", text, [],
                  "In-line engines without gas, exact kinematics. Computed with Laufruhe.")  # fmt: skip
    style.save(drawn.figure, path)


def main() -> None:
    """Measure and write."""
    lines = ["# Fidelity, batches and growth", "", "Processor time, the least of several calls on one core.", ""]
    table, rows = growth()
    text = "\n".join([*lines, *solves(), *batches(), *table]) + "\n"
    publish(OUT, text)
    draw(rows, OUT.with_suffix(".png"))


if __name__ == "__main__":
    sys.exit(main())
