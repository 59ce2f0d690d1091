"""A problem that no method of its own decides: what a local search may say of it, and no more."""

from __future__ import annotations

import laufruhe
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.conclusion import FEASIBILITY_TOL
from laufruhe.solvers.result import Result


def searched(problem: Problem, seconds: float | None = None) -> Result:
    """Return the result of a search, which is no worse than the design as given and claims no bound."""
    result = laufruhe.solve(problem, time_limit=seconds)
    assert result.status.has_design
    assert result.certificate is not None
    assert result.certificate.kind is Proof.LOCAL
    assert result.certificate.lower_bound == 0.0
    assert result.certificate.method.startswith("local programs")
    assert result.objective is not None
    assert result.final.violation(result.problem.limits) <= FEASIBILITY_TOL
    if result.initial.violation(result.problem.limits) <= FEASIBILITY_TOL:
        assert result.objective.value <= result.objective.initial
    return result
