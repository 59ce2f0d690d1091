"""Optional shafts that have no room where they stand: alone, or beside each other."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

from laufruhe.problem.evaluation import Evaluation, with_fine_sampling
from laufruhe.problem.measure import Limit
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import broken_limits


def with_room(problem: Problem, limits: Sequence[Limit], given: Evaluation) -> tuple[Problem, Evaluation]:
    """The problem without choices of shafts that break limits on where these stand.

    Parameters
    ----------
    limits
        That nothing open moves, but for which shafts are built.
    given
        With all shafts.

    Returns
    -------
    The problem, and what is given with as few shafts as may be: what that breaks, every design does.
    """
    placing = tuple(limit for limit in limits if limit.measure.channel.is_placing)
    phasing = problem.phasing
    if phasing is None or not (phasing.shafts.optional and placing):
        return problem, given

    def built(sets: Sequence[int]) -> Evaluation:
        gone = phasing.without(sets)
        rotors = tuple(rotor for rotor in given.engine.rotors if rotor.shaft.name not in gone)
        return replace(given, engine=replace(given.engine, rotors=rotors))

    clashes: list[tuple[int, ...]] = []
    # every distance is that of one shaft, or of two
    for count in (1, 2):
        for sets in itertools.combinations(range(len(phasing.shafts.optional)), count):
            known = any(set(clash) <= set(sets) for clash in clashes)
            if not known and broken_limits(placing, built(sets)):
                clashes.append(sets)
    shafts = replace(phasing.shafts, clashes=tuple(clashes))
    return replace(problem, phasing=replace(phasing, shafts=shafts)), built(())


def surely_broken(limits: Sequence[Limit], evaluation: Evaluation) -> tuple[str, ...]:
    """Of limits that nothing open moves those that are broken: many angles tell, and not the few of a fidelity (P7)."""
    return broken_limits(limits, with_fine_sampling(evaluation))
