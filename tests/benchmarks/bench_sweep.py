"""A sweep of proven optima, and a study of them, against bare re-solves, SciPy SLSQP and differential evolution.

Writes results/benchmarks/sweep.md. Ratios are what counts; the times are this machine's.
"""

from __future__ import annotations

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    # as in a study's own processes; threads that wait would count as processor time
    os.environ.setdefault(name, "1")

import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from pages import PAGES, ROOT, publish
from scipy.optimize import NonlinearConstraint, differential_evolution, minimize

from laufruhe import load
from laufruhe.load_models.affine import AffineModel, AffineProblem
from laufruhe.solvers import solve
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.studies.reader import load_study
from laufruhe.studies.runner import run

PROBLEM = ROOT / "problems" / "tractor-four-lanchester-and-moment.toml"
OUT = PAGES / "sweep.md"
SAMPLES, POINTS, EVOLVED = 360, 13, 3
STUDIED, STUDY_POINTS = ("tractor-single", "tractor-four-lanchester-and-moment", "tractor-four-front-force"), 25


def timed(run: Callable[[], list[float]]) -> tuple[float, np.ndarray]:
    """Return the seconds of processor time, which a busy machine disturbs less, and objectives."""
    start = time.process_time()
    values = run()
    return time.process_time() - start, np.array(values)


def general(affines: list[AffineProblem], evolve: bool) -> list[float]:
    """Return the optima of the sampled objective by a general-purpose optimiser; decisions lie in discs."""
    values = []
    for affine in affines:
        scales, width = affine.scales, affine.size

        def objective(y: np.ndarray, a: AffineProblem = affine, s: np.ndarray = scales) -> float:
            return a.objective(y * s)

        def room(y: np.ndarray) -> np.ndarray:
            return 1.0 - (y.reshape(-1, 2) ** 2).sum(axis=1)

        if evolve:
            disc = NonlinearConstraint(room, 0.0, np.inf)
            bounds = [(-1.0, 1.0)] * width
            optimum = differential_evolution(objective, bounds, constraints=disc, seed=1, maxiter=100, polish=False)
        else:
            inside = {"type": "ineq", "fun": room}
            start = np.full(width, 0.05)
            optimum = minimize(objective, start, method="SLSQP", constraints=[inside], options={"maxiter": 300})
        values.append(float(optimum.fun))
    return values


def over_square(affine: AffineProblem, speed: float) -> AffineProblem:
    """Return the forces over speed squared, so that slopes stay over a sweep of the speed."""
    terms = ((w, replace(n, constant=n.constant / speed**2, slope=n.slope / speed**2)) for w, n in affine.terms)
    return replace(affine, terms=tuple(terms))


def study_rows() -> list[str]:
    """Return the cost of a point of a study, compared with a bare solve of its program."""
    rows = []
    for name in STUDIED:
        problem = load(ROOT / "problems" / f"{name}.toml")
        rated = problem.points[0]
        factors = [float(f) for f in np.linspace(0.6, 1.2, STUDY_POINTS)]
        affines = []
        for factor in factors:
            model = AffineModel(replace(problem, points=(replace(rated, speed=factor * rated.speed),)))
            affines.append(over_square(model.at(model.full_samples), factor * rated.speed))
        solve_cones(affines[0])

        def bare(affines: list[AffineProblem] = affines) -> list[float]:
            return [solve_cones(affine).solver_seconds for affine in affines]

        turns = [(timed(bare)[0], timed(lambda n=name: studied(n))[0]) for _ in range(5)]
        plain, whole = (1e3 * statistics.median(turn[k] for turn in turns) / STUDY_POINTS for k in (0, 1))
        rows.append(f"| {name} | {affines[0].samples} | {plain:.1f} | {whole:.1f} | {whole / plain:.2f} |")
    return rows


def studied(name: str) -> list[float]:
    """Return the seconds of a study over speed on one core, from its file to its dataset."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        path.write_text(
            f'title = "t"\n[study]\n[[study.parts]]\nname = "p"\nkind = "layout comparison"\ntitle = "t"\n'
            f'[[study.parts.sweep]]\nquantity = "operating_points.1.mean_piston_speed"\n'
            f'from = "6 m/s"\nto = "12 m/s"\npoints = {STUDY_POINTS}\n'
            f'[[study.parts.cases]]\nname = "one"\nproblem = "{ROOT / "problems" / name}.toml"\n',
            encoding="utf-8",
        )
        datasets, _ = run(load_study(path), path.parent, path.parent / "kept")
    return [float(value) for value in datasets["p"]["objective"].values]


def main() -> None:
    """Measure and write the tables."""
    problem = load(PROBLEM)
    rated = problem.points[0]
    speeds = [float(f) * rated.speed for f in np.linspace(0.4, 1.0, POINTS)]
    models = [AffineModel(replace(problem, points=(replace(rated, speed=s),))) for s in speeds]
    coarse, fine = [m.at(SAMPLES) for m in models], [m.at(2 * SAMPLES) for m in models]
    swept = []

    def sweep() -> list[float]:
        swept[:] = [solve(replace(problem, points=(replace(rated, speed=s),))) for s in speeds]
        return [result.objective.value for result in swept]

    def bare() -> list[float]:
        return [float(solve_cones(a).x is not None) for a in squared]

    squared = [over_square(affine, speed) for affine, speed in zip(coarse, speeds, strict=True)]
    sweep()
    turns = [(timed(bare), timed(sweep)) for _ in range(5)]
    plain, proven = (statistics.median(turn[k][0] for turn in turns) for k in (0, 1))
    rows = [("bare re-solve, no proof", plain, turns[0][0][1], POINTS)]
    rows += [("sweep with proofs", proven, turns[0][1][1], POINTS)]
    rows += [("SciPy SLSQP, sampled objective", *timed(lambda: general(fine, False)), POINTS)]
    rows += [("differential evolution", *timed(lambda: general(fine[-EVOLVED:], True)), EVOLVED)]
    bounds = np.array([result.certificate.lower_bound for result in swept])
    lines = [
        "# A sweep over speed, against general-purpose optimisers",
        "",
        f"`problems/{PROBLEM.name}`, {POINTS} speeds, {SAMPLES} angles a period; differential evolution has the last",
        f"{EVOLVED} speeds only, SciPy's own stopping rule and at most 100 generations. Building",
        "the program is part of both first rows, medians of 5 runs in turns; the others ran once. Processor time.",
        "Above: over the proven lower bound of the same speed.",
        "",
        "| method | ms a point | to bare re-solve | mean above [%] | worst above [%] |",
        "| --- | ---: | ---: | ---: | ---: |",
    ]
    unit = rows[0][1] / POINTS
    for k, (name, seconds, values, count) in enumerate(rows):
        above = 100.0 * (values / bounds[-count:] - 1.0)
        excess = "- | -" if k == 0 else f"{above.mean():.2g} | {above.max():.2g}"
        lines.append(f"| {name} | {1e3 * seconds / count:.1f} | {seconds / count / unit:.2f} | {excess} |")
    lines += [
        "",
        "## A study, point by point",
        "",
        f"`laufruhe study` over {STUDY_POINTS} piston speeds from 6 to 12 m/s on one core, all of it: scene, loads,",
        "optimum, proof, evaluation, peaks, the file of finished points, the dataset. A bare re-solve is that of the",
        "compiled program, its compiling not counted. Medians of 5 runs in turns.",
        "",
        "| problem | angles a period | bare re-solve [ms] | study [ms a point] | ratio |",
        "| --- | ---: | ---: | ---: | ---: |",
        *study_rows(),
    ]
    text = "\n".join(lines) + "\n"
    publish(OUT, text)


if __name__ == "__main__":
    main()
