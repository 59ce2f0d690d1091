"""Which objectives are sums of norms of a star's forces and couples, and with what factors (S3)."""

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

NEGLIGIBLE = 1e-13
DIRECTIONS = 400
_LEVERS: dict[Channel, int] = {SHAKING_FORCE: 0, SURGING_FORCE: 0, ROCKING_COUPLE: 1, SWAYING_COUPLE: 1}
"""Powers of a throw's position that loads grow with, for loads that add up by positions alone."""


@dataclass(frozen=True)
class AmplitudeTerm:
    """w sqrt(sum_h (f_h |F_h|)^2 + (c_h |C_h|)^2), one norm of the objective (S3).

    Attributes
    ----------
    force, couple
        f_h and c_h of every order.
    """

    weight: float
    force: tuple[float, ...]
    couple: tuple[float, ...]


@dataclass(frozen=True)
class AmplitudeObjective:
    """A sum of norms of forces and couples of a star by order (S3)."""

    orders: tuple[int, ...]
    terms: tuple[AmplitudeTerm, ...]

    def values(self, space: StarSpace, stars: Stars, maximum: float = math.inf) -> Array:  # noqa: ARG002
        """Return the objective of many stars, shape (n,).

        Any number between `maximum` and a larger value may stand for it.
        """
        return self._of_sums(star_sums(stars, space.phases, space.places, self.orders))

    def of_angles(self, places: Sequence[float], throws: Array) -> Array:
        """Return the objective of many cranks, shape (n,), from throw angles [rad], shape (n, throws)."""
        weights = np.stack([np.ones(len(places)), places], axis=-1)
        waves = np.exp(1j * throws[:, None, :] * np.array(self.orders)[:, None])
        return self._of_sums(waves @ weights)

    def _of_sums(self, sums: NDArray[np.complex128]) -> Array:
        squares = np.square(sums.real) + np.square(sums.imag)
        out = np.zeros(len(sums))
        for term in self.terms:
            factors = np.stack([np.square(term.force), np.square(term.couple)], axis=-1)
            out += term.weight * np.sqrt(np.einsum("nhc,hc->n", squares, factors))
        return out


def amplitude_objective(problem: Problem, phasing: Phasing, layout: Layout) -> AmplitudeObjective | None:
    """The objective as norms of |F_h| and |C_h|, where it is of that kind; else None.

    It is if nothing but throws that are alike and what hangs on them makes forces and couples,
    nothing else is open, no limit can tell even stars apart, and every term is a root mean square or is
    of a single order: then no phase between orders can matter.

    Parameters
    ----------
    problem
        Of one of the stars.
    phasing, layout
        What is open, and where the cylinders of these stars stand.
    """
    engine = problem.engine
    if problem.decisions or phasing.shafts.optional or not problem.objective:
        return None
    if any(rotor.role is not Role.THROW for rotor in engine.rotors):
        return None
    single = _one_throw(engine, layout)
    if single is None or not all(_is_amplitude(term) for term in problem.objective):
        return None
    if not _limits_massless(problem, phasing, layout):
        return None
    x = layout.throw_positions[0]
    silent = tuple(replace(point, gas=None) for point in problem.points)
    alone = evaluate(replace(problem, engine=single, points=silent))
    highest = max(len(shaking_loads(single, point, problem.fidelity).coefficients) for point in silent)
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


def _limits_massless(problem: Problem, phasing: Phasing, layout: Layout) -> bool:
    # even stars share the limited forces where the counts on the steps are the same
    if not problem.limits:
        return True
    if (
        any(_LEVERS.get(limit.measure.channel) != 0 for limit in problem.limits)
        or len(even_patterns(phasing.cycle, layout)) > 1
    ):
        return False
    given = evaluate(problem)
    return all(given.value(limit.measure) <= limit.maximum for limit in problem.limits)


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
    own = tuple(part for part, pin in zip(engine.slider_cranks, pins, strict=True) if pin == 0)
    if any(type(part) is not SliderCrank for part in own):
        return None
    return Engine(engine.name, engine.cycle, own, tuple(rotor for rotor in engine.rotors if rotor.x == places[0]))


def _orders(problem: Problem, highest: int) -> list[int]:
    wanted: set[int] = set()
    for term in problem.objective:
        given = term.measure.orders
        wanted |= set(range(1, highest)) if given is None else {int(h) for h in given if h == int(h) and h > 0}
    return sorted(wanted)


def _factors(term: Term, alone: Evaluation, orders: Sequence[int], x: float) -> AmplitudeTerm:
    counted = term.measure.orders
    values = []
    for h in orders:
        counts = counted is None or any(float(h) == order for order in counted)
        values.append(alone.value(replace(term.measure, orders=(float(h),))) if counts else 0.0)
    none = (0.0,) * len(orders)
    if _LEVERS[term.measure.channel] == 0:
        return AmplitudeTerm(term.weight, tuple(values), none)
    return AmplitudeTerm(term.weight, none, tuple(v / x for v in values))


def directions(objective: AmplitudeObjective) -> NDArray[np.complex128]:
    """Points of the dual ball: v_h = sum_t w_t c_th u_th with sum_h |u_th|^2 <= 1 (S4).

    Returns
    -------
    Shape (directions, orders). The orders that weigh little are left at zero, which is
    allowed and costs tightness only.
    """
    total = np.sum([np.multiply(t.weight, t.couple) for t in objective.terms], axis=0)
    heavy = [int(h) for h in np.argsort(total)[::-1] if total[h] > 0.0][:3]
    if not heavy:
        return np.zeros((1, len(objective.orders)), dtype=complex)
    angles = max(4, int((DIRECTIONS / 3 if len(heavy) > 1 else DIRECTIONS) ** (1.0 / len(heavy))))
    out = []
    for shares in _shares(objective, heavy):
        for turn in itertools.product(range(angles), repeat=len(heavy)):
            v = np.zeros(len(objective.orders), dtype=complex)
            for h, size, t in zip(heavy, shares, turn, strict=True):
                v[h] = size * np.exp(2j * np.pi * t / angles)
            out.append(v)
    return np.unique(np.array(out), axis=0)


def _shares(objective: AmplitudeObjective, heavy: Sequence[int]) -> Iterator[Array]:
    """Sizes of v on the heavy orders: a term of several orders divides its unit between them."""
    grid = [np.array(s) for s in itertools.product((0.25, 0.6, 0.95), repeat=len(heavy))] if len(heavy) > 1 else []
    grid = (
        [np.ones(len(heavy)), *grid]
        if any(_orders_of(t, heavy) > 1 for t in objective.terms)
        else [np.ones(len(heavy))]
    )
    for raw in grid:
        sizes = np.zeros(len(heavy))
        for term in objective.terms:
            mine = np.array([term.couple[h] for h in heavy])
            unit = np.where(mine > 0.0, raw, 0.0)
            length = float(np.sqrt((unit**2).sum()))
            sizes += term.weight * mine * (unit / length if length > 0.0 else unit)
        yield sizes


def _orders_of(term: AmplitudeTerm, heavy: Sequence[int]) -> int:
    return sum(1 for h in heavy if term.couple[h] > 0.0)
