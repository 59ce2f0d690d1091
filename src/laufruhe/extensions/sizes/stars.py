"""Crank stars, firing orders and shafts with open sizes of the running gear: a problem for each star (Z12, Z14).

The best value so far bounds the search of the next star.
"""

from __future__ import annotations

import time
from dataclasses import replace

from laufruhe.errors import ModelError
from laufruhe.extensions.sizes.solver import solve_sizes
from laufruhe.problem.problem import Problem
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.families import families_of
from laufruhe.solvers.stars.phasing_solver import even_stars, solve_every_order
from laufruhe.solvers.stars.star_results import no_star
from laufruhe.solvers.throws.throw_starts import why_none_fires

MAX_STARS = 60
"""Most stars that are solved one by one."""


def solve_star_sizes(problem: Problem) -> Result:
    """Return the best star with its optimal sizes and unbalances.

    Raises
    ------
    ModelError
        If there are too many stars, or throws are open that need not fire evenly.
    """
    phasing = problem.phasing
    if phasing is None:
        raise ValueError("nothing of the phasing is open")
    started = time.perf_counter()
    if phasing.continuous or phasing.throw_bounds is not None:
        rule = "open sizes need even firing or fixed throws"
        raise ModelError(f"{rule}; leave phasing.intervals and bounds of throws out, or fix the sizes")
    if phasing.throws is None and sum(family.size for family in families_of(phasing)[0]) > MAX_STARS:
        many = f"more than {MAX_STARS} stars are open together with sizes"
        raise ModelError(f"{many}; fix the firing order or the sizes")
    stars = even_stars(phasing)
    if not stars:
        return no_star(problem, why_none_fires(phasing)[0])
    result = solve_every_order(problem, phasing, stars, solve_sizes)
    return replace(result, timing={**result.timing, "phasing": time.perf_counter() - started})
