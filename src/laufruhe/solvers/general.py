"""Optimise any open numbers by local programs of exact evaluations, without a lower bound.

An open number of the problem file has an address there, and each design is built anew from the file. Open crank stars
are solved one by one, up to a maximum number.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from laufruhe.errors import ModelError, counted
from laufruhe.numerics.budget import until_time_limit
from laufruhe.numerics.progress import search_scope, with_progress
from laufruhe.problem.decision import AddressDrive, Decision
from laufruhe.problem.evaluation import objective_value
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Drawing, Path, Phasing, Problem
from laufruhe.problem.sets import Interval, Value
from laufruhe.prove.certificate import Certificate, ProofStrength
from laufruhe.solvers.conclusion import build_result, evaluate_design, quote_names
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.smooth.local_programs import LocalProgram, best_local_optimum, proof_data, spread_starts
from laufruhe.solvers.stars.phasing_solver import even_stars, solve_every_order
from laufruhe.solvers.stars.ranking import ranked_star, ranking_result
from laufruhe.solvers.stars.star_results import no_star, with_star
from laufruhe.solvers.throws.throw_starts import firing_intervals, start_candidates, why_none_fires

Decide = Callable[[Problem], Result]
MAX_STARS = 60
"""Largest number of crank stars, firing orders and sets of shafts that are solved one by one."""


def solve_by_local_programs(problem: Problem, decide: Decide, starts: Sequence[Sequence[Value]] = ()) -> Result:
    """Return the best design of local searches from several starts, with zero as its lower bound.

    Parameters
    ----------
    decide
        Solver of a problem with a fixed crank star.
    starts
        Further values of all decisions from which local programs start.
    """
    phasing = problem.phasing
    if phasing is not None and (phasing.continuous or phasing.throw_bounds is not None):
        return solve_moved_throws(problem, phasing, lambda moved: solve_by_local_programs(moved, decide))
    if phasing is not None:
        return solve_star_by_star(problem, decide)
    started = time.perf_counter()
    initial, program = evaluate_start(problem), LocalProgram.of(problem)
    # raise ModelError before the search if the initial design cannot be evaluated
    objective_value(problem, initial)
    points = [*map(program.shares, (problem.start, *starts)), *spread_starts(problem)]
    modelled = time.perf_counter()
    best = best_local_optimum(program, points, problem.search.starts)
    design = evaluate_design(problem, program.values(best))
    text = f"local programs from the best of {counted(len(points), 'start')}"
    claims = dict.fromkeys(measure.norm.claim for measure in problem.measures if measure.is_load)
    text = "; ".join(filter(None, [text, *claims]))
    proof = proof_data(program, design, 0.0, ProofStrength.RELAXED, text)
    # gas pressure and speeds may depend on open numbers
    solved = replace(problem, points=tuple(loads.point for loads in design.evaluation.loads))
    timing = {"model": modelled - started, "solve": time.perf_counter() - modelled}
    return build_result(replace(design, problem=solved), initial, proof, timing)


def solve_star_by_star(problem: Problem, decide: Decide) -> Result:
    """Return the best result over all crank stars with even firing and all sets of shafts, up to `MAX_STARS`.

    Each is solved as a problem of its own.
    """
    phasing = problem.phasing
    assert phasing is not None
    stars = even_stars(phasing)
    if not stars:
        return no_star(problem, why_none_fires(phasing)[0])
    return solve_every_order(problem, phasing, stars, decide, MAX_STARS)


MAX_STARTS, MAX_SEARCHES = 4, 4
"""Largest number of start cranks, and number of starts of the search from each."""
CRANK, BANK, SPLIT = "crank", "bank angle", "split pin angle"


@dataclass(frozen=True)
class _MovedCrank:
    """Function from angles of a crank to its engine, as a `Drawing`; the candidate has the start angles."""

    phasing: Phasing
    candidate: Candidate

    def at(self, changes: Mapping[Path, str | float]) -> Candidate:
        """Return the crank with other values of its open angles [rad]."""
        crank = self.candidate
        bank, split = (
            None if angle is None else float(changes.get((CRANK, name), angle))
            for name, angle in ((BANK, crank.bank_angle), (SPLIT, crank.split_pin))
        )
        throws = tuple(float(changes.get((CRANK, k), angle)) for k, angle in enumerate(crank.throws))
        return replace(crank, throws=throws, bank_angle=bank, split_pin=split)

    def __call__(self, changes: Mapping[Path, str | float]) -> Drawing:
        """Return the drawn engine with changed numbers; raise `ModelError` if a firing interval leaves its bounds."""
        candidate = self.at(changes)
        if candidate.firing_order and not self.phasing.intervals.holds(firing_intervals(self.phasing, candidate)):
            raise ModelError(f"the throws violate the allowed firing intervals, {self.phasing.intervals.text}")
        star_problem = self.phasing.problem_of(candidate)
        other_changes = {path: value for path, value in changes.items() if path[0] != CRANK}
        if other_changes:
            return star_problem.rebuild(other_changes)
        return Drawing(star_problem.engine, star_problem.points, star_problem.decisions, star_problem.mount_numbers)


def solve_moved_throws(problem: Problem, phasing: Phasing, search: Callable[[Problem], Result]) -> Result:
    """Return the best local optimum over throws and all other decisions together, from several start cranks.

    `search` is a local search over the numbers of a problem.
    """
    starts = start_candidates(phasing, None, problem.depends_on_gas)[:MAX_STARTS]
    if not starts:
        return no_star(problem, why_none_fires(phasing)[0])
    designs: list[tuple[float, Candidate, Result, Certificate]] = []
    count = 0
    for start in until_time_limit(with_progress("start cranks", starts)):
        crank, star_problem = _MovedCrank(phasing, start), phasing.problem_of(start)
        angles = tuple(_angle_decisions(phasing, start))
        options = replace(star_problem.search, starts=min(star_problem.search.starts, MAX_SEARCHES))
        decisions = (*star_problem.decisions, *angles)
        open_problem = replace(star_problem, phasing=None, rebuild=crank, decisions=decisions, search=options)
        with search_scope("a crank that throws leave"):
            result = search(open_problem)
        values = {entry.name: entry.value for entry in result.decisions}
        changes = {drive.path: values[d.name] for d in angles for drive in d.address_drives if d.name in values}
        names = {decision.name for decision in angles}
        remaining = tuple(decision for decision in result.problem.decisions if decision.name not in names)
        result = replace(
            result,
            decisions=tuple(entry for entry in result.decisions if entry.name not in names),
            problem=replace(result.problem, decisions=remaining, rebuild=star_problem.rebuild),
        )
        count += 1
        if result.status.has_design and result.objective and result.certificate:
            designs.append((result.objective.value, crank.at(changes), result, result.certificate))
    if not designs:
        limits = quote_names(limit.name for limit in problem.limits) or "the firing intervals"
        return no_star(problem, f"no crank was found that keeps {limits}, but one may exist", Status.FAILED)
    value, candidate, best, proof = min(designs, key=lambda design: design[0])
    method = f"{proof.method}; throws moved from {counted(count, 'crank')}"
    phasing_of_order = replace(phasing, firing_order=candidate.firing_order)
    ranking = [ranked_star(phasing_of_order, candidate, None, value, 0.0, False)]
    details = ranking_result(phasing, candidate, ranking, count, len(designs), method)
    return with_star(problem, phasing, best, candidate, replace(proof, method=method), details)


def _angle_decisions(phasing: Phasing, start: Candidate) -> Iterator[Decision]:
    """Yield throws, bank angle and split pin of a crank as decisions, if they are open."""
    even, allowed = phasing.even_interval, phasing.intervals
    freedom = min(max(even - allowed.minimum, allowed.maximum - even), math.pi)
    # fix the first throw, because rotating the whole crank changes nothing
    bounds_of_throws = phasing.throw_bounds or [
        (angle - freedom, angle + freedom) if k else (angle, angle) for k, angle in enumerate(start.throws)
    ]
    angles: list[tuple[str, Path, tuple[float, float] | None, float | None]] = [
        (f"throw {k + 1}", (CRANK, k), bounds, angle)
        for k, (bounds, angle) in enumerate(zip(bounds_of_throws, start.throws, strict=True))
    ]
    angles += [(BANK, (CRANK, BANK), phasing.bank, start.bank_angle)]
    angles += [(SPLIT, (CRANK, SPLIT), phasing.split, start.split_pin)]
    for name, path, bounds, value in angles:
        if bounds is not None and value is not None and bounds[0] < bounds[1]:
            yield Decision(
                name, "rad", Interval(*bounds), min(max(value, bounds[0]), bounds[1]), (AddressDrive(path, ""),)
            )
