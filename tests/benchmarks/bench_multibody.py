"""The analytic mount forces of a four-cylinder beside a rigid-body simulation of the same accuracy, in one run.

Writes results/benchmarks/multibody.md. Ratios are what counts; the times are this machine's.
"""

from __future__ import annotations

import math
import statistics
import sys
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pages import PAGES, publish, spent

from laufruhe.load_models.affine import AffineModel
from laufruhe.machine import Engine, Mount, OperatingPoint, Rotor
from laufruhe.numerics.norms import NORMS
from laufruhe.physics.mount_forces import rigid_mounting
from laufruhe.physics.shaking_loads import forget, shaking_loads
from laufruhe.problem import channels
from laufruhe.problem.decision import Decision, RotorDrive
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Sector

OUT = PAGES / "multibody.md"

FloatArray = NDArray[np.float64]

SAMPLES = 720
TOLERANCE = 1e-5
STEPS = (360, 720, 960, 1200, 1320, 1440, 1560, 1680, 1800, 2160, 2880)
REPEATS = 9
MOUNTS = tuple(
    Mount(f"{end} {side}", (x, y, -0.05))
    for end, x in (("front", 0.30), ("rear", -0.40))
    for side, y in (("left", 0.25), ("right", -0.25))
)


@dataclass(frozen=True)
class Scene:
    """A four-cylinder as bodies and as an engine, and the simulation code at its quickest."""

    multibody: Any
    machine: Any
    engine: Engine
    point: OperatingPoint
    integrator: Any

    def simulated(self, steps: int) -> FloatArray:
        """Return the mount forces of one turn from the simulation, from its first step on."""
        loads = self.multibody.simulate(self.machine, steps, run_in=0, integrator=self.integrator)
        return mount_forces(self.engine, loads.reactions)

    def integration_seconds(self, steps: int) -> float:
        """Return the processor time of one turn; building the system and reading its forces are not counted."""
        model = self.multibody.build(self.machine, 0.0)
        return spent(lambda: self.multibody.integrate(model, steps, steps, self.integrator))

    def analytic(self) -> FloatArray:
        """Return the mount forces over the working cycle from the analytic loads."""
        return rigid_mounting(self.engine.mounts).forces(shaking_loads(self.engine, self.point)).sample(SAMPLES)

    def exact(self, steps: int) -> FloatArray:
        """Return the analytic mount forces where the simulation has its own."""
        angles = math.tau * np.arange(steps) / steps
        return mount_forces(self.engine, shaking_loads(self.engine, self.point).values(angles))

    def problem(self) -> Problem:
        """Return the same engine with two counterweights open, for the mean mount force."""
        weights = tuple(Rotor(name, x, 0j, radius=0.08) for name, x in (("front", 0.2), ("rear", -0.2)))
        decisions = tuple(Decision(w.name, "kg m", Sector(0.1), 0j, (RotorDrive(w.name, 1.0),)) for w in weights)
        engine = replace(self.engine, rotors=(*self.engine.rotors, *weights))
        objective = (Term(Measure(channels.MOUNT_FORCE, NORMS["mean"])),)
        return Problem("bench", "bench", engine, (self.point,), decisions, objective)

    def designs(self) -> Callable[[FloatArray], FloatArray]:
        """Return the exact mount forces at the same angles of the same engine with other counterweights (P1)."""
        _, norm = AffineModel(self.problem()).at(SAMPLES).terms[0]
        return norm.rows

    def lengthened(self, factor: float) -> Scene:
        """Return the scene with other rods, so that no evaluation is remembered."""
        rods = tuple(replace(part, rod_length=factor * part.rod_length) for part in self.engine.slider_cranks)
        return replace(self, engine=replace(self.engine, slider_cranks=rods))


def mount_forces(engine: Engine, wrench: FloatArray) -> FloatArray:
    """Return the forces on rigid mounts, shape (samples, mounts, 3) [N]."""
    return np.asarray(np.einsum("mij,nj->nmi", rigid_mounting(engine.mounts).maps, wrench))


def scene() -> Scene:
    """Return the four-cylinder of the validation tests on four mounts."""
    # exudyn reads this on import: the build without range checks
    vars(sys)["exudynFast"] = True
    multibody = import_module("validation.multibody")
    case = import_module("validation.test_multibody").four_cylinder()
    quickest = multibody.Integrator(tolerance=1e-8, reuse=True, sparse=True)
    return Scene(multibody, case.machine, replace(case.engine, mounts=MOUNTS), case.point, quickest)


def error(scene: Scene, steps: int) -> float:
    """Return the largest difference of a mount force over the largest mount force, after a first tenth of a turn.

    The analytic loads are exact in the step; what is measured is the simulation.
    """
    forces, exact = scene.simulated(steps), scene.exact(steps)
    settled = slice(steps // 10, None)
    return float(np.abs(forces - exact)[settled].max() / np.abs(exact).max())


def least_steps(scene: Scene) -> tuple[int, float]:
    """Return the fewest steps a turn within the tolerance, or those that come nearest."""
    tried = []
    for steps in STEPS:
        tried.append((steps, error(scene, steps)))
        if tried[-1][1] <= TOLERANCE:
            return tried[-1]
    return min(tried, key=lambda trial: trial[1])


def peak_memory(scene: Scene) -> int:
    """Return the peak memory of the analytic evaluation above that before it, with cached tables [bytes]."""
    tracemalloc.start()
    scene.analytic()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return peak


def same_rods_again(scene: Scene) -> float:
    """Return the processor time of an evaluation that remembers order coefficients of the rods and no loads."""
    forget()
    return spent(scene.analytic)


def of_others(evaluated: Callable[[Any], object], designs: Sequence[Any]) -> float:
    """Return the processor time of each of some designs that differ in their counterweights from one before."""
    evaluated(designs[0])
    return spent(lambda: [evaluated(design) for design in designs]) / len(designs)


def in_turns(scene: Scene, steps: int) -> tuple[float, ...]:
    """Return the medians of both simulations, and of the analytic forces in four ways, in turns."""
    plain = replace(scene, integrator=scene.multibody.Integrator(tolerance=1e-8, reuse=False, sparse=False))
    scene.integration_seconds(steps), scene.analytic()
    designs, problem, rounds = scene.designs(), scene.problem(), []
    for k in range(REPEATS):
        new = scene.lengthened(1.0 + 1e-3 * (k + 1))
        others = [np.full(4, 1e-3 * k + 1e-5 * j) for j in range(20)]
        engines = [problem.design((complex(*x[:2]), complex(*x[2:]))) for x in others]
        rounds.append(
            (
                scene.integration_seconds(steps),
                plain.integration_seconds(steps),
                spent(new.analytic),
                same_rods_again(new),
                of_others(lambda engine: objective_value(problem, evaluate(problem, engine, SAMPLES)), engines),
                of_others(designs, others),
            )
        )
    return tuple(statistics.median(times) for times in zip(*rounds, strict=True))


def main() -> None:
    """Measure and write the table."""
    four = scene()
    memory = peak_memory(four)
    steps, reached = least_steps(four)
    simulated, plain, fresh, again, mean, affine = in_turns(four, steps)
    lines = [
        "# Four-cylinder: analytic mount forces beside a multibody simulation",
        "",
        "The simulation (exudyn, generalised-alpha, 12 rigid bodies, the build without range checks, sparse matrices,",
        "kept Jacobians) is the integration of one turn alone, with the fewest steps of those tried that reach an",
        f"error of {TOLERANCE:.0e} of the largest mount force once a tenth of the turn has settled the start. The",
        f"analytic side is the shaking loads with exact kinematics, the mounting, and the forces at {SAMPLES} angles.",
        f"Medians of {REPEATS} runs taken in turns on one machine, in processor time.",
        "",
        "| what | error | ms | simulation over it |",
        "| --- | ---: | ---: | ---: |",
        f"| exudyn, {steps} steps | {reached:.1e} | {1e3 * simulated:.1f} | 1 |",
        f"| exudyn, dense matrices, new Jacobians | {reached:.1e} | {1e3 * plain:.1f} | {simulated / plain:.2f} |",
        f"| analytic, other rods every time | rounding | {1e3 * fresh:.2f} | {simulated / fresh:.0f} |",
        f"| analytic, same rods again | rounding | {1e3 * again:.2f} | {simulated / again:.0f} |",
        f"| mean force, engine with other counterweights | rounding | {1e3 * mean:.3f} | {simulated / mean:.0f} |",
        f"| analytic, same engine, other counterweights | rounding | {1e3 * affine:.3f} | {simulated / affine:.0f} |",
        "",
        "The last row is what a solver and a sweep call: loads are affine in the unbalances, so another design is one",
        "product with matrices that were computed once. The row above begins with the engine.",
        "",
        f"Peak memory of the analytic evaluation above imports: {memory / 2**20:.2f} MiB.",
    ]
    text = "\n".join(lines) + "\n"
    publish(OUT, text)


if __name__ == "__main__":
    main()
