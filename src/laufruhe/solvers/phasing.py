"""Deciding stars, firing orders and shafts (S18)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

from laufruhe.errors import SolverError
from laufruhe.machine.layouts import Layout
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.model import Problem
from laufruhe.problem.phasing import Candidate, Phasing
from laufruhe.solvers.certificate import Certificate, Proof, gap_unit
from laufruhe.solvers.phasing_result import final_result, names_of, no_design, no_result, phase_decisions, solve_fixed
from laufruhe.solvers.ranking import PhasingResult, ranked_orders, ranked_star
from laufruhe.solvers.result import ObjectiveValue, Result, Status
from laufruhe.solvers.star_answers import searched
from laufruhe.solvers.star_families import families_of


def solve_phasing(problem: Problem) -> Result:
    """Decide open throws, firing orders, shafts and unbalances together.

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
    if not problem.objective:
        raise SolverError("nothing is to be minimised; add [objective] or [mounts]")
    started = time.perf_counter()
    if phasing.throws is not None:
        result = _of_fixed_throws(problem, phasing)
    elif phasing.throw_bounds is not None:
        result = _uneven(problem, phasing, None)
    else:
        result = _of_open_throws(problem, phasing)
    return replace(result, timing={**result.timing, "phasing": time.perf_counter() - started})


def _of_open_throws(problem: Problem, phasing: Phasing) -> Result:
    even, slack = phasing.even_interval, 1e-9
    if phasing.intervals.least > even + slack or phasing.intervals.most < even - slack:
        return no_result(
            problem,
            f"no star can meet the intervals: {phasing.cylinders} cylinders fire {math.degrees(even):g} deg apart on "
            f"average, phasing.intervals allows {math.degrees(phasing.intervals.least):g} to "
            f"{math.degrees(phasing.intervals.most):g} deg",
        )
    families, reason = families_of(phasing)
    if not families:
        return (
            no_result(problem, f"no star exists: {reason}")
            if not phasing.continuous
            else _uneven(problem, phasing, None)
        )
    answer = searched(problem, phasing, families)
    if not answer.designs:
        if answer.complete:
            return no_design(problem, answer)
        return replace(
            no_result(
                problem, f"no feasible design was found in phasing.time_limit = {phasing.time_limit:g} s; raise it"
            ),
            status=Status.FAILED,
        )
    result = final_result(problem, phasing, answer)
    return _uneven(problem, phasing, result) if phasing.continuous else result


def _of_fixed_throws(problem: Problem, phasing: Phasing) -> Result:
    """Throws as given: the best of their firing orders, and of the sets of shafts."""
    throws = phasing.throws or ()
    bank, split = (b[0] if b is not None else None for b in (phasing.bank, phasing.split))
    layout = phasing.layout(bank, split)
    orders, count = ranked_orders(phasing, layout, throws, None)
    if not orders:
        return no_result(problem, _no_order(phasing, layout, throws))
    # the small ones first: a shaft that buys nothing is not built
    sets = sorted(phasing.shafts.allowed, key=lambda chosen: (len(chosen), chosen))
    best: tuple[tuple[int, ...], Result] | None = None
    for built in sets:
        names = names_of(phasing, built)
        left_out = tuple(n for group in phasing.shafts.optional for n in group if n not in names)
        candidate = Candidate(throws, orders[0].order, bank, split, left_out)
        result = solve_fixed(replace(phasing.realise(candidate), tolerance=problem.tolerance))
        if result.objective is None:
            continue
        worth = problem.tolerance * gap_unit(result.objective.value, result.objective.initial)
        if best is None or result.objective.value < _value(best[1]) - worth:
            best = built, result
    if best is None:
        return no_result(problem, "no set of shafts that may be built keeps the limits")
    built, result = best
    given = evaluate(problem)
    value, bound = _value(result), result.certificate.lower_bound if result.certificate else _value(result)
    entry = ranked_star(
        phasing, layout, throws, None, value, bound, True, names_of(phasing, built), (bank, split)
    )  # fmt: skip
    entry = replace(entry, order_count=count)
    method = f"{len(orders)} firing order(s), {len(sets)} set(s) of shafts looked at"
    candidate = Candidate(throws, orders[0].order, bank, split)
    certificate = result.certificate or Certificate(Proof.GLOBAL, value, 0.0, 0.0, method)
    return replace(
        result,
        problem=replace(result.problem, phasing=phasing),
        status=Status.OPTIMAL if result.certificate is None else result.status,
        objective=ObjectiveValue(
            problem.objective_name, value, problem.objective[0].quantity.unit, objective_value(problem, given)
        ),
        certificate=replace(certificate, method=f"{certificate.method}; {method}"),
        decisions=(*phase_decisions(problem, phasing, candidate, names_of(phasing, built)), *result.decisions),
        initial=replace(given, samples=result.final.samples),
        phasing=PhasingResult((entry,), layout.throw_positions, layout.banks, count * len(sets), len(sets), method),
    )


def _value(result: Result) -> float:
    return result.objective.value if result.objective is not None else math.inf


def _no_order(phasing: Phasing, layout: Layout, throws: Sequence[float]) -> str:
    free = replace(phasing, intervals=replace(phasing.intervals, least=0.0, most=math.inf))
    orders, _ = ranked_orders(free, layout, throws, None)
    shown = [f"{math.degrees(angle):g}" for angle in throws]
    allowed = f"{math.degrees(phasing.intervals.least):g} to {math.degrees(phasing.intervals.most):g} deg"
    nearest = min(orders, key=lambda o: max(o.intervals) - min(o.intervals)) if orders else None
    tail = ""
    if nearest is not None:
        low, high = math.degrees(min(nearest.intervals)), math.degrees(max(nearest.intervals))
        tail = f"; the most even order of these throws has intervals from {low:g} to {high:g} deg"
    return f"throws [{', '.join(shown)}] deg contradict the firing intervals allowed, {allowed}{tail}"


def _uneven(problem: Problem, phasing: Phasing, even: Result | None) -> Result:
    from laufruhe.solvers.uneven import solve_uneven

    return solve_uneven(problem, phasing, even)
