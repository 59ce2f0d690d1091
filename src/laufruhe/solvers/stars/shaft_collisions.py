"""Exclude sets of optional shafts that collide with the engine or with each other."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.measure import Limit
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import violated_limits


def exclude_collisions(problem: Problem, limits: Sequence[Limit], initial: Evaluation) -> tuple[Problem, Evaluation]:
    """Return the problem without those optional shafts, alone or in pairs, that violate limits on their positions.

    Parameters
    ----------
    limits
        Limits that depend on the choice of shafts alone.
    initial
        Evaluation with all shafts.

    Returns
    -------
    The problem without these sets of shafts, and the evaluation without any optional shaft. Every design violates the
    limits that this evaluation violates.
    """
    placing = tuple(limit for limit in limits if limit.measure.channel.is_placing)
    phasing = problem.phasing
    if phasing is None or not (phasing.shafts.optional and placing):
        return problem, initial

    def evaluation_with(sets: Sequence[int]) -> Evaluation:
        left_out = phasing.without(sets)
        rotors = tuple(rotor for rotor in initial.engine.rotors if rotor.shaft.name not in left_out)
        return replace(initial, engine=replace(initial.engine, rotors=rotors))

    clashes: list[tuple[int, ...]] = []
    # a distance involves one shaft or two
    for count in (1, 2):
        for sets in itertools.combinations(range(len(phasing.shafts.optional)), count):
            is_known = any(set(clash) <= set(sets) for clash in clashes)
            if not is_known and violated_limits(placing, evaluation_with(sets)):
                clashes.append(sets)
    shafts = replace(phasing.shafts, clashes=tuple(clashes))
    return replace(problem, phasing=replace(phasing, shafts=shafts)), evaluation_with(())
