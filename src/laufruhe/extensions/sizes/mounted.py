"""Sizes of the running gear beside elastic mounts, and unbalances with both: local programs and their bound (Z15).

What sizes add to the masses that move lies between two ends each. With these masses as decisions of their own, and no
stress limited, it is a problem of loads that are affine in what is open, and of mounts: its bounds hold here too.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.extensions.sizes.machine import RunningGear
from laufruhe.extensions.sizes.model import SizeModel
from laufruhe.extensions.sizes.solver import check_acts, solve_sizes
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import Decision, Drive, Kind, NumberDrive, RotorDrive
from laufruhe.problem.measure import Measure
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Interval, Value
from laufruhe.prove.certificate import ProofStrength, gap_tolerance_of
from laufruhe.prove.mounts.provers import Question, proven
from laufruhe.solvers.conclusion import KEPT, Design, build_result, evaluate_design
from laufruhe.solvers.mounts.nonlinear import mounts_bound
from laufruhe.solvers.result import Result
from laufruhe.solvers.smooth.local_programs import LocalProgram, best_local_optimum, proof_data, spread_starts

STARTS, LOOKS = 2, 6
"""Searches, and designs looked at before these."""
ROUGHLY = 1e-2
MASSES = ("reciprocating_mass", "rotating_mass", "rod_inertia_deficit")


def solve_mounted_sizes(problem: Problem) -> Result:
    """The best local optimum of a few searches, with a bound."""
    started = time.perf_counter()
    initial, without_mounts = evaluate_start(problem), _on_given_mounts(problem)
    check_acts(SizeModel(without_mounts))
    program = LocalProgram.of(problem)
    best = best_local_optimum(
        program, [*_first(program, without_mounts), *spread_starts(problem)[:LOOKS]], min(problem.search.starts, STARTS)
    )
    design = evaluate_design(problem, program.values(best))
    bound = _bound(problem, design)
    words = "local programs; bound of the mounts with any masses that the sizes may have" if bound else "local programs"
    proof = proof_data(program, design, bound, ProofStrength.RELAXED, words)
    return build_result(design, initial, proof, {"solve": time.perf_counter() - started})


def _on_given_mounts(problem: Problem) -> Problem:
    decisions = tuple(d for d in problem.decisions if d not in problem.mount_decisions)
    terms = tuple(term for term in problem.objective if not term.measure.is_mounting)
    limits = tuple(limit for limit in problem.limits if not limit.measure.is_mounting)
    return replace(problem, decisions=decisions, objective=terms, limits=limits)


def _first(program: LocalProgram, without_mounts: Problem) -> list[Array]:
    problem, start = program.problem, program.shares(program.problem.start)
    alone = solve_sizes(replace(without_mounts, tolerance=ROUGHLY, search=replace(without_mounts.search, boxes=1)))
    if not alone.status.has_design:
        return [start]
    values = dict(zip((d.name for d in without_mounts.decisions), _decided(without_mounts, alone), strict=True))
    return [program.shares([values.get(d.name, d.start) for d in problem.decisions]), start]


def _decided(without_mounts: Problem, result: Result) -> list[Value]:
    """Values of decisions, read back from a result."""
    values = {entry.name: entry.value for entry in result.decisions}
    rotors = {r.name: r.unbalance for r in result.final.engine.rotors}
    unbalances = {r.name: r.unbalance for r in result.initial.engine.rotors}
    out: list[Value] = []
    for decision in without_mounts.decisions:
        if not decision.is_affine:
            out.append(values[decision.name])
            continue
        drive = decision.rotor_drives[0]
        moved = (rotors[drive.rotor] - unbalances[drive.rotor]) / drive.gain
        out.append(decision.start + (moved.conjugate() if drive.mirrored else moved))
    return out


def _bound(problem: Problem, design: Design) -> float:
    model = SizeModel(_on_given_mounts(problem))
    of_sizes = any(term.measure.channel.of_engine is not None or _sized(term.measure) for term in problem.objective)
    if model.moves_rod or of_sizes or design.violation > KEPT:
        return 0.0
    relaxed, near = with_masses(problem, model, design.values)
    room = gap_tolerance_of(design.value, problem.tolerance, numerical_zero(problem, design.evaluation.engine))
    return max(proven(Question(relaxed, design.value, room, near)).bound, mounts_bound(relaxed, near))


def with_masses(problem: Problem, model: SizeModel, values: Sequence[Value]) -> tuple[Problem, list[Value]]:
    """The problem with the masses of its sizes as decisions of their own; and what these are where sizes have values.

    Limits on what sizes make of loads, and on these themselves, are left out.
    """
    low, high = model.mass_box
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    at = dict(zip((d.name for d in problem.decisions), values, strict=True))
    masses = model.masses(np.array([at[d.name].real for d in model.sizes])) - middle
    engine = model.with_masses(middle)
    gear = engine.extra(RunningGear)
    ways = gear.throws if gear is not None else ()
    drives: list[tuple[Drive, ...]] = [
        *(tuple(NumberDrive(Kind.PISTON, (part.name, mass)) for part in engine.slider_cranks) for mass in MASSES),
        tuple(RotorDrive(name, way) for name, way in ways),
    ]
    moving = [k for k in range(len(half)) if half[k] > 0.0]
    of_masses = [Decision(f"mass {k}", "kg", Interval(-half[k], half[k]), 0.0, drives[k]) for k in moving]
    others = tuple(d for d in problem.decisions if d not in model.sizes)
    limits = tuple(x for x in problem.limits if x.measure.channel.of_engine is None and not _sized(x.measure))
    changed = replace(problem, engine=engine, decisions=(*of_masses, *others), limits=limits)
    return changed, [*(float(masses[k]) for k in moving), *(at[d.name] for d in others)]


def _sized(measure: Measure) -> bool:
    return measure.is_load and measure.load.of_sizes is not None
