"""Unbalances decided for the engines that tolerances allow: the least worst case, or what a share stays below.

The least worst case is a cone program with a sum of norms for every extreme point of the errors (R4). Only those that
hold the design are in it: the worst engine of a design joins, the program is solved again, and what it cannot go under
meets what no engine exceeds (R8).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.robust.built_engines import (
    Adversary,
    SampledEngines,
    WorstCaseAdversary,
    WorstEngines,
    evaluate_built,
)
from laufruhe.extensions.robust.conclusion import ActiveErrors, compare_designs, infeasible_robust_result, robust_result
from laufruhe.extensions.robust.tolerance import Population, robust_of, tolerances_of, with_errors, with_tolerances
from laufruhe.load_models.affine import AffineModel, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import in_time
from laufruhe.numerics.progress import report_progress, within
from laufruhe.numerics.spectrum import common_base
from laufruhe.numerics.witness import is_over
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import is_affine
from laufruhe.problem.evaluation import fine_samples, objective_value, with_fine_sampling
from laufruhe.problem.measure import Limit
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import ProofStrength, best_bound, gap_of, kkt_residual
from laufruhe.solvers.conclusion import FEASIBLE, KEPT, READINGS, ProofData, evaluate_design, unbalances_of
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.unbalances import is_infeasible, smallest_conflict, tighten_limits
from laufruhe.solvers.general import solve_star_by_star
from laufruhe.solvers.result import Result, Status

Solve = Callable[[Problem], Result]

MOST_ROUNDS = 60
MOST_SCENARIOS = 24
COARSER = 4
"""The program has so many times fewer angles than the fidelity at first."""
SAME = 1e-9
JOINS = 0.1
"""Share of the tolerance by which an engine has to be worse than all in the program to join it."""
MOST_MARGINS, MOST_DOUBLINGS = 3, 3
"""Times that limits are lowered, and that the angles of the fidelity are doubled, where its own leave a gap."""
FALLS = 0.99
"""What is passed by limits has to fall by so much for more errors to join: else angles or margins are what it is."""
SMALL = 1e-2
"""Share of a limit by which what is proven may be over it for margins to help."""
OUTER = 12
"""Rounds in which the engines that may be above are chosen anew."""


@dataclass(frozen=True, eq=False)
class RobustDesign:
    """A design, what no engine of it exceeds, and what no design goes under.

    Attributes
    ----------
    samples
        Steps over the cycle at which engines are measured.
    margin
        Share by which limits were lowered, for peaks stand between angles.
    conflict
        Limits that no design keeps in every engine; nothing else means anything then.
    """

    values: tuple[Value, ...]
    found: WorstEngines
    bound: float
    active: ActiveErrors
    scenarios: int
    angles: int
    samples: int
    margin: float = 0.0
    conflict: tuple[str, ...] = ()


def solve_built(problem: Problem, solve: Solve, _: Solve) -> Result:
    """Decide for the engines that tolerances allow.

    Parameters
    ----------
    problem
        Its unbalances may be open.
    solve
        Decides the drawing, and each star of an open one.

    Raises
    ------
    ModelError
        If anything else is open or asked.
    """
    refuse(problem)
    if problem.phasing is not None:
        found = solve_star_by_star(problem, solve)
        # of engines as built the design as given is told as they are too
        given = None if found.objective is None else solve(replace(problem, phasing=None, decisions=())).objective
        if found.objective is None or given is None:
            return found
        return replace(found, objective=replace(found.objective, initial=given.value))
    over = robust_of(problem).over
    started = time.perf_counter()
    with within("drawing"):
        drawing = solve(problem.drawing)
    nonzero = tolerances_of(problem).nonzero
    without = drawing.certificate is None and (problem.decisions or drawing.status is Status.INFEASIBLE)
    if without or not nonzero.tolerances:
        return replace(drawing, problem=problem)
    problem = with_tolerances(replace(problem, fidelity=drawing.problem.fidelity), nonzero)
    start = tuple(unbalances_of(problem, drawing))
    report_progress("worst errors of the drawing")
    adversary, minimum = _decide(problem, over, start, drawing)
    adversary = replace(adversary, samples=minimum.samples)
    as_given = adversary.at(problem.start, proven=False)
    if minimum.conflict:
        return infeasible_robust_result(problem, as_given, minimum.conflict, {"solve": time.perf_counter() - started})
    solved = time.perf_counter()
    strength = ProofStrength.EXACT if over.share is None else ProofStrength.RELAXED
    design = evaluate_design(problem, minimum.values, minimum.samples)
    shown = ProofData(minimum.bound, strength, minimum.active.residual, _method(problem, minimum))
    details = compare_designs(
        problem, adversary, start, minimum.values, minimum.found, minimum.active, minimum.scenarios
    )
    timing = {"solve": solved - started, "compare": time.perf_counter() - solved}
    return robust_result(problem, design, as_given, minimum.found, minimum.active, shown, details, timing)


def _decide(
    problem: Problem, over: Population, start: tuple[Value, ...], drawing: Result
) -> tuple[Adversary, RobustDesign]:
    """Return the adversary that fits the tolerances, and the best design against it."""
    tolerances, samples = tolerances_of(problem), problem.fidelity.samples
    zero_level, random = numerical_zero(problem, drawing.final.engine), np.random.default_rng(over.seed)
    if over.share is None and tolerances.is_affine:
        every = WorstCaseAdversary(problem, samples, 0.5 * problem.tolerance)
        return every, _minimise_worst_case(problem, every, start, zero_level)
    if over.share is None:
        drawn = SampledEngines(problem, tolerances.draw(random, over.engines), samples)
        return drawn, _minimise_worst_case(problem, drawn, start, zero_level)
    drawn = SampledEngines(problem, tolerances.draw_mirrored(random, over.engines), samples)
    found = _minimise_share(problem, drawn, start, over.share, zero_level)
    # of errors that lie alike to both sides half of all engines are no better than the drawing (R9)
    bound = drawing.certificate.lower_bound if drawing.certificate and tolerances.is_affine else 0.0
    found = replace(found, bound=bound if problem.decisions else found.found.bound)
    for _ in in_time(range(READINGS)):
        if not is_over(found.bound, found.found.bound, zero_level):
            break
        drawn = replace(drawn, samples=fine_samples(found.samples))
        level = _quantile(drawn, found.values, over.share)
        found = replace(found, found=replace(found.found, value=level, bound=level), samples=drawn.samples)
    return drawn, found


def refuse(problem: Problem) -> None:
    """Refuse what no method decides for built engines."""
    phasing = problem.phasing
    if phasing is not None:
        if phasing.continuous or phasing.throw_bounds is not None:
            rule = "[robust] decides cranks that fire evenly"
            raise ModelError(f"{rule}; leave phasing.intervals and bounds of throws out, or leave [robust] out")
        return
    open_kinds = {decision.kind for decision in problem.decisions} - {Kind.UNBALANCE}
    if open_kinds:
        names = ", ".join(d.name for d in problem.decisions if d.kind in open_kinds)
        raise ModelError(f"[robust] decides unbalances, and {names} is open too; fix it, or leave [robust] out")
    if problem.engine.geared:
        raise ModelError("[robust] takes all inertia on the crank; leave [[geared_inertias]] out, or [robust]")
    if problem.fidelity.is_uneven:
        raise ModelError("[robust] takes a crank that turns evenly; leave fidelity.crank_inertia out, or [robust]")
    for measure in problem.measures:
        if measure.channel.is_number or not is_affine(measure.channel, {Kind.UNBALANCE, Kind.PISTON}, problem):
            raise ModelError(f"[robust] is for loads only, not for {measure.name}; ask for it without [robust]")
    if not problem.objective:
        raise ModelError("[robust] minimises nothing; add [objective]")
    if robust_of(problem).over.share is not None and any(m.measure.is_load for m in problem.limits):
        raise ModelError('limits of loads are kept in the worst case only; take over = "worst case", or leave them out')


def _method(problem: Problem, found: RobustDesign) -> str:
    over, angles = robust_of(problem).over, f"at {found.angles} angles; " if found.angles else ""
    cones = f"second-order cones over {found.scenarios} sets of errors {angles}" if angles else ""
    if over.share is not None:
        bounded = "bounded by the drawing" if tolerances_of(problem).is_affine else "without a bound"
        return f"{cones}{over.engines} drawn engines, {bounded}"
    if tolerances_of(problem).is_affine:
        return f"{cones}every error bounded by branch and bound"
    return f"{cones}the worst of {over.engines} drawn engines, not of all"


class _Program:
    """The cone program of several sets of errors, as they join."""

    def __init__(self, problem: Problem, zero_level: float) -> None:
        self.problem, self.zero_level, self.samples = problem, zero_level, problem.fidelity.samples
        self.errors: list[Array] = []
        self.models: list[AffineModel] = []
        self.shares: list[float] = []
        self.active = ActiveErrors()
        self.margin, self.margins = 0.0, 0
        self.conflict: tuple[str, ...] = ()

    def add(self, errors: Sequence[Array]) -> bool:
        """Add sets that are not in it yet, and return whether there were any."""
        new = [z for z in errors if all(np.abs(z - own).max(initial=0.0) > SAME for own in self.errors)]
        while self.errors and len(self.errors) + len(new) > MOST_SCENARIOS:
            minimum = int(np.argmin(self.shares)) if self.shares else 0
            for own in (self.errors, self.models, self.shares):
                del own[minimum]
        for z in new:
            self.errors.append(z)
            self.models.append(AffineModel(with_errors(self.problem, z)))
            self.shares.append(1.0)
        base = common_base([model.base for model in self.models])
        for model in self.models:
            model.base = base
        return bool(new)

    def lower(self, violation: float) -> None:
        """Lower limits by a little more than what one is passed by."""
        self.margin, self.margins = self.margin + 1.05 * violation, self.margins + 1

    @property
    def angles(self) -> int:
        """Angles of the fidelity within the period of all loads."""
        return max(model.full_samples for model in self.models)

    def at(self, samples: int, averaged: bool = False) -> tuple[AffineProblem, list[tuple[int, Limit]]]:
        """Return all sets at so many angles, and of every limit the set and the limit that it is of."""
        parts = [model.at(samples, averaged) for model in self.models]
        limits = [(k, limit, own) for k, part in enumerate(parts)
                  for limit, own in zip(self.problem.load_limits, part.limits, strict=True)
                  if k == 0 or limit.measure.is_load]  # fmt: skip
        return AffineProblem(
            tuple(term for part in parts for term in part.terms),
            tuple(own for _, _, own in limits),
            parts[0].domains,
            samples,
            tuple(k for k, part in enumerate(parts) for _ in part.terms),
        ), [(k, limit) for k, limit, _ in limits]

    def solved(self, samples: int) -> tuple[tuple[Value, ...], float] | None:
        """Return its optimum and the bound of all designs; None where no design keeps the limits at these angles."""
        coarse, owners = self.at(samples)
        coarse = tighten_limits(coarse, self.margin)
        solution = solve_cones(coarse)
        if solution.x is None:
            # margins, and means of a few angles, forbid what is allowed (P7)
            averaged, _ = self.at(samples, averaged=True)
            names = [limit.name for _, limit in owners]
            self.conflict = tuple(dict.fromkeys(smallest_conflict(averaged, names))) if is_infeasible(averaged) else ()
            return None
        shares = solution.shares
        terms = tuple(z for z, k in zip(solution.multipliers.terms, coarse.groups, strict=True) if shares[k] > 0.0)
        told = replace(solution.multipliers, terms=terms)
        fine, _ = self.at(2 * max(self.angles, samples), averaged=True)
        weighed = fine.shared(shares)
        bound = best_bound(weighed, solution.x, told)
        self.shares = [float(share) for share in shares]
        prices = bound.multipliers.shadow_prices(weighed)
        residual = kkt_residual(weighed, solution.x, bound)
        of = [[(limit, price) for (owner, limit), price in zip(owners, prices, strict=True) if owner == k]
              for k in range(len(self.errors))]  # fmt: skip
        self.active = ActiveErrors(tuple(self.errors), tuple(self.shares), tuple(map(tuple, of)), residual)
        return tuple(domain.complex_value(solution.x) for domain in coarse.domains), bound.value

    def level(self, values: Sequence[Value]) -> float:
        """Return the largest objective of a design with the errors that are in it."""
        found = (evaluate_built(model.problem, values, self.samples) for model in self.models)
        return max(objective_value(self.problem, each) for each in found)


def _minimise_worst_case(
    problem: Problem, adversary: Adversary, start: tuple[Value, ...], zero_level: float
) -> RobustDesign:
    """Return the design whose worst engine is least, from a given one (R8)."""
    found = adversary.at(start, proven=not problem.decisions)
    best = RobustDesign(start, found, 0.0, ActiveErrors((found.errors[0],), (1.0,), ((),)), 1, 0, adversary.samples)
    if not problem.decisions:
        # an engine that was found is built, whatever else is: what it breaks is broken, and what it has is had
        engine = evaluate_built(with_errors(problem, found.errors[0]), start, adversary.samples)
        best = replace(best, bound=objective_value(problem, with_fine_sampling(engine)), conflict=found.broken)
        return _refine_sampling(adversary, best, zero_level)
    program, values, bound = _Program(problem, zero_level), start, 0.0
    program.add([np.zeros(tolerances_of(problem).count)])
    samples, level, before, known = program.angles // COARSER, 0.0, math.inf, True
    for _ in in_time(range(MOST_ROUNDS)):
        is_worse = found.value > level * (1.0 + JOINS * problem.tolerance)
        is_new = known and (is_worse or FEASIBLE < found.violation < FALLS * before)
        if is_new and program.add(found.errors):
            samples, before = max(samples, program.angles // COARSER), found.violation
        elif known and found.violation > FEASIBLE and samples >= program.angles and program.margins < MOST_MARGINS:
            # it knows all engines that hold this design, and peaks stand between its angles: limits a little lower
            program.lower(found.violation)
        else:
            samples, program.margin, program.margins, before = 2 * samples, 0.0, 0, math.inf
            if samples > program.angles << MOST_DOUBLINGS:
                break
            if samples > program.angles:
                adversary = replace(adversary, samples=2 * adversary.samples)
                program.samples = adversary.samples
        solved = program.solved(samples)
        if program.conflict:
            return replace(best, conflict=program.conflict)
        known = solved is not None
        if solved is None:
            continue
        values, own = solved
        bound, level = max(bound, own), program.level(values)
        found = adversary.at(values, proven=False)
        if gap_of(found.value, bound, zero_level) <= problem.tolerance and found.violation <= FEASIBLE:
            found = adversary.at(values, proven=True)
        each = RobustDesign(
            values, found, bound, program.active, len(program.errors), samples, adversary.samples, program.margin
        )
        best = min(best, each, key=lambda one: (one.found.violation > KEPT, one.found.value))
        if gap_of(found.bound, bound, zero_level) <= problem.tolerance and found.violation <= FEASIBLE:
            break
    if not best.found.proven or best.samples < adversary.samples:
        best = replace(best, found=adversary.at(best.values, proven=True), samples=adversary.samples)
    return _refine_sampling(adversary, replace(_keep_limits(program, adversary, best), bound=bound), zero_level)


def _refine_sampling(adversary: Adversary, best: RobustDesign, zero_level: float) -> RobustDesign:
    for _ in in_time(range(READINGS)):
        if not is_over(best.bound, best.found.bound, zero_level):
            break
        adversary = replace(adversary, samples=fine_samples(best.samples))
        best = replace(best, found=adversary.at(best.values, proven=True), samples=adversary.samples)
    return best


def _keep_limits(program: _Program, adversary: Adversary, best: RobustDesign) -> RobustDesign:
    """Lower limits a little until the proven bound of a design keeps them, where only the bound breaks them."""
    program.margin = best.margin
    for _ in in_time(range(MOST_MARGINS)):
        if not KEPT < best.found.violation <= SMALL:
            break
        program.lower(best.found.violation)
        # of the design as given no program is known yet
        solved = program.solved(best.angles or program.angles)
        if solved is None:
            break
        found = adversary.at(solved[0], proven=True)
        if found.violation < best.found.violation:
            best = replace(best, values=solved[0], found=found, active=program.active)
    return best


def _quantile(adversary: SampledEngines, values: Sequence[Value], share: float) -> float:
    return float(np.sort(adversary.objective(values))[math.ceil(share * len(adversary.errors)) - 1])


def _minimise_share(
    problem: Problem, adversary: SampledEngines, start: tuple[Value, ...], share: float, zero_level: float
) -> RobustDesign:
    """Return the design that a share of the drawn engines stays below least, as far as a search finds it (R9)."""
    below = math.ceil(share * len(adversary.errors))
    values, best = start, None
    for _ in in_time(range(OUTER)):
        order = np.argsort(adversary.objective(values), kind="stable")
        lower_share = adversary.subset(order[:below])
        each = _minimise_worst_case(problem, lower_share, values, zero_level)
        if best is not None and each.found.value >= best.found.value * (1.0 - SAME):
            break
        best, values = each, each.values
    if best is None:
        raise ModelError("no design was found within the time limit; raise it")
    level = _quantile(adversary, best.values, share)
    return replace(best, found=replace(best.found, value=level, bound=level), samples=adversary.samples)
