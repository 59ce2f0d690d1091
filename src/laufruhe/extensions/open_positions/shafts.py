"""Reduction of optional shafts that collide: they are not built together."""

from __future__ import annotations

import itertools
from dataclasses import replace

from laufruhe.extensions.open_positions.channels import ShaftChannel
from laufruhe.problem.dependence import depends, open_kinds
from laufruhe.problem.measure import Limit
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import violated_limits
from laufruhe.solvers.methods import Decide, Reduction, with_shafts
from laufruhe.solvers.result import Result


def _fixed_distances(problem: Problem) -> list[Limit]:
    # limits that depend on the choice of shafts alone
    if problem.phasing is None or not problem.phasing.shafts.optional or problem.phasing.shafts.clashes:
        return []
    channels, kinds = ((limit, limit.measure.channel) for limit in problem.limits), open_kinds(problem)
    return [limit for limit, one in channels if isinstance(one, ShaftChannel) and not depends(one, kinds, problem)]


def _without_collisions(problem: Problem, _: Decide, rest: Decide) -> Result:
    phasing, limits, initial = problem.phasing, _fixed_distances(problem), evaluate_start(problem)
    assert phasing is not None
    clashes: list[tuple[int, ...]] = []
    # a distance involves one shaft or two
    for count in (1, 2):
        for sets in itertools.combinations(range(len(phasing.shafts.optional)), count):
            is_known = any(set(clash) <= set(sets) for clash in clashes)
            if not is_known and violated_limits(limits, with_shafts(problem, initial, sets)):
                clashes.append(sets)
    shafts = replace(phasing.shafts, clashes=tuple(clashes))
    return rest(replace(problem, phasing=replace(phasing, shafts=shafts)))


COLLISIONS = Reduction(
    "collisions of shafts", lambda problem: bool(_fixed_distances(problem)), _without_collisions,
    before="constant limits",
)  # fmt: skip
