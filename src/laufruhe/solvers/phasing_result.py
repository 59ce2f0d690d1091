"""From decided stars to a result: everything evaluated anew, ranked, and certified (S17)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from laufruhe.load_models.star_model import StarModel
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.phasing import Candidate, Phasing
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import FLOOR, Certificate, Proof, gap_unit
from laufruhe.solvers.ranking import PhasingResult, RankedStar, ranked_orders, ranked_star
from laufruhe.solvers.result import DecisionValue, ObjectiveValue, Result, Status
from laufruhe.solvers.star_answers import Answer, Decided
from laufruhe.solvers.star_cuts import owners_of, solve_design
from laufruhe.solvers.star_families import families_of
from laufruhe.solvers.unbalances import solve_unbalances


def final_result(problem: Problem, phasing: Phasing, answer: Answer) -> Result:
    """The best design solved once more as a problem of its own, with what was proven of all designs."""
    best = answer.designs[0]
    shafts = names_of(phasing, _needed(problem, phasing, best))
    orders, _ = ranked_orders(phasing, best.family.layout, best.family.throws(best.steps), best.steps)
    left_out = tuple(name for names in phasing.shafts.optional for name in names if name not in shafts)
    candidate = replace(best.family.candidate(phasing, best.steps, left_out), firing_order=orders[0].order)
    chosen = replace(phasing.realise(candidate), tolerance=problem.tolerance, phasing=None)
    result = solve_fixed(chosen)
    given = evaluate(problem)
    value = result.objective.value if result.objective else best.value
    bound = min(answer.bound, value)
    gap = (value - bound) / gap_unit(value, objective_value(problem, given))
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
        objective=ObjectiveValue.of(problem, value, objective_value(problem, initial)),
        certificate=certificate,
        decisions=(*phase_decisions(problem, phasing, candidate, shafts), *result.decisions),
        initial=initial,
        phasing=details,
    )


def solve_fixed(problem: Problem) -> Result:
    """One design with its unbalances at their optimum."""
    if problem.decisions:
        return solve_unbalances(problem)
    from laufruhe.solvers import state

    return state(problem)


def sum_of_designs(phasing: Phasing) -> int:
    """Even stars of every geometry, images counted."""
    return sum(family.size for family in families_of(phasing)[0])


def _needed(problem: Problem, phasing: Phasing, best: Decided) -> tuple[int, ...]:
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


def names_of(phasing: Phasing, built: Sequence[int]) -> tuple[str, ...]:
    """Shafts of some of the sets."""
    return tuple(name for k in built for name in phasing.shafts.optional[k])


def _entry(phasing: Phasing, design: Decided, shafts: tuple[str, ...] | None) -> RankedStar:
    family = design.family
    return ranked_star(
        phasing,
        family.layout,
        family.throws(design.steps),
        design.steps,
        design.value,
        design.bound,
        design.proven,
        names_of(phasing, design.built) if shafts is None else shafts,
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


def no_result(problem: Problem, why: str) -> Result:
    """No design, and why."""
    given = evaluate(problem)
    return Result(problem, Status.INFEASIBLE, None, None, (), (), given, given, why)


def no_design(problem: Problem, answer: Answer) -> Result:
    """Stars exist, but none keeps the limits: the conflict of the first one names them."""
    result = solve_fixed(replace(problem, phasing=None)) if problem.decisions else None
    names = result.conflict if result is not None else tuple(limit.name for limit in problem.limits)
    shown = " and ".join(f"'{name}'" for name in names) or "the bounds"
    why = f"no star keeps {shown}, whatever else is decided ({answer.infeasible} design(s) tried)"
    return replace(no_result(problem, why), conflict=names)
