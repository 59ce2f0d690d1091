"""Choose the lightest of equally good designs, with negligible decisions set to zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from laufruhe.load_models.affine import FEASIBLE, AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import MEAN, Grid
from laufruhe.problem.decision import Domain
from laufruhe.problem.problem import Problem
from laufruhe.solvers.cones.cone_program import project_on_sets
from laufruhe.solvers.cones.conic import solve_cones

SAME_LOAD = 1e-10
"""Relative change of a load that counts as none."""
NEGLIGIBLE = 1e-6
"""Relative load of a decision, or of a remaining sum of loads, that counts as zero."""


def break_ties(problem: Problem, affine: AffineProblem, x: Array) -> Array:
    """Return the lightest design with the same loads as the optimum x, shape (n,); negligible unbalances are zero."""
    directions = _free_directions(problem, affine)
    if directions.shape[1]:
        x = _minimise_mass(affine, x, directions)
    return _cancel_exactly(affine, drop_negligible(affine, x))


def _free_directions(problem: Problem, affine: AffineProblem) -> Array:
    """Return directions of unbalances that change no load of the problem, (n, m); m = 0 if a mass is minimised."""
    if not affine.size or any(term.measure.is_mass for term in problem.objective):
        return np.zeros((affine.size, 0))
    loads = [norm for _, norm in affine.terms]
    loads += [
        norm for limit, (_, norm) in zip(problem.load_limits, affine.limits, strict=True)
        if not limit.measure.is_mass
    ]  # fmt: skip
    # unit of each decision by its effect on loads, because bounds may differ by orders of magnitude
    sizes = np.sqrt(np.sum([np.sum(norm.slope**2, axis=(0, 1)) for norm in loads], axis=0))
    units = np.where(sizes > 0.0, 1.0 / np.where(sizes > 0.0, sizes, 1.0), affine.scales)
    # factor R of each norm's QR factorisation: the same null space in at most n rows
    triangles = [np.asarray(np.linalg.qr((norm.slope * units).reshape(-1, affine.size), mode="r")) for norm in loads]
    stacked = np.concatenate([triangle / (float(np.abs(triangle).max()) or 1.0) for triangle in triangles])
    _, values, rows = np.linalg.svd(stacked, full_matrices=True)
    small = np.ones(affine.size, dtype=bool)
    small[: len(values)] = values <= SAME_LOAD * values[0]
    free = rows[small].T * units[:, None]
    return np.asarray(free / np.abs(free).max(axis=0, initial=1e-300))


def _minimise_mass(affine: AffineProblem, x: Array, directions: Array) -> Array:
    """Return the lightest x + directions z within the sets and limits, for any z."""
    domains = affine.domains
    weights = [sum(abs(drive.gain) for drive in domain.decision.rotor_drives) for domain in domains]
    sizes = [float(np.hypot.reduce(x[domain.columns])) for domain in domains]
    total = sum(w * size for w, size in zip(weights, sizes, strict=True))
    if total == 0.0:
        return x
    # in a lighter design, no decision can exceed the total mass
    domains = tuple(
        replace(d, decision=replace(d.decision, set=d.set.within(total / w if w else size)))
        for d, w, size in zip(domains, weights, sizes, strict=True)
    )
    limits = tuple(
        (max(maximum, norm.value(x)), norm) for maximum, norm in affine.limits if is_moved_along(norm, directions)
    )
    terms = tuple((w, distance(d, np.zeros(d.width), affine.size)) for w, d in zip(weights, domains, strict=True) if w)
    scales = np.concatenate([np.full(d.width, d.scale) for d in domains])
    # equations fix the design in all directions orthogonal to the free ones
    base, values, _ = np.linalg.svd(directions / scales[:, None], full_matrices=True)
    normals = base[:, len(values) :].T / scales
    solution = solve_cones(AffineProblem(terms, limits, domains, affine.samples), (normals, normals @ x))
    if solution.x is None:
        return x
    steps, *_ = np.linalg.lstsq(directions / scales[:, None], (solution.x - x) / scales)
    return project_on_sets(affine, x + directions @ steps)


def is_moved_along(norm: AffineNorm, directions: Array) -> bool:
    """Return True if one of the directions, shape (n, m), changes a norm by more than rounding."""
    change = np.abs(np.einsum("kdn,nm->kdm", norm.slope, directions)).max(initial=0.0)
    return bool(change > SAME_LOAD * np.abs(norm.slope * np.abs(directions).max(axis=1)).max(initial=0.0))


def distance(domain: Domain, target: Array, columns: int) -> AffineNorm:
    """Return the distance of a decision from a target, shape (width,), as a norm of all `columns` columns."""
    slope = np.zeros((1, domain.width, columns))
    slope[0, :, domain.columns] = np.eye(domain.width)
    return AffineNorm(MEAN, -target[None], slope, Grid(np.ones(1), 1))


def drop_negligible(affine: AffineProblem, x: Array) -> Array:
    """Return x with those unbalances set to zero that have a negligible load, or do not lower the objective.

    The test compares loads and not bounds, which may be a million times too wide.
    """
    x = x.copy()
    zero = np.zeros_like(x)
    may_vanish = all(domain.set.lower <= 0.0 for domain in affine.domains)
    if may_vanish and affine.objective(zero) <= affine.objective(x) and _violates_no_more(affine, x, zero):
        return zero
    # loads of the decisions alone, without constants
    norms = [
        (replace(norm, constant=np.zeros_like(norm.constant)), max(norm.value(x), norm.value(zero)))
        for _, norm in affine.terms
    ]
    for domain in affine.domains:
        if domain.set.lower > 0.0 or not x[domain.columns].any():
            continue
        single, without = zero.copy(), x.copy()
        single[domain.columns] = x[domain.columns]
        without[domain.columns] = 0.0
        is_faint = all(norm.value(single) <= NEGLIGIBLE * size for norm, size in norms)
        if (is_faint or affine.objective(without) <= affine.objective(x)) and _violates_no_more(affine, x, without):
            x = without
    return x


def _cancel_exactly(affine: AffineProblem, x: Array) -> Array:
    # if the loads cancel, least squares reduce the solver's residual to rounding
    norms = [norm for _, norm in affine.terms]
    loads = sum(weight * replace(norm, constant=0.0 * norm.constant).value(x) for weight, norm in affine.terms)
    if not 0.0 < affine.objective(x) <= NEGLIGIBLE * loads:
        return x
    slope = np.concatenate([norm.slope.reshape(-1, affine.size) * affine.units for norm in norms])
    residual = np.concatenate([norm.rows(x).reshape(-1) for norm in norms])
    # decisions at zero stay zero
    exact = project_on_sets(affine, x - affine.units * np.linalg.lstsq(slope * (x != 0.0), residual)[0])
    is_better = affine.objective(exact) < affine.objective(x) and _violates_no_more(affine, x, exact)
    return exact if is_better else x


def _violates_no_more(affine: AffineProblem, x: Array, candidate: Array) -> bool:
    return all(
        norm.value(candidate) <= (1.0 + 0.1 * FEASIBLE) * max(maximum, norm.value(x)) for maximum, norm in affine.limits
    )
