"""The result of one star as that of all of them, or that there is none."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

from laufruhe.machine import Engine
from laufruhe.machine.layouts import Layout
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import Certificate, Proof
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.ranking import PhasingResult
from laufruhe.solvers.values import DecisionValue, ObjectiveValue


def with_star(
    problem: Problem, phasing: Phasing, best: Result, candidate: Candidate, certificate: Certificate | None,
    details: PhasingResult,
) -> Result:  # fmt: skip
    """The result of one star as that of all of them.

    Parameters
    ----------
    problem
        As given, its phasing open.
    best
        Of the star, nothing of the phasing open.
    """
    given = evaluate(problem)
    proven = certificate is not None and certificate.kind is Proof.GLOBAL
    status = best.status
    if status.has_design:
        status = Status.OPTIMAL if proven else Status.FEASIBLE
    initial = replace(given, samples=best.final.samples)
    value = best.objective.value if best.objective else objective_value(problem, best.final)
    return replace(
        best,
        problem=replace(best.problem, phasing=phasing),
        status=status,
        objective=ObjectiveValue.of(problem, value, objective_value(problem, initial)),
        certificate=certificate,
        decisions=(*phase_decisions(problem, phasing, candidate), *best.decisions),
        initial=initial,
        phasing=details,
    )


def phase_decisions(problem: Problem, phasing: Phasing, candidate: Candidate) -> tuple[DecisionValue, ...]:
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
    bank, split = _geometry_given(problem.engine, phasing.layout_of(candidate))
    for name, bounds, value, given_angle in (
        ("bank angle", phasing.bank, candidate.bank_angle, bank),
        ("split pin angle", phasing.split, candidate.split_pin, split),
    ):
        if bounds is not None and value is not None and bounds[0] < bounds[1]:
            edge = min(value - bounds[0], bounds[1] - value) <= 1e-9
            out.append(DecisionValue(name, value, "rad", *bounds, given_angle, edge))
    optional = (name for names in phasing.shafts.optional for name in names)
    out += [
        DecisionValue(f"{name} built", float(name not in candidate.left_out), "", 0.0, 1.0, 1.0, False)
        for name in optional
    ]
    return tuple(out)


def _geometry_given(engine: Engine, layout: Layout) -> tuple[float, float]:
    """Angle between the banks, and between split pins, as an engine has them [rad]; zero where it has none."""
    parts, bank, split = engine.slider_cranks, 0.0, 0.0
    for left, right in itertools.permutations(range(len(layout.sides)), 2):
        if layout.side(left) > layout.side(right):
            bank = (parts[left].bank - parts[right].bank) % math.tau
            if layout.pins[left] == layout.pins[right]:
                split = math.remainder(parts[right].throw - parts[left].throw, math.tau)
    return bank, split


def no_star(problem: Problem, why: str, status: Status = Status.INFEASIBLE, conflict: tuple[str, ...] = ()) -> Result:
    """No star, and why."""
    given = evaluate(problem)
    return Result(problem=problem, status=status, initial=given, final=given, message=why, conflict=conflict)
