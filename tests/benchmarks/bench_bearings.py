"""Bearing forces beside mount forces, and beside a rigid-body simulation of the same accuracy, in one run.

Writes results/benchmarks/bearings.md. Ratios are what counts; the times are this machine's.
"""

from __future__ import annotations

import math
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from bench_multibody import STEPS, Scene, scene
from pages import PAGES, ROOT, publish, spent

import laufruhe
from laufruhe.extensions.bearing_loads.channels import CRANK_PIN_FORCE, MAIN_BEARING_FORCE
from laufruhe.extensions.bearing_loads.machine import Bearing, MainBearings
from laufruhe.extensions.bearing_loads.physics import main_bearing_forces
from laufruhe.machine import Engine
from laufruhe.numerics.norms import NORMS
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem import channels
from laufruhe.problem.channels import LoadChannel
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.problem import Problem

OUT = PAGES / "bearings.md"
PROBLEMS = ROOT / "problems"
REPEATS, DESIGNS, SAMPLES, TARGET = 5, 40, 720, 1e-5
FORCES: Sequence[LoadChannel] = (channels.MOUNT_FORCE, MAIN_BEARING_FORCE, CRANK_PIN_FORCE)


def per_design(problem: Problem, channel: LoadChannel | None) -> float:
    """Return the processor time of one random design of the webs with the mean of one channel [s]."""
    rng = np.random.default_rng(1964)
    designs = [problem.design(rng.uniform(0.0, 2.0, len(problem.decisions)).tolist()) for _ in range(DESIGNS)]

    def one(engine: Engine) -> None:
        evaluation = evaluate(problem, engine)
        if channel is not None:
            evaluation.value(Measure(channel))

    one(designs[0])
    started = time.process_time()
    for engine in designs:
        one(engine)
    return (time.process_time() - started) / DESIGNS


def of_channels() -> list[str]:
    """Time mount, bearing and pin forces of a design, against the design and against the mounts."""
    whole = laufruhe.load(PROBLEMS / "tractor-four-bearings.toml")
    problem = replace(whole, points=whole.points[:1])
    rounds = [[per_design(problem, channel) for channel in (None, *FORCES)] for _ in range(REPEATS)]
    bare, *environment = (statistics.median(times) for times in zip(*rounds, strict=True))
    costs = [cost - bare for cost in environment]
    return [
        f"| {channel} | {1e3 * cost:.2f} | {cost / costs[0]:.2f} |" for channel, cost in zip(FORCES, costs, strict=True)
    ]


def of_optima() -> list[str]:
    """Return the proven optima of the same eight webs under the same limit of mass, by mount and by bearing forces."""
    whole = laufruhe.load(PROBLEMS / "tractor-four-bearings.toml")
    mass = tuple(limit for limit in whole.limits if limit.measure.is_mass)

    def term(channel: LoadChannel, norm: str) -> Problem:
        return replace(whole, objective=(Term(Measure(channel, NORMS[norm])),), limits=mass)

    pairs = [(f"{norm} {channel}", term(channel, norm)) for norm in ("mean", "maximum") for channel in FORCES[:2]]
    rows, before = [], 0.0
    for name, problem in [*pairs, ("as the ready problem, limits of peaks and mounts too", whole)]:
        times = []
        for _ in range(REPEATS):
            started = time.process_time()
            result = laufruhe.solve(problem)
            times.append(time.process_time() - started)
        took = statistics.median(times)
        before = took if "mount force" in name else before
        proof = result.certificate
        rows.append(f"| {name} | {took:.2f} | {took / before:.1f} | {proof.kind}, gap {proof.gap:.1e} |")
    return rows


def carried(four: Scene) -> Spectrum:
    """Return the forces on five main bearings over the cycle."""
    parts = four.engine.slider_cranks
    ends = max(part.x for part in parts) + 0.06, min(part.x for part in parts) - 0.06
    bearings = tuple(Bearing(str(k), x) for k, x in enumerate(np.linspace(*ends, 5)))
    return main_bearing_forces(four.engine.with_extra(MainBearings(bearings)), four.point)


def simulated_error(four: Scene, steps: int) -> float:
    """Return the largest difference of the bearing forces over the largest one, after a first tenth of a turn."""
    loads = four.multibody.simulate(four.machine, steps, run_in=0, integrator=four.integrator)
    _, left, up = carried(four).values(math.tau * np.arange(steps) / steps).sum(axis=1).T
    off = np.abs(loads.bearings.sum(axis=1) - (up + 1j * left))[steps // 10 :]
    return float(off.max() / np.hypot(left, up).max())


def simulation_rows() -> list[str]:
    """Return the time of one turn of the nearest simulation within the tolerance, and of the analytic forces."""
    four = scene()
    tried = []
    for steps in STEPS:
        tried.append((simulated_error(four, steps), steps))
        if tried[-1][0] <= TARGET:
            break
    reached, steps = min(tried)
    rounds = []
    for k in range(REPEATS):
        new = four.lengthened(1.0 + 1e-3 * (k + 1))
        package = [spent(lambda n=new: carried(n).sample(SAMPLES)) for _ in range(2)]
        rounds.append((four.integration_seconds(steps), *package))
    joint, fresh, again = (statistics.median(times) for times in zip(*rounds, strict=True))
    return [
        f"| exudyn, {steps} steps a turn | {reached:.1e} | {1e3 * joint:.1f} | 1 |",
        f"| analytic, other rods every time | rounding | {1e3 * fresh:.1f} | {joint / fresh:.0f} |",
        f"| analytic, same rods again | rounding | {1e3 * again:.2f} | {joint / again:.0f} |",
    ]


def front() -> str:
    """Time of the study of both fronts, by its command."""
    program = "from laufruhe.cli import app; app()"
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-c", program, "study", str(PROBLEMS / "bearing-pareto.toml"), "--out", folder]
        package = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(words, env=package, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    took = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return f"{took:.0f} s of a processor"


def orders() -> str:
    """Return the line about the best firing order and webs of six cylinders."""
    started = time.process_time()
    result = laufruhe.solve(laufruhe.load(PROBLEMS / "tractor-six-bearings.toml"))
    took = time.process_time() - started
    return f"{took:.0f} s of a processor; {result.certificate.kind}, {result.phasing.method}"


def main() -> None:
    """Measure and write the page."""
    by_channel, optima, simulated, study, firing = of_channels(), of_optima(), simulation_rows(), front(), orders()
    lines = [
        "# Bearing forces beside mount forces and beside a multibody simulation",
        "",
        "`problems/tractor-four-bearings.toml`: four cylinders, five main bearings, gas, eight webs. Processor",
        f"time, medians of {REPEATS} runs on one core.",
        "",
        "One more design, its webs at random, and the mean of a channel over its cycle of 1440 steps, less what the",
        "design costs by itself:",
        "",
        "| channel | ms a design | over mount force |",
        "| --- | ---: | ---: |",
        *by_channel,
        "",
        "Proven optima of the eight webs under 8 kg in all:",
        "",
        "| minimised | s | over the mounts' | proof |",
        "| --- | ---: | ---: | --- |",
        *optima,
        "",
        "What the bearings of a four-cylinder carry in sum, beside the joints of its throws in exudyn (fewest steps of",
        f"those tried that reach {TARGET:.0e} of the largest force, generalised-alpha; integration of one turn alone):",
        "",
        "| what | error | ms | simulation over it |",
        "| --- | ---: | ---: | ---: |",
        *simulated,
        "",
        f"Both fronts of `problems/bearing-pareto.toml`, 59 points, with their pictures: {study}.",
        "",
        f"Firing order and twelve webs of `problems/tractor-six-bearings.toml`: {firing}.",
    ]
    publish(OUT, "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
