"""Pareto front between the objective and another measure, computed point by point from coarse to fine."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

from laufruhe.errors import ModelError
from laufruhe.extensions.served_page.follower import Follower, SliderOptimum, can_follow
from laufruhe.files.complaints import Refused
from laufruhe.files.measures import MeasureContext, QuantityTable
from laufruhe.problem.measure import Limit, Measure, Term
from laufruhe.problem.problem import Problem

POINTS = 25
"""Points of a front."""
_USUAL = ("maximum mount force", "mean mount force", "rms shaking force", "rms rocking couple", "counterweight mass",
          "balancer mass", "maximum main-bearing force")  # fmt: skip
_NARROW = 1e-3
"""Relative width of a range that is too narrow for points within it."""


def partners(problem: Problem) -> dict[str, Measure]:
    """Return measures for the second axis of a Pareto front, by name: those of the problem, then common ones."""
    if not can_follow(problem):
        return {}
    minimised = {term.measure for term in problem.objective}
    measures = {limit.name: limit.measure for limit in problem.limits if limit.maximum < math.inf}
    measures |= {m.name: m for rank in problem.ranks for m in (term.measure for term in rank.terms)}
    context = MeasureContext(problem.engine, problem.points)
    for name in _USUAL:
        with suppress(Refused):
            measures.setdefault(name, context.measure(name, QuantityTable(), f"front.{name}"))
    return {name: m for name, m in measures.items() if m not in minimised and not m.channel.is_number}


class ParetoFront:
    """Pareto front between the objective and the measure `across`, computed point by point."""

    def __init__(self, problem: Problem, across: Measure) -> None:
        if not can_follow(problem):
            raise ModelError(
                "a live Pareto front needs loads that are affine in the open numbers; fix all but unbalances"
            )
        self.across, self.others = across, tuple(limit for limit in problem.limits if limit.measure != across)
        self._limit = Limit(across.name, across, 1e300)
        self.problem = problem.changed(limits=(*self.others, self._limit), ranks=())
        self._follower = Follower(self.problem)
        self._minimum = Follower(self.problem.changed(objective=(Term(across),), limits=self.others))

    def ends(self) -> tuple[float, float]:
        """Return the ends of the Pareto front: minimum of the other measure, and its value at the least objective."""
        minimum = self._minimum.at(self.others)
        if minimum.conflict:
            raise ModelError(f"no design satisfies the limits {' and '.join(minimum.conflict)} together")
        free = self._follower.at((*self.others, self._limit))
        return minimum.value, max(free.standing[-1], minimum.value)

    def at(self, maximum: float) -> SliderOptimum:
        """Return the least objective with the other measure at most `maximum`, or a conflict."""
        return self._follower.at((*self.others, replace(self._limit, maximum=maximum)))


def places(low: float, high: float, count: int = POINTS) -> Iterator[float]:
    """Yield `count` values from `low` to `high`: the ends, then midpoints, so that the front is visible early."""
    if high - low <= _NARROW * abs(high):
        yield high
        return
    # the minimum is accurate to the solver's tolerance
    yield high
    yield low + 1e-4 * (high - low)
    yielded, parts = 2, 2
    while yielded < count:
        for k in range(1, parts, 2):
            yield low + (high - low) * k / parts
            yielded += 1
            if yielded >= count:
                return
        parts *= 2
