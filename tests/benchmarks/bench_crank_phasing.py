"""Crank stars: proven search beside plain enumeration of the same objective, in one run on one core.

Writes results/benchmarks/crank-phasing.md, crank-phasing.png, and rankings.md with the ranked stars of
the ready problems. Ratios are what counts; the times are this machine's.
"""

from __future__ import annotations

import os
import statistics
import sys
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from pages import PAGES, ROOT, publish, spent

from laufruhe.extensions.long_cranks.couple_objectives import StarAmplitudes
from laufruhe.extensions.long_cranks.couple_search import search_stars
from laufruhe.files.reader import load
from laufruhe.load_models.amplitudes import AmplitudeTerm
from laufruhe.load_models.star_model import StarModel
from laufruhe.machine import Cycle
from laufruhe.machine.firing import even_patterns
from laufruhe.machine.layouts import inline
from laufruhe.physics.crank_stars import StarSpace, star_sums
from laufruhe.present.tables import Table
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.report.sections import stars
from laufruhe.solvers import solve
from laufruhe.solvers.stars.even_search import enumerate_stars
from laufruhe.solvers.stars.families import families_of
from laufruhe.solvers.stars.star_program import search_designs, solve_design

OUT = PAGES / "crank-phasing.md"
RANKED = (
    "two-stroke-four-open", "vee-six-open", "vee-eight-open", "inline-five-open", "inline-seven-uneven",
    "two-stroke-eight-uneven", "inline-nine-uneven", "vee-twenty-open",
)  # fmt: skip
COUPLE = StarAmplitudes((1, 2), (AmplitudeTerm(1.0, (0.0, 0.0), (1.0, 0.25)),))
SIZES = range(4, 14)
MOST_ENUMERATED = 12
SCORED = 400_000
ORDERS = (1, 2, 4)
TEXT = """title = "bench"
[engine]
layout = "inline"
cycle = "two-stroke"
cylinders = {n}
stroke = "120 mm"
rod_ratio = 0.26
reciprocating_mass = "1.25 kg"
cylinder_spacing = "125 mm"
throws = "open"
firing_order = "open"
[[operating_points]]
speed = "2500 rpm"
"""
COUPLE_TEXT = '[objective]\nminimise = "rms rocking couple"\norders = [1, 2]\n'
JOINT_TEXT = """
[mounts]
positions = [
    ["400 mm", "252 mm", "0 mm"], ["400 mm", "-252 mm", "0 mm"],
    ["-900 mm", "252 mm", "0 mm"], ["-900 mm", "-252 mm", "0 mm"],
]
[[counterweights]]
name = "front"
x = "300 mm"
unbalance = { between = ["0 kg m", "0.1 kg m"] }
angle = { between = [0, 360] }
[[counterweights]]
name = "rear"
x = "-300 mm"
unbalance = { between = ["0 kg m", "0.1 kg m"] }
angle = { between = [0, 360] }
[objective]
minimise = "mean mount force"
"""


@dataclass(frozen=True)
class Row:
    """Row of the table: times for the two-order couple of one number of throws."""

    throws: int
    stars: int
    search: float
    nodes: int
    enumeration: float | None
    value: float


def seconds(work: Callable[[], object], repeats: int = 3) -> float:
    """Return the median processor time."""
    times = []
    for _ in range(repeats):
        times.append(spent(work))
        if times[-1] > 2.0:
            break
    return statistics.median(times)


def quickest(work: Callable[[], object], repeats: int = 9) -> float:
    """Return the least processor time: what the code needs, without what else the machine does."""
    return min(seconds(work, 1) for _ in range(repeats))


def problem_of(text: str) -> Problem:
    """Return a problem from its text."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "bench.toml"
        path.write_text(text, encoding="utf-8")
        return load(path)


def space_of(throws: int) -> StarSpace:
    """Return the space of all stars of a two-stroke in-line engine, mirror images counted once."""
    layout = inline(throws, 1.0)
    return StarSpace(throws, even_patterns(Cycle.TWO_STROKE, layout), layout.throw_positions, True, True)


def rows() -> list[Row]:
    """Return the two-order couple, size by size."""
    out = []
    for n in SIZES:
        space = space_of(n)
        text = search_stars(space, COUPLE)
        assert text.complete
        enumeration = None
        if n <= MOST_ENUMERATED:
            start = time.process_time()
            listed = enumerate_stars(space, COUPLE)
            whole = time.process_time() - start
            assert abs(listed.values[0] - text.values[0]) <= 1e-9 * max(1.0, listed.values[0])
            enumeration = whole if n > 10 else seconds(lambda s=space: enumerate_stars(s, COUPLE))
        took = seconds(lambda s=space: search_stars(s, COUPLE))
        out.append(Row(n, space.size, took, text.nodes, enumeration, float(text.values[0])))
        print(out[-1], flush=True)
    return out


def joint(n: int) -> tuple[str, ...]:
    """Return the row of free counterweights under mean mount force: cuts, compared with every star solved."""
    problem = problem_of(TEXT.format(n=n) + JOINT_TEXT)
    phasing = problem.phasing
    assert phasing is not None
    (family,), _ = families_of(phasing)
    floor = numerical_zero(problem)
    start = time.process_time()
    model = StarModel(phasing, family.space, family.geometry)
    designs = search_designs(model, family.stars, 1, problem.tolerance, 90.0, floor)
    by_cuts = time.process_time() - start
    start = time.process_time()
    some = family.stars[:60]
    for star in some.tolist():
        solve_design(model, tuple(star), (), problem.tolerance, floor)
    every = (time.process_time() - start) * len(family.stars) / len(some)
    gap = (designs.solved[0].value - designs.lower_bound) / max(designs.solved[0].value, floor)
    return (
        f"{n}", f"{len(family.stars)}", f"{by_cuts:.2f}", f"{len(designs.solved)}", f"{gap:.1e}",
        f"{every:.1f}{'' if len(some) == len(family.stars) else ' (from 60)'}", f"{every / by_cuts:.1f}",
    )  # fmt: skip


def scoring() -> list[tuple[str, ...]]:
    """Return the stars scored a second, and how many the machine could add up."""
    rng = np.random.default_rng(0)
    a, b = np.ones(1024), np.ones(1024)
    loops = 20_000

    def adding() -> None:
        for _ in range(loops):
            np.add(a, b, out=a)

    additions = loops * len(a) / quickest(adding)
    out = []
    for n in (6, 8, 10, 12):
        stars = np.argsort(rng.random((SCORED, n)), axis=1).astype(np.uint8)
        places = inline(n, 1.0).throw_positions
        rate = SCORED / quickest(lambda s=stars, x=places, n=n: np.abs(star_sums(s, n, x, ORDERS)))
        # two complex sums an order of n terms each, and a length of each: 2 squares, a sum, a root
        work = len(ORDERS) * 2 * (2 * n + 4)
        limit = additions / work
        out.append((f"{n}", f"{rate / 1e6:.2f}", f"{work}", f"{limit / 1e6:.1f}", f"{100.0 * rate / limit:.0f} %"))
    return out


def memory() -> list[tuple[str, ...]]:
    """Return the largest memory of an enumeration."""
    out = []
    for n in (8, 9, 10, 11):
        tracemalloc.start()
        enumerate_stars(space_of(n), COUPLE)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        out.append((f"{n}", f"{space_of(n).size}", f"{peak / 2**20:.1f}"))
    return out


def table(head: tuple[str, ...], body: list[tuple[str, ...]]) -> str:
    """Return the Markdown table."""
    lines = [f"| {' | '.join(head)} |", f"| {' | '.join('---:' for _ in head)} |"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in body)])


def growth(results: list[Row]) -> None:
    """Time against size on a logarithmic scale."""
    figure = Figure(figsize=(7.0, 4.2), dpi=150)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.11, 0.13, 0.85, 0.75))
    series = (
        ("halves that meet, proven", [(r.throws, r.search) for r in results], "#0072B2", "o-"),
        ("enumeration, vectorised", [(r.throws, r.enumeration) for r in results if r.enumeration], "#8a8a8a", "s-"),
    )
    for name, points, colour, mark in series:
        axes.semilogy(*zip(*points, strict=True), mark, color=colour, label=name, markersize=5, linewidth=1.5)
    axes.set(xlabel="throws, two-stroke in-line", ylabel="time to the proven optimum [s]")
    axes.set_xticks(list(SIZES))
    axes.grid(color="#e4e4e4", linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.legend(frameon=False)
    axes.set_title("Least couple of two orders: time against the number of throws", loc="left", size=11, weight="bold")
    figure.savefig(OUT.with_suffix(".png"))


def grid_text(grid: Table) -> str:
    """Return a table of the report."""
    return f"**{grid.title}**\n\n{table(grid.head, list(grid.rows))}\n\n{grid.note}"


def rankings() -> str:
    """Return the ready problems' stars and firing orders."""
    parts = [
        "# Crank stars and firing orders, ranked",
        "Each part is one ready problem; `laufruhe solve` makes it again.",
    ]
    for name in RANKED:
        start = time.process_time()
        result = solve(load(ROOT / "problems" / f"{name}.toml"))
        took = time.process_time() - start
        certificate, objective = result.certificate, result.objective
        assert certificate is not None
        assert objective is not None
        proof = f"proof: {certificate.kind}, lower bound {certificate.lower_bound:.6g}"
        proof += f", KKT residual {certificate.kkt_residual:.0e}"
        parts.append(f"## {result.problem.title}")
        designs = f"{objective.name} {objective.value:.6g} {objective.unit}"
        parts.append(f"`problems/{name}.toml`: {designs} in {took:.1f} s of a processor; {proof}.")
        parts += [grid_text(grid) for grid in stars.crank_stars(result)]
    return "\n\n".join(parts) + "\n"


def on_one_core() -> None:
    """Start again with libraries that keep to one core; they read that on import."""
    if os.environ.get("OMP_NUM_THREADS") != "1":
        alone = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, **alone})


def main() -> None:
    """Measure and write."""
    on_one_core()
    publish(PAGES / "rankings.md", rankings())
    results = rows()
    growth(results)
    body = [
        (
            f"{r.throws}", f"{r.stars}", f"{r.search:.3f}", f"{r.nodes}",
            "" if r.enumeration is None else f"{r.enumeration:.3f}",
            "" if r.enumeration is None else f"{r.enumeration / r.search:.2f}",
            f"{r.value:.6f}",
        )
        for r in results
    ]  # fmt: skip
    head = ("throws", "stars", "search s", "nodes", "enumeration s", "enumeration / search", "least couple")
    joined = ("throws", "stars", "cuts s", "programs", "gap", "every star s", "every / cuts")
    text = [
        "# Crank phasing: time to a proven optimum",
        "Seconds of processor time on one core, medians of up to three runs.",
        "## Least couple of two orders, two-stroke in-line",
        "sqrt(C1^2 + (C2/4)^2) in forces of one throw times the spacing. Stars: with the first throw fixed; "
        "enumeration and search count images once. Search: halves that meet, which ends with a proof. Enumeration "
        "scores every star in vectorised blocks.",
        table(head, body),
        "![Time against size](crank-phasing.png)",
        "## Mean mount force, two counterweights free",
        "Cuts: cone programs of as many stars as the bounds leave in doubt. Every star: the same cone programs without "
        "bounds.",
        table(joined, [joint(n) for n in range(4, 11)]),
        f"## Scoring fixed stars: force and couple of orders {', '.join(map(str, ORDERS))}",
        "Arithmetic limit: additions of numbers in the first-level cache that NumPy makes a second on this core, over "
        "the additions and multiplications that one star needs. Throws are joined in tables, so that fewer are made. "
        "Least time of nine runs.",
        table(("throws", "million stars/s", "operations a star", "limit, million stars/s", "of the limit"), scoring()),
        "## Memory of an enumeration",
        table(("throws", "stars", "largest MiB"), memory()),
    ]
    publish(OUT, "\n\n".join(text) + "\n")


if __name__ == "__main__":
    main()
