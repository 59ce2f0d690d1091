"""Deciding stars, firing orders and shafts (S18)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from laufruhe.errors import SolverError
from laufruhe.machine.layouts import Layout
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import Reach, certified, gap_unit
from laufruhe.solvers.conclusion import KEPT, no_star, with_star
from laufruhe.solvers.phasing_result import final_result, names_of, no_design, solve_fixed
from laufruhe.solvers.ranking import ORDERS_LISTED, PhasingResult, RankedOrder, ranked_orders, ranked_star
from laufruhe.solvers.result import Result, Status
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
        return no_star(
            problem,
            f"no star can meet the intervals: {phasing.cylinders} cylinders fire {math.degrees(even):g} deg apart on "
            f"average, phasing.intervals allows {math.degrees(phasing.intervals.least):g} to "
            f"{math.degrees(phasing.intervals.most):g} deg",
        )
    families, reason = families_of(phasing)
    if not families:
        return (
            no_star(problem, f"no star exists: {reason}") if not phasing.continuous else _uneven(problem, phasing, None)
        )
    answer = searched(problem, phasing, families)
    if not answer.designs:
        if answer.complete:
            return no_design(problem, answer)
        why = f"no feasible design was found in phasing.time_limit = {phasing.time_limit:g} s; raise it"
        return no_star(problem, why, Status.FAILED)
    result = final_result(problem, phasing, answer)
    return _uneven(problem, phasing, result) if phasing.continuous else result


def _of_fixed_throws(problem: Problem, phasing: Phasing) -> Result:
    """Throws as given: the best of their firing orders, and of the sets of shafts."""
    throws = phasing.throws or ()
    bank, split = (b[0] if b is not None else None for b in (phasing.bank, phasing.split))
    layout = phasing.layout(bank, split)
    orders, count = ranked_orders(phasing, layout, throws, None)
    if not orders:
        return no_star(problem, _no_order(phasing, layout, throws))
    # the small ones first: a shaft that buys nothing is not built
    sets = sorted(phasing.shafts.allowed, key=lambda chosen: (len(chosen), chosen))
    told = orders if problem.feels_gas and not all(_is_even(order) for order in orders) else orders[:1]
    designs = [(order, built) for built in sets for order in told]
    solved, complete = _solved(problem, phasing, throws, designs)
    if not solved:
        return no_star(problem, "no firing order and no set of shafts that may be built keeps the limits")
    initial = objective_value(problem, evaluate(problem))
    best = solved[0]
    for design in solved[1:]:
        if design.value < best.value - _share(problem) * gap_unit(best.value, initial):
            best = design
    bound = min(design.bound for design in solved) if complete else 0.0
    names = names_of(phasing, best.built)
    entry = ranked_star(phasing, layout, throws, None, best.value, bound, complete, names, (bank, split))
    rest = tuple(order for order in orders if order != best.order)
    entry = replace(entry, firing_orders=(best.order, *rest)[:ORDERS_LISTED], even=_is_even(best.order))
    method = f"{len(told)} of {count} firing order(s), {len(sets)} set(s) of shafts looked at"
    own = best.result.certificate
    how, residual = (f"{own.method}; {method}", own.kkt_residual) if own else (method, 0.0)
    certificate = certified(best.value, bound, initial, problem.tolerance, Reach.WHOLE, residual, how)
    details = PhasingResult((entry,), layout.throw_positions, layout.banks, count * len(sets), len(solved), method)
    return with_star(problem, phasing, best.result, best.candidate, certificate, details)


@dataclass(frozen=True, eq=False)
class _Solved:
    """A firing order and sets of shafts with everything else at its optimum."""

    order: RankedOrder
    built: tuple[int, ...]
    candidate: Candidate
    result: Result

    @property
    def value(self) -> float:
        return _value(self.result)

    @property
    def bound(self) -> float:
        """What no design of this order and these shafts goes under."""
        return self.result.certificate.lower_bound if self.result.certificate else self.value


def _solved(
    problem: Problem,
    phasing: Phasing,
    throws: tuple[float, ...],
    designs: Sequence[tuple[RankedOrder, tuple[int, ...]]],
) -> tuple[list[_Solved], bool]:
    """Those designs that keep the limits, and whether time was enough for all."""
    started = time.perf_counter()
    bank, split = (b[0] if b is not None else None for b in (phasing.bank, phasing.split))
    found: list[_Solved] = []
    for order, built in designs:
        if found and time.perf_counter() - started > phasing.time_limit:
            return found, False
        names = names_of(phasing, built)
        left_out = tuple(n for group in phasing.shafts.optional for n in group if n not in names)
        candidate = Candidate(throws, order.order, bank, split, left_out)
        result = solve_fixed(replace(phasing.realise(candidate), tolerance=_share(problem)))
        # of a design without decisions nobody has looked at the limits
        met = result.final.excess(result.problem.limits) <= KEPT
        kept = met and result.status in (Status.OPTIMAL, Status.FEASIBLE)
        if kept and result.objective is not None:
            found.append(_Solved(order, built, candidate, result))
    return found, True


def _share(problem: Problem) -> float:
    """Tolerance of one design, and by how much another has to be better: both together are what was asked."""
    return 0.5 * problem.tolerance


def _is_even(order: RankedOrder) -> bool:
    return max(order.intervals) - min(order.intervals) <= 1e-9 * math.tau


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
