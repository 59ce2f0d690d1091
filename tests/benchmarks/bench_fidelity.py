"""Automatic against exact, batches beside the machine's matrix products, and what cost grows with, in one run.

Writes results/benchmarks/fidelity.md and fidelity.png. Ratios are what counts; the times are this machine's.
Set OMP_NUM_THREADS=1: every figure is per core.
"""

from __future__ import annotations

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    # before NumPy starts its threads
    os.environ.setdefault(name, "1")

import importlib  # noqa: E402
import math  # noqa: E402
import sys  # noqa: E402
from collections.abc import Callable, Sequence  # noqa: E402
from dataclasses import replace  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402
from pages import PAGES, ROOT, publish, spent  # noqa: E402

from laufruhe import load  # noqa: E402
from laufruhe.fidelity.automatic import automatic, choose  # noqa: E402
from laufruhe.load_models.batch import BatchNorm, Designs, prepare  # noqa: E402
from laufruhe.machine import Cycle, Engine, Mount, OperatingPoint  # noqa: E402
from laufruhe.machine.layouts import Mechanism, boxer, build, inline  # noqa: E402
from laufruhe.numerics.norms import NORMS, Grid  # noqa: E402
from laufruhe.physics.fidelity import Fidelity  # noqa: E402
from laufruhe.physics.shaking_loads import forget  # noqa: E402
from laufruhe.problem import channels  # noqa: E402
from laufruhe.problem.evaluation import evaluate, objective_value  # noqa: E402
from laufruhe.problem.measure import Measure, Term  # noqa: E402
from laufruhe.problem.problem import Problem  # noqa: E402
from random_decisions import random_decisions  # noqa: E402

OUT = PAGES / "fidelity.md"
DESIGNS = 100_000


def seconds(work: Callable[[], object], repeats: int = 5) -> float:
    """Least of a few calls, after one that warms caches: others may use the machine too."""
    work()
    return min(spent(work) for _ in range(repeats))


def product_rate() -> float:
    """Additions and multiplications a second of a large matrix product on one core."""
    a = np.random.default_rng(0).normal(size=(1200, 1200))
    return 2.0 * 1200**3 / seconds(lambda: a @ a, 12)


def four_cylinder() -> list[str]:
    """Automatic at 1e-3 against exact at 720 samples, like for like."""
    problem = load(ROOT / "problems" / "tractor-four-lanchester.toml")
    exact = replace(problem, fidelity=Fidelity(samples=720))
    auto = automatic(problem, 1e-3)
    cheap, whole = prepare(auto), prepare(exact, prune=False)
    values = random_decisions(problem, DESIGNS)
    engine = problem.design(list(values[0]))
    unseen, heavier, known = (
        [seconds(work(p, engine), 200) for p in (exact, auto)] for work in (_other_rods, _other_pistons, _other_rotors)
    )
    x = np.concatenate([[1.0], *(d.columns_of(u) for d, u in zip(cheap.model.domains, values[0], strict=True))])
    one_whole, one = (seconds(lambda d=d: d.objective_from_features(x[None]), 2000) for d in (whole, cheap))
    empty = _one_row(cheap)
    floor = seconds(lambda: empty.objective_from_features(x[None]), 2000)
    many_whole, many = (seconds(lambda d=d: d.objective(values), 12) for d in (whole, cheap))
    choosing = seconds(lambda: (forget(), choose(problem, 1e-3)), 3)
    rate = product_rate()
    operations = sum(2 * norm.rows.size for _, norm in cheap.terms)
    both = seconds(lambda: cheap.objective(values, threads=2), 12)
    error = float(np.abs(cheap.objective(values[:2000]) / whole.objective(values[:2000]) - 1.0).max())

    def line(what: str, pair: Sequence[float]) -> str:
        return f"| {what} | {1e6 * pair[0]:.1f} us | {1e6 * pair[1]:.1f} us | {pair[0] / pair[1]:.1f} |"

    return [
        "## Automatic at 1e-3 against exact at 720 samples",
        "",
        "Mean mount force of `problems/tractor-four-lanchester.toml`; exact samples the whole cycle, nothing pruned.",
        "",
        "| what | exact | auto | ratio |",
        "| --- | ---: | ---: | ---: |",
        line("from an engine object whose rods were never seen", unseen),
        line("from an engine object, the masses of its pistons new", heavier),
        line("from an engine object, the rotors new", known),
        line("one design of a prepared scene, the decisions new", (one_whole, one)),
        f"| {DESIGNS} designs of a prepared scene in one call | {many_whole:.2f} s | {many:.3f} s "
        f"| {many_whole / many:.1f} |",
        "",
        f"One design of a prepared scene is a handful of NumPy calls: on a single row they take {1e6 * floor:.1f} us. "
        f"With no angle left at all the ratio could be {one_whole / floor:.1f}, so ten times is out of reach there. "
        "From an engine object both pay for the rotors, the mounts and the objects, and, where rods are new, "
        "for the gas. Where there is much to do, in batches, what is left out is what is saved. "
        f"From exact engine objects with new rotors to automatic and prepared it is {known[0] / one:.0f} times: "
        f"{known[0] / one_whole:.0f} by preparing, {one_whole / one:.1f} by what is left out.",
        "",
        f"Choosing takes {1e3 * choosing:.0f} ms, once for a scene. "
        f"Largest disagreement over 2000 random designs {error:.1e}.",
        "",
        f"Batch throughput on one core: {DESIGNS / many / 1e6:.2f} million designs a second, "
        f"{operations * DESIGNS / many / 1e9:.1f} billion operations of its matrix products a second, "
        f"{operations * DESIGNS / many / rate:.2f} of this machine's large matrix product "
        f"({rate / 1e9:.1f} billion). "
        f"Squares, roots and sums of the norm are not counted as work. Two threads: {many / both:.2f} times as fast.",
        "",
    ]


def _other_rods(problem: Problem, engine: Engine) -> Callable[[], object]:
    """Objective of engines whose rods differ in length from call to call."""
    return _other_parts(problem, engine, "rod_length")


def _other_pistons(problem: Problem, engine: Engine) -> Callable[[], object]:
    """Objective of engines whose pistons differ in mass from call to call."""
    return _other_parts(problem, engine, "reciprocating_mass")


def _other_parts(problem: Problem, engine: Engine, number: str) -> Callable[[], object]:
    count = iter(range(1, 10**9))

    def work() -> object:
        factor = 1.0 + 1e-9 * next(count)
        parts = tuple(replace(p, **{number: factor * getattr(p, number)}) for p in engine.slider_cranks)
        return objective_value(problem, evaluate(problem, replace(engine, slider_cranks=parts)))

    return work


def _other_rotors(problem: Problem, engine: Engine) -> Callable[[], object]:
    """Objective of engines whose unbalances differ from call to call."""
    count = iter(range(1, 10**9))

    def work() -> object:
        factor = 1.0 + 1e-9 * next(count)
        rotors = tuple(replace(rotor, unbalance=factor * rotor.unbalance) for rotor in engine.rotors)
        return objective_value(problem, evaluate(problem, replace(engine, rotors=rotors)))

    return work


def _one_row(designs: Designs) -> Designs:
    """The same calls with nothing to do."""
    terms = tuple(
        (weight, BatchNorm(norm.norm, np.ascontiguousarray(norm.rows[:, :, :1]), Grid(norm.grid.weights[:1], 1)))
        for weight, norm in designs.terms
    )
    return replace(designs, terms=terms)


def pruned() -> list[str]:
    """ProblemFiles whose symmetry leaves something out, beside themselves with nothing left out."""
    lines = [
        "## What pruning alone gives",
        "",
        "720 samples, exact kinematics; only what is exactly zero or repeats is left out. The result is the same.",
        "",
        "| scene | numbers sampled, whole / pruned | ratio | time ratio, 2000 designs |",
        "| --- | ---: | ---: | ---: |",
    ]
    for name, problem in _scenes():
        own = replace(problem, fidelity=Fidelity(samples=720))
        whole, less = prepare(own, prune=False), prepare(own)
        values = random_decisions(own, 2000)
        size = [sum(n.rows.shape[0] * n.rows.shape[2] for _, n in d.terms) for d in (whole, less)]
        times = [seconds(lambda d=d, v=values: d.objective(v)) for d in (whole, less)]
        assert np.allclose(whole.objective(values[:50]), less.objective(values[:50]), rtol=1e-11)
        lines.append(f"| {name} | {size[0]} / {size[1]} | {size[0] / size[1]:.1f} | {times[0] / times[1]:.1f} |")
    return [*lines, ""]


def _scenes() -> list[tuple[str, Problem]]:
    six = load(ROOT / "problems" / "tractor-six.toml")
    parts, _ = build(Cycle.FOUR_STROKE, boxer(4, 0.1, 0.03), Mechanism(0.04, 0.15, 0.5), [0.0, math.pi, 0.0, math.pi])
    flat = Problem("boxer", "boxer", Engine("boxer", Cycle.FOUR_STROKE, parts, (), _mounts(4)),
                   (OperatingPoint("p", 300.0),), objective=(_mean(),))  # fmt: skip
    return [("six in line (tractor-six)", six), ("boxer of four, motored", flat)]


def _mean() -> Term:
    return Term(Measure(channels.MOUNT_FORCE, NORMS["mean"]))


def _mounts(count: int) -> tuple[Mount, ...]:
    angles = [2.0 * math.pi * k / count for k in range(count)]
    return tuple(Mount(f"m{k}", (math.cos(a), 0.3 * math.sin(a), 0.0), (1.0, 1.0, 1.0)) for k, a in enumerate(angles))


def _row(cylinders: int, mounts: int, samples: int, orders: int | None) -> Callable[[], object]:
    throws = [2.0 * math.pi * k * 0.37 for k in range(cylinders)]
    parts, _ = build(Cycle.FOUR_STROKE, inline(cylinders, 0.1), Mechanism(0.04, 0.11, 0.5), throws)
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
    found = []
    for name, sizes, make in sweeps:
        times = [seconds(make(n), 15) for n in sizes]
        exponent = math.log(times[-1] / times[-3]) / math.log(sizes[-1] / sizes[-3])
        found.append((name, sizes, times, exponent))
        lines.append(
            f"| {name} | {sizes[0]} | {sizes[-1]} | {1e3 * times[0]:.2f} to {1e3 * times[-1]:.2f} ms | {exponent:.2f} |"
        )
    return [*lines, "", "![Time against cylinders, orders, mounts and samples](fidelity.png)"], found


def draw(found: list[tuple[str, Sequence[int], list[float], float]], path: Path) -> None:
    """Four lines on one panel, sizes over the smallest of each."""
    style = importlib.import_module("laufruhe.plots.style")
    from matplotlib.ticker import FuncFormatter

    drawn = style.page(1, 1, (6.4, 3.8))
    axes = drawn.panels[0]
    for (name, sizes, times, exponent), colour in zip(found, ("#0072B2", "#D55E00", "#009E73", "#555555"), strict=True):
        axes.plot([n / sizes[0] for n in sizes], [1e3 * t for t in times], "o-", color=colour, lw=1.3, ms=4)
        axes.annotate(f"{name}, {exponent:.2f}", (sizes[-1] / sizes[0], 1e3 * times[-1]), xytext=(6, 0),
                      textcoords="offset points", va="center", fontsize=8, color=colour)  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel="size over the smallest", ylabel="one evaluation [ms]")
    axes.set_xlim(0.9, 160.0)
    plain = FuncFormatter(lambda value, _: f"{value:g}")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(plain)
        axis.set_minor_formatter(FuncFormatter(lambda *_: ""))
    text = "One evaluation from nothing; beside each line its exponent."
    style.heading(drawn.figure, "What cost grows with", text, [],
                  "In-line engines without gas, exact kinematics. Computed with Laufruhe.")  # fmt: skip
    style.save(drawn.figure, path)


def main() -> None:
    """Measure and write."""
    lines = ["# Fidelity, batches and growth", "", "Processor time, the least of several calls on one core.", ""]
    table, found = growth()
    text = "\n".join([*lines, *four_cylinder(), *pruned(), *table]) + "\n"
    publish(OUT, text)
    draw(found, OUT.with_suffix(".png"))


if __name__ == "__main__":
    sys.exit(main())
