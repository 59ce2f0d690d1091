"""Torsional vibration beside openTorsion, and firing orders decided against it.

Writes results/benchmarks/torsion.md. Ratios are what counts; the times are this machine's.
"""

from __future__ import annotations

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import statistics
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import opentorsion
from pages import PAGES, ROOT, publish

import laufruhe
from laufruhe.extensions.torsion.machine import Torsion
from laufruhe.extensions.torsion.physics import chain_of, natural_modes, throw_torques, twist
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.machine import Engine

PROBLEM = ROOT / "problems" / "inline-five-torsion.toml"
OUT = PAGES / "torsion.md"
RUNS, CYLINDERS = 7, (5, 6, 8, 10, 11, 12)


def seconds(work: Callable[[], object]) -> float:
    """Return the median processor time of one call."""
    work()
    times = []
    for _ in range(RUNS):
        started = time.process_time()
        work()
        times.append(time.process_time() - started)
    return statistics.median(times)


def assembly(chain: Torsion) -> opentorsion.Assembly:
    """Return the same chain in openTorsion, which has viscous damping."""
    discs = [opentorsion.Disk(k, I=disc.inertia, c=disc.damping) for k, disc in enumerate(chain.discs)]
    shafts = [opentorsion.Shaft(k, k + 1, k=s.stiffness, c=s.damping) for k, s in enumerate(chain.sections)]
    return opentorsion.Assembly(shafts, disk_elements=discs)


def viscous(engine: Engine) -> Engine:
    """Return an engine whose shafts have viscous damping alone."""
    chain = chain_of(engine)
    sections = tuple(replace(section, loss_factor=0.0, damping=2.0) for section in chain.sections)
    return engine.with_extra(replace(chain, sections=sections))


def comparison_rows() -> list[str]:
    """Return the natural modes, and the response of every order at one speed, of both programs."""
    problem = laufruhe.load(PROBLEM)
    engine, point = viscous(problem.engine), problem.points[1]
    torques = throw_torques(engine, point)
    orders, series = torques.orders[1:], torques.coefficients[1:].T
    theirs = assembly(chain_of(engine))
    squares, _ = theirs.undamped_modal_analysis()
    frequencies = np.sort(np.sqrt(np.abs(squares)))[1:] / (2.0 * np.pi)
    modes = np.abs(natural_modes(chain_of(engine)).frequencies / frequencies - 1.0).max()

    def their_response() -> np.ndarray:
        angles, _ = theirs.ss_response(series, orders * point.speed)
        return (angles[:-1] - angles[1:]).T

    ours, other = twist(engine, point).coefficients[1:], their_response()
    differs = np.abs(ours - other).max() / np.abs(other).max()
    rows = []
    for what, package, their, difference in (
        ("natural modes", lambda: natural_modes(chain_of(engine)), theirs.undamped_modal_analysis, modes),
        (f"response in {len(orders)} orders", lambda: twist(engine, point), their_response, differs),
    ):
        a, b = 1e3 * seconds(package), 1e3 * seconds(their)
        rows.append(f"| {what} | {a:.2f} | {b:.2f} | {b / a:.1f} | {difference:.0e} |")
    return rows


def ranked() -> list[str]:
    """Rank all firing orders of more and more cylinders; the best ten are proven."""
    rows = []
    for count in CYLINDERS:
        tables = tables_of(PROBLEM)
        tables["engine"] = {**tables["engine"], "cylinders": count}
        # the limits are those of five cylinders
        del tables["constraints"]
        problem = load_tables(tables, PROBLEM)
        started = time.process_time()
        result = laufruhe.solve(problem)
        spent = time.process_time() - started
        best = result.objective
        fired = "-".join(map(str, result.phasing.ranking[0].firing_orders[0].order))
        rows.append(
            f"| {count} | {result.phasing.designs:,} | {spent:.1f} | {1e-6 * best.value:.3f} | "
            f"{result.certificate.kind} | {fired} |"
        )
    return rows


def main() -> None:
    """Write the page."""
    lines = [
        "# Torsional vibration",
        "",
        f"`problems/{PROBLEM.name}`: seven discs. Processor time of one core, medians of {RUNS} runs; our response",
        "has the torque of gas, pistons and rods in its time. Apart: largest difference over the largest value.",
        "",
        "| what | Laufruhe [ms] | openTorsion [ms] | ratio | apart |",
        "| --- | ---: | ---: | ---: | ---: |",
        *comparison_rows(),
        "",
        "## Firing orders against torsion",
        "",
        "Least root mean square of the shaft stress at two speeds, in all sections and orders, over all firing orders;",
        "the time is that of the whole solve. Limits left out.",
        "",
        "| cylinders | firing orders | seconds | least stress [N/mm^2] | proof | firing order |",
        "| ---: | ---: | ---: | ---: | --- | --- |",
        *ranked(),
        "",
    ]
    publish(OUT, "\n".join(lines))


if __name__ == "__main__":
    main()
