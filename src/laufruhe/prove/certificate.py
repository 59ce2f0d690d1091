"""Lower bound, gap and certificate of a design, computed from the exact model (P4-P6).

The rows V of a load have a norm of at least <Z, V> for every Z in the unit ball of the dual norm. With multipliers
mu >= 0 on the limits, the sum of these inequalities is an affine lower bound of the objective. Its minimum over the
sets of the decisions has a closed form. Any Z and mu give a valid bound, so a solver only has to propose good ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.witness import check_bound, is_over


def relative_gap(value: float, bound: float, zero_level: float) -> float:
    """Return the relative gap (value - bound) / value, or 0 if the value is at most `zero_level` or the bound.

    A value that is zero, negative or infinite is returned as it is. All gaps of the package are computed here.
    """
    if not 0.0 < value < math.inf:
        return value
    return (value - bound) / value if value > max(bound, zero_level) else 0.0


def gap_of(value: float, bound: float, zero_level: float) -> float:
    """Return the relative gap that a search has to close, which is 0 for a difference of at most `zero_level`."""
    return 0.0 if 0.0 < value < math.inf and value - bound <= zero_level else relative_gap(value, bound, 0.0)


ROUNDING = 1e-12
"""Relative rounding error of a sum."""
# rounds of `flatten_interior`, and the relative gap from which a round pays
CORRECTIONS, WORTHWHILE_GAP = 2, 1e-7


def gap_tolerance_of(value: float, tolerance: float, zero_level: float) -> float:
    """Return the improvement on `value` that counts as none [SI], from the relative tolerance and the zero level."""
    return tolerance * value + zero_level


class Proof(StrEnum):
    """Degree of optimality proven of a design."""

    GLOBAL = "global"
    WITHIN_GAP = "global within gap"
    LOCAL = "local"
    NONE = "none"


PROOF_RANK = (Proof.NONE, Proof.LOCAL, Proof.WITHIN_GAP, Proof.GLOBAL).index
"""Sort key of a `Proof`, weakest first: several proofs together are as strong as the weakest."""


class ProofStrength(StrEnum):
    """Degree of optimality that the bound of a method can prove.

    Attributes
    ----------
    EXACT
        The bound reaches the optimum if the search runs long enough, so any gap is a proof within that gap.
    PARTIAL
        The bound need not reach the optimum. A gap of at most `SMALL_GAP` is a proof within that gap.
    RELAXED
        The bound is valid, but of a relaxation that is not refined; it proves the optimum or nothing.
    """

    EXACT = "reaches the optimum in enough time"
    PARTIAL = "may come near the optimum"
    RELAXED = "valid, not refined"


USELESS_GAP = 0.99
"""Relative gap from which a bound helps no user."""
SMALL_GAP = 0.05
"""Largest relative gap of an approximate bound that is called a proof within its gap."""


def make_certificate(
    value: float, bound: float, zero_level: float, tolerance: float, strength: ProofStrength, kkt_residual: float,
    method: str, value_error: float = 0.0,
) -> Certificate:  # fmt: skip
    """Return the certificate of a design from its objective and a lower bound.

    A bound above the objective is a contradiction: it is reported, and the certificate then claims nothing.

    Parameters
    ----------
    value
        Objective of a feasible design [SI].
    bound
        Lower bound over all feasible designs as computed [SI]; nothing may lower it to the value before.
    zero_level
        Difference that counts as zero [SI].
    tolerance
        Relative gap that counts as closed.
    strength
        Degree of optimality that the bound can prove.
    kkt_residual
        Largest relative violation of the optimality conditions.
    method
        Description of the method that computed the bound.
    value_error
        Largest error by which the objective may be too low [SI]: between samples, and by accepted violations of limits.
    """
    # a norm is never negative
    value, bound = float(value), max(float(bound), 0.0)
    if not check_bound(method, bound, value, zero_level + value_error):
        return unproven_certificate(value, kkt_residual, method)
    gap = relative_gap(value, bound, zero_level)
    if gap_of(value, bound, zero_level) <= tolerance:
        kind = Proof.GLOBAL
    elif strength is ProofStrength.EXACT or (strength is ProofStrength.PARTIAL and gap <= SMALL_GAP):
        kind = Proof.WITHIN_GAP
    else:
        kind = Proof.LOCAL
    return Certificate(kind, bound, gap, kkt_residual, method)


def unproven_certificate(value: float, kkt_residual: float, method: str) -> Certificate:
    """Return a certificate that claims nothing: no proof, and zero as the lower bound."""
    return Certificate(Proof.NONE, 0.0, relative_gap(value, 0.0, 0.0), kkt_residual, method)


@dataclass(frozen=True)
class Certificate:
    """Proven quality of a design: lower bound, gap and optimality residual.

    Attributes
    ----------
    kind
        Degree of optimality proven.
    lower_bound
        Lower bound of the objective over all feasible designs [SI].
    gap
        Objective less lower bound, over the objective; zero if the objective is a numerical zero.
    kkt_residual
        Largest violation of stationarity, feasibility and complementarity, each
        relative to its own scale.
    method
        Description of the method that computed the bound.
    """

    kind: Proof
    lower_bound: float
    gap: float
    kkt_residual: float
    method: str

    @property
    def is_useful(self) -> bool:
        """Return True if the optimum is proven, or the gap is below `USELESS_GAP`."""
        return self.kind is Proof.GLOBAL or self.gap < USELESS_GAP


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Dual rows of an affine problem, shape (k, d) each: Z of a term, and mu Z of a limit with its multiplier mu."""

    terms: tuple[Array, ...]
    limits: tuple[Array, ...]

    def shadow_prices(self, problem: AffineProblem) -> tuple[float, ...]:
        """Return the fall of the objective per unit by which each limit is relaxed (P5)."""
        return tuple(norm.dual_norm(z) for (_, norm), z in zip(problem.limits, self.limits, strict=True))


@dataclass(frozen=True, eq=False)
class Minorant:
    """Affine lower bound constant + gradient . x of the objective at feasible decision vectors x, by its dual rows."""

    constant: float
    gradient: Array
    multipliers: Multipliers


@dataclass(frozen=True, eq=False)
class Bound(Minorant):
    """Affine lower bound of the objective, and its minimum over the sets of the decisions [SI], at least zero."""

    value: float


def minorant(problem: AffineProblem, multipliers: Multipliers) -> Minorant:
    """Return the affine lower bound of the objective that multipliers give, valid for every feasible x (P4).

    The multipliers are any dual rows on the grid of the problem; those of terms are scaled into the dual unit ball.
    """
    norms = [norm for _, norm in (*problem.terms, *problem.limits)]
    gradient, constant = np.zeros(norms[0].slope.shape[-1] if norms else problem.size), 0.0
    terms = []
    for (weight, norm), proposal in zip(problem.terms, multipliers.terms, strict=True):
        # the best bound of a term that no decision changes is its value
        z = norm.dual_feasible(proposal) if is_moved(norm) else norm.subgradient(np.zeros(len(gradient)))
        terms.append(z)
        constant += weight * float(np.vdot(z, norm.constant))
        gradient += weight * norm.pullback(z)
    limits = [
        norm.norm.balanced_dual(norm.grid, z) for (_, norm), z in zip(problem.limits, multipliers.limits, strict=True)
    ]
    for (maximum, norm), z in zip(problem.limits, limits, strict=True):
        price = norm.dual_norm(z)
        constant += float(np.vdot(z, norm.constant)) - price * maximum
        gradient += norm.pullback(z)
    return Minorant(constant, gradient, Multipliers(tuple(terms), tuple(limits)))


def is_moved(norm: AffineNorm) -> bool:
    """Return True if any decision changes the rows of a load in a norm."""
    # the slope of the first row mostly decides, and saves a look at all rows
    return bool(norm.slope[:1].any() or norm.slope.any())


def lower_bound(problem: AffineProblem, multipliers: Multipliers) -> Bound:
    """Return a lower bound of the objective over all feasible designs, and its dual rows (P4).

    Any dual rows on the grid of samples of the problem give a valid bound; better ones give a higher bound.
    """
    affine = minorant(problem, multipliers)
    minimum = affine.constant + sum(domain.minimum(affine.gradient) for domain in problem.domains)
    # a sum of norms is never negative
    return Bound(affine.constant, affine.gradient, affine.multipliers, max(minimum, 0.0))


def excludes(problem: AffineProblem, limits: tuple[Array, ...]) -> bool:
    """Return True if dual rows prove that no design keeps all limits (P4).

    `limits` has the dual rows of every limit, shape (k, d) each.
    """
    proof = lower_bound(replace(problem, terms=()), Multipliers((), limits))
    sizes = [maximum + norm.value(np.zeros(problem.size)) for maximum, norm in problem.limits]
    scale = sum(price * size for price, size in zip(proof.multipliers.shadow_prices(problem), sizes, strict=True))
    return proof.value > ROUNDING * scale


def best_bound(problem: AffineProblem, x: Array, solution: Multipliers) -> Bound:
    """Return the best lower bound of the objective from a solution on the same or a coarser grid of samples (P6).

    Two proposals are compared. One interpolates the solver's dual rows between the coarse samples. The other takes the
    subgradient of every term at x, and the solver's dual row only where a row of the term vanishes.

    Parameters
    ----------
    problem
        Norms on the grid of samples on which the bound is to hold.
    x
        Decision vector of the solution, shape (n,).
    solution
        Dual rows of the solution, on the grid of the solution.
    """
    interpolated = interpolate_duals(problem, solution)
    pairs = zip(problem.terms, interpolated.terms, strict=True)
    aligned = tuple(norm.norm.aligned_dual(norm.grid, norm.rows(x), z) for (_, norm), z in pairs)
    proposals = (lower_bound(problem, rows) for rows in (interpolated, replace(interpolated, terms=aligned)))
    best, value = max(proposals, key=lambda bound: bound.value), problem.objective(x)
    for _ in range(CORRECTIONS):
        if value - best.value > WORTHWHILE_GAP * best.value:
            corrected = lower_bound(problem, flatten_interior(problem, x, best))
            best = max(best, corrected, key=lambda bound: bound.value)
    check_dual("dual rows", best.value, problem, x, best)
    return best


def check_dual(what: str, value: float, problem: AffineProblem, x: Array, bound: Bound) -> None:
    """Report an error if a lower bound exceeds the Lagrangian of its own dual rows at a decision vector (P4).

    The check needs no feasible design: violations of limits are priced.

    Parameters
    ----------
    what
        Name of the bound in messages.
    value
        Lower bound over all feasible designs that the dual rows are said to prove [SI].
    problem, bound
        Norms, and the dual rows on their grid.
    x
        Decision vector, inside the sets of the decisions except for rounding, shape (n,).
    """
    maximum = problem.objective(x)
    if not is_over(value, maximum):
        return
    prices = bound.multipliers.shadow_prices(problem)
    maximum += sum(price * (norm.value(x) - limit) for price, (limit, norm) in zip(prices, problem.limits, strict=True))
    projected = np.concatenate([np.zeros(0), *(domain.project(x) for domain in problem.domains)])
    sizes = [weight * _size(norm, x) for weight, norm in problem.terms]
    sizes += [price * (limit + _size(norm, x)) for price, (limit, norm) in zip(prices, problem.limits, strict=True)]
    check_bound(what, value, maximum, float(np.abs(bound.gradient) @ np.abs(projected - x)) + ROUNDING * sum(sizes))


def _size(norm: AffineNorm, x: Array) -> float:
    # norm of the rows with the absolute value of every summand, which scales their rounding errors
    return norm.norm.value(norm.grid, np.abs(norm.constant) + np.abs(norm.slope) @ np.abs(x))


def interpolate_duals(problem: AffineProblem, solution: Multipliers) -> Multipliers:
    """Return dual rows on the samples of a problem, interpolated from a solution with fewer samples (P6).

    Terms of the problem beyond those of the solution are left out.
    """
    return Multipliers(
        tuple(_interpolate(norm, z) for (_, norm), z in zip(problem.terms, solution.terms, strict=False)),
        tuple(_interpolate(norm, z) for (_, norm), z in zip(problem.limits, solution.limits, strict=True)),
    )


def flatten_interior(problem: AffineProblem, x: Array, bound: Bound) -> Multipliers:
    """Return corrected dual rows, so that the linear lower bound has no slope along decisions between their bounds.

    The dual rows of the objective terms change as little as possible.

    The interior directions are those in which no decision of x is on a bound. A slope along one of them, even a
    rounding error of the solver, costs slope times distance to the bound, which may be all of the lower bound.

    Parameters
    ----------
    problem, bound
        Norms on the grid of the dual rows; lower bound with the dual rows to correct, and with its gradient.
    x
        Decision vector, shape (n,).
    """
    columns = [np.zeros((problem.size, 0))]
    for domain in problem.domains:
        embedding = np.zeros((problem.size, domain.width))
        embedding[domain.columns] = np.eye(domain.width)
        columns.append(embedding @ domain.set.inside(x[domain.columns]))
    interior = np.concatenate(columns, axis=1)
    slopes = [norm.slope @ interior for _, norm in problem.terms]
    weighted = [
        norm.grid.weights[:, None, None] * slope for (_, norm), slope in zip(problem.terms, slopes, strict=True)
    ]
    parts = zip(problem.terms, slopes, weighted, strict=True)
    gram = sum(weight * np.einsum("kdm,kdn->mn", slope, rows) for (weight, _), slope, rows in parts)
    if not interior.size or not np.any(gram):
        return bound.multipliers
    sizes = np.sqrt(np.where(np.diag(gram) > 0.0, np.diag(gram), 1.0))
    steps = np.linalg.lstsq(gram / np.outer(sizes, sizes), -(bound.gradient @ interior) / sizes)[0] / sizes
    terms = zip(bound.multipliers.terms, weighted, strict=True)
    return replace(bound.multipliers, terms=tuple(z + rows @ steps for z, rows in terms))


def _interpolate(fine: AffineNorm, z: Array) -> Array:
    """Return dual rows of a norm, shape (k, d), interpolated from fewer samples; dual rows of masses stay unchanged."""
    signals, kinks = len(fine.grid.weights) // fine.grid.steps, fine.grid.kinks
    factor, remainder = divmod(len(fine.grid.weights) - signals * kinks, max(len(z) - signals * kinks, 1))
    if remainder:
        # rows of a grid that this one does not refine
        return np.zeros_like(fine.constant)
    if factor <= 1:
        return z
    # rows at kinks of the signals stay
    by_signal = z.reshape(signals, -1, z.shape[-1])
    coarse, at_kinks = by_signal[:, : by_signal.shape[1] - kinks], by_signal[:, by_signal.shape[1] - kinks :]
    rows = fine.norm.refined_dual(coarse.reshape(-1, z.shape[-1]), coarse.shape[1], factor).reshape(
        signals, -1, z.shape[-1]
    )
    return np.concatenate([rows, at_kinks], axis=1).reshape(-1, z.shape[-1])


def kkt_residual(problem: AffineProblem, x: Array, bound: Bound, scale: float | None = None) -> float:
    """Return the largest violation of the optimality conditions, each relative to its own scale (P5).

    Parameters
    ----------
    problem, bound
        Norms, and the dual rows on their grid.
    x
        Decision vector, shape (n,).
    scale
        Objective to which violations are relative [SI], given where the objective itself may be zero, as of a
        perfectly balanced engine; the objective at x if None.
    """
    scales = problem.scales
    violations = [0.0]
    # sum of the absolute parts of the gradient
    gradient_size = np.zeros(problem.size)
    for (weight, norm), z in zip(problem.terms, bound.multipliers.terms, strict=True):
        gradient_size += weight * np.einsum("kd,kdn->n", np.abs(z), np.abs(norm.slope))
    gradient_scale = float(np.abs(gradient_size * scales).max(initial=0.0)) or 1.0
    for domain in problem.domains:
        columns = domain.columns
        # a step against the gradient, projected back, must not move: P_D(x - g) = x
        step = bound.gradient[columns] * scales[columns] ** 2 / gradient_scale
        moved = x.copy()
        moved[columns] = x[columns] - step
        violations.append(float(np.abs((domain.project(moved) - x[columns]) / scales[columns]).max(initial=0.0)))
    prices = bound.multipliers.shadow_prices(problem)
    scale = scale or problem.objective(x) or 1.0
    for (weight, norm), z in zip(problem.terms, bound.multipliers.terms, strict=True):
        # at an optimum the dual row points along its row: <Z, V> = norm(V)
        violations.append(weight * (norm.value(x) - float(np.vdot(z, norm.rows(x)))) / scale)
    for (maximum, norm), price in zip(problem.limits, prices, strict=True):
        value = norm.value(x)
        violations.append(max(0.0, value - maximum) / (maximum or 1.0))
        violations.append(price * abs(maximum - value) / scale)
    return max(violations)
