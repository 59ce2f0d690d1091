"""Smooth program of a problem as a dictionary for `casadi.nlpsol` (N1)."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.labelled_rows import named_values
from laufruhe.problem.decision import decision_vector
from laufruhe.problem.evaluation import objective_value
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.solvers.method import OF_MOUNTS
from laufruhe.solvers.smooth.program import SmoothProgram


def smooth_statement(problem: Problem) -> dict[str, Any]:
    """Return symbols, bounds, start and names of the smooth program (`Problem.to_casadi`)."""
    _refuse(problem)
    initial = evaluate_start(problem)
    size = np.inf if initial.resonance else objective_value(problem, initial)
    joint = SmoothProgram(problem, size if 0.0 < size < np.inf else 1.0)
    program = joint.program
    if program.external is not None:
        raise ModelError("a simulated measure has no symbols; remove it from objective and limits")
    constraints = ca.MX(0, 1) if program.constraints is None else program.constraints
    f, g = ca.substitute([program.objective, constraints], [program.parameters], [ca.DM(program.stages[-1])])
    mounts = [decision.real_start for decision in problem.mount_decisions]

    def values(x: Any) -> dict[str, float]:
        numbers, unbalances = joint.decision_values(np.array(x, dtype=float).reshape(-1))
        named = dict(zip((d.name for d in problem.mount_decisions), numbers, strict=True))
        return named | named_values(joint.domains, decision_vector(joint.domains, unbalances))

    return {
        "nlp": {"x": program.x, "f": f, "g": g},
        "bounds": {
            "lbx": program.lower, "ubx": program.upper,
            "lbg": program.constraint_lower, "ubg": program.constraint_upper,
        },
        "x0": np.clip(joint.start(mounts, decision_vector(joint.domains)), program.lower, program.upper),
        "names": joint.variable_names,
        "constraints": list(program.constraint_names),
        "values": values,
    }  # fmt: skip


def _refuse(problem: Problem) -> None:
    others = [d.name for d in problem.decisions if not d.rotor_drives and not d.mount_drives]
    others += problem.phasing.open_names if problem.phasing is not None else ()
    others += [extra.words for extra in problem.extras]
    if others:
        raise ModelError(f"the smooth program lacks {', '.join(others)}; fix or remove it")
    missing = [m.name for m in problem.measures if (m.channel.is_number and m.channel not in OF_MOUNTS)
               or not (m.channel.is_number or m.norm.is_convex)]  # fmt: skip
    if missing:
        raise ModelError(f"the smooth program has no formula for {', '.join(missing)}; remove it")
    if problem.ranks:
        raise ModelError("the smooth program has one objective; state one with problem.changed(ranks=())")
