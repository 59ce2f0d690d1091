"""Stars decided together with mounts and balance (E35).

Even stars are finitely many. On the mounts as given each one's balance is a cone
program, whose dual rows bound every other star (S14): that ranks them. The best of the
ranking then have mounts and balance decided together, each as a problem of its own. The
ranking chooses what is looked at and proves nothing of the joint problem, so the result
says how many stars were left out. Where firing may be uneven, throws then leave the
best of these stars, as further variables of the same smooth program (E36).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from laufruhe.errors import ModelError
from laufruhe.load_models.star_model import StarModel
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.numerics.norms import RMS
from laufruhe.problem import channels
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.phasing import Candidate, Method
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import FLOOR, Certificate, Proof, Reach, certified
from laufruhe.solvers.conclusion import no_star, with_star
from laufruhe.solvers.mount_nonlinear import solve_mounts, solve_moved
from laufruhe.solvers.phasing_result import names_of
from laufruhe.solvers.ranking import PhasingResult, RankedStar, ranked_orders, ranked_star
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.star_answers import MOST_LISTED
from laufruhe.solvers.star_cuts import search_designs
from laufruhe.solvers.star_families import Family, families_of
from laufruhe.solvers.uneven import firing_intervals, starts_of

MOST_SEARCHED = 3
FEWER_STARTS = 4
SHORTEST_SEARCH = 4


@dataclass(frozen=True, eq=False)
class _Star:
    """A star with a set of shafts; `steps` where it fires evenly."""

    throws: tuple[float, ...]
    steps: tuple[int, ...] | None
    built: tuple[int, ...]
    geometry: tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class _Found:
    """A star and what the joint solve made of it."""

    star: _Star
    candidate: Candidate
    result: Result
    moved: bool = False

    @property
    def key(self) -> tuple[bool, float]:
        """Designs within their limits first, the least objective first."""
        o = self.result.objective
        met = self.result.status in (Status.OPTIMAL, Status.FEASIBLE)
        return not met, math.inf if o is None or not met else o.value


def solve_star_mounts(problem: Problem, say: Callable[[str], None] = lambda _: None) -> Result:
    """The best of the stars, each with mounts and balance decided together (E35).

    Parameters
    ----------
    problem
        On elastic mounts, with throws, firing order or optional shafts open.
    say
        Told what is being decided.

    Raises
    ------
    ModelError
        If there are too many stars to list.
    SolverError
        If a solver stops without an answer.
    """
    phasing = problem.phasing
    if phasing is None:
        raise ValueError("nothing of the phasing is open")
    started = time.perf_counter()
    stars, designs = _stars(problem, phasing)
    ranked = time.perf_counter()
    found = _solved_shortly(problem, phasing, stars, say)
    found = _solved_fully(problem, found, say)
    if phasing.continuous:
        found = sorted([*found, *_moved(problem, phasing, found, say)], key=lambda f: f.key)
    timing = {"rank": ranked - started, "solve": time.perf_counter() - ranked}
    return replace(_result(problem, phasing, found, designs), timing=timing)


def _stars(problem: Problem, phasing: Phasing) -> tuple[list[_Star], int]:
    """Stars by their rank on the mounts as given, as many as are to be ranked; and how many there are."""
    if phasing.throws is not None:
        sets = [b for b in _sets(len(phasing.shafts.optional)) if phasing.shafts.allows(b)]
        bank, split = (b[0] if b is not None else None for b in (phasing.bank, phasing.split))
        return [_Star(phasing.throws, None, built, (bank, split)) for built in sets], len(sets)
    if phasing.throw_bounds is not None:
        return [], 0
    families, _ = families_of(phasing)
    if sum(family.size for family in families) > MOST_LISTED:
        raise ModelError(f"more than {MOST_LISTED} stars are open together with mounts; fix the firing order")
    on_given = replace(phasing, realise=lambda candidate: _on_given_mounts(phasing.realise(candidate)))
    many = phasing.method is Method.ENUMERATION
    scored: list[tuple[float, _Star]] = []
    designs = 0
    for family in families:
        scored_family, count = _ranked(problem, on_given, family, 10**9 if many else phasing.best)
        scored, designs = scored + scored_family, designs + count
    scored.sort(key=lambda pair: pair[0])
    return [star for _, star in scored][: designs if many else phasing.best], designs


def _sets(count: int) -> list[tuple[int, ...]]:
    return [tuple(k for k in range(count) if code >> k & 1) for code in range(1 << count)]


def _ranked(problem: Problem, phasing: Phasing, family: Family, count: int) -> tuple[list[tuple[float, _Star]], int]:
    """Stars of one geometry with their least objective on the mounts as given (S15)."""
    model = StarModel(phasing, family.space, family.geometry, family.fixed)
    given = model.problem
    floor = FLOOR * objective_value(given, evaluate(given))
    found = search_designs(model, family.stars, count, max(problem.tolerance, 1e-3), phasing.time_limit, floor)
    stars = [(s.value, _Star(family.throws(s.star), s.star, s.built, family.geometry)) for s in found.solved]
    return stars, found.designs


def _on_given_mounts(problem: Problem) -> Problem:
    """What ranks stars: the objective, or else the RMS mount force, under the limits on masses alone."""
    terms = problem.load_terms or (Term(Measure(channels.MOUNT_FORCE, RMS)),)
    masses = tuple(limit for limit in problem.limits if limit.measure.is_mass)
    return replace(problem.balance, objective=terms, limits=masses)


def _problem_of(problem: Problem, phasing: Phasing, candidate: Candidate, starts: int) -> Problem:
    """The joint problem of one star, nothing of its phasing open any more."""
    own = phasing.realise(candidate)
    search = replace(problem.search, starts=starts)
    return replace(own, phasing=None, tolerance=problem.tolerance, fidelity=problem.fidelity, search=search)


def _solved_shortly(problem: Problem, phasing: Phasing, stars: list[_Star], say: Callable[[str], None]) -> list[_Found]:
    """Every star with a quarter of the starts, the best first."""
    starts = problem.search.starts
    few = starts if len(stars) == 1 else min(starts, max(SHORTEST_SEARCH, starts // FEWER_STARTS))
    found = []
    for k, star in enumerate(stars):
        say(f"mounts of star {k + 1} of {len(stars)}")
        candidate = _candidate(phasing, star)
        if candidate is not None:
            # a process of its own costs more than so few starts
            own = _problem_of(problem, phasing, candidate, few)
            found.append(_Found(star, candidate, solve_mounts(own, workers=1 if len(stars) > 1 else None)))
    return sorted(found, key=lambda f: f.key)


def _candidate(phasing: Phasing, star: _Star) -> Candidate | None:
    """The design of a star with the best of its firing orders; None if none keeps the intervals."""
    orders, _ = ranked_orders(phasing, phasing.layout(*star.geometry), star.throws, star.steps)
    if not orders:
        return None
    kept = names_of(phasing, star.built)
    left_out = tuple(name for names in phasing.shafts.optional for name in names if name not in kept)
    return Candidate(star.throws, orders[0].order, *star.geometry, left_out)


def _solved_fully(problem: Problem, found: list[_Found], say: Callable[[str], None]) -> list[_Found]:
    """The best few again with all starts; the better of both answers is kept."""
    out = list(found)
    starts = problem.search.starts
    for k, each in enumerate(found[:MOST_SEARCHED]):
        own = each.result.problem
        if own.search.starts >= starts:
            continue
        say(f"mounts of the best stars, {k + 1} of {min(len(found), MOST_SEARCHED)}")
        more = replace(own, search=replace(own.search, starts=starts))
        again = replace(each, result=solve_mounts(more))
        out[k] = min(again, each, key=lambda f: f.key)
    return sorted(out, key=lambda f: f.key)


def _moved(problem: Problem, phasing: Phasing, found: list[_Found], say: Callable[[str], None]) -> list[_Found]:
    """Designs whose throws have left the best stars, or the middle of their own bounds (E36)."""
    starts: list[tuple[Candidate, Result | None]] = [
        (each.candidate, each.result) for each in found[:MOST_SEARCHED] if not each.key[0]
    ]
    starts = starts or [(start, None) for start in starts_of(phasing, None)[:MOST_SEARCHED]]
    out = []
    for k, (candidate, even) in enumerate(starts):
        say(f"throws that leave star {k + 1} of {len(starts)}")
        own = _problem_of(problem, phasing, candidate, problem.search.starts)
        layout = phasing.layout(candidate.bank_angle, candidate.split_pin)
        result, moved = solve_moved(own, ThrowMoves(phasing, layout, candidate, phasing.intervals), even)
        if result.objective is not None and not phasing.intervals.holds(firing_intervals(phasing, moved)):
            continue
        built = tuple(k for k, names in enumerate(phasing.shafts.optional) if not set(names) & set(moved.left_out))
        star = _Star(moved.throws, None, built, (moved.bank_angle, moved.split_pin))
        out.append(_Found(star, moved, result, moved=True))
    return out


def _result(problem: Problem, phasing: Phasing, found: list[_Found], designs: int) -> Result:
    given = evaluate(problem)
    if not found:
        return no_star(problem, "no star and firing order keeps the firing intervals allowed")
    best = found[0]
    if best.key[0]:
        return _none(problem, found, given, designs)
    whole = len(found) == designs and not phasing.continuous
    details = PhasingResult(
        tuple(_entry(phasing, each, whole and each is best) for each in found if not each.key[0]),
        phasing.layout(*best.star.geometry).throw_positions,
        phasing.layout(*best.star.geometry).banks,
        designs,
        len(found),
        _method(found, designs),
    )
    certificate = _certificate(found, whole, details.method, objective_value(problem, given), problem.tolerance)
    return with_star(problem, phasing, best.result, best.candidate, certificate, details)


def _certificate(
    found: list[_Found], whole: bool, method: str, given: float, tolerance: float
) -> Certificate | None:  # fmt: skip
    """By the least of the bounds of all stars; by zero where some were left out."""
    own = [each.result.certificate for each in found]
    best = own[0]
    if best is None:
        return None
    bounds = [c.lower_bound for c in own if c is not None]
    bound = min(bounds) if whole and len(bounds) == len(own) else 0.0
    text = f"{method}; of the best: {best.method}"
    return certified(found[0].key[1], bound, given, tolerance, Reach.ASIDE, best.kkt_residual, text)


def _method(found: list[_Found], designs: int) -> str:
    moved = sum(each.moved for each in found)
    even = len(found) - moved
    text = f"mounts and balance decided for each of {even} star(s)" if even else "mounts, balance and throws decided"
    if even and designs > even:
        text += f", the best of {designs} on the mounts as given"
    return f"{text}; throws moved from {moved} start(s)" if moved else text


def _built(phasing: Phasing, found: _Found) -> tuple[str, ...]:
    return names_of(phasing, found.star.built)


def _entry(phasing: Phasing, found: _Found, proven: bool) -> RankedStar:
    certificate, star = found.result.certificate, found.star
    bound = certificate.lower_bound if certificate is not None else 0.0
    proven = proven and certificate is not None and certificate.kind is Proof.GLOBAL
    only = replace(phasing, firing_order=found.candidate.firing_order) if found.moved else phasing
    return ranked_star(
        only, phasing.layout(*star.geometry), star.throws, star.steps, found.key[1], bound, proven,
        _built(phasing, found), star.geometry,
    )  # fmt: skip


def _none(problem: Problem, found: list[_Found], given: Evaluation, designs: int) -> Result:
    """No star led to a design: infeasible only if that is proven of every star there is."""
    proven = len(found) == designs and all(f.result.status is Status.INFEASIBLE for f in found)
    first = found[0].result
    status = Status.INFEASIBLE if proven else Status.FAILED
    message = f"{first.message} (best of {len(found)} of {designs} star(s))"
    return replace(
        first, problem=problem, status=status, objective=None, certificate=None, initial=given, final=given,
        message=message, conflict=first.conflict if proven else (),
    )  # fmt: skip
