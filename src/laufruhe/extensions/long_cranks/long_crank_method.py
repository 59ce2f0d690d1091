"""Row of the table of methods that long cranks add."""

from __future__ import annotations

from laufruhe.numerics.processes import call_by_name
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import Dependence
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.method import BUILT, Method, is_pointwise


def is_long(problem: Problem) -> bool:
    """Return True if even stars are open that are too many to be listed."""
    result: bool = call_by_name("laufruhe.solvers.stars.even_search:is_long", problem)
    return result


LONG_CRANKS = Method(
    "stars of long cranks, each with cones",
    {Kind.STAR: BUILT, Kind.UNBALANCE: (Dependence.AFFINE,)},
    ProofStrength.WHOLE,
    "laufruhe.extensions.long_cranks.long_crank_search:solve_long_cranks",
    True,
    norms=is_pointwise,
    also=is_long,
    proves="the optimum of up to sixteen throws with nothing else open, and of cranks without couples; else a bound",
    before="stars, each with cones",
)
