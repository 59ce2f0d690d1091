"""Proof of how good a design is, computed from the exact model alone (P4-P6).

A norm is at least <Z, V> for every Z in the unit ball of its dual norm. With multipliers
mu >= 0 on the limits the sum of such inequalities bounds the objective from below by an
affine function of the decisions, whose least value over their sets is known in closed
form. Any Z and mu give a valid bound; the solver only proposes good ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.witness import check_bound, is_over


def gap_of(value: float, bound: float, zero_level: float) -> float:
    """Share of a value by which a bound lies under it, what counts as zero left out.

    Gaps are counted here and nowhere else.
    """
    if not 0.0 < value < math.inf:
        return value
    return (value - bound) / value if value - bound > zero_level else 0.0


ROUNDING = 1e-12
# rounds of levelling, and the share of a bound from which it is worth one
LEVELLINGS, LEVEL = 2, 1e-6


def room_of(value: float, tolerance: float, zero_level: float) -> float:
    """Return the improvement on `value` that still counts as a gap within the tolerance."""
    return tolerance * value + zero_level


class Proof(StrEnum):
    """Degree of optimality proven of a design."""

    GLOBAL = "global"
    WITHIN_GAP = "global within gap"
    LOCAL = "local"
    NONE = "none"


STRENGTH = (Proof.NONE, Proof.LOCAL, Proof.WITHIN_GAP, Proof.GLOBAL).index
"""Of a proof: of several together the weakest counts."""


class ProofStrength(StrEnum):
    """Degree of optimality that the bound of a method can prove."""

    WHOLE = "closes on the optimum, however long that takes"
    NEAR = "closes where it comes near"
    ASIDE = "holds, and is not made to meet the design"


USELESS = 0.99
"""Gap from which a bound says nothing that a user can act on."""
NEAR = 0.05
"""Gap at which a bound that need not close is called a proof within its gap."""


def certified(
    value: float, bound: float, zero_level: float, tolerance: float, reach: ProofStrength, kkt_residual: float,
    method: str, doubt: float = 0.0,
) -> Certificate:  # fmt: skip
    """Return the certificate of a design; a bound that contradicts its value is reported, and proves nothing.

    Parameters
    ----------
    value
        Objective of a design that keeps all limits.
    bound
        What no design goes under, raw: it is never brought to the value.
    zero_level
        Difference that counts as zero.
    doubt
        By how much the value may be read too low: between samples, and where limits are exceeded by a rounding.
    """
    # no norm lies under zero
    value, bound = float(value), max(float(bound), 0.0)
    if not check_bound(method, bound, value, zero_level + doubt):
        return unproven_certificate(value, kkt_residual, method)
    gap = gap_of(value, bound, zero_level)
    if gap <= tolerance:
        kind = Proof.GLOBAL
    elif reach is ProofStrength.WHOLE or (reach is ProofStrength.NEAR and gap <= NEAR):
        kind = Proof.WITHIN_GAP
    else:
        kind = Proof.LOCAL
    return Certificate(kind, bound, gap, kkt_residual, method)


def unproven_certificate(value: float, kkt_residual: float, method: str) -> Certificate:
    """Return the certificate of a design of which nothing is claimed."""
    return Certificate(Proof.NONE, 0.0, gap_of(value, 0.0, 0.0), kkt_residual, method)


@dataclass(frozen=True)
class Certificate:
    """Proven quality of a design: lower bound, gap and optimality residual.

    Attributes
    ----------
    kind
        What was proven.
    lower_bound
        No design allowed has a smaller objective [SI].
    gap
        Objective less lower bound, over the objective; what loads that cancel leave as a rounding counts as zero.
    kkt_residual
        Largest violation of stationarity, feasibility and complementarity, each
        relative to its own scale.
    method
        How the bound was found.
    """

    kind: Proof
    lower_bound: float
    gap: float
    kkt_residual: float
    method: str

    @property
    def is_useful(self) -> bool:
        """Tell if the bound is more than a hundredth of the value, or closes."""
        return self.kind is Proof.GLOBAL or self.gap < USELESS


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Dual rows: Z of every term, and mu Z of every limit, shapes (k, d)."""

    terms: tuple[Array, ...]
    limits: tuple[Array, ...]

    def shadow_prices(self, problem: AffineProblem) -> tuple[float, ...]:
        """Fall of the objective per unit by which a limit is relaxed (P5)."""
        return tuple(norm.dual_norm(z) for (_, norm), z in zip(problem.limits, self.limits, strict=True))


@dataclass(frozen=True, eq=False)
class Bound:
    """An affine lower bound of the objective, constant + gradient . x, for every x allowed."""

    value: float
    gradient: Array
    multipliers: Multipliers


@dataclass(frozen=True, eq=False)
class Minorant:
    """An affine function of the decision vector that the objective of no allowed design lies under.

    Attributes
    ----------
    constant, gradient
        Of it.
    multipliers
        That it is made of.
    """

    constant: float
    gradient: Array
    multipliers: Multipliers


def minorant(problem: AffineProblem, multipliers: Multipliers) -> Minorant:
    """Return the affine lower bound by these multipliers, valid for every decision vector in any set (P4).

    Parameters
    ----------
    problem
        Rows on the grid on which it is to hold.
    multipliers
        Any dual rows on that grid; terms are scaled into the dual unit ball.
    """
    norms = [norm for _, norm in (*problem.terms, *problem.limits)]
    gradient, constant = np.zeros(norms[0].slope.shape[-1] if norms else problem.size), 0.0
    terms = []
    for (weight, norm), given in zip(problem.terms, multipliers.terms, strict=True):
        # a term that nothing open acts on is its own bound
        z = norm.dual_feasible(given) if is_moved(norm) else norm.subgradient(np.zeros(len(gradient)))
        terms.append(z)
        constant += weight * float(np.vdot(z, norm.constant))
        gradient += weight * norm.pulled(z)
    held = [norm.norm.balanced(norm.grid, z) for (_, norm), z in zip(problem.limits, multipliers.limits, strict=True)]
    for (maximum, norm), z in zip(problem.limits, held, strict=True):
        price = norm.dual_norm(z)
        constant += float(np.vdot(z, norm.constant)) - price * maximum
        gradient += norm.pulled(z)
    return Minorant(constant, gradient, Multipliers(tuple(terms), tuple(held)))


def is_moved(norm: AffineNorm) -> bool:
    """Return True if any decision changes a norm; the first row is tested first."""
    return bool(norm.slope[:1].any() or norm.slope.any())


def lower_bound(problem: AffineProblem, multipliers: Multipliers) -> Bound:
    """Least objective that these multipliers leave possible (P4).

    Parameters
    ----------
    problem
        Rows on the grid on which the bound is to hold.
    multipliers
        Any dual rows on that grid; terms are scaled into the dual unit ball.
    """
    under = minorant(problem, multipliers)
    minimum = under.constant + sum(domain.minimum(under.gradient) for domain in problem.domains)
    # every term is a norm, so nothing lies under zero
    return Bound(max(minimum, 0.0), under.gradient, under.multipliers)


def excludes(problem: AffineProblem, limits: tuple[Array, ...]) -> bool:
    """Return True if these dual rows of the limits prove that no design keeps all limits (P4)."""
    proof = lower_bound(replace(problem, terms=()), Multipliers((), limits))
    sizes = [maximum + norm.value(np.zeros(problem.size)) for maximum, norm in problem.limits]
    whole = sum(price * size for price, size in zip(proof.multipliers.shadow_prices(problem), sizes, strict=True))
    return proof.value > ROUNDING * whole


def best_bound(fine: AffineProblem, x: Array, found: Multipliers) -> Bound:
    """The best of the bounds that a solution on a coarser grid suggests (P6).

    One takes the solver's dual rows between the coarse angles; one takes the direction
    of every row of the design itself, and the solver's only where a row vanishes.
    """
    own = spread(fine, found)
    direct = Multipliers(
        tuple(
            norm.norm.aligned(norm.grid, norm.rows(x), z) for (_, norm), z in zip(fine.terms, own.terms, strict=True)
        ),
        own.limits,
    )
    best, value = max((lower_bound(fine, m) for m in (own, direct)), key=lambda bound: bound.value), fine.objective(x)
    for _ in range(LEVELLINGS):
        if value - best.value > LEVEL * best.value:
            best = max(best, lower_bound(fine, levelled(fine, x, best)), key=lambda bound: bound.value)
    check_dual("dual rows", best.value, fine, x, best)
    return best


def check_dual(what: str, value: float, problem: AffineProblem, x: Array, bound: Bound) -> None:
    """Report a value of dual rows over what they say of a decision vector, whatever limits that keeps (P4).

    Parameters
    ----------
    value
        What the rows of a bound are said to prove of every design [SI].
    x
        Decision vector, in its sets but for a rounding.
    """
    maximum = problem.objective(x)
    if not is_over(value, maximum):
        return
    prices = bound.multipliers.shadow_prices(problem)
    maximum += sum(price * (norm.value(x) - edge) for price, (edge, norm) in zip(prices, problem.limits, strict=True))
    inside = np.concatenate([np.zeros(0), *(domain.project(x) for domain in problem.domains)])
    sizes = [weight * _size(norm, x) for weight, norm in problem.terms]
    sizes += [price * (edge + _size(norm, x)) for price, (edge, norm) in zip(prices, problem.limits, strict=True)]
    check_bound(what, value, maximum, float(np.abs(bound.gradient) @ np.abs(inside - x)) + ROUNDING * sum(sizes))


def _size(norm: AffineNorm, x: Array) -> float:
    # norm of rows of which no parts cancel
    return norm.norm.value(norm.grid, np.abs(norm.constant) + np.abs(norm.slope) @ np.abs(x))


def spread(fine: AffineProblem, found: Multipliers) -> Multipliers:
    """Dual rows of a solution on a coarser grid between its angles (P6); terms that it has none of are left out."""
    return Multipliers(
        tuple(_spread(norm, z) for (_, norm), z in zip(fine.terms, found.terms, strict=False)),
        tuple(_spread(norm, z) for (_, norm), z in zip(fine.limits, found.limits, strict=True)),
    )


def levelled(problem: AffineProblem, x: Array, bound: Bound) -> Multipliers:
    """Dual rows of the terms, changed by as little as makes the bound level along what is inside its set.

    A slope that is a rounding of the solver, times a bound far from what is needed, would else be all that is left.
    """
    inside = _inside(problem, x)
    slopes = [norm.slope @ inside for _, norm in problem.terms]
    weighed = [norm.grid.weights[:, None, None] * slope for (_, norm), slope in zip(problem.terms, slopes, strict=True)]
    parts = zip(problem.terms, slopes, weighed, strict=True)
    pull = sum(weight * np.einsum("kdm,kdn->mn", slope, by) for (weight, _), slope, by in parts)
    if not inside.size or not np.any(pull):
        return bound.multipliers
    sizes = np.sqrt(np.where(np.diag(pull) > 0.0, np.diag(pull), 1.0))
    steps = np.linalg.lstsq(pull / np.outer(sizes, sizes), -(bound.gradient @ inside) / sizes)[0] / sizes
    terms = zip(bound.multipliers.terms, weighed, strict=True)
    return replace(bound.multipliers, terms=tuple(z + by @ steps for z, by in terms))


def _inside(problem: AffineProblem, x: Array) -> Array:
    # directions in which every decision is inside its set, shape (n, m)
    columns = [np.zeros((problem.size, 0))]
    for domain in problem.domains:
        own = np.zeros((problem.size, domain.width))
        own[domain.columns] = np.eye(domain.width)
        columns.append(own @ domain.set.inside(x[domain.columns]))
    return np.concatenate(columns, axis=1)


def _spread(fine: AffineNorm, z: Array) -> Array:
    """Dual rows of a coarser grid on a finer one; masses have no angles and stay."""
    signals, bends = len(fine.grid.weights) // fine.grid.steps, fine.grid.bends
    times, rest = divmod(len(fine.grid.weights) - signals * bends, max(len(z) - signals * bends, 1))
    if rest:
        # rows of another basis say nothing here
        return np.zeros_like(fine.constant)
    if times <= 1:
        return z
    # rows where the signals bend stay
    own = z.reshape(signals, -1, z.shape[-1])
    steps, kept = own[:, : own.shape[1] - bends], own[:, own.shape[1] - bends :]
    spread = fine.norm.spread(steps.reshape(-1, z.shape[-1]), steps.shape[1], times).reshape(signals, -1, z.shape[-1])
    return np.concatenate([spread, kept], axis=1).reshape(-1, z.shape[-1])


def kkt_residual(problem: AffineProblem, x: Array, bound: Bound, whole: float | None = None) -> float:
    """Largest violation of the optimality conditions, each relative to its own scale (P5).

    Parameters
    ----------
    whole
        What parts of the objective are relative to; the objective itself when left out,
        which a perfectly balanced engine does not have.
    """
    scales = problem.scales
    steps = [0.0]
    reach = float(np.abs(_gradient_size(problem, bound) * scales).max(initial=0.0)) or 1.0
    for domain in problem.domains:
        part = domain.columns
        # a step against the gradient, projected back, must not move: P_D(x - g) = x
        step = bound.gradient[part] * scales[part] ** 2 / reach
        moved = x.copy()
        moved[part] = x[part] - step
        steps.append(float(np.abs((domain.project(moved) - x[part]) / scales[part]).max(initial=0.0)))
    prices = bound.multipliers.shadow_prices(problem)
    whole = whole or problem.objective(x) or 1.0
    for (weight, norm), z in zip(problem.terms, bound.multipliers.terms, strict=True):
        # the dual row of an optimum points along its row: <Z, V> = norm(V)
        steps.append(weight * (norm.value(x) - float(np.vdot(z, norm.rows(x)))) / whole)
    for (maximum, norm), price in zip(problem.limits, prices, strict=True):
        value = norm.value(x)
        steps.append(max(0.0, value - maximum) / (maximum or 1.0))
        steps.append(price * abs(maximum - value) / whole)
    return max(steps)


def _gradient_size(problem: AffineProblem, bound: Bound) -> Array:
    # sum of the sizes of what adds up to the gradient, shape (n,)
    total = np.zeros(problem.size)
    for (weight, norm), z in zip(problem.terms, bound.multipliers.terms, strict=True):
        total += weight * np.einsum("kd,kdn->n", np.abs(z), np.abs(norm.slope))
    return total
