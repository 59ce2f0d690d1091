"""Growth of time and memory: one design evaluated, unbalances decided, stars searched, stiffness decided.

Writes results/benchmarks/growth.md. Each size runs in a forked process of its own, whose largest memory is read;
exponents are fitted to the larger half of the sizes. `--quick` takes the smaller half.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import os
import resource
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain
from multiprocessing.connection import wait
from typing import Any

import numpy as np
from pages import PAGES, ROOT, publish

from laufruhe import evaluate_many, load, solve
from laufruhe.physics.shaking_loads import forget
from laufruhe.problem.evaluation import evaluate, objective_value

OUT = PAGES / "growth.md"
# an evaluation is repeated for so long [s], and the least of so many rounds is taken
LONG_ENOUGH, ROUNDS = 0.03, 5
ELASTIC_SPRINGS = 6
MEGABYTE = 1e6
# a forked process touches some 10 MB whatever it does, so less than this says nothing about growth [MB]
NOISE = 14.0
# designs that are evaluated in one call, in two sizes
SMALL, MANY = 20_000, 200_000


def scene(
    cylinders: int = 4, *, counterweights: int = 0, shafts: int = 2, points: int = 1, mounts: int = 4,
    samples: int | None = None, orders: int | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Return a row of cylinders on rigid mounts; every counterweight has two open numbers, every shaft one."""
    length = 0.125 * cylinders
    tables: dict[str, Any] = {
        "title": "row",
        "engine": {
            "layout": "inline", "cycle": "four-stroke", "cylinders": cylinders, "stroke": "120 mm", "rod_ratio": 0.26,
            "reciprocating_mass": "1.25 kg", "cylinder_spacing": "125 mm",
            "throws": [round(137.5 * k % 360.0, 1) for k in range(cylinders)],
        },
        "operating_points": [{"name": f"p{k}", "speed": f"{800 + 3000 * k / points:.3f} rpm"} for k in range(points)],
        "mounts": {"positions": [
            [f"{length * math.cos(a):.6f} m", f"{0.3 * math.sin(a):.6f} m", "0 m"]
            for a in 2.0 * math.pi * (np.arange(mounts) + 0.5) / mounts
        ]},
        "counterweights": [
            {"name": f"w{k}", "x": f"{length * (k / max(counterweights - 1, 1) - 0.5):.6f} m", "radius": "80 mm",
             "mass": {"between": ["0 kg", "3 kg"]}, "angle": {"between": [0, 360]}}
            for k in range(counterweights)
        ],
        "balancer_shafts": [
            {"name": f"s{k}", "ratio": (2, -2, 1, -1)[k % 4], "position": [f"{100 - 200 * (k % 2)} mm", "-100 mm"],
             "unbalances": [{"x": f"{length * (k / max(shafts - 1, 1) - 0.5):.6f} m", "radius": "20 mm",
                             "unbalance": {"between": ["0 kg m", "0.05 kg m"]}, "angle": {"between": [0, 360]}}]}
            for k in range(shafts)
        ],
        "objective": {"minimise": "mean mount force"},
    }  # fmt: skip
    fidelity = {k: v for k, v in (("samples", samples), ("orders", orders)) if v is not None}
    return {**{k: v for k, v in tables.items() if v}, **({"fidelity": fidelity} if fidelity else {})}


def star(cylinders: int) -> dict[str, Any]:
    """Return a problem with open crank and firing order."""
    engine = {**scene(cylinders)["engine"], "throws": "open", "firing_order": "open"}
    points = [{"speed": "600 rpm"}]
    return {
        "title": "star", "engine": engine, "operating_points": points, "phasing": {"best": 8},
        "objective": {"minimise": "rms rocking couple", "orders": [1, 2]},
    }  # fmt: skip


def two_stroke_star(cylinders: int) -> dict[str, Any]:
    """Return a two-stroke with an open crank, each throw on its own step, so that some couple remains."""
    tables = star(cylinders)
    return {**tables, "engine": {**tables["engine"], "cycle": "two-stroke"}, "phasing": {"best": 1}}


def crank(cylinders: int, gas: bool) -> dict[str, Any]:
    """Return a two-stroke on rigid mounts with open crank and firing order, each throw on its own step."""
    tables = scene(cylinders, shafts=0)
    engine = {**tables["engine"], "cycle": "two-stroke", "bore": "100 mm", "throws": "open", "firing_order": "open"}
    fired = {"model": "wiebe", "imep": "5.5 bar", "start": -5, "duration": 50, "compression_ratio": 17}
    return {**tables, "engine": engine, **({"gas": fired} if gas else {})}


def elastic(springs: int, points: int = 1, cylinders: int = 4) -> dict[str, Any]:
    """Return a problem with so many open stiffnesses of four mounts."""
    left = iter(range(springs))
    places = []
    for k, (x, y) in enumerate([(0.3, 0.2), (0.32, -0.22), (-0.4, 0.2), (-0.38, -0.21)]):
        numbers = ["200 N/mm", "200 N/mm", "700 N/mm"]
        stiffness = [
            {"between": ["60 N/mm", "1200 N/mm"], "start": number} if next(left, None) is not None else number
            for number in numbers
        ]
        places.append({"name": f"m{k}", "position": [f"{x} m", f"{y} m", "0 m"], "stiffness": stiffness})
    tables = scene(cylinders, shafts=0, points=points)
    order = [1, 3, 4, 2] if cylinders == 4 else list(range(1, cylinders + 1))
    engine = {key: value for key, value in tables["engine"].items() if key != "throws"}
    engine |= {"bore": "100 mm", "firing_order": order}
    return {
        **tables, "engine": engine,
        "gas": {"model": "wiebe", "imep": "5.5 bar", "start": -5, "duration": 50, "compression_ratio": 17},
        "block": {"mass": "420 kg", "centre_of_gravity": ["-60 mm", "0 mm", "120 mm"],
                  "inertia": ["27 kg m^2", "62 kg m^2", "50 kg m^2"]},
        "mounts": {"kind": "elastic", "loss_factor": 0.1, "places": places},
        "objective": {"minimise": "rms mount force", "orders": [2, 4]},
        "constraints": [{"limit": "static sag", "max": "6 mm"}],
        "search": {"starts": 8},
    }  # fmt: skip


def evaluated(tables: dict[str, Any]) -> float:
    """Return the seconds of one evaluation from nothing, the least of several."""
    problem = load(tables)

    def work() -> float:
        forget()
        return objective_value(problem, evaluate(problem))

    work()
    best = math.inf
    for _ in range(ROUNDS):
        began, count = time.process_time(), 0
        while time.process_time() - began < LONG_ENOUGH:
            work()
            count += 1
        best = min(best, (time.process_time() - began) / count)
    return best


def solved(tables: dict[str, Any]) -> float:
    """Return the seconds of one solve."""
    return proven(tables)[0]


def proven(tables: dict[str, Any]) -> tuple[float, str]:
    """Return the seconds of one solve, and how good its answer is known to be."""
    problem = load(tables)
    began = time.process_time()
    result = solve(problem)
    took = time.process_time() - began
    proof = result.certificate
    assert result.objective is not None, result.message
    assert proof is not None
    return took, f"{proof.kind}, gap {proof.gap:.0e}" if proof.gap else f"{proof.kind}"


def in_processes(works: Sequence[Callable[[], Any]]) -> list[tuple[Any, float]]:
    """Return the answers of works, each in a forked process on one processor, and the memory that each added [MB]."""
    context, free = multiprocessing.get_context("fork"), sorted(os.sched_getaffinity(0))
    answers: list[Any] = [None] * len(works)
    running: dict[Any, tuple[int, int, Any]] = {}
    for number, work in enumerate(works):
        receiver, sender = context.Pipe(duplex=False)
        if not free:
            _receive(running, answers, free)
        cpu = free.pop()
        process = context.Process(target=_child, args=(work, cpu, sender))
        process.start()
        sender.close()
        running[receiver] = number, cpu, process
    while running:
        _receive(running, answers, free)
    return answers


def _child(work: Callable[[], Any], cpu: int, sender: Any) -> None:
    # one processor: what is measured is work, not how it is shared
    os.sched_setaffinity(0, {cpu})
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    answer = work()
    added = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    sender.send((answer, 1024.0 * added / MEGABYTE))


def _receive(running: dict[Any, tuple[int, int, Any]], answers: list[Any], free: list[int]) -> None:
    for receiver in wait(list(running)):
        number, cpu, process = running.pop(receiver)
        answers[number] = receiver.recv()
        process.join()
        free.append(cpu)
        print(f"{sum(answer is not None for answer in answers)} of {len(answers)}", flush=True)


@dataclass(frozen=True)
class Sweep:
    """A cost that grows with a size of the problem."""

    what: str
    by: str
    sizes: Sequence[int]
    tables: Callable[[int], dict[str, Any]]
    measured: Callable[[dict[str, Any]], float]
    grows_by_factor: bool = False

    def works(self, quick: bool) -> list[Callable[[], float]]:
        """Return what is to be done for each size; `quick` leaves the larger half out."""
        sizes = self.sizes[: (len(self.sizes) + 1) // 2 + 1] if quick else self.sizes
        return [lambda n=n: self.measured(self.tables(n)) for n in sizes]

    def row(self, answers: Sequence[tuple[float, float]]) -> str:
        """Return times and memory of the sizes, with their exponents."""
        sizes, fitted = self.sizes[: len(answers)], factor if self.grows_by_factor else exponent
        times, memory = [seconds for seconds, _ in answers], [added for _, added in answers]
        sign = "x " if self.grows_by_factor else ""
        grows = f"{sign}{fitted(sizes, memory):.2f}" if min(memory[len(memory) // 2 :]) >= NOISE else ""
        cells = (", ".join(map(str, sizes)), ", ".join(map(seconds_text, times)), f"{sign}{fitted(sizes, times):.2f}",
                 ", ".join(f"{added:.0f}" for added in memory), grows)  # fmt: skip
        return f"| {self.what} | {self.by} | {' | '.join(cells)} |"


SWEEPS = (
    Sweep("evaluate", "cylinders", (1, 3, 6, 12, 24, 48), lambda n: scene(n, samples=720), evaluated),
    Sweep("evaluate", "orders kept", (2, 4, 8, 16, 32), lambda n: scene(samples=720, orders=n), evaluated),
    Sweep("evaluate", "samples", (360, 720, 1440, 2880, 5760), lambda n: scene(samples=n), evaluated),
    Sweep("evaluate", "mounts", (4, 8, 16, 32, 64), lambda n: scene(mounts=n, samples=720), evaluated),
    Sweep("evaluate", "operating points", (1, 3, 10, 30, 100), lambda n: scene(points=n, samples=720), evaluated),
    Sweep("evaluate", "shafts", (2, 6, 16, 50), lambda n: scene(shafts=n, samples=720), evaluated),
    Sweep("solve unbalances", "cylinders", (1, 3, 6, 12, 24, 48), lambda n: scene(n), solved),
    Sweep("solve unbalances", "orders kept", (2, 4, 8, 16, 32), lambda n: scene(orders=n), solved),
    Sweep("solve unbalances", "samples", (360, 720, 1440, 2880), lambda n: scene(samples=n), solved),
    Sweep("solve unbalances", "mounts", (4, 8, 16, 32), lambda n: scene(mounts=n), solved),
    Sweep("solve unbalances", "operating points", (1, 3, 10, 30, 100), lambda n: scene(points=n), solved),
    Sweep("solve unbalances", "shafts", (2, 6, 16, 50), lambda n: scene(shafts=n), solved),
    Sweep("solve unbalances", "counterweights", (2, 6, 16, 50), lambda n: scene(shafts=0, counterweights=n), solved),
    Sweep("search stars", "cylinders", (4, 5, 6, 7, 8, 9, 10, 12), star, solved, True),
    Sweep("search stars, two-stroke", "throws", (11, 12, 13, 14, 16, 17), two_stroke_star, solved, True),
    Sweep("decide stiffness", "springs", (1, 2, 4, 6, 9, 12), elastic, solved),
    Sweep("decide stiffness", "operating points", (1, 2, 4, 8, 16), lambda n: elastic(ELASTIC_SPRINGS, n), solved),
)  # fmt: skip
LARGE = (
    ("48 cylinders, two shafts open, one point", lambda: scene(48)),
    ("48 cylinders, 50 unbalances open, one point", lambda: scene(48, shafts=0, counterweights=50)),
    ("4 cylinders, two shafts open, 100 points", lambda: scene(points=100)),
    ("12 cylinders, 50 unbalances open, 10 points", lambda: scene(12, shafts=0, counterweights=50, points=10)),
    ("48 cylinders, 25 unbalances open, 100 points", lambda: scene(48, shafts=0, counterweights=25, points=100)),
    ("48 cylinders, crank and firing order open", lambda: star(48)),
    ("15 throws of a two-stroke open, mean mount force", lambda: crank(15, False)),
    ("47 throws of a two-stroke open, with gas", lambda: crank(47, True)),
    ("48 throws of a two-stroke open, with gas", lambda: crank(48, True)),
    ("48 cylinders, six springs open", lambda: elastic(ELASTIC_SPRINGS, cylinders=48)),
    ("4 cylinders, six springs open, 100 points", lambda: elastic(ELASTIC_SPRINGS, 100)),
)


def one_cylinder() -> dict[str, Any]:
    """Return a single-cylinder at 144 samples."""
    return scene(1, shafts=1, samples=144)


DESIGNS = (
    ("single-cylinder, one shaft open, 144 samples", one_cylinder),
    ("`problems/tractor-four-lanchester.toml`", lambda: ROOT / "problems" / "tractor-four-lanchester.toml"),
    ("4 cylinders, two shafts open, 10 points", lambda: scene(points=10)),
    ("12 cylinders, 50 unbalances open, one point", lambda: scene(12, shafts=0, counterweights=50)),
)


def many_designs(source: Any, count: int) -> float:
    """Return the seconds of so many random designs in one call, each with unbalances anywhere in the circle."""
    problem, random = load(source), np.random.default_rng(1)
    designs = {decision.name: random.uniform(decision.lower, decision.upper, count) for decision in problem.decisions}
    designs |= {decision.angle_name: random.uniform(0.0, math.tau, count) for decision in problem.decisions}
    began = time.process_time()
    table = evaluate_many(problem, designs)
    took = time.process_time() - began
    assert np.isfinite(table["objective"]).all()
    return took


def designs_row(name: str, answers: Sequence[tuple[float, float]]) -> str:
    """Return time and memory of one more design by two sizes, and of a thousand million by extrapolation."""
    (small, few_memory), (many, many_memory) = answers
    seconds_each, size = (many - small) / (MANY - SMALL), MEGABYTE * (many_memory - few_memory) / (MANY - SMALL)
    return (f"| {name} | {seconds_text(small)} | {seconds_text(many)} | {1e6 * seconds_each:.2g} µs | {size:.0f} B "
            f"| {1e9 * seconds_each / 3600.0:.2g} h | {size:,.0f} GB |")  # fmt: skip


def exponent(sizes: Sequence[int], times: Sequence[float]) -> float:
    """Return the exponent of the larger half of the sizes, by least squares of the logarithms."""
    first = len(sizes) // 2 - (len(sizes) == 2)
    slope = np.polyfit(np.log(sizes[first:]), np.log(times[first:]), 1)[0]
    return float(slope)


def factor(sizes: Sequence[int], times: Sequence[float]) -> float:
    """Return the factor of time for each further one, over the larger half."""
    first = len(sizes) // 2
    return float(np.exp(np.polyfit(sizes[first:], np.log(times[first:]), 1)[0]))


def seconds_text(seconds: float) -> str:
    """Return a time [s] in a readable unit."""
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"


def main() -> None:
    """Measure one sweep after the other."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    for tables in (scene(), star(4), elastic(2)):
        # libraries are loaded before the clock starts
        solved(tables)
    lines = [
        "# What cost grows with",
        "",
        "Processor time, and memory that the work added to its process, each size in a process of its own; libraries",
        "are loaded before. Rows of cylinders without gas on four rigid mounts, two shafts of open size and angle,",
        "unless the column says otherwise; stars by the rms rocking couple; stiffness on elastic mounts with gas, and",
        "six springs where points grow. Exponents are fitted to the larger half of the sizes; of stars the factor for",
        "each further cylinder or throw. A process adds some 10 MB whatever it does;",
        f"under {NOISE:.0f} MB there is no exponent.",
        "",
        "| what | grows with | sizes | processor time | exponent | memory [MB] | exponent |",
        "| --- | --- | --- | --- | ---: | --- | ---: |",
    ]
    large, designs = () if quick else LARGE, DESIGNS[:1] if quick else DESIGNS
    works: list[list[Callable[[], Any]]] = [sweep.works(quick) for sweep in SWEEPS]
    works += [[lambda make=make: evaluated(make()), lambda make=make: proven(make())] for _, make in large]
    works += [[lambda make=make, n=n: many_designs(make(), n) for n in (SMALL, MANY)] for _, make in designs]
    flat = iter(in_processes(list(chain(*works))))
    answers = [[next(flat) for _ in group] for group in works]
    lines += [sweep.row(answer) for sweep, answer in zip(SWEEPS, answers, strict=False)]
    lines += ["", "## What to expect of large problems", ""]
    lines += ["| problem | evaluate | solve | memory [MB] | what is proven |", "| --- | ---: | ---: | ---: | --- |"]
    for (name, _), ((seconds, _), ((took, proof), added)) in zip(large, answers[len(SWEEPS) :], strict=False):
        lines.append(f"| {name} | {seconds_text(seconds)} | {seconds_text(took)} | {added:.0f} | {proof} |")
    lines += ["", "## A thousand million designs, by extrapolation", ""]
    lines += [
        f"`laufruhe.evaluate_many` was run with {SMALL:,} and {MANY:,} designs of random unbalances. The difference is",
        "the cost of one more design, and a thousand million times that the last two columns: of one core, and of one",
        "table with all designs. Pieces of a million designs need a thousandth of that memory.",
        "",
        f"| problem | {SMALL:,} | {MANY:,} | one more | memory of one more | 1e9: one core | 1e9: memory |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for (name, _), answer in zip(designs, answers[len(SWEEPS) + len(large) :], strict=True):
        lines.append(designs_row(name, answer))
    publish(OUT, "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
