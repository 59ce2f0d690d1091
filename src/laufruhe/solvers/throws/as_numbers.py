"""Throws that leave the even steps as numbers of a problem: the engine is put together anew for each crank.

So whatever is open beside them, and whatever is asked, a local program decides both together (`solvers.general`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

from laufruhe.errors import ModelError, counted
from laufruhe.numerics.budget import in_time
from laufruhe.numerics.progress import with_progress, within
from laufruhe.problem.decision import AddressDrive, Decision
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Drawing, Path, Phasing, Problem
from laufruhe.problem.sets import Interval
from laufruhe.solvers.conclusion import quoted
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.conclusion import no_star, with_star
from laufruhe.solvers.stars.ranking import ranked_star, ranking_result
from laufruhe.solvers.throws.starts import firing_intervals, none_fires, starts_of

MOST_STARTS, FEW_LOOKS = 4, 4
"""Cranks that throws leave, and starts of the search for each."""
CRANK, BANK, SPLIT = "crank", "bank angle", "split pin angle"


@dataclass(frozen=True)
class _MovedCrank:
    """The drawing of a crank whose throws, bank angle and split pins stand elsewhere."""

    phasing: Phasing
    candidate: Candidate

    def at(self, changes: Mapping[Path, str | float]) -> Candidate:
        """Return the crank with these angles."""
        given = self.candidate
        return replace(
            given,
            throws=tuple(float(changes.get((CRANK, k), angle)) for k, angle in enumerate(given.throws)),
            bank_angle=_angle(changes.get((CRANK, BANK), given.bank_angle)),
            split_pin=_angle(changes.get((CRANK, SPLIT), given.split_pin)),
        )

    def __call__(self, changes: Mapping[Path, str | float]) -> Drawing:
        """Return the drawing.

        Raises
        ------
        ModelError
            If the crank does not keep the firing intervals allowed.
        """
        candidate = self.at(changes)
        if candidate.firing_order and not self.phasing.intervals.holds(firing_intervals(self.phasing, candidate)):
            raise ModelError(f"these throws do not fire {self.phasing.intervals.shown} apart")
        found = self.phasing.realise(candidate)
        others = {path: value for path, value in changes.items() if path[0] != CRANK}
        if others:
            return found.rebuild(others)
        return Drawing(found.engine, found.points, found.decisions, found.mount_numbers)


def _angle(value: str | float | None) -> float | None:
    return None if value is None else float(value)


def solve_moved_throws(problem: Problem, phasing: Phasing, search: Callable[[Problem], Result]) -> Result:
    """Return the best of the local optima that a few cranks lead to, everything that is open moved together.

    Parameters
    ----------
    search
        A local search over numbers.
    """
    starts = starts_of(phasing, None, problem.feels_gas)[:MOST_STARTS]
    if not starts:
        return no_star(problem, *none_fires(phasing)[:1])
    found: list[tuple[Candidate, Result]] = []
    for start in in_time(with_progress("cranks that throws leave", starts)):
        crank, own = _MovedCrank(phasing, start), phasing.realise(start)
        angles = tuple(_angles(phasing, start))
        looks = replace(own.search, starts=min(own.search.starts, FEW_LOOKS))
        moved = replace(own, phasing=None, rebuild=crank, decisions=(*own.decisions, *angles), search=looks)
        with within("a crank that throws leave"):
            result = search(moved)
        told = {entry.name: entry.value for entry in result.decisions}
        changes = {drive.path: told[d.name] for d in angles for drive in d.address_drives if d.name in told}
        names = {decision.name for decision in angles}
        rest = tuple(entry for entry in result.decisions if entry.name not in names)
        still = tuple(decision for decision in result.problem.decisions if decision.name not in names)
        plain = replace(result, decisions=rest, problem=replace(result.problem, decisions=still, rebuild=own.rebuild))
        found.append((crank.at(changes), plain))
    met = [
        (least.value, certificate, candidate, result)
        for candidate, result in found
        if result.status.has_design and (least := result.objective) and (certificate := result.certificate)
    ]
    if not met:
        limits = quoted(limit.name for limit in problem.limits) or "the firing intervals"
        return no_star(problem, f"no crank was found that keeps {limits}, and none is excluded", Status.FAILED)
    value, proof, candidate, best = min(met, key=lambda one: one[0])
    method = f"{proof.method}; throws moved from {counted(len(found), 'crank')}"
    ordered = replace(phasing, firing_order=candidate.firing_order)
    ranking = [ranked_star(ordered, candidate, None, value, 0.0, False)]
    details = ranking_result(phasing, candidate, ranking, len(found), len(met), method)
    return with_star(problem, phasing, best, candidate, replace(proof, method=method), details)


def _angles(phasing: Phasing, start: Candidate) -> Iterator[Decision]:
    """Throws, bank angle and split pins of a crank as numbers that may move."""
    even, allowed = phasing.even_interval, phasing.intervals
    freedom = min(max(even - allowed.least, allowed.most - even), math.pi)
    for k, angle in enumerate(start.throws):
        if phasing.throw_bounds is not None:
            low, high = phasing.throw_bounds[k]
        else:
            # the first throw stays: a crank turned as a whole is the same crank
            low, high = (angle, angle) if k == 0 else (angle - freedom, angle + freedom)
        yield from _open(f"throw {k + 1}", (CRANK, k), low, high, angle)
    for name, bounds, value in ((BANK, phasing.bank, start.bank_angle), (SPLIT, phasing.split, start.split_pin)):
        if bounds is not None and value is not None:
            yield from _open(name, (CRANK, name), *bounds, value)


def _open(name: str, path: Path, low: float, high: float, start: float) -> Iterator[Decision]:
    if low < high:
        yield Decision(name, "rad", Interval(low, high), min(max(start, low), high), (AddressDrive(path, ""),))
