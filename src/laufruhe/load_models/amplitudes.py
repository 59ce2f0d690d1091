"""Objectives that depend only on the amplitudes of a crank star's forces and couples by order (S3)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Engine, Role, SliderCrank
from laufruhe.machine.firing import even_patterns
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.arrays import Array
from laufruhe.physics.crank_stars import Stars, StarSpace, star_sums
from laufruhe.physics.order_coefficients import orders_needed
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.problem.channels import ROCKING_COUPLE, SHAKING_FORCE, SURGING_FORCE, SWAYING_COUPLE, Channel
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Term
from laufruhe.problem.problem import Phasing, Problem

# relative factor of an order that counts as zero
NEGLIGIBLE = 1e-13
# largest number of directions of dual vectors
DIRECTIONS = 400
_LEVERS: dict[Channel, int] = {SHAKING_FORCE: 0, SURGING_FORCE: 0, ROCKING_COUPLE: 1, SWAYING_COUPLE: 1}
"""Power of the throw position by which each load grows."""


@dataclass(frozen=True)
class AmplitudeTerm:
    """Term of the objective: w sqrt(sum_h (f_h |F_h|)^2 + (c_h |C_h|)^2) over the orders h (S3).

    F_h is the sum of e^{i h theta} over the throws, C_h the same sum weighted by throw positions.

    Attributes
    ----------
    weight
        Weight w.
    force, couple
        Factors f_h and c_h of every order.
    """

    weight: float
    force: tuple[float, ...]
    couple: tuple[float, ...]


@dataclass(frozen=True)
class AmplitudeObjective:
    """Sum of norms of the forces and couples of a crank star by order (S3)."""

    orders: tuple[int, ...]
    terms: tuple[AmplitudeTerm, ...]

    def values(self, space: StarSpace, stars: Stars, maximum: float = math.inf) -> Array:  # noqa: ARG002
        """Return the objective of many stars, shape (n,).

        Parameters
        ----------
        space
            Steps and positions of the throws.
        stars
            Step of every throw, shape (n, throws).
        maximum
            Value above which other objectives of this interface may return any number above `maximum`; unused here.
        """
        return self._values_of_sums(star_sums(stars, space.phases, space.places, self.orders))

    def values_at_angles(self, places: Sequence[float], throws: Array) -> Array:
        """Return the objective of many cranks, shape (n,), from positions [m] and angles [rad], shape (n, throws)."""
        weights = np.stack([np.ones(len(places)), places], axis=-1)
        waves = np.exp(1j * throws[:, None, :] * np.array(self.orders)[:, None])
        return self._values_of_sums(waves @ weights)

    def _values_of_sums(self, sums: NDArray[np.complex128]) -> Array:
        squares = np.square(sums.real) + np.square(sums.imag)
        values = np.zeros(len(sums))
        for term in self.terms:
            factors = np.stack([np.square(term.force), np.square(term.couple)], axis=-1)
            values += term.weight * np.sqrt(np.einsum("nhc,hc->n", squares, factors))
        return values


def amplitude_objective(problem: Problem, phasing: Phasing, layout: Layout) -> AmplitudeObjective | None:
    """Return the objective as norms of the amplitudes |F_h| and |C_h|, or None if it depends on anything else.

    Amplitudes suffice if all of the following hold. Equal throws cause all forces and couples, and only the star is
    open. Limits have the same value for all even stars. Every term is a root mean square, or has a single order, so
    that no phase between orders matters.

    Parameters
    ----------
    problem
        Problem of one of the stars.
    phasing
        Open crank star.
    layout
        Positions of the cylinders.
    """
    engine = problem.engine
    if problem.decisions or phasing.shafts.optional or not problem.objective:
        return None
    if any(rotor.role is not Role.THROW for rotor in engine.rotors):
        return None
    single = _one_throw(engine, layout)
    if single is None or not all(_is_amplitude(term) for term in problem.objective):
        return None
    if not _limits_are_kept(problem, phasing, layout):
        return None
    x = layout.throw_positions[0]
    points = tuple(replace(point, gas=None) for point in problem.points)
    alone = evaluate(replace(problem, engine=single, points=points))
    highest = max(len(shaking_loads(single, point, problem.fidelity).coefficients) for point in points)
    highest = min(highest, max(orders_needed(p.rod_ratio, p.offset_ratio) for p in single.slider_cranks) + 1)
    orders = _orders(problem, highest)
    terms = tuple(_factors(term, alone, orders, abs(x)) for term in problem.objective)
    used = [
        k for k in range(len(orders))
        if any(t.force[k] > NEGLIGIBLE * max(t.force) or t.couple[k] > NEGLIGIBLE * max(t.couple) for t in terms)
    ]  # fmt: skip
    return AmplitudeObjective(
        tuple(orders[k] for k in used),
        tuple(
            AmplitudeTerm(t.weight, tuple(t.force[k] for k in used), tuple(t.couple[k] for k in used)) for t in terms
        ),
    )


def _limits_are_kept(problem: Problem, phasing: Phasing, layout: Layout) -> bool:
    # even stars have equal forces if they have equal numbers of throws on the steps
    if not problem.limits:
        return True
    if (
        any(_LEVERS.get(limit.measure.channel) != 0 for limit in problem.limits)
        or len(even_patterns(phasing.cycle, layout)) > 1
    ):
        return False
    evaluation = evaluate(problem)
    return all(evaluation.value(limit.measure) <= limit.maximum for limit in problem.limits)


def _is_amplitude(term: Term) -> bool:
    q = term.measure
    if q.channel not in _LEVERS:
        return False
    return q.norm.is_euclidean or (q.orders is not None and len(q.orders) == 1)


def _one_throw(engine: Engine, layout: Layout) -> Engine | None:
    places, pins = layout.throw_positions, layout.pins
    if len(engine.slider_cranks) != len(pins):
        return None
    if places[0] == 0.0 or any(x != places[pin] for x, pin in zip(layout.positions, pins, strict=True)):
        return None
    cylinders = tuple(part for part, pin in zip(engine.slider_cranks, pins, strict=True) if pin == 0)
    if any(type(part) is not SliderCrank for part in cylinders):
        return None
    return Engine(engine.name, engine.cycle, cylinders, tuple(rotor for rotor in engine.rotors if rotor.x == places[0]))


def _orders(problem: Problem, highest: int) -> list[int]:
    orders: set[int] = set()
    for term in problem.objective:
        counted = term.measure.orders
        orders |= set(range(1, highest)) if counted is None else {int(h) for h in counted if h == int(h) and h > 0}
    return sorted(orders)


def _factors(term: Term, alone: Evaluation, orders: Sequence[int], x: float) -> AmplitudeTerm:
    counted = term.measure.orders
    values = []
    for h in orders:
        counts = counted is None or any(float(h) == order for order in counted)
        values.append(alone.value(replace(term.measure, orders=(float(h),))) if counts else 0.0)
    zeros = (0.0,) * len(orders)
    if _LEVERS[term.measure.channel] == 0:
        return AmplitudeTerm(term.weight, tuple(values), zeros)
    return AmplitudeTerm(term.weight, zeros, tuple(v / x for v in values))


def dual_directions(objective: AmplitudeObjective) -> NDArray[np.complex128]:
    """Return dual vectors v_h = sum_t w_t c_th u_th with sum_h |u_th|^2 <= 1 for every term t (S4).

    Each gives a lower bound Re sum_h v_h C_h of the objective. Orders with a small weight stay at zero, which keeps
    the bound valid.

    Returns
    -------
    NDArray
        Dual vectors, shape (directions, orders).
    """
    total = np.sum([np.multiply(t.weight, t.couple) for t in objective.terms], axis=0)
    heavy = [int(h) for h in np.argsort(total)[::-1] if total[h] > 0.0][:3]
    if not heavy:
        return np.zeros((1, len(objective.orders)), dtype=complex)
    angles = max(4, int((DIRECTIONS / 3 if len(heavy) > 1 else DIRECTIONS) ** (1.0 / len(heavy))))
    vectors = []
    for sizes in _sizes(objective, heavy):
        for steps in itertools.product(range(angles), repeat=len(heavy)):
            v = np.zeros(len(objective.orders), dtype=complex)
            for h, size, step in zip(heavy, sizes, steps, strict=True):
                v[h] = size * np.exp(2j * np.pi * step / angles)
            vectors.append(v)
    return np.unique(np.array(vectors), axis=0)


def _sizes(objective: AmplitudeObjective, heavy: Sequence[int]) -> Iterator[Array]:
    """Yield sizes of v on the heavy orders; a term with several of them divides its unit between them."""
    grid = [np.array(s) for s in itertools.product((0.25, 0.6, 0.95), repeat=len(heavy))] if len(heavy) > 1 else []
    grid = (
        [np.ones(len(heavy)), *grid]
        if any(_orders_of(t, heavy) > 1 for t in objective.terms)
        else [np.ones(len(heavy))]
    )
    for shares in grid:
        sizes = np.zeros(len(heavy))
        for term in objective.terms:
            factors = np.array([term.couple[h] for h in heavy])
            unit = np.where(factors > 0.0, shares, 0.0)
            length = float(np.sqrt((unit**2).sum()))
            sizes += term.weight * factors * (unit / length if length > 0.0 else unit)
        yield sizes


def _orders_of(term: AmplitudeTerm, heavy: Sequence[int]) -> int:
    return sum(1 for h in heavy if term.couple[h] > 0.0)
