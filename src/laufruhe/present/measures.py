"""Loads of an evaluation for tables, files and pictures, point by point."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.spectrum import Spectrum, order_amplitude
from laufruhe.physics.bearing_loads import has_bearing_loads
from laufruhe.physics.torque import turning_inertia
from laufruhe.present.numbers import with_unit
from laufruhe.problem.channels import (
    CHANNELS,
    CRANK_PIN_FORCE,
    CRANK_PIN_PRESSURE,
    FRICTION_POWER,
    MAIN_BEARING_FORCE,
    MOUNT_FORCE,
    LoadChannel,
)
from laufruhe.problem.evaluation import Evaluation, channel_samples
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, limit_values
from laufruhe.solvers.result import FINAL, INITIAL, Result
from laufruhe.solvers.stars.ranking import PhasingResult
from laufruhe.solvers.values import LimitValue


@dataclass(frozen=True)
class Places:
    """A force, or its power, shown place by place: key in `result.json`, title, first head and note of its table."""

    key: str
    channel: LoadChannel
    title: str
    place: str
    note: Callable[[Problem], str] = lambda _: ""


MOUNTS = Places("mounts", MOUNT_FORCE, "Mount forces", "mount")
BEARINGS = Places("main_bearings", MAIN_BEARING_FORCE, "Main-bearing forces", "bearing")
PINS = Places("crank_pins", CRANK_PIN_FORCE, "Crank-pin forces", "pin of", lambda problem: pin_note(problem))
FRICTION = Places("friction", FRICTION_POWER, "Friction power of main bearings", "bearing")


def places_of(result: Result) -> list[Places]:
    """Return the quantities that a result shows for each mount, bearing, pin or other place."""
    engine, problem = result.problem.engine, result.problem
    titled = () if problem.fidelity.has_uneven_speed else titled_places()
    mounts = [MOUNTS] if engine.mounts else []
    return [
        *mounts,
        *_crankcase_places(problem),
        *(one for one in titled if one.channel.needs.of(engine) and one.channel.places(engine)),
    ]


def _crankcase_places(problem: Problem) -> list[Places]:
    # the requested quantities, or all if the engine has bearings
    bearings, requested = problem.engine.bearings, {measure.channel for measure in problem.measures}
    rubs = all(bearing.friction is not None for bearing in bearings)
    has_data = {BEARINGS: bool(bearings), PINS: bool(bearings), FRICTION: bool(bearings) and rubs}
    inside = has_bearing_loads(problem.engine, problem.fidelity)
    return [
        places for places, is_available in has_data.items() if inside and (is_available or places.channel in requested)
    ]


def pin_note(problem: Problem) -> str:
    """Return a sentence on the mass whose pull the crank-pin forces include (B3); empty if no such force is shown."""
    masses = [part.rotating_mass for part in problem.engine.slider_cranks if part.master_bank is None]
    if not {CRANK_PIN_FORCE, CRANK_PIN_PRESSURE} & {
        *(measure.channel for measure in problem.measures), *(places.channel for places in _crankcase_places(problem))
    }:  # fmt: skip
        return ""
    if not any(masses):
        return (
            "Crank-pin forces have no pull of a big end, because no [engine.rod] gives its mass; rotating_mass of a "
            "throw loads the main bearings alone."
        )
    masses_text = " to ".join(dict.fromkeys(with_unit(mass, "kg") for mass in (min(masses), max(masses))))
    return f"Crank-pin forces include the pull of a rotating mass of {masses_text} at each pin."


def titled_places() -> list[Places]:
    """Return the loads that every report shows at their places, such as those of extensions."""
    loads = [Measure(channel).load for channel in CHANNELS.values() if channel.title]
    return [Places(load.name.replace(" ", "_"), load, load.title, load.place) for load in loads]


def hardest_point(result: Result) -> int:
    """Return the index of the operating point with the largest loads of the initial design."""
    sizes = [float(np.abs(main_load(loads).coefficients).max(initial=0.0)) for loads in result.initial.loads]
    return int(np.argmax(sizes))


def main_load(loads: PointLoads) -> Spectrum:
    """Return mount forces, or the shaking force of an engine without mounts."""
    return loads.wrench if loads.mount_forces is None else loads.mount_forces


def mount_orders(spectrum: Spectrum) -> Array:
    """Return the amplitude by order of every mount's force, shape (orders, mounts) [N]."""
    # a resonance has no finite amplitude
    with np.errstate(invalid="ignore"):
        return order_amplitude(spectrum.coefficients)


def shaking_orders(wrench: Spectrum) -> tuple[Array, Array]:
    """Return the amplitude by order of the shaking force [N] and of the moment about the origin of C2 [N m]."""
    return order_amplitude(wrench.coefficients[:, :3]), order_amplitude(wrench.coefficients[:, 3:])


def moment_orders(wrench: Spectrum) -> tuple[Array, Array]:
    """Return the amplitude by order of the roll moment and of the rocking couple [N m] (C2)."""
    return order_amplitude(wrench.coefficients[:, 3:4]), order_amplitude(wrench.coefficients[:, 4:])


def pad_orders(values: Array, length: int) -> Array:
    """Return values with zeros for missing orders."""
    return np.pad(values, [(0, length - len(values))] + [(0, 0)] * (values.ndim - 1))


def limits_of(result: Result) -> tuple[LimitValue, ...]:
    """Return the limits of a solved result, or the limits of an evaluated design."""
    return result.limits or limit_values(result.problem, result.final)


def breaks_a_limit(problem: Problem, evaluation: Evaluation) -> bool:
    """Return True if a design violates a limit of its problem."""
    return not all(is_met(limit) for limit in limit_values(problem, evaluation))


def is_met(limit: LimitValue) -> bool:
    """Return True if the design keeps a limit within the tolerance of feasible designs."""
    sign = 1.0 if limit.side == "at most" else -1.0
    return sign * (limit.value - limit.limit) <= FEASIBILITY_TOL * (abs(limit.limit) or 1.0)


def has_mounts(result: Result) -> bool:
    """Return True for rigid or elastic mounts."""
    return bool(result.problem.engine.mounts)


def has_firing(result: Result) -> bool:
    """Return True if cylinders fire; chambers of steam and pumps do not."""
    return all(point.gas is None or point.gas.fires for point in result.problem.points)


def firing_words(result: Result) -> tuple[str, str]:
    """Return the names of the marked events, for all cylinders and for one."""
    if has_firing(result):
        return "firings", "a cylinder fires"
    return "dead centres at the head end", "a dead centre at the head end"


def has_loads(result: Result) -> bool:
    """Return True if there are operating points and the final design has finite loads, not on a resonance."""
    return bool(result.problem.points) and not evaluations_with_loads(result)[-1].resonance


def has_mount_forces(result: Result) -> bool:
    """Return True if there are mount forces to draw."""
    return has_mounts(result) and has_loads(result)


def has_ranking(result: Result) -> bool:
    """Return True if stars or firing orders were open and some were found."""
    return result.phasing is not None and bool(result.phasing.ranking)


def ranking_of(result: Result) -> PhasingResult:
    """Return the ranking of stars; `ValueError` without phasing."""
    if result.phasing is None:
        raise ValueError("the result ranks no crank stars, because neither throws nor firing order were open")
    return result.phasing


def is_changed(result: Result) -> bool:
    """Return True if the final design differs from the initial design."""
    return result.final is not result.initial


def designs_with_loads(result: Result) -> dict[str, Evaluation]:
    """Return the designs with finite loads, by name; the final design is always among them."""
    return {name: design for name, design in result.designs.items() if design is result.final or not design.resonance}


def decided_design(result: Result) -> str:
    """Return the name of the design that tables of one design show."""
    return f"{FINAL if is_changed(result) else INITIAL} design"


def evaluations_with_loads(result: Result) -> list[Evaluation]:
    """Return the designs with finite loads as a list."""
    return list(designs_with_loads(result).values())


def has_bearings(result: Result) -> bool:
    """Return True if there are main-bearing loads to draw."""
    return BEARINGS in places_of(result) and has_loads(result)


def bearing_paths(design: Evaluation, k: int) -> ComplexArray:
    """Return main-bearing forces at an operating point, upward + i leftward, shape (angles, bearings) [N]."""
    samples = channel_samples(design, k, BEARINGS.channel)
    return np.asarray(samples[..., 2] + 1j * samples[..., 1])


def as_crank_turns(design: Evaluation, steps: int) -> ComplexArray:
    """Return factors that turn forces into the frame of the crank, shape (steps,)."""
    return np.asarray(np.exp(-1j * design.engine.cycle.angle * np.arange(steps) / steps))


def objective_unit(result: Result) -> str:
    """Return the SI unit of the objective; empty without one."""
    return result.objective.unit if result.objective else ""


def uses_torque(result: Result) -> bool:
    """Return True with a flywheel, or for measures inside the crankcase."""
    problem = result.problem
    is_requested = any(measure.is_inside for measure in problem.measures)
    return is_requested or turning_inertia(result.final.engine, problem.fidelity) is not None
