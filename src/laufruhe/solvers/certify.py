"""Prove how good a design is that someone else found (P4).

The exact model evaluates the design. Its lower bound comes from multipliers that are given, or from a solve. Any
multipliers give a valid bound, so neither the design nor the multipliers are trusted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from laufruhe.errors import Complaint, InputError, refused, wrong_call
from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem
from laufruhe.load_models.labelled_rows import affine_problem_of, part_names
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.witness import collected
from laufruhe.problem.decision import decision_vector
from laufruhe.problem.evaluation import FINE_SAMPLES, evaluate, fine_samples
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import Multipliers, Proof, ProofStrength, best_bound, gap_of, kkt_residual, relative_gap
from laufruhe.solvers.accuracy import solve_accurately
from laufruhe.solvers.conclusion import (
    Design,
    ProofData,
    evaluate_design,
    result_of,
    violated_limits,
    without_proof,
)
from laufruhe.solvers.cones.conic import refine_multipliers
from laufruhe.solvers.many import columns_of, numbers_of, values_of_columns
from laufruhe.solvers.methods import solve
from laufruhe.solvers.prices import affine_prices
from laufruhe.solvers.result import Result, Status

REFINEMENTS = (2, 8)
"""Factors of the samples of given multipliers at which the bound is taken until the gap closes (P6)."""


def certify(problem: Problem, values: Mapping[str, Any], multipliers: Mapping[str, Any] | None = None) -> Result:
    """Return a design of given values with its proof (`laufruhe.certify`)."""
    if problem.ranks:
        rule = f"has {len(problem.ranks)} objectives in order of priority, and a bound refers to one"
        raise wrong_call("problem", problem.name, rule, "state one with problem.changed(ranks=())")
    if problem.phasing is not None or problem.extras:
        names = [*(problem.phasing.open_names if problem.phasing else ()), *(extra.words for extra in problem.extras)]
        rule = f"has {' and '.join(names)}, which values of open numbers do not state"
        raise wrong_call("problem", problem.name, rule, "fix or remove it")
    decided = _values(problem, values)
    listed: object = multipliers
    if multipliers is not None and not isinstance(listed, Mapping):
        rule = "are no table of names and multipliers"
        raise wrong_call("multipliers", multipliers, rule, "take to_cvxpy().multipliers")
    message = ""
    with collected() as reports:
        if multipliers is None:
            # refuse a design that breaks a limit before the solve
            _exact_design(problem, decided)
            reference = solve(problem)
            # the solve may take more samples of the gas
            design = _exact_design(problem.at(reference.problem.fidelity), decided, reference.final.samples)
            result = result_of(design, _initial_design(design.problem), _proof_of(reference, design), {})
            if reference.status is Status.INFEASIBLE:
                message = "the solve excludes every design, which this design contradicts; please report it"
        else:
            result = solve_accurately(problem, partial(_with_multipliers, decided, multipliers))
    result = replace(result, problem=replace(result.problem, origin=problem.origin))
    if reports:
        return without_proof(result, reports[0])
    certificate = result.certificate
    assert certificate is not None
    if certificate.kind is Proof.LOCAL or message:
        # nothing shows that a design which someone else found is a local optimum
        certificate = replace(certificate, kind=Proof.NONE)
    return replace(result, certificate=certificate, message=message)


def _with_multipliers(values: list[Value], multipliers: Mapping[str, Any], problem: Problem) -> Result:
    design = _exact_design(problem, values)
    return result_of(design, _initial_design(problem), _bounded(design, multipliers), {})


def _initial_design(problem: Problem) -> Design:
    return Design.of(problem, problem.start, evaluate(problem))


def _values(problem: Problem, values: Mapping[str, Any]) -> list[Value]:
    """Return the value of every decision, from sizes and angles by name; a number that is missing has its start."""
    if not isinstance(values, Mapping):
        raise wrong_call("values", values, "is no table of names and values", 'write {"left.unbalance": 0.01}')
    columns, _ = columns_of(problem, [dict(values)])
    row, inside = values_of_columns(problem.decisions, columns, 1)
    for k, decision in enumerate(problem.decisions):
        if not inside[0, k]:
            size, angle = decision.set.split(row[0, k])
            span, text = f"{decision.lower:.6g} to {decision.upper:.6g} {decision.unit}".rstrip(), f"{size:.6g}"
            if decision.set.width > 1:
                low, high = map(math.degrees, decision.set.angles)
                span, text = f"{span} at {low:.6g} to {high:.6g} deg", f"{text} at {math.degrees(angle):.6g} deg"
            raise refused(f"values, {decision.name}", text, f"lies outside of {span}", "give a value inside")
    return numbers_of(problem.decisions, row[0])


def _exact_design(problem: Problem, values: list[Value], samples: int = FINE_SAMPLES) -> Design:
    """Return a design, evaluated at so many samples over the cycle, at least `FINE_SAMPLES`.

    Raises
    ------
    InputError
        With every limit that the design violates.
    """
    design = evaluate_design(problem, values, max(samples, fine_samples(problem.fidelity.samples)))
    evaluation, complaints = design.evaluation, []
    broken = violated_limits(problem.limits, evaluation)
    for limit in (limit for limit in problem.limits if limit.name in broken):
        check = evaluation.check_limit(limit)
        unit = limit.measure.unit
        value, edge = f"{check.value:.6g} {unit}".rstrip(), f"{check.edge:.6g} {unit}".rstrip()
        rule = f"is {value}, and has to be {check.side} {edge}"
        complaints.append(Complaint(f"limit '{limit.name}'", "", rule, "give a design that keeps it"))
    if complaints:
        raise InputError("values", tuple(complaints))
    return design


def _proof_of(reference: Result, design: Design) -> ProofData:
    # the lower bound of a solve holds for every design
    certificate = reference.certificate
    bound, method, is_exact = 0.0 if reference.problem.decisions else design.value, "evaluation", True
    if certificate is not None:
        bound, method = certificate.lower_bound, f"bound of a solve: {certificate.method}"
        is_exact = certificate.kind in (Proof.GLOBAL, Proof.WITHIN_GAP)
    strength = ProofStrength.EXACT if is_exact else ProofStrength.RELAXED
    # without multipliers, the gap and the violation stand for the residual
    gap = relative_gap(design.value, bound, numerical_zero(design.problem, design.evaluation.engine))
    return ProofData(bound, strength, max(design.violation, gap, 0.0), method, reference.prices)


def _bounded(design: Design, multipliers: Mapping[str, Any]) -> ProofData:
    """Return the lower bound from given multipliers (P4, P6)."""
    problem = affine_problem_of(design.problem)
    model = AffineModel(problem, keep_all=True)
    x = decision_vector(model.domains, design.values)
    terms, limits = part_names(problem)
    names = [
        *terms,
        *(name for name, limit in zip(limits, problem.limits, strict=True) if limit in problem.load_limits),
    ]
    samples = _samples(model, names, multipliers)
    coarse = model.at(samples)
    rows = _dual_rows(coarse, names, multipliers, x)
    zero_level, times = numerical_zero(problem), REFINEMENTS[0]
    for times in REFINEMENTS:
        relaxed = model.at(times * samples, averaged=True)
        bound = best_bound(relaxed, x, refine_multipliers(coarse, relaxed, rows))
        if gap_of(relaxed.objective(x), bound.value, zero_level) <= problem.tolerance:
            break
    residual = kkt_residual(relaxed, x, bound, max(design.value, zero_level))
    prices, bounds = affine_prices(relaxed, problem.load_limits, x, bound)
    method = f"given multipliers, dual bound at {times * samples}"
    return ProofData(bound.value, ProofStrength.EXACT, residual, method, prices, bounds)


def _samples(model: AffineModel, names: list[str], multipliers: Mapping[str, Any]) -> int:
    """Return the samples per period at which dual rows of loads are given; by default those of the problem."""
    usual = model.at(model.full_samples)
    for name, (_, norm) in zip(names, (*usual.terms, *usual.limits), strict=True):
        grid, z = norm.grid, multipliers.get(name)
        signals = len(grid.weights) // grid.steps
        if z is not None and np.ndim(z) == 2 and grid.steps > 1:
            samples = len(z) / signals - grid.kinks
            if samples == int(samples) > 0:
                return int(samples)
    return model.full_samples


def _dual_rows(affine: AffineProblem, names: list[str], multipliers: Mapping[str, Any], x: Array) -> Multipliers:
    """Return dual rows of terms and limits: as given, or along the load rows at x for a number or nothing."""
    if not set(multipliers) <= set(names):
        rule = "must be a mapping of names of terms and limits to multipliers"
        raise wrong_call("multipliers", multipliers, rule, f"the names are {', '.join(names)}")

    def rows(name: str, norm: AffineNorm, default: float) -> Array:
        entry = multipliers.get(name, default)
        try:
            z = np.nan_to_num(np.asarray(entry, dtype=float), posinf=0.0, neginf=0.0)
        except (TypeError, ValueError):
            raise wrong_call(f"multipliers, {name}", entry, "is no number and no array", "give one") from None
        if z.ndim == 0:
            return np.asarray(max(float(z), 0.0) * norm.subgradient(x))
        if z.shape != norm.constant.shape:
            k, d = norm.constant.shape
            rule = f"has the shape {z.shape}, not ({k}, {d}) as its load rows"
            raise refused(f"multipliers, {name}", "", rule, "take those of problem.to_cvxpy(), or give one number")
        return np.asarray(z)

    count = len(affine.terms)
    norms = [norm for _, norm in (*affine.terms, *affine.limits)]
    duals = [rows(name, norm, float(k < count)) for k, (name, norm) in enumerate(zip(names, norms, strict=True))]
    return Multipliers(tuple(duals[:count]), tuple(duals[count:]))
