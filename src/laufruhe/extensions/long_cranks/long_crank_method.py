"""Method for long cranks, one row of the table of methods."""

from __future__ import annotations

from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import Dependence
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.method import BUILT, Method, imported, is_pointwise


def _is_long(problem: Problem) -> bool:
    from laufruhe.solvers.stars.even_search import is_long

    return is_long(problem)


LONG_CRANKS = Method(
    "stars of long cranks, each with cones",
    {Kind.STAR: BUILT, Kind.UNBALANCE: (Dependence.AFFINE,)},
    ProofStrength.EXACT,
    imported("laufruhe.extensions.long_cranks.long_crank_search:solve_long_cranks"),
    refines_fidelity=True,
    accepts_norm=is_pointwise,
    accepts_problem=_is_long,
    proves=(
        "the optimum of up to nineteen throws with nothing else open (eighteen with a mean force on one core in ten "
        "minutes), and of cranks without couples; else a bound"
    ),
    before="stars, each with cones",
)
