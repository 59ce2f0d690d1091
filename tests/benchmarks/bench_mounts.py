"""Speed of elastic mounts: frequency domain, map of speeds, joint solve. Writes results/benchmarks/mounts.md."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np
from pages import PAGES, ROOT, processor_seconds, publish, spent
from scipy.optimize import minimize

from laufruhe.files.reader import load
from laufruhe.machine import OperatingPoint
from laufruhe.physics.shaking_loads import forget, shaking_loads
from laufruhe.physics.speed_map import speed_map, split_loads
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.solvers.mounts.nonlinear import solve_joint
from laufruhe.solvers.mounts.search import ITERATIONS, MountSearch
from laufruhe.solvers.mounts.starts import start_points
from laufruhe.solvers.smooth.nonlinear import NonlinearProgram, solve_nonlinear
from laufruhe.solvers.smooth.program import SmoothProgram
from mounts.test_moving_block import simulated_forces

PROBLEM = ROOT / "problems" / "tractor-four-elastic.toml"
RPM = math.pi / 30.0
STARTS = 32
SLSQP_SECONDS = 60.0
SAMPLES = 96


def seconds(work: Callable[[], object], minimum: float = 0.5) -> float:
    """Return the best time of one call over at least half a second of calls."""
    best, whole = math.inf, 0.0
    while whole < minimum:
        last = spent(work)
        best, whole = min(best, last), whole + last
    return best


def one_speed(problem: Problem) -> list[str]:
    """Return the row of the frequency domain and of rigid bodies in time, both to 1e-6 of the peak."""
    # the reference has no gas
    mounting, point = mounting_in(problem.engine), replace(problem.points[-1], gas=None)
    wrench = shaking_loads(problem.engine, point, problem.fidelity)

    def anew() -> object:
        forget()
        return mounting.forces(shaking_loads(problem.engine, point, problem.fidelity), point.speed)

    # the motion of one wrench is kept for forces and travel: a copy is another one
    response, whole = (
        seconds(lambda: mounting.forces(wrench.with_coefficients(wrench.coefficients), point.speed)),
        seconds(anew),
    )
    runs = {}
    for steps in (720, 1440):
        started = time.process_time()
        runs[steps] = simulated_forces(1.0, steps=steps), time.process_time() - started
    coarse, fine = runs[720][0], runs[1440][0][1::2]
    # the error of the method falls with the square of the step
    error = float(np.abs(fine - coarse).max() / np.abs(fine).max()) / 3.0
    needed = max(1440 * math.sqrt(error / 1e-6), 1440)
    spent = runs[1440][1] * needed / 1440
    return [
        "## Mount forces at one speed, to 1e-6 of the peak",
        "",
        "| method | seconds |",
        "| --- | ---: |",
        f"| frequency domain, four-cylinder, response to loads that are known | {response:.2e} |",
        f"| frequency domain, loads included | {whole:.2e} |",
        f"| exudyn, one cylinder on a moving block in the plane, 60 turns of {needed:.0f} steps | {spent:.1f} |",
        f"| ratio, loads included | {spent / whole:.1e} |",
        f"| ratio, response alone | {spent / response:.1e} |",
        "",
        f"exudyn took {runs[1440][1]:.1f} s for 1440 steps a turn with an error of {error:.1e} by halving the step; "
        "its time for 1e-6 follows from the order of the method. It has one cylinder where the frequency domain has "
        "four, so the ratio is on the safe side.",
        "",
    ]


def many_speeds(problem: Problem) -> list[str]:
    """Time one mapped call against a loop over single calls."""
    engine, point = problem.engine, problem.points[-1]
    speeds = np.linspace(300.0, 3000.0, 1000) * RPM

    def loop() -> list[object]:
        optima = []
        for speed in speeds:
            at = OperatingPoint("", float(speed), point.gas)
            optima.append(mounting_in(engine).forces(shaking_loads(engine, at, problem.fidelity), float(speed)))
        return optima

    def at_once() -> object:
        return speed_map(mounting_in(engine), *split_loads(engine, point, problem.fidelity), speeds)

    single, together = seconds(loop, 0.1), seconds(at_once)
    return [
        "## Map of 1000 speeds",
        "",
        "| method | seconds |",
        "| --- | ---: |",
        f"| loop over single calls | {single:.3f} |",
        f"| one map | {together:.4f} |",
        f"| ratio | {single / together:.0f} |",
        "",
    ]


def joint(problem: Problem) -> list[str]:
    """Return the row of balance with mounts: this package, and SLSQP with differences, from the same starts."""
    problem = replace(problem, search=replace(problem.search, starts=STARTS))
    started = processor_seconds()
    result = solve_joint(problem)
    ours = processor_seconds() - started
    assert result.objective is not None
    assert result.certificate is not None
    started = processor_seconds()
    search = MountSearch(problem, evaluate_start(problem), 1)
    search.run()
    ended_early, tried = processor_seconds() - started, sum(optimum.starts for optimum in search.optima)
    assert search.best_or_initial is not None
    started = processor_seconds()
    optima = solve_nonlinear(*_program(problem), max_iterations=ITERATIONS)
    alone = processor_seconds() - started
    by_slsqp = [_by_slsqp(problem, mounts, columns) for mounts, columns in start_points(problem)[0]]
    values = [value for value, _, is_kept in by_slsqp if is_kept]
    reached = sum(value <= result.objective.value * 1.01 for value in values)
    usable = [optimum.value for optimum in optima if optimum.usable]
    ended = sum(value <= result.objective.value * 1.01 for value in usable)
    return [
        "## Joint solve: balance and mounts",
        "",
        "| method | starts | seconds | within all limits | at the best to 1 % | best mean force [N] |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
        f"| IPOPT, exact derivatives | {STARTS} | {alone:.1f} | {len(usable)} | {ended} | {min(usable):.4f} |",
        f"| SLSQP, finite differences | {STARTS} | {sum(t for _, t, _ in by_slsqp):.1f} | {len(values)} | {reached} | "
        f"{min(values, default=math.nan):.4f} |",
        f"| search of `laufruhe solve`, ended when nothing better is to be expected (N5) | {tried} | "
        f"{ended_early:.1f} | | | {search.best_or_initial.design.value:.4f} |",
        f"| `laufruhe solve`: with balance anew and bounds by boxes | {tried} | {ours:.1f} | | | "
        f"{result.objective.value:.4f} |",
        "",
        f"The problem is `tractor-four-elastic` with all its limits, and both take the same starts. SLSQP sees the "
        f"exact model at {SAMPLES} angles and stops after {SLSQP_SECONDS:.0f} s a start at the latest. "
        f"{result.certificate.method}; KKT residual {result.certificate.kkt_residual:.1e}.",
        "",
    ]


def _program(problem: Problem) -> tuple[NonlinearProgram, list[np.ndarray]]:
    points, size = start_points(problem)
    program = SmoothProgram(problem, size)
    return program.program, [program.start(mounts, columns) for mounts, columns in points]


class _LateError(Exception):
    """A start has had its time."""


def _by_slsqp(problem: Problem, mounts: list[float], columns: np.ndarray) -> tuple[float, float, bool]:
    """Return the objective, seconds, and whether all limits are kept, from one start."""
    places, rotors = problem.mount_decisions, problem.unbalances
    low = np.array([d.lower for d in places] + [-d.upper for d in rotors for _ in range(2)])
    high = np.array([d.upper for d in places] + [d.upper for d in rotors for _ in range(2)])
    count, began = len(places), time.process_time()
    known: dict[bytes, tuple[float, np.ndarray]] = {}
    point = np.clip((np.concatenate([mounts, columns]) - low) / (high - low), 0.0, 1.0)

    def evaluate_design(y: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the objective, and the room under every limit."""
        x = low + y * (high - low)
        unbalances = [complex(a, b) for a, b in x[count:].reshape(-1, 2)]
        at = evaluate(problem, problem.design([*unbalances, *x[:count].tolist()]), SAMPLES)
        rooms = [-at.check_limit(limit).violation for limit in problem.mount_limits]
        rooms += [1.0 - at.value(limit.measure) / limit.maximum for limit in problem.load_limits]
        rooms += [1.0 - abs(u) / d.upper for d, u in zip(rotors, unbalances, strict=True)]
        return objective_value(problem, at), np.array(rooms)

    def seen(y: np.ndarray) -> tuple[float, np.ndarray]:
        """Evaluate objective and limits at once."""
        key = y.tobytes()
        if key not in known:
            if time.process_time() - began > SLSQP_SECONDS:
                raise _LateError
            known.clear()
            known[key] = evaluate_design(y)
        return known[key]

    def remember(y: np.ndarray) -> None:
        nonlocal point
        point = y.copy()

    with suppress(_LateError):
        point = minimize(
            lambda y: seen(y)[0], point, method="SLSQP", bounds=[(0.0, 1.0)] * len(low), callback=remember,
            constraints={"type": "ineq", "fun": lambda y: seen(y)[1]}, options={"maxiter": 200, "ftol": 1e-9},
        ).x  # fmt: skip
    spent = time.process_time() - began
    value, rooms = evaluate_design(np.clip(point, 0.0, 1.0))
    return value, spent, bool(rooms.min() > -1e-5)


def main() -> None:
    problem = load(PROBLEM)
    lines = ["# Elastic mounts: benchmark", "", f"`problems/{PROBLEM.name}`; seconds are processor time.", ""]
    for part in (one_speed, many_speeds, joint):
        lines += part(problem)
        print("\n".join(lines[-16:]), flush=True)
    publish(PAGES / "mounts.md", "\n".join(lines).rstrip() + "\n")


if __name__ == "__main__":
    main()
