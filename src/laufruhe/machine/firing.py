"""Even firing as a lattice: crank stars that fire evenly, and their firing orders (S6-S8).

Cylinders that fire at equal intervals of turns/n have their dead centres on the R multiples of 1/R of a turn. As many
cylinders have their dead centre on a multiple as the lattice has firings there. So a crank star fires evenly if and
only if these counts agree.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import numpy as np

from laufruhe.errors import ModelError, counted
from laufruhe.machine.engine import Cycle
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.exact_angles import SAME_TURN, angle_of, as_turn

MAX_ORDERS = 4096
"""Largest number of firing orders that are ranked for a crank star, or solved one by one."""
ORDERS_LOOKED_AT = 200_000
"""Largest number of sequences that are examined for firing orders."""


class NoEvenStarError(ModelError):
    """Error of a layout without an evenly firing crank star."""


@dataclass(frozen=True)
class FiringLattice:
    """Crank angles of firings at equal intervals (S6).

    Attributes
    ----------
    steps
        R, the number of different crank angles within one turn at which a cylinder fires.
    slots
        Step of each of the n firings of a cycle, in their order.
    """

    steps: int
    slots: tuple[int, ...]


def firing_lattice(cycle: Cycle, cylinders: int) -> FiringLattice:
    """Return the lattice of `cylinders` equal intervals."""
    steps = cylinders // math.gcd(cycle.turns, cylinders)
    interval = cycle.turns * steps // cylinders
    return FiringLattice(steps, tuple(s * interval % steps for s in range(cylinders)))


def pin_steps(layout: Layout, lattice: FiringLattice) -> tuple[tuple[int, ...], ...]:
    """Return the dead centres of each throw's cylinders (S6).

    Values are steps after the first cylinder of the throw.

    Raises
    ------
    NoEvenStarError
        If the angle between two cylinders of one throw is no whole number of steps.
    """
    out = []
    for pin in range(len(layout.throw_positions)):
        steps, first = [], layout.throw_centre_turn(pin)
        for k in (k for k, throw in enumerate(layout.pins) if throw == pin):
            distance = (layout.dead_centre_turn(k) - first) * lattice.steps
            nearest = round(float(distance))
            if abs(float(distance) - nearest) > SAME_TURN * lattice.steps:
                raise NoEvenStarError(
                    "even firing needs the angle between dead centres on one throw (bank angle plus split pins, or "
                    f"leads of cranks) to be a multiple of {360.0 / lattice.steps:g} deg, and they make "
                    f"{math.degrees(angle_of(first - layout.dead_centre_turn(k))):.6g} deg; "
                    "change or open one of these angles, or allow uneven intervals"
                )
            steps.append(nearest % lattice.steps)
        out.append(tuple(steps))
    return tuple(out)


def even_patterns(cycle: Cycle, layout: Layout) -> tuple[tuple[int, ...], ...]:
    """Return the numbers of throws on every step with which the firing is even, shape (patterns, R) (S7).

    The first throw is on step 0.

    Raises
    ------
    NoEvenStarError
        If no pattern fires evenly.
    """
    lattice = firing_lattice(cycle, len(layout.positions))
    pins = pin_steps(layout, lattice)
    if len({tuple(sorted(pin)) for pin in pins}) > 1:
        raise NoEvenStarError(
            "open throws need the same arrangement of cylinders on every throw; use layout inline or vee"
        )
    steps, maximum, pin = lattice.steps, lattice.slots.count(0), pins[0]
    # last place whose throws load each step; a step that is not full after it stays so
    last = {(step - p) % steps: p for p in range(steps) for step in pin}

    def grow(counts: list[int], load: list[int], left: int) -> Iterator[tuple[int, ...]]:
        if len(counts) == steps:
            if left == 0 and all(x == maximum for x in load):
                yield tuple(counts)
            return
        p = len(counts)
        for count in range(1 if p == 0 else 0, min(left, maximum) + 1):
            after = load.copy()
            for step in pin:
                after[(step - p) % steps] += count
            full = all(after[j] == maximum for j in {(step - p) % steps for step in pin} if last[j] == p)
            if full and max(after) <= maximum:
                yield from grow([*counts, count], after, left - count)

    patterns = tuple(grow([], [0] * steps, len(layout.throw_positions)))
    if not patterns:
        raise NoEvenStarError(
            f"no crank star of {counted(len(layout.throw_positions), 'throw')} fires evenly with cylinders of one "
            f"throw {' and '.join(f'{360.0 * s / steps:g}' for s in pin)} deg apart"
        )
    return patterns


def star_throws(layout: Layout, steps: Sequence[int], lattice_steps: int) -> tuple[float, ...]:
    """Return the throw angles of a crank star [rad], cylinder 1 at its dead centre at phi = 0 (C5)."""
    return tuple(
        angle_of((layout.throw_centre_turn(pin) + Fraction(int(step), lattice_steps)) % 1)
        for pin, step in enumerate(steps)
    )


def star_steps(layout: Layout, throws: Sequence[float], lattice_steps: int) -> tuple[int, ...]:
    """Return the steps of a crank star from its throw angles [rad], the first throw on step 0; see `star_throws`."""
    turns = [as_turn(angle) - layout.throw_centre_turn(pin) for pin, angle in enumerate(throws)]
    return tuple(round(float(turn - turns[0]) * lattice_steps) % lattice_steps for turn in turns)


def even_orders(cycle: Cycle, layout: Layout, steps: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Yield the firing orders of a crank star, cylinder 1 first (S8).

    Each cylinder takes a free firing slot at the crank angle of its throw.
    """
    lattice = firing_lattice(cycle, len(layout.positions))
    pins = pin_steps(layout, lattice)
    seen = [0] * len(pins)
    cylinders: dict[int, list[int]] = {step: [] for step in range(lattice.steps)}
    for k, pin in enumerate(layout.pins):
        step = (pins[pin][seen[pin]] - int(steps[pin])) % lattice.steps
        seen[pin] += 1
        cylinders[step].append(k)
    free = {step: [s for s, at in enumerate(lattice.slots) if at == step] for step in cylinders}
    if any(len(cylinders[step]) != len(free[step]) for step in cylinders):
        return
    choices = [list(itertools.permutations(cylinders[step])) for step in cylinders]
    for chosen in itertools.islice(itertools.product(*choices), ORDERS_LOOKED_AT):
        order = [0] * len(lattice.slots)
        for step, members in zip(cylinders, chosen, strict=True):
            for slot, k in zip(free[step], members, strict=True):
                order[slot] = k + 1
        if order[0] == 1:
            yield tuple(order)


@lru_cache(maxsize=64)
def _dead_centres(layout: Layout, throws: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(float(layout.dead_centre(throws, k) % 1) for k in range(len(layout.positions)))


def slot_steps(cycle: Cycle, slots: Sequence[int]) -> tuple[int, ...]:
    """Return the lattice steps of throws with one cylinder each, from the slots in which these fire (S6)."""
    count = len(slots)
    shared = math.gcd(cycle.turns, count)
    return tuple(-slot * (cycle.turns // shared) % (count // shared) for slot in slots)


def slot_order(slots: Sequence[int]) -> tuple[int, ...]:
    """Return the firing order of cylinders, from the slot in which each fires."""
    return tuple(1 + slots.index(slot) for slot in range(len(slots)))


def from_one(order: Sequence[int]) -> tuple[int, ...]:
    """Rotate a firing order so that it begins with cylinder 1."""
    first = order.index(1)
    return (*order[first:], *order[:first])


def order_slots(order: Sequence[int]) -> tuple[int, ...]:
    """Return the slot in which each cylinder of a firing order fires."""
    return tuple(order.index(number) for number in range(1, len(order) + 1))


def firing_turns(layout: Layout, throws: Sequence[float], order: Sequence[int]) -> tuple[float, ...]:
    """Return the crank angles, in turns, at which the cylinders of a firing order fire, ascending from 0."""
    turns = _dead_centres(layout, tuple(throws))
    start, out = None, []
    previous = -1.0
    for number in order:
        k = number - 1
        turn = turns[k]
        turn = turn - 1.0 if turn > 1.0 - SAME_TURN else turn
        while turn <= previous + SAME_TURN:
            turn += 1.0
        start = turn if start is None else start
        out.append(turn - start)
        previous = turn
    return tuple(out)


def lap_orders(cycle: Cycle, layout: Layout, throws: Sequence[float]) -> Iterator[tuple[int, ...]]:
    """Yield each firing order of throws at any angles once, cylinder 1 first.

    An order says only that a cylinder fires at its first dead centre after the cylinder before it. Firings that wait
    for a later dead centre, and simultaneous firings, have no order.
    """
    turns = np.array(_dead_centres(layout, tuple(throws)))
    relative = (turns - turns[0]) % 1.0
    relative[relative > 1.0 - SAME_TURN] = 0.0
    others, start, size = len(relative) - 1, 0, 64
    looked_at = min(cycle.turns**others, ORDERS_LOOKED_AT)
    # values of digits to the base of the turns, a digit for each cylinder but the first
    worth = np.array([min(cycle.turns**k, looked_at) for k in reversed(range(others))], dtype=np.intp)
    while start < looked_at:
        numbers = np.arange(start, min(start + size, looked_at))
        turns_of_laps = np.tile(relative, (len(numbers), 1))
        turns_of_laps[:, 1:] += numbers[:, None] // worth % cycle.turns
        orders = np.argsort(turns_of_laps, axis=1, kind="stable")
        steps = np.diff(np.take_along_axis(turns_of_laps, orders, axis=1), axis=1)
        for order in orders[np.all((steps > SAME_TURN) & (steps <= 1.0 + SAME_TURN), axis=1)]:
            yield tuple((order + 1).tolist())
        start, size = start + size, min(2 * size, 4096)


def intervals_of(cycle: Cycle, turns: Sequence[float]) -> tuple[float, ...]:
    """Return the crank angles from each firing to the next [rad]."""
    following = [*turns[1:], turns[0] + cycle.turns]
    return tuple(math.tau * (b - a) for a, b in zip(turns, following, strict=True))


@lru_cache(maxsize=64)
def _ranks_along_crank(layout: Layout) -> tuple[int, ...]:
    pins = range(len(layout.throw_positions))
    from_front = sorted(pins, key=lambda pin: -layout.throw_positions[pin])
    return tuple(from_front.index(pin) for pin in pins)


def successive_neighbours(layout: Layout, order: Sequence[int]) -> int:
    """Count successive firings on one throw, or on neighbouring throws."""
    along = _ranks_along_crank(layout)
    pins = [along[layout.pins[number - 1]] for number in order]
    return sum(abs(a - b) <= 1 for a, b in zip(pins, [*pins[1:], pins[0]], strict=True)) if len(pins) > 2 else 0


def longest_bank_gap(cycle: Cycle, layout: Layout, order: Sequence[int], turns: Sequence[float]) -> float:
    """Return the largest crank angle in which one bank does not fire [rad]."""
    gaps = []
    for bank in sorted(set(layout.banks)):
        bank_turns = [t for number, t in zip(order, turns, strict=True) if layout.banks[number - 1] == bank]
        gaps.append(max(intervals_of(cycle, bank_turns)))
    return max(gaps)


def order_content(cycle: Cycle, turns: Sequence[float]) -> float:
    """Return the largest remaining share of a torque order below the firing order, 0 to 1 (S9).

    Equal impulses at these turns add up to |sum_k e^{-i h 2 pi t_k}| / n in order h.
    """
    orders = np.arange(1, len(turns)) / cycle.turns
    left = np.abs(np.exp(-2j * np.pi * np.outer(orders, turns)).sum(axis=1)) / len(turns)
    return float(left.max(initial=0.0))
