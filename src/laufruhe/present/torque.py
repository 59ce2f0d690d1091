"""Whether a result shows the torque of its crankshaft."""

from __future__ import annotations

from laufruhe.physics.reduced_inertia import turning_inertia
from laufruhe.solvers.result import Result


def asks_torque(result: Result) -> bool:
    """Whether a flywheel is told, or the inside of the crankcase is asked for."""
    problem = result.problem
    asked = any(measure.is_inside for measure in problem.measures)
    return asked or turning_inertia(result.final.engine, problem.fidelity) is not None
