"""NumPy, numba, cvxpy, SciPy and CP-SAT beside this package, and the rows of `ratios.py` beside their neighbours.

Writes results/benchmarks/speed.md, all in one run on one thread. Ratios are what counts; the times are this machine's.
numba and OR-Tools are used if they are installed. `--peers` leaves the rows of `ratios.py` out.
"""

from __future__ import annotations

import argparse
import math
import os
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from itertools import count, permutations
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

# before cvxpy, whose HiGHS is another one
CP_MODEL = import_module("ortools.sat.python.cp_model") if find_spec("ortools") else None

import cvxpy as cp
import numpy as np
from bench_growth import two_stroke_star
from pages import PAGES, ROOT, publish
from ratios import neighbours
from scipy.optimize import minimize
from threadpoolctl import threadpool_info

import laufruhe
from laufruhe.load_models.affine import AffineModel, AffineProblem
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.physics.mount_forces import rigid_mounting
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.problem.evaluation import evaluate, objective_value
from validation.plain_forces import PlainEngine, plain_engine

PROBLEM = ROOT / "problems" / "tractor-four-lanchester.toml"
OUT = PAGES / "speed.md"
SAMPLES, ANGLES = 1440, 180
"""Angles over the cycle of forces, and over the period of the rows that an optimiser has."""
CALLS, ROUNDS, DESIGNS = 40, 7, 10_000
AGREES, AGREES_IN_INTEGERS = 1e-9, 1e-3
THROWS, INTEGERS = 10, 10_000
"""Throws of a crank, and integers for a force of first order at the spacing of two throws."""
MISSING = float("nan")
Answer = tuple[str, float, float, str]
"""Program that computes an optimum, its time [ms], its value and its proof."""


def best(work: Callable[[int], object], calls: int = CALLS) -> float:
    """Return the least processor time of a call over several rounds, each with a new number [ms]."""
    numbers, lowest = count(), float("inf")
    for _ in range(ROUNDS):
        began = time.process_time()
        for _ in range(calls):
            work(next(numbers))
        lowest = min(lowest, (time.process_time() - began) / calls)
    return 1e3 * lowest


def compiled() -> Callable[..., Array] | None:
    """Return the forces of pistons and gas in loops that numba compiles; None without numba."""
    if find_spec("numba") is None:
        return None

    def wrench(radius, mass, area, x, sine, cosine, since, ratio, speed, gas, cut):  # type: ignore[no-untyped-def]
        out = np.zeros((sine.shape[0], 6))
        with_gas, compression, n, m, peak, intake, exhaust, crankcase = gas
        clearance = 1.0 / (compression - 1.0)
        for i in range(sine.shape[0]):
            for k in range(sine.shape[1]):
                s, c = sine[i, k], cosine[i, k]
                root = np.sqrt(1.0 - (ratio * s) ** 2)
                bent = (c * c - s * s) / root + ratio**2 * (s * c) ** 2 / root**3
                force = mass * radius * speed**2 * (c + ratio * bent)
                thrust = 0.0
                if with_gas:
                    volume, angle = clearance + 0.5 * (1.0 - c + (1.0 - root) / ratio), since[i, k]
                    if angle > 3.0 * np.pi:
                        pressure = intake * ((1.0 + clearance) / volume) ** n
                    elif angle < np.pi:
                        pressure = peak * min(1.0, cut / volume) ** m
                    else:
                        pressure = exhaust if angle < 2.0 * np.pi else intake
                    thrust = -area * (pressure - crankcase)
                out[i, 2] += force
                out[i, 3] -= radius * (force + thrust) * s * (1.0 + ratio * c / root)
                out[i, 4] -= force * x[k]
        return out

    return import_module("numba").njit(wrench)  # type: ignore[no-any-return]


def by_numba(wrench: Callable[..., Array], plain: PlainEngine, ratio: float, speed: float) -> Array:
    """Return the mount forces from compiled loops, with the rotors of plain NumPy."""
    g = plain.gas
    gas = (False, 2.0, *[1.0] * 6)
    if g is not None:
        gas = (True, g.compression_ratio, g.compression_exponent, g.expansion_exponent, g.peak_pressure,
               g.intake_pressure, g.exhaust_pressure, g.crankcase_pressure)  # fmt: skip
    numbers = (plain.radius, plain.mass, plain.area, plain.x, plain.sine, plain.cosine, plain.since)
    return plain.on_mounts(wrench(*numbers, ratio, speed, gas, plain.cut_off) + plain.turning(speed))


def own_forces(engine: Engine, point: OperatingPoint) -> Array:
    """Return the mount forces by this package."""
    return rigid_mounting(engine.mounts).forces(shaking_loads(engine, point)).sample(SAMPLES)


def with_rods(engine: Engine, ratio: float) -> Engine:
    """Return the engine with rods of another length."""
    parts = tuple(replace(part, rod_length=part.crank_radius / ratio) for part in engine.slider_cranks)
    return replace(engine, slider_cranks=parts)


def force_times(engine: Engine, point: OperatingPoint) -> dict[str, float]:
    """Return the milliseconds of the forces over the cycle, by what computes them."""
    plain, loops = plain_engine(engine, point, SAMPLES), compiled()
    ratio, speed = engine.slider_cranks[0].rod_ratio, point.speed
    package = own_forces(engine, point)
    answers = [plain.forces(ratio, speed), plain.truncated(ratio)(speed)]
    answers += [] if loops is None else [by_numba(loops, plain, ratio, speed)]
    for answer in answers:
        assert np.abs(answer - package).max() < AGREES * np.abs(package).max()
    with_orders = plain.truncated(ratio)
    times = {"NumPy, everything anew": best(lambda k: plain.forces(ratio + 1e-6 * k, speed))}
    times["NumPy, new speed, rest kept"] = best(lambda k: with_orders(speed + 1e-4 * k))
    times["numba, everything anew"] = (
        MISSING if loops is None else best(lambda k: by_numba(loops, plain, ratio + 1e-6 * k, speed))
    )
    engines = [with_rods(engine, ratio + 1e-6 * k) for k in range(CALLS * ROUNDS)]
    times["this package, new rods"] = best(lambda k: own_forces(engines[k], point))
    times["this package, new speed"] = best(lambda k: own_forces(engine, replace(point, speed=speed + 1e-4 * k)))
    return times


def design_times() -> dict[str, float]:
    """Return the microseconds of a design, by what evaluates it."""
    problem, random = laufruhe.load(PROBLEM), np.random.default_rng(1)
    designs = {d.name: random.uniform(d.lower, d.upper, DESIGNS) for d in problem.decisions}
    affine = AffineModel(problem).at(SAMPLES // 4)
    (_, norm), x = affine.terms[0], random.uniform(-0.01, 0.01, (100, affine.size))

    def rows(_: int) -> Array:
        moved = norm.constant + np.einsum("kdn,mn->mkd", norm.slope, x)
        return np.asarray(np.sqrt((moved**2).sum(axis=2)) @ norm.grid.weights)

    def loop(k: int) -> object:
        return laufruhe.evaluate(problem.with_values({"left.unbalance": f"{1e-5 * k} kg m"})).objective

    def bare(k: int) -> object:
        return objective_value(problem, evaluate(problem, problem.design([0.0, 0.0, 1e-5 * k, 0.0])))

    many = best(lambda _: laufruhe.evaluate_many(laufruhe.load(PROBLEM), designs), 1) / DESIGNS
    return {
        "NumPy, norms of known rows": 1e3 * best(rows, 3) / len(x),
        f"`evaluate_many`, {DESIGNS:,} designs, the file read anew": 1e3 * many,
        "evaluation inside the package": 1e3 * best(bare),
        "`with_values` and `evaluate`, in a loop": 1e3 * best(loop),
    }


def by_cvxpy(affine: AffineProblem) -> float:
    """Return the optimum of the rows by cvxpy and Clarabel [N]."""
    x = cp.Variable(affine.size)

    def value(norm: object) -> cp.Expression:
        rows = norm.constant + cp.reshape(  # type: ignore[attr-defined]
            norm.slope.reshape(norm.constant.size, -1) @ x, norm.constant.shape, order="C"  # type: ignore[attr-defined]
        )  # fmt: skip
        return norm.grid.weights @ cp.norm(rows, 2, axis=1)  # type: ignore[attr-defined]

    bounds = [cp.norm(x[d.columns]) <= d.set.upper for d in affine.domains]
    bounds += [value(norm) <= maximum for maximum, norm in affine.limits]
    return float(cp.Problem(cp.Minimize(value(affine.terms[0][1])), bounds).solve(solver=cp.CLARABEL))


def by_scipy(affine: AffineProblem) -> float:
    """Return the optimum of the rows by SciPy's SLSQP with exact gradients [N]."""
    norm, scales = affine.terms[0][1], affine.scales

    def objective(u: Array) -> tuple[float, Array]:
        z = norm.subgradient(scales * u)
        return norm.value(scales * u), scales * norm.pullback(z)

    def room(u: Array) -> Array:
        discs = [1.0 - float(np.hypot(*u[d.columns])) ** 2 for d in affine.domains]
        return np.array([*discs, *(1.0 - limit.value(scales * u) / maximum for maximum, limit in affine.limits)])

    inside = {"type": "ineq", "fun": room}
    start = np.full(affine.size, 0.05)
    return float(minimize(objective, start, jac=True, method="SLSQP", constraints=[inside]).fun)


def optimum_times() -> list[Answer]:
    """Return the milliseconds, value and proof of the optimum, by what finds it."""
    problem = laufruhe.load(PROBLEM)
    affine = AffineModel(problem).at(ANGLES)
    result = laufruhe.solve(problem)
    assert result.objective is not None
    assert result.certificate is not None
    return [
        ("cvxpy with Clarabel, rows known", best(lambda _: by_cvxpy(affine), 1), by_cvxpy(affine), "none"),
        ("SciPy SLSQP, rows known", best(lambda _: by_scipy(affine), 1), by_scipy(affine), "none"),
        ("`laufruhe.solve`, from the problem", best(lambda _: laufruhe.solve(problem), 1), result.objective.value,
         f"bound {result.certificate.lower_bound:.3f} N"),
    ]  # fmt: skip


def crank_times() -> list[Answer]:
    """Return milliseconds, value and proof of the crank with the least rocking couple of orders 1 and 2, by method."""
    tables = two_stroke_star(THROWS)
    engine, alpha = tables["engine"], math.tau * np.arange(256) / 256
    position = np.cos(alpha) + np.sqrt(engine["rod_ratio"] ** -2 - np.sin(alpha) ** 2)
    orders, steps = np.array([1, 2]), np.arange(THROWS)
    forces = orders**2 * 2.0 * np.fft.rfft(position)[orders].real / len(alpha)
    turns = np.exp(1j * math.tau * np.multiply.outer(orders, steps) / THROWS)
    # couple of each order by a throw on a step, shape (orders, throws, steps)
    couples = np.einsum("h,k,hs->hks", forces, steps - 0.5 * (THROWS - 1), turns)

    def value(stars: Array) -> Array:
        return np.asarray(np.linalg.norm(couples[:, steps, stars].sum(axis=-1), axis=0) / math.sqrt(2.0))

    def every(_: int) -> Array:
        rest = np.array(list(permutations(range(1, THROWS))))
        return value(np.pad(rest, ((0, 0), (1, 0)))).min()

    problem = laufruhe.load(tables)
    result = laufruhe.solve(problem)
    assert result.objective is not None
    assert result.certificate is not None
    (part, *_), point = problem.engine.slider_cranks, problem.points[0]
    unit = (
        part.reciprocating_mass * part.crank_radius * point.speed**2 * abs(problem.engine.slider_cranks[1].x - part.x)
    )
    package = result.objective.value / unit
    assert abs(float(every(0)) / package - 1.0) < AGREES
    rows = [
        (f"NumPy, all {math.factorial(THROWS - 1):,} stars", best(every, 1), float(every(0)), "enumeration"),
        ("`laufruhe.solve`, from the problem", best(lambda _: laufruhe.solve(problem), 1), package,
         f"{result.certificate.kind}, gap {result.certificate.gap:.0e}"),
    ]  # fmt: skip
    if CP_MODEL is None:
        return [*rows, ("CP-SAT", MISSING, MISSING, "")]
    star, proof = by_cp_sat(CP_MODEL, couples)
    assert value(star) / package - 1.0 < AGREES_IN_INTEGERS
    return [*rows, ("CP-SAT, one worker", best(lambda _: by_cp_sat(CP_MODEL, couples), 1), float(value(star)), proof)]


def by_cp_sat(cp_model: Any, couples: Array) -> tuple[Array, str]:
    """Return the step of every throw with the least sum of squared couples in integers, and the status of CP-SAT."""
    model, places = cp_model.CpModel(), range(couples.shape[1])
    stands = [[model.new_bool_var(f"{k} on {s}") for s in places] for k in places]
    for line in (*stands, *zip(*stands, strict=True)):
        model.add_exactly_one(line)
    model.add(stands[0][0] == 1)
    squares = []
    for part in np.rint(INTEGERS * np.concatenate([couples.real, couples.imag])).astype(int):
        largest = int(np.abs(part).max(axis=1).sum())
        total, square = model.new_int_var(-largest, largest, ""), model.new_int_var(0, largest**2, "")
        model.add(total == sum(int(part[k, s]) * stands[k][s] for k in places for s in places))
        model.add_multiplication_equality(square, [total, total])
        squares.append(square)
    model.minimize(sum(squares))
    solver = cp_model.CpSolver()
    solver.parameters.num_workers = 1
    status = solver.solve(model)
    star = np.array([next(s for s in places if solver.value(stands[k][s])) for k in places])
    return star, f"{solver.status_name(status).lower()} in integers"


def answers(rows: Sequence[Answer], unit: str) -> list[str]:
    """Return the table of an optimum."""
    cells = [
        f"| {what} | not installed | | |" if math.isnan(spent) else f"| {what} | {spent:.1f} | {value:.4f} | {proof} |"
        for what, spent, value, proof in rows
    ]
    return [f"| what | ms | value {unit} | proof |", "| --- | ---: | ---: | --- |", *cells]


def main() -> None:
    """Measure and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peers", action="store_true")
    peers_alone = parser.parse_args().peers
    problem = laufruhe.load(PROBLEM)
    engine, point = problem.design([0.05 + 0.02j, 0.03j, 0.01, 0.01j]), problem.points[0]
    gas, still = force_times(engine, point), force_times(engine, replace(point, gas=None))
    threads = {library["prefix"]: library["num_threads"] for library in threadpool_info()}
    lines = [
        "# Speed beside NumPy, numba, cvxpy, SciPy and CP-SAT",
        "",
        f"One run of one process on {platform.machine()} with {os.cpu_count()} processors. Linear algebra runs on one",
        f"thread ({', '.join(f'{name}: {number}' for name, number in threads.items())}). Times are the least processor",
        "times of several rounds. The problem is `problems/tractor-four-lanchester.toml`.",
        "",
        "## Forces",
        "",
        f"Forces of a four-cylinder on four rigid mounts at {SAMPLES} angles of the cycle, from the engine, with four",
        f"rotors. All agree within {AGREES:.0e} of the largest force. `NumPy` computes the closed forms of the",
        "slider-crank at each angle ([plain_forces.py](../../tests/validation/plain_forces.py)).",
        "",
        "| what | with gas [ms] | NumPy over it | without gas [ms] | NumPy over it |",
        "| --- | ---: | ---: | ---: | ---: |",
    ]
    base = "NumPy, everything anew"
    for what, time_with_gas in gas.items():
        if math.isnan(time_with_gas):
            lines.append(f"| {what} | not installed | | | |")
            continue
        ratios = gas[base] / time_with_gas, still[base] / still[what]
        lines.append(f"| {what} | {time_with_gas:.3f} | {ratios[0]:.2f} | {still[what]:.3f} | {ratios[1]:.2f} |")
    lines += ["", "## Designs", "", "Designs that differ in their unbalances, with gas: objective and limits.", ""]
    lines += ["| what | microseconds a design |", "| --- | ---: |"]
    designs = design_times()
    lines += [f"| {what} | {spent:.1f} |" for what, spent in designs.items()]
    lines += ["", "## Optimum", "", f"Two weights and two shafts for the least mean mount force. Rows have {ANGLES}"]
    lines += ["angles; `solve` refines them, evaluates the design exactly and proves it.", ""]
    lines += answers(optimum_times(), "[N]")
    lines += ["", "## Crank", "", f"Two-stroke with {THROWS} throws: least root mean square of the rocking couples of"]
    lines += [
        "orders 1 and 2, over the inertia force of a piston on an endless rod times the spacing of two throws.",
        "",
    ]
    lines += answers(crank_times(), "[-]")
    if not peers_alone:
        lines += ["", "## Work beside its neighbour", ""]
        lines += [
            "Processor time of the work over that of its neighbour, both of this run; beside it the ratio when the"
        ]
        lines += ["row was measured for the first time. Work without a neighbour has its time.", ""]
        lines += ["| work | neighbour | at first | now |", "| --- | --- | ---: | ---: |"]
        lines += [f"| {' | '.join(row)} |" for row in neighbours(gas, designs)]
    publish(OUT, "\n".join(lines))


if __name__ == "__main__":
    main()
