"""Loads of an evaluation for tables, files and pictures, point by point."""

from __future__ import annotations

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum, order_amplitude
from laufruhe.problem.channels import LoadChannel, load_channels
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, limit_values
from laufruhe.solvers.result import FINAL, INITIAL, Result
from laufruhe.solvers.stars.ranking import PhasingResult
from laufruhe.solvers.values import LimitValue


def places_of(result: Result) -> list[LoadChannel]:
    """Return the loads of which a result has a table for each mount, bearing, pin or other place."""
    return [load for load in displayed_loads(result.problem) if load.display.title]


def displayed_loads(problem: Problem) -> list[LoadChannel]:
    """Return the loads that the results of a problem show place by place."""
    requested = {measure.channel for measure in problem.measures}
    return [load for load in load_channels() if load.is_displayed(problem.engine, problem.fidelity, requested)]


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


def objective_unit(result: Result) -> str:
    """Return the SI unit of the objective; empty without one."""
    return result.objective.unit if result.objective else ""
