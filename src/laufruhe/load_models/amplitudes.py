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
from laufruhe.physics.crank_stars import Stars, StarSpace, phase_waves, star_sums
from laufruhe.physics.order_coefficients import orders_needed
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.problem.channels import ROCKING_COUPLE, SHAKING_FORCE, SURGING_FORCE, SWAYING_COUPLE, Channel
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Phasing, Problem

# relative size of the factor of an order that counts as zero, and relative difference of equal throws
NEGLIGIBLE, SAME_PLACE = 1e-13, 1e-12
# largest number of directions of dual vectors
DIRECTIONS = 400
_LEVERS: dict[Channel, int] = {SHAKING_FORCE: 0, SURGING_FORCE: 0, ROCKING_COUPLE: 1, SWAYING_COUPLE: 1}
"""Power of the throw position by which each load grows."""


@dataclass(frozen=True)
class AmplitudeTerm:
    """Term of the objective: w sqrt(sum_h (f_h |F_h|)^2 + (c_h |C_h|)^2) over the orders h (S3).

    F_h is the sum of e^{i h theta} over the throw angles theta, and C_h the same sum weighted by throw positions. w is
    the `weight` of the term. `force` and `couple` are the factors f_h and c_h of every order.
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
        """Return the objective of many crank stars, shape (n,), from the step of every throw, shape (n, throws).

        Other objectives of this interface may return any number above `maximum` in place of a larger value.
        """
        return self._values_of_sums(star_sums(stars, space.phases, space.places, self.orders))

    def values_at_angles(self, places: Sequence[float], throws: Array) -> Array:
        """Return the objective of many cranks, shape (n,), from positions [m] and angles [rad], shape (n, throws)."""
        weights = np.stack([np.ones(len(places)), places], axis=-1)
        waves = np.exp(1j * throws[:, None, :] * np.array(self.orders)[:, None])
        return self._values_of_sums(waves @ weights)

    def lower_bound(self, space: StarSpace) -> float:
        """Return a lower bound over all crank stars: the forces, which depend on the pattern only [SI]."""
        return min(self.forces(space, pattern) for pattern in space.patterns)

    def forces(self, space: StarSpace, pattern: Sequence[int]) -> float:
        """Return the terms without couples of crank stars of a pattern [SI]."""
        forces = np.abs(phase_waves(space.phases, self.orders) @ np.array(pattern))
        forces[forces <= 1e-12 * space.throws] = 0.0
        pure = [term for term in self.terms if not any(term.couple)]
        return sum(term.weight * float(np.linalg.norm(np.multiply(term.force, forces))) for term in pure)

    def _values_of_sums(self, sums: NDArray[np.complex128]) -> Array:
        squares = np.square(sums.real) + np.square(sums.imag)
        values = np.zeros(len(sums))
        for term in self.terms:
            factors = np.stack([np.square(term.force), np.square(term.couple)], axis=-1)
            values += term.weight * np.sqrt(np.einsum("nhc,hc->n", squares, factors))
        return values


def amplitude_objective(problem: Problem, phasing: Phasing, layout: Layout) -> AmplitudeObjective | None:
    """Return the objective as norms of the amplitudes |F_h| and |C_h|, or None if it depends on anything else.

    Amplitudes suffice if all of the following hold. Equal throws at symmetric positions cause all forces and couples,
    and only the crank star is open. Limits have the same value for all crank stars that fire evenly. Every term is a
    root mean square, or has a single order, so that no phase between orders matters.
    """
    engine = problem.engine
    if problem.decisions or phasing.shafts.optional or not problem.objective:
        return None
    if any(rotor.role is not Role.THROW for rotor in engine.rotors):
        return None
    measures = [term.measure for term in problem.objective]
    if any(m.channel not in _LEVERS for m in measures):
        return None
    if not all(m.norm.is_euclidean or (m.orders is not None and len(m.orders) == 1) for m in measures):
        return None
    places, pins = layout.throw_positions, layout.pins
    if len(engine.slider_cranks) != len(pins) or places[0] == 0.0:
        return None
    if any(x != places[pin] for x, pin in zip(layout.positions, pins, strict=True)):
        return None
    cylinders = tuple(part for part, pin in zip(engine.slider_cranks, pins, strict=True) if pin == 0)
    if any(type(part) is not SliderCrank for part in cylinders) or not _throws_are_alike(engine, layout):
        return None
    if problem.limits:
        # even stars have equal forces if they have equal numbers of throws on the steps
        is_of_forces = all(_LEVERS.get(limit.measure.channel) == 0 for limit in problem.limits)
        if not is_of_forces or len(even_patterns(phasing.cycle, layout)) > 1:
            return None
        if evaluate(problem).violation(problem.limits) > 0.0:
            return None
    rotors = tuple(rotor for rotor in engine.rotors if rotor.x == places[0])
    single = Engine(engine.name, engine.cycle, cylinders, rotors)
    points = tuple(replace(point, gas=None) for point in problem.points)
    alone = evaluate(replace(problem, engine=single, points=points))
    highest = max(len(shaking_loads(single, point, problem.fidelity).coefficients) for point in points)
    highest = min(highest, max(orders_needed(p.rod_ratio, p.offset_ratio) for p in single.slider_cranks) + 1)
    all_orders = {float(h) for h in range(1, highest)}
    by_measure = [
        all_orders if m.orders is None else {h for h in m.orders if h == int(h) and h > 0} for m in measures
    ]  # fmt: skip
    orders = sorted(set().union(*by_measure))
    terms = []
    for term, counted in zip(problem.objective, by_measure, strict=True):
        values = tuple(alone.value(replace(term.measure, orders=(h,))) if h in counted else 0.0 for h in orders)
        zeros = (0.0,) * len(orders)
        if _LEVERS[term.measure.channel] == 0:
            terms.append(AmplitudeTerm(term.weight, values, zeros))
        else:
            terms.append(AmplitudeTerm(term.weight, zeros, tuple(value / abs(places[0]) for value in values)))
    used = [
        k for k in range(len(orders))
        if any(t.force[k] > NEGLIGIBLE * max(t.force) or t.couple[k] > NEGLIGIBLE * max(t.couple) for t in terms)
    ]  # fmt: skip
    strong = [AmplitudeTerm(t.weight, tuple(t.force[k] for k in used), tuple(t.couple[k] for k in used)) for t in terms]
    return AmplitudeObjective(tuple(int(orders[k]) for k in used), tuple(strong))


def _throws_are_alike(engine: Engine, layout: Layout) -> bool:
    # equal cylinders and rotating masses on all throws, whose positions equal their mirror image
    places = layout.throw_positions
    if any(abs(front + back) > SAME_PLACE * abs(places[0]) for front, back in zip(places, places[::-1], strict=True)):
        return False
    cylinders = [
        [replace(engine.slider_cranks[k], name="", x=0.0, throw=0.0, firing_angle=0.0) for k in layout.on_throw(pin)]
        for pin in range(len(places))
    ]
    sizes = [sum(abs(rotor.unbalance) for rotor in engine.rotors if rotor.x == x) for x in places]
    return all(c == cylinders[0] for c in cylinders) and max(sizes) - min(sizes) <= SAME_PLACE * max(sizes)


def dual_directions(objective: AmplitudeObjective) -> NDArray[np.complex128]:
    """Return dual vectors v that bound the objective by the couples of a crank star, (directions, orders) (S4).

    Each v gives a lower bound Re sum_h conj(v_h) C_h of the objective, with the couple C_h in order h. Here
    v_h = sum_t w_t c_th u_th, with weight w_t and couple factors c_th of term t, and any vector u_t with
    sum_h |u_th|^2 <= 1. v is zero in all but the three orders with the largest factors, so the bound stays valid.
    """
    total = np.sum([np.multiply(t.weight, t.couple) for t in objective.terms], axis=0)
    strongest = [int(h) for h in np.argsort(total)[::-1] if total[h] > 0.0][:3]
    if not strongest:
        return np.zeros((1, len(objective.orders)), dtype=complex)
    angles = max(4, int((DIRECTIONS / 3 if len(strongest) > 1 else DIRECTIONS) ** (1.0 / len(strongest))))
    vectors = []
    for sizes in _sizes(objective, strongest):
        for steps in itertools.product(range(angles), repeat=len(strongest)):
            v = np.zeros(len(objective.orders), dtype=complex)
            for h, size, step in zip(strongest, sizes, steps, strict=True):
                v[h] = size * np.exp(2j * np.pi * step / angles)
            vectors.append(v)
    return np.unique(np.array(vectors), axis=0)


def _sizes(objective: AmplitudeObjective, strongest: Sequence[int]) -> Iterator[Array]:
    """Yield possible magnitudes |v_h| of dual vectors in the orders with the largest couple factors (S4).

    `strongest` are the indices of these orders. A term with several of them divides its unit vector between them.
    """
    grid = [np.ones(len(strongest))]
    if any(np.count_nonzero(np.take(term.couple, strongest) > 0.0) > 1 for term in objective.terms):
        grid += [np.array(shares) for shares in itertools.product((0.25, 0.6, 0.95), repeat=len(strongest))]
    for shares in grid:
        sizes = np.zeros(len(strongest))
        for term in objective.terms:
            factors = np.array([term.couple[h] for h in strongest])
            unit = np.where(factors > 0.0, shares, 0.0)
            length = float(np.sqrt((unit**2).sum()))
            sizes += term.weight * factors * (unit / length if length > 0.0 else unit)
        yield sizes
