"""Deciding stars, firing orders and shafts: which solver for which problem, and what it proved (S18)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import SolverError
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.mixed_norms import Norm
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.model import Problem
from laufruhe.problem.phasing import Candidate, Method, Phasing
from laufruhe.solve.certificate import Certificate, Proof
from laufruhe.solve.ranking import PhasingResult, RankedStar, ranked_orders, ranked_star
from laufruhe.solve.result import DecisionValue, ObjectiveValue, Result, Status
from laufruhe.solve.star_cuts import CutsFound, owners_of, search_designs, solve_design
from laufruhe.solve.star_families import Family, families_of
from laufruhe.solve.star_model import StarModel
from laufruhe.solve.star_objective import amplitude_objective
from laufruhe.solve.star_search import StarsFound, enumerate_stars, search_stars
from laufruhe.solve.unbalances import objective_name, solve_unbalances

MOST_LISTED = 1_000_000
# looking at every star is as quick as a search up to here
FEW_STARS = 60_000
PROGRAM_SAMPLES = 24
FLOOR = 1e-3


@dataclass(frozen=True, eq=False)
class _Decided:
    """A design that a search returned, before it is evaluated anew."""

    family: Family
    steps: tuple[int, ...]
    built: tuple[int, ...]
    value: float
    bound: float
    proven: bool


@dataclass(frozen=True, eq=False)
class _Answer:
    """Designs, best first, and what no design goes under."""

    designs: tuple[_Decided, ...]
    bound: float
    complete: bool
    looked_at: int
    method: str
    infeasible: int = 0


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
        return _none(
            problem,
            f"no star can meet the intervals: {phasing.cylinders} cylinders fire {math.degrees(even):g} deg apart on "
            f"average, phasing.intervals allows {math.degrees(phasing.intervals.least):g} to "
            f"{math.degrees(phasing.intervals.most):g} deg",
        )
    families, reason = families_of(phasing)
    if not families:
        return (
            _none(problem, f"no star exists: {reason}") if not phasing.continuous else _uneven(problem, phasing, None)
        )
    answer = _searched(problem, phasing, families)
    if not answer.designs:
        if answer.complete:
            return _no_design(problem, answer)
        return replace(
            _none(problem, f"no feasible design was found in phasing.time_limit = {phasing.time_limit:g} s; raise it"),
            status=Status.FAILED,
        )
    result = _final(problem, phasing, answer)
    return _uneven(problem, phasing, result) if phasing.continuous else result


def _searched(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> _Answer:
    simple = amplitude_objective(problem)
    if simple is None or any(family.fixed for family in families):
        return _by_designs(problem, phasing, families)
    if phasing.method is Method.PROGRAM:
        return _by_program(problem, phasing, families)
    answers = []
    for family in families:
        own = amplitude_objective(phasing.realise(family.candidate(phasing, family.first))) or simple
        space = replace(family.space, mirror=True, reflect=True)
        few = phasing.method is Method.AUTO and space.size <= FEW_STARS
        if few or phasing.method is Method.ENUMERATION:
            found = enumerate_stars(space, own, phasing.best)
            answers.append(_stars_answer(family, found, "every star looked at"))
        else:
            found = search_stars(space, own, phasing.best, phasing.time_limit)
            answers.append(_stars_answer(family, found, "branch and bound over partial stars"))
    return _joined(answers, phasing.best)


def _stars_answer(family: Family, found: StarsFound, method: str) -> _Answer:
    designs = tuple(
        _Decided(family, tuple(int(p) for p in star), (), float(value), float(value), found.complete)
        for star, value in zip(found.stars, found.values, strict=True)
    )
    return _Answer(designs, found.lower_bound, found.complete, found.nodes, method)


def _by_designs(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> _Answer:
    """Everything else is decided by cone programs: cuts where the stars can be listed, else the program."""
    if phasing.method is Method.PROGRAM or sum(family.size for family in families) > MOST_LISTED:
        return _by_program(problem, phasing, families)
    floor = FLOOR * objective_value(problem, evaluate(problem))
    count = 10**9 if phasing.method is Method.ENUMERATION else phasing.best
    answers = []
    for family in families:
        model = StarModel(phasing, family.space, family.geometry, family.fixed)
        found = search_designs(model, family.stars, count, problem.tolerance, phasing.time_limit, floor)
        designs = tuple(
            _Decided(family, s.star, s.built, s.value, s.bound, s.value <= found.beyond * (1.0 + problem.tolerance))
            for s in found.solved
        )
        method = f"cone programs of {len(found.solved)} of {found.designs} designs, dual cuts for the others"
        # what is proven of the best does not need the whole ranking
        closed = found.complete or _is_closed(found, problem.tolerance, floor)
        answers.append(_Answer(designs, found.lower_bound, closed, len(found.solved), method, found.infeasible))
    return _joined(answers, phasing.best)


def _is_closed(found: CutsFound, tolerance: float, floor: float) -> bool:
    return bool(found.solved) and found.solved[0].value - found.lower_bound <= tolerance * max(
        found.solved[0].value, floor
    )


def _by_program(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> _Answer:
    """The mixed-integer program by SCIP, its design solved again and bounded by the exact model."""
    from laufruhe.solve.mixed_conic import solve_program

    floor = FLOOR * objective_value(problem, evaluate(problem))
    simple = amplitude_objective(problem) is not None
    answers = []
    for family in families:
        space = replace(family.space, mirror=simple, reflect=simple)
        model = StarModel(phasing, space, family.geometry, family.fixed)
        exact = all(term.quantity.norm is Norm.RMS for term in problem.objective) and not problem.limits
        samples = model.samples if exact else PROGRAM_SAMPLES
        owners, shafts = owners_of(model), phasing.shafts
        program = solve_program(
            model.at(samples), space, owners, [len(names) for names in shafts.optional], shafts.masses,
            shafts.most, shafts.most_mass, phasing.time_limit,
        )  # fmt: skip
        if program.star is None:
            answers.append(_Answer((), math.inf, program.status == "infeasible", 0, "SCIP"))
            continue
        again = solve_design(model, program.star, program.built, owners, problem.tolerance, floor)
        if again is None:
            raise SolverError("the design that SCIP returned breaks a limit between the angles it was solved at")
        found, cut = again
        bound = max(program.bound if exact else 0.0, cut.least(space))
        done = program.status == "optimal" and found.value - bound <= 2.0 * problem.tolerance * max(found.value, floor)
        method = f"mixed-integer cone program (SCIP: {program.status}) at {samples} angles, design solved again"
        design = _Decided(family, found.star, found.built, found.value, found.bound, done)
        answers.append(_Answer((design,), bound, done, 1, method))
    return _joined(answers, phasing.best)


def _joined(answers: Sequence[_Answer], count: int) -> _Answer:
    """Of several geometries the best designs, equals counted once."""
    designs = sorted((d for answer in answers for d in answer.designs), key=lambda d: d.value)
    kept: list[_Decided] = []
    for design in designs:
        if not any(_equal(design, other) for other in kept):
            kept.append(design)
        if len(kept) == count:
            break
    return _Answer(
        tuple(kept),
        min(answer.bound for answer in answers),
        all(answer.complete for answer in answers),
        sum(answer.looked_at for answer in answers),
        answers[0].method,
        sum(answer.infeasible for answer in answers),
    )


def _equal(a: _Decided, b: _Decided) -> bool:
    """Whether one star is an image of the other and is worth the same (S2)."""
    if a.family is not b.family or a.built != b.built or abs(a.value - b.value) > 1e-6 * max(a.value, b.value):
        return False
    space = replace(a.family.space, mirror=True, reflect=True)
    both = space.canonical(np.array([a.steps, b.steps], dtype=np.uint8))
    return bool(np.all(both[0] == both[1]))


def _final(problem: Problem, phasing: Phasing, answer: _Answer) -> Result:
    """The best design solved once more as a problem of its own, with what was proven of all designs."""
    best = answer.designs[0]
    shafts = _named(phasing, _needed(problem, phasing, best))
    orders, _ = ranked_orders(phasing, best.family.layout, best.family.throws(best.steps), best.steps)
    left_out = tuple(name for names in phasing.shafts.optional for name in names if name not in shafts)
    candidate = replace(best.family.candidate(phasing, best.steps, left_out), firing_order=orders[0].order)
    chosen = replace(phasing.realise(candidate), tolerance=problem.tolerance, phasing=None)
    result = solve_fixed(chosen)
    given = evaluate(problem)
    floor = FLOOR * objective_value(problem, given)
    value = result.objective.value if result.objective else best.value
    bound = min(answer.bound, value)
    gap = (value - bound) / (max(value, floor) or 1.0)
    proven = gap <= 2.0 * problem.tolerance and answer.complete
    certificate = Certificate(
        Proof.GLOBAL if proven else Proof.WITHIN_GAP,
        bound,
        max(gap, 0.0),
        result.certificate.kkt_residual if result.certificate else 0.0,
        answer.method,
    )
    status = result.status
    if status in (Status.OPTIMAL, Status.FEASIBLE):
        status = Status.OPTIMAL if proven else Status.FEASIBLE
    ranking = tuple(_entry(phasing, d, None if k else shafts) for k, d in enumerate(answer.designs))
    details = PhasingResult(
        ranking,
        best.family.layout.throw_positions,
        best.family.layout.banks,
        sum_of_designs(phasing),
        answer.looked_at,
        answer.method,
    )
    initial = replace(given, samples=result.final.samples)
    return replace(
        result,
        problem=replace(chosen, phasing=phasing),
        status=status,
        objective=ObjectiveValue(
            objective_name(problem), value, problem.objective[0].quantity.unit, objective_value(problem, initial)
        ),
        certificate=certificate,
        decisions=(*phase_decisions(problem, phasing, candidate, shafts), *result.decisions),
        initial=initial,
        phasing=details,
    )


def solve_fixed(problem: Problem) -> Result:
    """One design with its unbalances at their optimum."""
    if problem.decisions:
        return solve_unbalances(problem)
    from laufruhe.solve import state

    return state(problem)


def sum_of_designs(phasing: Phasing) -> int:
    """Even stars of every geometry, images counted."""
    return sum(family.size for family in families_of(phasing)[0])


def _needed(problem: Problem, phasing: Phasing, best: _Decided) -> tuple[int, ...]:
    """The sets of shafts without which the design would be worse: the others need not be built."""
    kept = best.built
    if not kept:
        return kept
    model = StarModel(phasing, best.family.space, best.family.geometry, best.family.fixed)
    owners = owners_of(model)
    floor = FLOOR * objective_value(problem, evaluate(problem))
    for k in sorted(best.built, key=lambda k: -phasing.shafts.masses[k]):
        fewer = tuple(j for j in kept if j != k)
        again = solve_design(model, best.steps, fewer, owners, problem.tolerance, floor)
        if again is not None and again[0].value <= best.value + problem.tolerance * max(best.value, floor):
            kept = fewer
    return kept


def _named(phasing: Phasing, built: Sequence[int]) -> tuple[str, ...]:
    return tuple(name for k in built for name in phasing.shafts.optional[k])


def _entry(phasing: Phasing, design: _Decided, shafts: tuple[str, ...] | None) -> RankedStar:
    family = design.family
    return ranked_star(
        phasing,
        family.layout,
        family.throws(design.steps),
        design.steps,
        design.value,
        design.bound,
        design.proven,
        _named(phasing, design.built) if shafts is None else shafts,
        family.geometry,
    )


def phase_decisions(
    problem: Problem, phasing: Phasing, candidate: Candidate, shafts: Sequence[str]
) -> tuple[DecisionValue, ...]:
    """Throws, banks and shafts as entries of the result."""
    out = []
    if phasing.throws is None:
        given = [part.throw for part in problem.engine.slider_cranks]
        layout = phasing.layout(candidate.bank_angle, candidate.split_pin)
        before = [
            given[layout.pins.index(pin)] - layout.pin_offsets[layout.pins.index(pin)] for pin in set(layout.pins)
        ]
        for k, (angle, was) in enumerate(zip(candidate.throws, before, strict=True)):
            low, high = phasing.throw_bounds[k] if phasing.throw_bounds else (0.0, math.tau)
            out.append(DecisionValue(f"throw {k + 1}", angle, "rad", low, high, was % math.tau, False))
    for name, bounds, value in (
        ("bank angle", phasing.bank, candidate.bank_angle),
        ("split pin angle", phasing.split, candidate.split_pin),
    ):
        if bounds is not None and value is not None and bounds[0] < bounds[1]:
            edge = min(value - bounds[0], bounds[1] - value) <= 1e-9
            out.append(DecisionValue(name, value, "rad", *bounds, bounds[0], edge))
    optional = (name for names in phasing.shafts.optional for name in names)
    out += [DecisionValue(f"{name} built", float(name in shafts), "", 0.0, 1.0, 1.0, False) for name in optional]
    return tuple(out)


def _of_fixed_throws(problem: Problem, phasing: Phasing) -> Result:
    """Throws as given: the best of their firing orders, and of the sets of shafts."""
    throws = phasing.throws or ()
    bank, split = (b[0] if b is not None else None for b in (phasing.bank, phasing.split))
    layout = phasing.layout(bank, split)
    orders, count = ranked_orders(phasing, layout, throws, None)
    if not orders:
        return _none(problem, _no_order(phasing, layout, throws))
    sets = [b for b in _all_sets(len(phasing.shafts.optional)) if phasing.shafts.allows(b)]
    best: tuple[tuple[int, ...], Result] | None = None
    for built in sets:
        names = _named(phasing, built)
        left_out = tuple(n for group in phasing.shafts.optional for n in group if n not in names)
        candidate = Candidate(throws, orders[0].order, bank, split, left_out)
        result = solve_fixed(replace(phasing.realise(candidate), tolerance=problem.tolerance))
        if result.objective is None:
            continue
        worth = problem.tolerance * max(result.objective.value, FLOOR * result.objective.initial)
        if best is None or result.objective.value < _value(best[1]) - worth:
            best = built, result
    if best is None:
        return _none(problem, "no set of shafts that may be built keeps the limits")
    built, result = best
    given = evaluate(problem)
    value, bound = _value(result), result.certificate.lower_bound if result.certificate else _value(result)
    entry = ranked_star(
        phasing, layout, throws, None, value, bound, True, _named(phasing, built), (bank, split)
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
            objective_name(problem), value, problem.objective[0].quantity.unit, objective_value(problem, given)
        ),
        certificate=replace(certificate, method=f"{certificate.method}; {method}"),
        decisions=(*phase_decisions(problem, phasing, candidate, _named(phasing, built)), *result.decisions),
        initial=replace(given, samples=result.final.samples),
        phasing=PhasingResult((entry,), layout.throw_positions, layout.banks, count * len(sets), len(sets), method),
    )


def _value(result: Result) -> float:
    return result.objective.value if result.objective is not None else math.inf


def _all_sets(count: int) -> list[tuple[int, ...]]:
    """Every set, the small ones first."""
    every = [tuple(k for k in range(count) if code >> k & 1) for code in range(1 << count)]
    return sorted(every, key=lambda chosen: (len(chosen), chosen))


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


def _none(problem: Problem, why: str) -> Result:
    """No design, and why."""
    given = evaluate(problem)
    return Result(problem, Status.INFEASIBLE, None, None, (), (), given, given, why)


def _no_design(problem: Problem, answer: _Answer) -> Result:
    """Stars exist, but none keeps the limits: the conflict of the first one names them."""
    result = solve_fixed(replace(problem, phasing=None)) if problem.decisions else None
    names = result.conflict if result is not None else tuple(limit.name for limit in problem.limits)
    shown = " and ".join(f"'{name}'" for name in names) or "the bounds"
    why = f"no star keeps {shown}, whatever else is decided ({answer.infeasible} design(s) tried)"
    return replace(_none(problem, why), conflict=names)


def _uneven(problem: Problem, phasing: Phasing, even: Result | None) -> Result:
    from laufruhe.solve.uneven import solve_uneven

    return solve_uneven(problem, phasing, even)
