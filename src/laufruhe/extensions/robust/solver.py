"""Optimum of unbalances for engines within tolerances: smallest worst case, or smallest objective of a share.

The smallest worst case is a cone program with a sum of norms for each extreme point of the errors (R4). The program has
only the points that determine the design. The worst engine of a design joins, and the program is solved again, until
its lower bound meets the upper bound over all engines (R8).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.robust.built_engines import (
    Adversary,
    SampledEngines,
    WorstCaseAdversary,
    WorstEngines,
    evaluate_built,
)
from laufruhe.extensions.robust.conclusion import ActiveErrors, RobustDesign, infeasible_robust_result, robust_result
from laufruhe.extensions.robust.tolerance import robust_of, tolerances_of, with_errors, with_tolerances
from laufruhe.load_models.affine import AffineModel, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import until_time_limit
from laufruhe.numerics.progress import report_progress, search_scope
from laufruhe.numerics.spectrum import common_base
from laufruhe.numerics.witness import is_over
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import is_affine
from laufruhe.problem.evaluation import fine_samples, objective_value, with_fine_sampling
from laufruhe.problem.measure import Limit
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import best_bound, gap_of, kkt_residual
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, FEASIBLE, MAX_REFINEMENTS, unbalance_values
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.unbalances import is_infeasible, smallest_conflict, tighten_limits
from laufruhe.solvers.general import solve_star_by_star
from laufruhe.solvers.result import Result, Status

Solve = Callable[[Problem], Result]

MAX_ROUNDS = 60
MAX_SCENARIOS = 24
COARSER = 4
"""Factor by which the first program has fewer samples than the fidelity."""
SAME = 1e-9
ADVERSARY_SHARE = 0.2
"""Share of the tolerance that the upper bound over all engines of a design may take."""
JOIN_SHARE = 0.1
"""Share of the tolerance by which an engine must exceed all in the program to join it."""
MAX_MARGINS, MAX_DOUBLINGS = 3, 3
"""Most times that limits are lowered, and that samples of the fidelity are doubled to close a gap."""
MIN_FALL = 0.99
"""Ratio of violations in successive rounds below which errors join; above it, samples or margins are the cause."""
MAX_MARGIN = 1e-2
"""Largest relative violation that margins can remove."""
SHARE_ROUNDS = 12
"""Most rounds that select the engines that may exceed the objective."""


def solve_built(problem: Problem, solve: Solve, _: Solve) -> Result:
    """Return the unbalances that are best for engines within tolerances; `solve` solves the exact drawing."""
    refuse(problem)
    if problem.phasing is not None:
        result = solve_star_by_star(problem, solve)
        # the objective of the initial design is also that of built engines
        initial = None if result.objective is None else solve(replace(problem, phasing=None, decisions=())).objective
        if result.objective is None or initial is None:
            return result
        return replace(result, objective=replace(result.objective, initial=initial.value))
    started = time.perf_counter()
    with search_scope("drawing"):
        drawing = solve(problem.drawing)
    nonzero = tolerances_of(problem).nonzero
    is_unsolved = drawing.certificate is None and (problem.decisions or drawing.status is Status.INFEASIBLE)
    if is_unsolved or not nonzero.tolerances:
        return replace(drawing, problem=problem)
    problem = with_tolerances(replace(problem, fidelity=drawing.problem.fidelity), nonzero)
    start = tuple(unbalance_values(problem, drawing))
    report_progress("worst errors of the drawing")
    adversary, robust = _minimise(problem, start, drawing)
    adversary = replace(adversary, samples=robust.samples)
    initial_worst, share = adversary.at(problem.start, proven=False), robust_of(problem).population.share
    if share is not None and isinstance(adversary, SampledEngines):
        initial_worst = _at_share(initial_worst, adversary, problem.start, share)
    seconds = time.perf_counter() - started
    if robust.conflict:
        return infeasible_robust_result(problem, initial_worst, robust.conflict, {"solve": seconds})
    return robust_result(problem, adversary, start, initial_worst, robust, _method(problem, robust), seconds)


def _minimise(problem: Problem, start: tuple[Value, ...], drawing: Result) -> tuple[Adversary, RobustDesign]:
    """Return the search for worst engines (adversary), and the best design against these engines."""
    tolerances, population, samples = tolerances_of(problem), robust_of(problem).population, problem.fidelity.samples
    zero_level, random = numerical_zero(problem, drawing.final.engine), np.random.default_rng(population.seed)
    if population.share is None and tolerances.is_affine:
        adversary = WorstCaseAdversary(problem, samples, ADVERSARY_SHARE * problem.tolerance)
        return adversary, _minimise_worst_case(problem, adversary, start, zero_level)
    if population.share is None:
        sampled = SampledEngines(problem, tolerances.draw(random, population.engines), samples)
        return sampled, _minimise_worst_case(problem, sampled, start, zero_level)
    sampled = SampledEngines(problem, tolerances.draw_mirrored(random, population.engines), samples)
    robust = _minimise_share(problem, sampled, start, population.share, zero_level)
    # with symmetric errors at least half of all engines are no better than the drawing (R9)
    bound = drawing.certificate.lower_bound if drawing.certificate and tolerances.is_affine else 0.0
    robust = replace(robust, bound=bound if problem.decisions else robust.worst.bound)
    for _ in until_time_limit(range(MAX_REFINEMENTS)):
        if not is_over(robust.bound, robust.worst.bound, zero_level):
            break
        sampled = replace(sampled, samples=fine_samples(robust.samples))
        worst = _at_share(robust.worst, sampled, robust.values, population.share)
        robust = replace(robust, worst=worst, samples=sampled.samples)
    return sampled, robust


def refuse(problem: Problem) -> None:
    """Raise ModelError for problems that [robust] does not support."""
    phasing = problem.phasing
    if phasing is not None:
        if phasing.continuous or phasing.throw_bounds is not None:
            rule = "[robust] decides cranks that fire evenly"
            raise ModelError(f"{rule}; leave phasing.intervals and bounds of throws out, or leave [robust] out")
        return
    open_kinds = {decision.kind for decision in problem.decisions} - {Kind.UNBALANCE}
    if open_kinds:
        names = ", ".join(decision.name for decision in problem.decisions if decision.kind in open_kinds)
        raise ModelError(
            f"[robust] decides unbalances only, and {names} is open too; fix this number, or remove [robust]"
        )
    if problem.engine.geared:
        raise ModelError("[robust] does not support geared inertias; remove [[geared_inertias]], or [robust]")
    if problem.fidelity.has_uneven_speed:
        raise ModelError("[robust] assumes a constant crank speed; remove fidelity.crank_inertia, or [robust]")
    for measure in problem.measures:
        if measure.channel.is_number or not is_affine(measure.channel, {Kind.UNBALANCE, Kind.PISTON}, problem):
            raise ModelError(f"[robust] is for loads only, not for {measure.name}; remove [robust], or name a load")
    if not problem.objective:
        raise ModelError("[robust] has no objective to minimise; add [objective]")
    if robust_of(problem).population.share is not None and any(limit.measure.is_load for limit in problem.limits):
        raise ModelError(
            'limits on loads hold for the worst case only; set robust.over = "worst case", or remove these limits'
        )


def _method(problem: Problem, robust: RobustDesign) -> str:
    population, sampling = robust_of(problem).population, f"at {robust.angles} angles; " if robust.angles else ""
    cones = f"second-order cones over {robust.scenarios} sets of errors {sampling}" if sampling else ""
    if population.share is not None:
        bound = "bounded by the drawing" if tolerances_of(problem).is_affine else "without a bound"
        return f"{cones}{population.engines} drawn engines, {bound}"
    if tolerances_of(problem).is_affine:
        return f"{cones}every error bounded by branch and bound"
    return f"{cones}the worst of {population.engines} drawn engines, not of all"


class _Program:
    """Cone program of several error sets, which grows as sets join."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self.samples = problem, problem.fidelity.samples
        self.errors: list[Array] = []
        self.models: list[AffineModel] = []
        self.shares: list[float] = []
        self.active = ActiveErrors()
        self.margin, self.margins = 0.0, 0
        self.conflict: tuple[str, ...] = ()

    def add(self, errors: Sequence[Array]) -> bool:
        """Add new sets of errors to the program.

        Return True if there are any. The least active sets leave a full program.
        """
        added = [z for z in errors if all(np.abs(z - present).max(initial=0.0) > SAME for present in self.errors)]
        while self.errors and len(self.errors) + len(added) > MAX_SCENARIOS:
            index = int(np.argmin(self.shares)) if self.shares else 0
            for entries in (self.errors, self.models, self.shares):
                del entries[index]
        for error_set in added:
            self.errors.append(error_set)
            self.models.append(AffineModel(with_errors(self.problem, error_set)))
            self.shares.append(1.0)
        base = common_base([model.base for model in self.models])
        for model in self.models:
            model.base = base
        return bool(added)

    def lower(self, violation: float) -> None:
        """Lower limits by slightly more than a relative violation."""
        self.margin, self.margins = self.margin + 1.05 * violation, self.margins + 1

    @property
    def angles(self) -> int:
        """Samples of the fidelity within the common period of all loads."""
        return max(model.full_samples for model in self.models)

    def at(self, samples: int, averaged: bool = False) -> tuple[AffineProblem, list[tuple[int, Limit]]]:
        """Return the cone program over all error sets at `samples`, and the error set and limit of each constraint."""
        parts = [model.at(samples, averaged) for model in self.models]
        limits = [(set_index, limit, affine_limit) for set_index, part in enumerate(parts)
                  for limit, affine_limit in zip(self.problem.load_limits, part.limits, strict=True)
                  if set_index == 0 or limit.measure.is_load]  # fmt: skip
        return AffineProblem(
            tuple(term for part in parts for term in part.terms),
            tuple(affine_limit for _, _, affine_limit in limits),
            parts[0].domains,
            samples,
            tuple(set_index for set_index, part in enumerate(parts) for _ in part.terms),
        ), [(set_index, limit) for set_index, limit, _ in limits]

    def solved(self, samples: int) -> tuple[tuple[Value, ...], float] | None:
        """Return the optimal decisions and a lower bound of the objective.

        The result is None if no design satisfies the sampled limits.
        """
        coarse, owners = self.at(samples)
        coarse = tighten_limits(coarse, self.margin)
        solution = solve_cones(coarse)
        if solution.x is None:
            # margins and coarse samples of means are stricter than the limits, so check for a real conflict (P7)
            averaged, _ = self.at(samples, averaged=True)
            names = [limit.name for _, limit in owners]
            self.conflict = tuple(dict.fromkeys(smallest_conflict(averaged, names))) if is_infeasible(averaged) else ()
            return None
        shares = solution.shares
        terms = tuple(z for z, k in zip(solution.multipliers.terms, coarse.groups, strict=True) if shares[k] > 0.0)
        active_multipliers = replace(solution.multipliers, terms=terms)
        fine_problem, _ = self.at(2 * max(self.angles, samples), averaged=True)
        weighted = fine_problem.with_weighted_groups(shares)
        bound = best_bound(weighted, solution.x, active_multipliers)
        self.shares = [float(share) for share in shares]
        prices = bound.multipliers.shadow_prices(weighted)
        residual = kkt_residual(weighted, solution.x, bound)
        prices_by_set = [[(limit, price) for (owner, limit), price in zip(owners, prices, strict=True) if owner == k]
              for k in range(len(self.errors))]  # fmt: skip
        self.active = ActiveErrors(tuple(self.errors), tuple(self.shares), tuple(map(tuple, prices_by_set)), residual)
        return tuple(domain.complex_value(solution.x) for domain in coarse.domains), bound.value

    def level(self, values: Sequence[Value]) -> float:
        """Return the largest objective of a design over the error sets of the program."""
        return max(objective_value(self.problem, evaluate_built(m.problem, values, self.samples)) for m in self.models)


def _minimise_worst_case(
    problem: Problem, adversary: Adversary, start: tuple[Value, ...], zero_level: float
) -> RobustDesign:
    """Return the design with the smallest worst case, from an initial design (R8)."""
    worst = adversary.at(start, proven=not problem.decisions)
    best = RobustDesign(start, worst, 0.0, ActiveErrors((worst.errors[0],), (1.0,), ((),)), 1, 0, adversary.samples)
    if not problem.decisions:
        # without decisions the worst engine found gives both the bound and the violated limits
        engine = evaluate_built(with_errors(problem, worst.errors[0]), start, adversary.samples)
        best = replace(best, bound=objective_value(problem, with_fine_sampling(engine)), conflict=worst.violated)
        return _refine_sampling(adversary, best, zero_level)
    program, values, bound = _Program(problem), start, 0.0
    program.add([np.zeros(tolerances_of(problem).count)])
    samples, level, previous_violation, is_solved = program.angles // COARSER, 0.0, math.inf, True
    for _ in until_time_limit(range(MAX_ROUNDS)):
        is_worse = worst.value > level * (1.0 + JOIN_SHARE * problem.tolerance)
        is_new = is_solved and (is_worse or FEASIBLE < worst.violation < MIN_FALL * previous_violation)
        if is_new and program.add(worst.errors):
            samples, previous_violation = max(samples, program.angles // COARSER), worst.violation
        elif is_solved and worst.violation > FEASIBLE and samples >= program.angles and program.margins < MAX_MARGINS:
            # all active engines are in the program, so peaks lie between samples: lower the limits slightly
            program.lower(worst.violation)
        else:
            samples, program.margin, program.margins, previous_violation = 2 * samples, 0.0, 0, math.inf
            if samples > program.angles << MAX_DOUBLINGS:
                break
            if samples > program.angles:
                adversary = replace(adversary, samples=2 * adversary.samples)
                program.samples = adversary.samples
        solved = program.solved(samples)
        if program.conflict:
            return replace(best, conflict=program.conflict)
        is_solved = solved is not None
        if solved is None:
            continue
        values, lower_bound = solved
        bound, level = max(bound, lower_bound), program.level(values)
        worst = adversary.at(values, proven=False)
        if gap_of(worst.value, bound, zero_level) <= problem.tolerance and worst.violation <= FEASIBLE:
            worst = adversary.at(values, proven=True)
        candidate = RobustDesign(
            values, worst, bound, program.active, len(program.errors), samples, adversary.samples, program.margin
        )
        best = min(best, candidate, key=lambda design: (design.worst.violation > FEASIBILITY_TOL, design.worst.value))
        if gap_of(worst.bound, bound, zero_level) <= problem.tolerance and worst.violation <= FEASIBLE:
            break
    if not best.worst.proven or best.samples < adversary.samples:
        best = replace(best, worst=adversary.at(best.values, proven=True), samples=adversary.samples)
    return _refine_sampling(adversary, replace(_keep_limits(program, adversary, best), bound=bound), zero_level)


def _refine_sampling(adversary: Adversary, best: RobustDesign, zero_level: float) -> RobustDesign:
    for _ in until_time_limit(range(MAX_REFINEMENTS)):
        if not is_over(best.bound, best.worst.bound, zero_level):
            break
        adversary = replace(adversary, samples=fine_samples(best.samples))
        best = replace(best, worst=adversary.at(best.values, proven=True), samples=adversary.samples)
    return best


def _keep_limits(program: _Program, adversary: Adversary, best: RobustDesign) -> RobustDesign:
    """Tighten the limits of the program until the proven worst case of its design satisfies the given limits."""
    program.margin = best.margin
    for _ in until_time_limit(range(MAX_MARGINS)):
        if not FEASIBILITY_TOL < best.worst.violation <= MAX_MARGIN:
            break
        program.lower(best.worst.violation)
        # the initial design has no program yet
        solved = program.solved(best.angles or program.angles)
        if solved is None:
            break
        worst = adversary.at(solved[0], proven=True)
        if worst.violation < best.worst.violation:
            best = replace(best, values=solved[0], worst=worst, active=program.active)
    return best


def _at_share(worst: WorstEngines, adversary: SampledEngines, values: Sequence[Value], share: float) -> WorstEngines:
    # the objective of these engines is the one that a share of all drawn engines does not exceed
    level = float(np.sort(adversary.objectives(values))[math.ceil(share * len(adversary.errors)) - 1])
    return replace(worst, value=level, bound=level)


def _minimise_share(
    problem: Problem, adversary: SampledEngines, start: tuple[Value, ...], share: float, zero_level: float
) -> RobustDesign:
    """Return the best design found whose objective at least a fraction of random engines does not exceed (R9)."""
    count = math.ceil(share * len(adversary.errors))
    values, best = start, None
    for _ in until_time_limit(range(SHARE_ROUNDS)):
        order = np.argsort(adversary.objectives(values), kind="stable")
        lower_share = adversary.subset(order[:count])
        candidate = _minimise_worst_case(problem, lower_share, values, zero_level)
        if best is not None and candidate.worst.value >= best.worst.value * (1.0 - SAME):
            break
        best, values = candidate, candidate.values
    if best is None:
        raise ModelError("no design was found within the time limit; raise the time limit")
    return replace(best, worst=_at_share(best.worst, adversary, best.values, share), samples=adversary.samples)
