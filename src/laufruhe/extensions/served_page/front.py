"""The front between what is minimised and another measure: one bounded point after the other, the whole seen early."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

from laufruhe.errors import ModelError
from laufruhe.extensions.served_page.following import Followed, Follower, can_follow
from laufruhe.files.complaints import Refused
from laufruhe.files.measures import QuantityTable, Scene
from laufruhe.problem.measure import Limit, Measure, Term
from laufruhe.problem.problem import Problem

POINTS = 25
_USUAL = ("maximum mount force", "mean mount force", "rms shaking force", "rms rocking couple", "counterweight mass",
          "balancer mass", "maximum main-bearing force")  # fmt: skip
_NARROW = 1e-3
"""Of the whole range: ends that are nearer have nothing between them."""


def partners(problem: Problem) -> dict[str, Measure]:
    """Norms that the objective may be traded against, by name: those that are asked, then usual ones."""
    if not can_follow(problem):
        return {}
    own = {term.measure for term in problem.objective}
    found = {limit.name: limit.measure for limit in problem.limits if limit.maximum < math.inf}
    found |= {m.name: m for rank in problem.ranks for m in (term.measure for term in rank.terms)}
    scene = Scene(problem.engine, problem.points)
    for name in _USUAL:
        with suppress(Refused):
            found.setdefault(name, scene.measure(name, QuantityTable(), f"front.{name}"))
    return {name: m for name, m in found.items() if m not in own and not m.channel.is_number}


class Front:
    """Points of a front, asked for one at a time."""

    def __init__(self, problem: Problem, across: Measure) -> None:
        if not can_follow(problem):
            raise ModelError("what is open here has no front that is drawn while one looks; hold what is not affine")
        others = tuple(limit for limit in problem.limits if limit.measure != across)
        top = 1e300
        self._limit = Limit(across.name, across, top)
        self.others = others
        alone = problem.changed(limits=(*others, self._limit), ranks=())
        self.problem, self.across = alone, across
        self._follower = Follower(alone)
        self._least = Follower(alone.changed(objective=(Term(across),), limits=others))

    def ends(self) -> tuple[float, float]:
        """Least of the other measure, and what it is where the objective is least."""
        least = self._least.at(self.others)
        if least.conflict:
            raise ModelError(f"no design keeps {' and '.join(least.conflict)}")
        free = self._follower.at((*self.others, self._limit))
        return least.value, max(free.standing[-1], least.value)

    def at(self, most: float) -> Followed:
        """The least objective with no more of the other than this, where the last limit stands; a conflict else."""
        return self._follower.at((*self.others, replace(self._limit, maximum=most)))


def places(low: float, high: float, count: int = POINTS) -> Iterator[float]:
    """Where to look between two ends: they themselves, then always the middles, so that the whole is seen early."""
    if high - low <= _NARROW * abs(high):
        yield high
        return
    # the least of the other measure is known up to a solver's tolerance
    yield high
    yield low + 1e-4 * (high - low)
    told, parts = 2, 2
    while told < count:
        for k in range(1, parts, 2):
            yield low + (high - low) * k / parts
            told += 1
            if told >= count:
                return
        parts *= 2
