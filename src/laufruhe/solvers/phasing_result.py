"""From decided stars to a result: everything evaluated anew, ranked, and certified (S17)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from laufruhe.load_models.star_model import StarModel
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import FLOOR, Reach, certified
from laufruhe.solvers.conclusion import no_star, state, with_star
from laufruhe.solvers.ranking import PhasingResult, RankedOrder, RankedStar, ranked_orders, ranked_star
from laufruhe.solvers.result import Result
from laufruhe.solvers.star_answers import Answer, Decided
from laufruhe.solvers.star_cuts import owners_of, solve_design
from laufruhe.solvers.star_families import families_of
from laufruhe.solvers.unbalances import solve_unbalances


def final_result(problem: Problem, phasing: Phasing, answer: Answer) -> Result:
    """The best design solved once more as a problem of its own, with what was proven of all designs."""
    designs = [design for design in answer.designs if _orders(phasing, design)]
    if not designs:
        return no_star(problem, "no star has a firing order that keeps the firing intervals allowed")
    best = designs[0]
    shafts, orders = names_of(phasing, _needed(problem, phasing, best)), _orders(phasing, best)
    left_out = tuple(name for names in phasing.shafts.optional for name in names if name not in shafts)
    candidate = replace(best.family.candidate(phasing, best.steps, left_out), firing_order=orders[0].order)
    result = solve_fixed(replace(phasing.realise(candidate), tolerance=problem.tolerance, phasing=None))
    value = result.objective.value if result.objective else best.value
    # a star's own tolerance, and that by which another has to be better
    certificate = certified(
        value, answer.bound, objective_value(problem, evaluate(problem)), 2.0 * problem.tolerance, Reach.WHOLE,
        result.certificate.kkt_residual if result.certificate else 0.0, answer.method,
    )  # fmt: skip
    details = PhasingResult(
        tuple(_entry(phasing, d, None if k else shafts) for k, d in enumerate(designs)),
        best.family.layout.throw_positions,
        best.family.layout.banks,
        sum_of_designs(phasing),
        answer.looked_at,
        answer.method,
    )
    return with_star(problem, phasing, result, candidate, certificate, details)


def _orders(phasing: Phasing, design: Decided) -> tuple[RankedOrder, ...]:
    return ranked_orders(phasing, design.family.layout, design.family.throws(design.steps), design.steps)[0]


def solve_fixed(problem: Problem) -> Result:
    """One design with its unbalances at their optimum."""
    if problem.decisions:
        return solve_unbalances(problem)
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


def no_design(problem: Problem, answer: Answer) -> Result:
    """Stars exist, but none keeps the limits: the conflict of the first one names them."""
    result = solve_fixed(replace(problem, phasing=None)) if problem.decisions else None
    names = result.conflict if result is not None else tuple(limit.name for limit in problem.limits)
    shown = " and ".join(f"'{name}'" for name in names) or "the bounds"
    why = f"no star keeps {shown}, whatever else is decided ({answer.infeasible} design(s) tried)"
    return no_star(problem, why, conflict=names)
