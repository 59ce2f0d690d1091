"""Deciding stars, firing orders and shafts (S18)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeAlias

import numpy as np

from laufruhe.errors import ModelError, SolverError, counted
from laufruhe.load_models.lone_parts import gas_tells_apart
from laufruhe.machine.firing import MOST_ORDERS
from laufruhe.numerics.budget import limited, passed
from laufruhe.numerics.progress import report_progress
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Candidate, Intervals
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import Reach, certified, room_of
from laufruhe.prove.throws.firing_share import firing_bound
from laufruhe.solvers.conclusion import quoted, result_under
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.answers import Answer, Decided, searched
from laufruhe.solvers.stars.conclusion import no_star, with_star
from laufruhe.solvers.stars.design import StarDesign, solve_fixed
from laufruhe.solvers.stars.even_turning import floors, of_wheel, solve_told_alike
from laufruhe.solvers.stars.families import Family, families_of
from laufruhe.solvers.stars.program import owners_of, solve_design
from laufruhe.solvers.stars.ranking import (
    ORDERS_LISTED,
    RankedOrder,
    RankedStar,
    ranked_orders,
    ranked_star,
    ranking_result,
    told_orders,
)
from laufruhe.solvers.throws.starts import none_fires

FINER, ROUNDS = 16, 2
"""Times as many angles at most for a search whose own are too few to prove its best star, and how often."""
Star: TypeAlias = tuple[Candidate, tuple[int, ...] | None]
"""A star, and its steps where it fires evenly."""
Decide: TypeAlias = Callable[[Problem, float], Result]
Search: TypeAlias = Callable[[Problem, Phasing, Sequence[Family]], Answer]


def solve_phasing(problem: Problem, search: Search = searched) -> Result:
    """Decide open throws, firing orders, shafts and unbalances together.

    Parameters
    ----------
    search
        Return the best designs of all even stars of some families.

    Returns
    -------
    Result with a ranking. Its certificate is `global` if the search ended by itself,
    `global within gap` if time ended it, and `local` where throws left the even steps.

    Raises
    ------
    SolverError
        If a solver stops without an answer.
    """
    phasing = problem.phasing
    if phasing is None:
        raise SolverError("nothing of the phasing is open")
    wheel = of_wheel(problem)
    if phasing.throws is None and wheel and not phasing.continuous and not gas_tells_apart(problem):
        return solve_told_alike(problem, phasing, partial(solve_phasing, search=search))
    started = time.perf_counter()
    if phasing.throws is not None:
        result = by_each_order(problem, phasing, every_star(phasing))
    elif phasing.throw_bounds is not None:
        result = _uneven(problem, phasing, None)
    else:
        result = _of_open_throws(problem, phasing, search)
    return replace(result, timing={**result.timing, "phasing": time.perf_counter() - started})


def _of_open_throws(problem: Problem, phasing: Phasing, search: Search) -> Result:
    is_even = phasing.intervals.holds([phasing.even_interval])
    unlike = gas_tells_apart(problem)
    if of_wheel(problem) and not unlike:
        even = replace(phasing, intervals=Intervals(phasing.even_interval, phasing.even_interval))
        again = partial(solve_phasing, search=search)
        told = solve_told_alike(problem, even, again) if is_even and families_of(even)[0] else None
        return _uneven(problem, phasing, None if told is None or told.objective is None else told)
    alone = unlike or phasing.shares_throws or any(measure.is_cylinder_resolved for measure in problem.measures)
    if (problem.feels_order or unlike) and is_even and alone:
        stars = every_star(phasing)
        result = by_each_order(problem, phasing, stars) if stars else no_star(problem, none_fires(phasing)[0])
        if not phasing.continuous:
            return result
        return _uneven(problem, phasing, None if result.objective is None else result)
    families = families_of(phasing, problem.feels_order)[0] if is_even else ()
    if not families and not phasing.continuous:
        return no_star(problem, none_fires(phasing)[0])
    if not families:
        return _uneven(problem, phasing, None)
    answer = search(replace(problem, tolerance=_share(problem)), phasing, families)
    if not answer.designs:
        if phasing.continuous:
            return _uneven(problem, phasing, None)
        if answer.complete:
            return _none(problem, answer.infeasible)
        given = "the time limit" if passed() else f"phasing.time_limit = {phasing.time_limit:g} s"
        why = f"no feasible design was found in {given}; raise it"
        return no_star(problem, why, Status.FAILED)
    result = _best_of(problem, phasing, answer)
    if answer.complete and problem.search.proves:
        result = _with_more_angles(problem, families, result, search)
    return _uneven(problem, phasing, result) if phasing.continuous else result


def _with_more_angles(problem: Problem, families: Sequence[Family], result: Result, search: Search) -> Result:
    """The same search at more angles, while these are all that keeps a gap open (P7)."""
    for _ in range(ROUNDS):
        gap = result.certificate.gap if result.certificate else 0.0
        if gap <= problem.tolerance or passed():
            break
        # averages about angles fall short of means by the square of their step
        times = min(math.ceil(math.sqrt(2.0 * gap / problem.tolerance)), FINER)
        own = problem.fidelity
        # the gas keeps its steps: a design is worth the same at as many angles, whoever evaluates it
        problem = problem.at(replace(own, samples=times * own.samples, gas_samples=own.gas_steps))
        assert problem.phasing is not None
        answer = search(replace(problem, tolerance=_share(problem)), problem.phasing, families)
        found = _best_of(problem, problem.phasing, answer) if answer.designs else result
        if found.certificate is None or found.certificate.gap >= gap or not answer.complete:
            break
        result = found
    return result


def every_star(phasing: Phasing) -> list[Star]:
    """Throws as given, or all that fire evenly, images included."""
    if phasing.throws is not None:
        return [(Candidate(phasing.throws, None, *phasing.least_geometry), None)]
    pairs = [(family, tuple(map(int, star))) for family in families_of(phasing)[0] for star in family.stars]
    return [(replace(family.candidate(phasing, steps), firing_order=None), steps) for family, steps in pairs]


def by_each_order(
    problem: Problem, phasing: Phasing, stars: Sequence[Star], decide: Decide = lambda own, _: solve_fixed(own),
    most: int | None = None,
) -> Result:  # fmt: skip
    """Every firing order that loads tell apart of every star, and every set of shafts, each solved by itself.

    Parameters
    ----------
    decide
        What else is open of one of them, where a design of a value is known.
    most
        Designs, drawn of all, that are decided where no bound is asked for; None for every one, with its bound.
    """
    orders = {star: ranked_orders(phasing, star, steps) for star, steps in stars}
    if not any(orders.values()):
        return no_star(problem, none_fires(phasing)[0])
    # the small ones first: a shaft that buys nothing is not built
    sets = sorted(phasing.shafts.allowed, key=lambda chosen: (len(chosen), chosen))
    told = [(star, order.order) for star, steps in stars for order in told_orders(problem, phasing, star, steps)]
    if most is None and len(told) * len(sets) >= MOST_ORDERS:
        many = f"{MOST_ORDERS} and more firing orders and sets of shafts are too many to decide one by one"
        raise ModelError(f"{many}; give a firing order, or throws")
    designs = [replace(star, firing_order=o, left_out=phasing.without(built)) for built in sets for star, o in told]
    whole = len(designs)
    if most is not None and whole > most:
        drawn = np.random.default_rng(problem.search.seed).choice(whole, most, replace=False)
        designs = [designs[k] for k in sorted({0, *drawn.tolist()})]
    every, least, complete = _solved(problem, phasing, designs, decide, most is None)
    complete = complete and len(designs) == whole
    solved = [design for design in every if design.is_met]
    if not solved:
        proven = complete and all(design.is_excluded for design in every)
        why = f"no firing order and no set of shafts that may be built {'keeps' if proven else 'was found that keeps'}"
        status, names = Status.INFEASIBLE if proven else Status.FAILED, [limit.name for limit in problem.limits]
        return no_star(problem, f"{why} the limits", status, tuple(names) if proven else ())
    nothing = numerical_zero(problem)
    best = solved[0]
    for design in solved[1:]:
        if design.value < best.value - room_of(best.value, _share(problem), nothing):
            best = design
    bound = min([least, *(design.bound for design in every)]) if complete else 0.0
    count = sum(map(len, orders.values()))
    of_stars = f" of {len(stars)} stars" if len(stars) > 1 else ""
    method = f"{len(told)} of {counted(count, 'firing order')}{of_stars} seen at {counted(len(sets), 'set')} of shafts"
    if len(designs) < whole or not complete:
        method += f", {len(every)} of all {whole} drawn and decided"
    if len(every) < len(designs) and complete:
        method += f", {len(designs) - len(every)} of these by one order of the torque alone"
    proof = best.result.certificate
    how, residual = (f"{proof.method}; {method}", proof.kkt_residual) if proof else (method, 0.0)
    reach = Reach.WHOLE if most is None else Reach.ASIDE
    result, doubt = result_under(best.result, bound, nothing)
    best = replace(best, result=result)
    certificate = certified(best.value, bound, nothing, problem.tolerance, reach, residual, how, doubt)
    ranking = _entries(phasing, [best, *sorted(solved, key=lambda one: one.value)], orders, bound, complete)
    details = ranking_result(phasing, best.candidate, ranking, count * len(sets), len(solved), method)
    return with_star(problem, phasing, best.result, best.candidate, certificate, details)


def _entries(
    phasing: Phasing, designs: Sequence[StarDesign], orders: Mapping[Candidate, tuple[RankedOrder, ...]], bound: float,
    complete: bool,
) -> list[RankedStar]:  # fmt: skip
    """The first design of every star, its own firing order before the others of the star."""
    firsts: dict[Candidate, StarDesign] = {}
    for design in designs:
        firsts.setdefault(replace(design.candidate, firing_order=None, left_out=()), design)
    found = []
    for star, design in [*firsts.items()][: phasing.best]:
        entry = ranked_star(phasing, design.candidate, None, design.value, bound, complete)
        own = next(order for order in orders[star] if order.order == design.candidate.firing_order)
        rest = tuple(order for order in orders[star] if order != own)
        found.append(replace(entry, firing_orders=(own, *rest)[:ORDERS_LISTED], even=own.is_even))
    return found


def _solved(
    problem: Problem, phasing: Phasing, designs: Sequence[Candidate], decide: Decide, is_bounded: bool
) -> tuple[list[StarDesign], float, bool]:
    """Those that may be the best, the rest at its optimum; what the others are at least; whether time was enough."""
    started = time.perf_counter()
    found: list[StarDesign] = []
    # those that one order of the torque says least of come first, where all else that is open leaves the torque alone
    lowest, broken = floors(problem, phasing, designs if is_bounded else ())
    if not is_bounded:
        lowest, broken = np.zeros(len(designs)), np.zeros(len(designs), dtype=bool)
    places, nothing = np.argsort(lowest, kind="stable"), numerical_zero(problem)
    for k, place in enumerate(places):
        best = min((one.value for one in found), default=math.inf)
        report_progress("firing orders and sets of shafts", k, len(designs), best)
        if lowest[place] > best + room_of(best, problem.tolerance, nothing):
            return found, float(lowest[place]), True
        if broken[place]:
            continue
        if found and (passed() or time.perf_counter() - started > phasing.time_limit):
            return found, 0.0, False
        result = decide(replace(phasing.realise(designs[place]), tolerance=_share(problem)), best)
        found.append(StarDesign(designs[place], result))
    return found, math.inf, True


def _share(problem: Problem) -> float:
    """Tolerance of one design, and by how much another has to be better: both together are what was asked."""
    return 0.5 * problem.tolerance


def _best_of(problem: Problem, phasing: Phasing, answer: Answer) -> Result:
    """The best even design solved once more as a problem of its own, with what was proven of all designs (S17)."""
    entries = [d.ranked(phasing) for d in answer.designs]
    fired = [(design, entry) for design, entry in zip(answer.designs, entries, strict=True) if entry.firing_orders]
    if not fired:
        return no_star(problem, "no star has a firing order that keeps the firing intervals allowed")
    left = iter(fired)
    for best, first in left:
        left_out = phasing.without(_needed(problem, phasing, best))
        candidate = replace(best.candidate, firing_order=first.firing_orders[0].order, left_out=left_out)
        result = solve_fixed(replace(phasing.realise(candidate), tolerance=_share(problem), phasing=None))
        # a peak may stand between the angles at which the search looks
        if StarDesign(candidate, result).is_met:
            break
    else:
        why = f"each of the best {counted(len(fired), 'star')} breaks a limit between angles that the search looks at"
        return no_star(problem, f"{why}; raise phasing.best or fidelity.samples", Status.FAILED)
    shared = firing_bound(problem, result.final) if result.objective and not any(phasing.opened) else 0.0
    bound, nothing = max(answer.bound, shared), numerical_zero(problem)
    result, doubt = result_under(result, bound, nothing)
    value = result.objective.value if result.objective else best.value
    certificate = certified(
        value, bound, nothing, problem.tolerance, Reach.WHOLE,
        result.certificate.kkt_residual if result.certificate else 0.0, answer.method, doubt,
    )  # fmt: skip
    ranking = [replace(first, shafts=phasing.built(candidate)), *(entry for _, entry in left)]
    count = sum(family.size for family in families_of(phasing, problem.feels_order)[0])
    details = ranking_result(phasing, candidate, ranking, count, answer.looked_at, answer.method)
    return with_star(problem, phasing, result, candidate, certificate, details)


def _needed(problem: Problem, phasing: Phasing, best: Decided) -> tuple[int, ...]:
    """The sets of shafts without which the design would be worse: the others need not be built."""
    kept = best.built
    if not kept:
        return kept
    model = best.family.model(phasing)
    owners = owners_of(model)
    nothing = numerical_zero(problem)
    for k in sorted(best.built, key=lambda k: -phasing.shafts.masses[k]):
        fewer = tuple(j for j in kept if j != k)
        again, _ = solve_design(model, best.steps, fewer, owners, _share(problem), nothing)
        if again is not None and again.value <= best.value + room_of(best.value, _share(problem), nothing):
            kept = fewer
    return kept


def _none(problem: Problem, tried: int) -> Result:
    """Stars exist, but none keeps all limits: one may break some of them, and another the others."""
    names = tuple(limit.name for limit in problem.limits)
    shown = (quoted(names) or "the bounds") + " together" * (len(names) > 1)
    why = f"no star keeps {shown}, whatever else is decided ({counted(tried, 'design')} tried)"
    return no_star(problem, why, conflict=names)


def _uneven(problem: Problem, phasing: Phasing, even: Result | None) -> Result:
    from laufruhe.solvers.throws.uneven import solve_uneven

    with limited(phasing.time_limit):
        return solve_uneven(problem, phasing, even)
