"""Throws that leave the even steps as numbers of a problem: the engine is put together anew for each crank.

A local program (`solvers.general`) then decides throws together with whatever else is open.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

from laufruhe.errors import ModelError, counted
from laufruhe.numerics.budget import until_time_limit
from laufruhe.numerics.progress import search_scope, with_progress
from laufruhe.problem.decision import AddressDrive, Decision
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Drawing, Path, Phasing, Problem
from laufruhe.problem.sets import Interval
from laufruhe.solvers.conclusion import quoted
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.ranking import ranked_star, ranking_result
from laufruhe.solvers.stars.star_results import no_star, with_star
from laufruhe.solvers.throws.throw_starts import firing_intervals, starts_of, why_none_fires

MOST_STARTS, MOST_SEARCHES = 4, 4
"""Cranks that throws leave, and starts of the search for each."""
CRANK, BANK, SPLIT = "crank", "bank angle", "split pin angle"


@dataclass(frozen=True)
class _MovedCrank:
    """Drawing of a crank whose throws, bank angle and split pins are moved."""

    phasing: Phasing
    candidate: Candidate

    def at(self, changes: Mapping[Path, str | float]) -> Candidate:
        """Return the crank with these angles."""
        crank = self.candidate
        bank, split = (
            None if angle is None else float(changes.get((CRANK, name), angle))
            for name, angle in ((BANK, crank.bank_angle), (SPLIT, crank.split_pin))
        )
        throws = tuple(float(changes.get((CRANK, k), angle)) for k, angle in enumerate(crank.throws))
        return replace(crank, throws=throws, bank_angle=bank, split_pin=split)

    def __call__(self, changes: Mapping[Path, str | float]) -> Drawing:
        """Return the drawing, or raise `ModelError` if the crank does not keep the firing intervals allowed."""
        candidate = self.at(changes)
        if candidate.firing_order and not self.phasing.intervals.holds(firing_intervals(self.phasing, candidate)):
            raise ModelError(f"these throws do not fire {self.phasing.intervals.text} apart")
        realised = self.phasing.realise(candidate)
        others = {path: value for path, value in changes.items() if path[0] != CRANK}
        if others:
            return realised.rebuild(others)
        return Drawing(realised.engine, realised.points, realised.decisions, realised.mount_numbers)


def solve_moved_throws(problem: Problem, phasing: Phasing, search: Callable[[Problem], Result]) -> Result:
    """Return the best of the local optima that a few cranks lead to, everything that is open moved together.

    Parameters
    ----------
    search
        A local search over numbers.
    """
    starts = starts_of(phasing, None, problem.depends_on_gas)[:MOST_STARTS]
    if not starts:
        return no_star(problem, why_none_fires(phasing)[0])
    results: list[tuple[Candidate, Result]] = []
    for start in until_time_limit(with_progress("cranks that throws leave", starts)):
        crank, realised = _MovedCrank(phasing, start), phasing.realise(start)
        angles = tuple(_angle_decisions(phasing, start))
        options = replace(realised.search, starts=min(realised.search.starts, MOST_SEARCHES))
        decisions = (*realised.decisions, *angles)
        moved = replace(realised, phasing=None, rebuild=crank, decisions=decisions, search=options)
        with search_scope("a crank that throws leave"):
            result = search(moved)
        values = {entry.name: entry.value for entry in result.decisions}
        changes = {drive.path: values[d.name] for d in angles for drive in d.address_drives if d.name in values}
        names = {decision.name for decision in angles}
        others = tuple(decision for decision in result.problem.decisions if decision.name not in names)
        result = replace(
            result,
            decisions=tuple(entry for entry in result.decisions if entry.name not in names),
            problem=replace(result.problem, decisions=others, rebuild=realised.rebuild),
        )
        results.append((crank.at(changes), result))
    allowed = [
        (objective.value, certificate, candidate, result)
        for candidate, result in results
        if result.status.has_design and (objective := result.objective) and (certificate := result.certificate)
    ]
    if not allowed:
        limits = quoted(limit.name for limit in problem.limits) or "the firing intervals"
        return no_star(problem, f"no crank was found that keeps {limits}, and none is excluded", Status.FAILED)
    value, proof, candidate, best = min(allowed, key=lambda one: one[0])
    method = f"{proof.method}; throws moved from {counted(len(results), 'crank')}"
    ordered = replace(phasing, firing_order=candidate.firing_order)
    ranking = [ranked_star(ordered, candidate, None, value, 0.0, False)]
    details = ranking_result(phasing, candidate, ranking, len(results), len(allowed), method)
    return with_star(problem, phasing, best, candidate, replace(proof, method=method), details)


def _angle_decisions(phasing: Phasing, start: Candidate) -> Iterator[Decision]:
    """Yield throws, bank angle and split pins of a crank as numbers, where they may move."""
    even, allowed = phasing.even_interval, phasing.intervals
    freedom = min(max(even - allowed.minimum, allowed.maximum - even), math.pi)
    angles: list[tuple[str, Path, float, float, float]] = []
    for k, angle in enumerate(start.throws):
        if phasing.throw_bounds is not None:
            low, high = phasing.throw_bounds[k]
        else:
            # the first throw stays: a crank turned as a whole is the same crank
            low, high = (angle, angle) if k == 0 else (angle - freedom, angle + freedom)
        angles.append((f"throw {k + 1}", (CRANK, k), low, high, angle))
    for name, bounds, value in ((BANK, phasing.bank, start.bank_angle), (SPLIT, phasing.split, start.split_pin)):
        if bounds is not None and value is not None:
            angles.append((name, (CRANK, name), *bounds, value))
    for name, path, low, high, value in angles:
        if low < high:
            drives = (AddressDrive(path, ""),)
            yield Decision(name, "rad", Interval(low, high), min(max(value, low), high), drives)
