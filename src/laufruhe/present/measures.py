"""What tables, files and pictures read from an evaluation: mount forces and orders, point by point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe.machine import Chambers
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.spectrum import Spectrum, order_amplitude
from laufruhe.physics.bearing_loads import has_bearing_loads
from laufruhe.physics.reduced_inertia import turning_inertia
from laufruhe.problem.channels import (
    CHANNELS,
    CRANK_PIN_FORCE,
    FRICTION_POWER,
    MAIN_BEARING_FORCE,
    MOUNT_FORCE,
    LoadChannel,
)
from laufruhe.problem.evaluation import Evaluation, samples_of
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import limit_values
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.ranking import PhasingResult
from laufruhe.solvers.values import LimitValue


@dataclass(frozen=True)
class Places:
    """A force, or its power, that tables, files and pictures show place by place.

    Attributes
    ----------
    key
        In `result.json`.
    title, place
        In a table.
    """

    key: str
    channel: LoadChannel
    title: str
    place: str


MOUNTS = Places("mounts", MOUNT_FORCE, "Mount forces", "mount")
BEARINGS = Places("main_bearings", MAIN_BEARING_FORCE, "Main-bearing forces", "bearing")
PINS = Places("crank_pins", CRANK_PIN_FORCE, "Crank-pin forces", "pin of")
FRICTION = Places("friction", FRICTION_POWER, "Friction power of main bearings", "bearing")


def places_of(result: Result) -> list[Places]:
    """Return what a result shows by places; inside the crankcase what is asked, and all where bearings are given."""
    engine, problem = result.problem.engine, result.problem
    asked, inside = {measure.channel for measure in problem.measures}, has_bearing_loads(engine, problem.fidelity)
    shown = [MOUNTS] if engine.mounts else []
    rubs = all(bearing.friction is not None for bearing in engine.bearings)
    given = {BEARINGS: bool(engine.bearings), PINS: bool(engine.bearings), FRICTION: bool(engine.bearings) and rubs}
    shown += [places for places, known in given.items() if inside and (known or places.channel in asked)]
    loads = [Measure(channel).load for channel in CHANNELS.values() if channel.title and not problem.fidelity.is_uneven]
    found = [load for load in loads if load.needs.of(engine) and load.places(engine)]
    return [*shown, *(Places(load.name.replace(" ", "_"), load, load.title, load.place) for load in found)]


def hardest_point(result: Result) -> int:
    """The operating point whose loads are largest in the design as given."""
    sizes = [float(np.abs(main_load(loads).coefficients).max(initial=0.0)) for loads in result.initial.loads]
    return int(np.argmax(sizes))


def main_load(loads: PointLoads) -> Spectrum:
    """Mount forces, or the shaking force of an engine without mounts."""
    return loads.wrench if loads.mount_forces is None else loads.mount_forces


def mount_orders(spectrum: Spectrum) -> Array:
    """Amplitude by order of every mount's force, shape (orders, mounts) [N]."""
    # on a resonance there is none
    with np.errstate(invalid="ignore"):
        return order_amplitude(spectrum.coefficients)


def shaking_orders(wrench: Spectrum) -> tuple[Array, Array]:
    """Amplitude by order of the shaking force [N] and of the moment about the origin of C2 [N m]."""
    return order_amplitude(wrench.coefficients[:, :3]), order_amplitude(wrench.coefficients[:, 3:])


def moment_orders(wrench: Spectrum) -> tuple[Array, Array]:
    """Amplitude by order of the roll moment, about the crank axis, and of the rocking couple, across it [N m] (C2)."""
    return order_amplitude(wrench.coefficients[:, 3:4]), order_amplitude(wrench.coefficients[:, 4:])


def padded(values: Array, length: int) -> Array:
    """Zeros for orders that one of two designs does not have."""
    return np.pad(values, [(0, length - len(values))] + [(0, 0)] * (values.ndim - 1))


def limits_of(result: Result) -> tuple[LimitValue, ...]:
    """Limits as solved, or how an evaluated design stands to those of its problem."""
    return result.limits or limit_values(result.problem, result.final)


def breaks_a_limit(problem: Problem, evaluation: Evaluation) -> bool:
    """Whether a design keeps not all limits of its problem."""
    return not all(is_met(limit) for limit in limit_values(problem, evaluation))


def is_met(limit: LimitValue) -> bool:
    """Whether the design keeps a limit, up to the rounding of a solver."""
    sign = 1.0 if limit.side == "at most" else -1.0
    return sign * (limit.value - limit.limit) <= 1e-6 * (abs(limit.limit) or 1.0)


def has_mounts(result: Result) -> bool:
    """Whether there are mounts, rigid or elastic."""
    return bool(result.problem.engine.mounts)


def has_firing(result: Result) -> bool:
    """Whether its cylinders fire; chambers of steam and pumps work from a dead centre to the next."""
    return not any(isinstance(point.gas, Chambers) for point in result.problem.points)


def firing_words(result: Result) -> tuple[str, str]:
    """What is marked over a cycle, of all cylinders and of one."""
    if has_firing(result):
        return "firings", "a cylinder fires"
    return "dead centres at the head end", "a dead centre at the head end"


def has_loads(result: Result) -> bool:
    """Whether there are loads to draw: on a resonance they are infinite."""
    return bool(result.problem.points) and not load_designs(result)[-1].resonance


def has_mount_forces(result: Result) -> bool:
    """Whether there are mount forces to draw."""
    return has_mounts(result) and has_loads(result)


def has_ranking(result: Result) -> bool:
    """Whether stars and firing orders were open, and some were found."""
    return result.phasing is not None and bool(result.phasing.ranking)


def ranking_of(result: Result) -> PhasingResult:
    """Stars and firing orders of a result that has them."""
    if result.phasing is None:
        raise ValueError("a result without phasing has no star")
    return result.phasing


def changed(result: Result) -> bool:
    """Whether the design is another than the one given."""
    return result.final is not result.initial


def loaded(result: Result) -> dict[str, Evaluation]:
    """Designs whose loads are shown, by name: a resonance of the one given leaves the other."""
    return {name: design for name, design in result.designs.items() if design is result.final or not design.resonance}


def load_designs(result: Result) -> list[Evaluation]:
    """The same in their order."""
    return list(loaded(result).values())


def has_bearings(result: Result) -> bool:
    """Whether there are main bearings with loads to draw."""
    return BEARINGS in places_of(result) and has_loads(result)


def bearing_paths(design: Evaluation, k: int) -> ComplexArray:
    """Force on every main bearing at an operating point, up and left as one number, shape (angles, bearings) [N]."""
    samples = samples_of(design, k, BEARINGS.channel)
    return np.asarray(samples[..., 2] + 1j * samples[..., 1])


def as_crank_turns(design: Evaluation, steps: int) -> ComplexArray:
    """What turns forces at as many angles of a cycle into those that the crank feels."""
    return np.asarray(np.exp(-1j * design.engine.cycle.angle * np.arange(steps) / steps))


def objective_unit(result: Result) -> str:
    """SI unit of what was minimised; empty where nothing was."""
    return result.objective.unit if result.objective else ""


def asks_torque(result: Result) -> bool:
    """Whether a flywheel is told, or the inside of the crankcase is asked for."""
    problem = result.problem
    asked = any(measure.is_inside for measure in problem.measures)
    return asked or turning_inertia(result.final.engine, problem.fidelity) is not None
