"""Sizes of the running gear with elastic mounts, and unbalances with both: local programs and their bound (Z15).

The masses that sizes add lie between two ends each. With these masses as decisions, and without limits on stresses, the
problem has loads affine in its decisions, and mounts. Bounds of that relaxed problem also hold here.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.extensions.sizes.machine import RunningGear
from laufruhe.extensions.sizes.model import SizeModel
from laufruhe.extensions.sizes.solver import check_acts, solve_sizes
from laufruhe.problem.decision import Decision, Drive, Kind, NumberDrive, RotorDrive
from laufruhe.problem.measure import Measure
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Interval, Value
from laufruhe.prove.certificate import ProofStrength, gap_tolerance_of
from laufruhe.prove.mounts.provers import Question, run_provers
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, Design, build_result, evaluate_design, values_of
from laufruhe.solvers.mounts.nonlinear import mounts_bound
from laufruhe.solvers.result import Result
from laufruhe.solvers.smooth.local_programs import LocalProgram, best_local_optimum, proof_data, spread_starts

STARTS, RANKED_STARTS = 2, 6
"""Local searches, and start designs that are ranked for them."""
# relative tolerance of the start without mounts
ROUGH_TOLERANCE = 1e-2
MASSES = ("reciprocating_mass", "rotating_mass", "rod_inertia_deficit")


def solve_mounted_sizes(problem: Problem) -> Result:
    """Return the best sizes of an engine on elastic mounts: a local optimum of a few searches, with a lower bound."""
    started = time.perf_counter()
    without_mounts = replace(
        problem,
        decisions=tuple(decision for decision in problem.decisions if decision not in problem.mount_decisions),
        objective=tuple(term for term in problem.objective if not term.measure.is_mounting),
        limits=tuple(limit for limit in problem.limits if not limit.measure.is_mounting),
    )
    initial, model, program = evaluate_start(problem), SizeModel(without_mounts), LocalProgram.of(problem)
    check_acts(model)
    starts = [program.shares(problem.start), *spread_starts(problem)[:RANKED_STARTS]]
    search = replace(without_mounts.search, boxes=1)
    sizes_result = solve_sizes(replace(without_mounts, tolerance=ROUGH_TOLERANCE, search=search))
    if sizes_result.status.has_design:
        # mounts keep their start values
        starts.insert(0, program.shares(values_of(problem, sizes_result)))
    best = best_local_optimum(program, starts, min(problem.search.starts, STARTS))
    design = evaluate_design(problem, program.values(best))
    bound = _bound(problem, model, design)
    words = "local programs; bound of the mounts with any masses that the sizes may have" if bound else "local programs"
    proof = proof_data(program, design, bound, ProofStrength.RELAXED, words)
    return build_result(design, initial, proof, {"solve": time.perf_counter() - started})


def _bound(problem: Problem, model: SizeModel, design: Design) -> float:
    depends_on_sizes = any(
        term.measure.channel.size_value is not None or _has_size_factors(term.measure) for term in problem.objective
    )
    if model.moves_rod or depends_on_sizes or design.violation > FEASIBILITY_TOL:
        return 0.0
    relaxed, reference = with_masses(problem, model, design.values)
    gap_tolerance = gap_tolerance_of(design.value, problem.tolerance, numerical_zero(problem, design.evaluation.engine))
    bound = run_provers(Question(relaxed, design.value, gap_tolerance, reference)).bound
    return max(bound, mounts_bound(relaxed, reference))


def with_masses(problem: Problem, model: SizeModel, values: Sequence[Value]) -> tuple[Problem, list[Value]]:
    """Return a problem with open masses in place of open sizes, and its decision values for the sizes `values`.

    Limits on stresses and on sizes are omitted.
    """
    low, high = model.mass_box
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    values_by_name = dict(zip((d.name for d in problem.decisions), values, strict=True))
    masses = model.masses(np.array([values_by_name[d.name].real for d in model.sizes])) - middle
    engine = model.with_masses(middle)
    gear = engine.extra(RunningGear)
    drives: list[tuple[Drive, ...]] = [
        *(tuple(NumberDrive(Kind.PISTON, (part.name, mass)) for part in engine.slider_cranks) for mass in MASSES),
        tuple(RotorDrive(name, direction) for name, direction in (gear.throws if gear is not None else ())),
    ]
    open_masses = [k for k in range(len(half)) if half[k] > 0.0]
    mass_decisions = [Decision(f"mass {k}", "kg", Interval(-half[k], half[k]), 0.0, drives[k]) for k in open_masses]
    other_decisions = tuple(d for d in problem.decisions if d not in model.sizes)
    limits = tuple(
        x for x in problem.limits if x.measure.channel.size_value is None and not _has_size_factors(x.measure)
    )
    relaxed = replace(problem, engine=engine, decisions=(*mass_decisions, *other_decisions), limits=limits)
    return relaxed, [*(float(masses[k]) for k in open_masses), *(values_by_name[d.name] for d in other_decisions)]


def _has_size_factors(measure: Measure) -> bool:
    return measure.is_load and measure.load.size_factors is not None
