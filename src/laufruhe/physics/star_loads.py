"""Loads of a star: the coefficients of one cylinder, times phase and weight of each (L6)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import lru_cache

import numpy as np

from laufruhe.machine import Cycle, SliderCrank
from laufruhe.numerics.arrays import ComplexArray
from laufruhe.numerics.exact_angles import as_turn, cis, star_orders
from laufruhe.numerics.spectrum import Spectrum, as_order
from laufruhe.physics.mechanism import Direction, Effect
from laufruhe.physics.rigid_body import ROLL, plane_parts


def star_loads(
    cycle: Cycle, parts: Sequence[SliderCrank], speed: float, effects: Callable[[SliderCrank], Iterable[Effect]]
) -> Spectrum:
    """Return the wrench of all cylinders: coefficients of one times phase and weight of each, shape (n, 6) (L6)."""
    alike: dict[tuple[Direction, Hashable, float], list[tuple[SliderCrank, Effect]]] = defaultdict(list)
    for part in parts:
        for effect in effects(part):
            alike[effect.direction, effect.shape, part.shaft.ratio].append((part, effect))
    loads = []
    for (direction, _, ratio), members in alike.items():
        series, square = members[0][1].series(), (ratio * speed) ** 2
        weights = [np.multiply(effect.size * square, _wrench_of(direction, part)) for part, effect in members]
        load = star_orders(np.array(weights), tuple([part.star_turn for part, _ in members]), len(series))
        load *= series[:, None]
        # a crank that runs backwards turns its phasors backwards: Re c e^{-ix} = Re conj(c) e^{ix}
        loads.append(spread(load if ratio > 0.0 else load.conj(), order_index(cycle, abs(ratio))))
    total = np.zeros((max(map(len, loads), default=1), 6), dtype=complex)
    for load in loads:
        total[: len(load)] += load
    return Spectrum(cycle.base_order, total)


def spread(load: ComplexArray, step: int) -> ComplexArray:
    """Spread a load by order of its own crank angle, shape (n, d), to orders of the cycle, `step` to one of its own."""
    if step == 1:
        return load
    out = np.zeros(((len(load) - 1) * step + 1, load.shape[1]), dtype=complex)
    out[::step] = load
    return out


@lru_cache(maxsize=1024)
def order_index(cycle: Cycle, order: float) -> int:
    """Return the index of an order of crank speed among those of a cycle."""
    return int(as_order(order) / cycle.base_order)


def _wrench_of(direction: Direction, part: SliderCrank) -> tuple[float, ...]:
    # wrench of a unit load of a cylinder
    if direction is Direction.ROLL:
        return tuple(ROLL.tolist())
    axis = cis(as_turn(part.bank)) * (1j if direction is Direction.TRANSVERSE else 1.0)
    return plane_parts(axis.imag, axis.real, part.x, part.shaft)
