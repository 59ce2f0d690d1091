"""Free forces and couples of common engines, as handbooks tabulate them for the choice of a crankshaft.

Such tables give couples about the middle of the engine in units of F_I a and F_II a: F_I = m r w^2 and
F_II = lambda F_I of one cylinder, a the distance of neighbouring throws. They are known to four digits after the point,
which makes the tolerance half of the last; most are radicals, and are asked for to rounding as well. What a star
cancels is zero and not a small number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from laufruhe import load
from laufruhe.errors import ModelError
from laufruhe.extensions.sweeps.free_forces import FreeLoad, free_load
from laufruhe.machine import Cycle, Engine, OperatingPoint
from laufruhe.machine.layouts import Layout, build, even_throws, inline, vee
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.order_coefficients import piston_acceleration_orders
from laufruhe.physics.shaking_loads import shaking_loads
from mechanisms import mechanism_of
from one_cylinder import rotating_loads
from problem_files import PROBLEMS

TWO_ORDER = Fidelity(kinematics="two-order")
HALF_DIGIT = 0.00005
MASS, RADIUS, LENGTH, SPACING, SPEED = 1.25, 0.060, 0.230, 0.125, 261.8
UNIT_FORCE = MASS * RADIUS * SPEED**2


@dataclass(frozen=True)
class Row:
    """A line of the table: printed couples of first and second order, in closed form where there is one."""

    name: str
    cycle: Cycle
    layout: Layout
    firing_order: tuple[int, ...] | None
    throws: tuple[float, ...]
    first: float
    second: float
    closed: tuple[float | None, float | None]
    directions: int

    def engine(self, offset: float = 0.0) -> Engine:
        mechanism = mechanism_of(RADIUS, LENGTH, MASS, rod_rotating_mass=MASS, offset=offset)
        cylinders, _ = build(self.cycle, self.layout, mechanism, self.throws, self.firing_order)
        return Engine(self.name, self.cycle, cylinders)


def _inline(
    cycle: Cycle,
    firing_order: tuple[int, ...],
    first: float,
    second: float,
    closed: tuple[float | None, float | None],
    directions: int,
) -> Row:
    layout = inline(len(firing_order), SPACING)
    throws = even_throws(cycle, layout, firing_order)
    name = f"inline {'-'.join(map(str, firing_order))} {cycle.name.lower()}"
    return Row(name, cycle, layout, firing_order, throws, first, second, closed, directions)


def _vee(
    name: str,
    throws_deg: tuple[int, ...],
    first: float,
    second: float,
    closed: tuple[float | None, float | None],
    directions: int,
) -> Row:
    layout = vee(2 * len(throws_deg), SPACING, 0.5 * math.pi)
    throws = tuple(math.tau * degrees / 360 for degrees in throws_deg)
    return Row(name, Cycle.FOUR_STROKE, layout, None, throws, first, second, closed, directions)


FOUR, TWO = Cycle.FOUR_STROKE, Cycle.TWO_STROKE
INLINE = [
    _inline(FOUR, (1, 3, 2), 1.7321, 1.7321, (math.sqrt(3), math.sqrt(3)), 3),
    _inline(FOUR, (1, 2, 4, 5, 3), 0.4490, 4.9798, (None, None), 5),
    _inline(FOUR, (1, 5, 3, 6, 2, 4), 0.0, 0.0, (0.0, 0.0), 3),
    _inline(TWO, (1, 5, 3, 4, 2, 6), 0.0, 3.4641, (0.0, 2 * math.sqrt(3)), 6),
    _inline(TWO, (1, 7, 2, 5, 4, 3, 6), 0.2673, 1.0056, (None, None), 7),
]
V6 = _vee("V6 90 deg", (0, 240, 120), 1.7321, 2.4495, (math.sqrt(3), math.sqrt(6)), 3)
V8 = _vee("V8 90 deg cross-plane", (0, 90, 270, 180), 3.1623, 0.0, (math.sqrt(10), 0.0), 4)
ROWS = [*INLINE, V6, V8]
by_name = pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
by_fidelity = pytest.mark.parametrize("fidelity", [EXACT, TWO_ORDER], ids=lambda fidelity: fidelity.kinematics)


def _loads(row: Row, order: int, fidelity: Fidelity = EXACT, offset: float = 0.0) -> NDArray[np.complex128]:
    """Return the wrench of the reciprocating masses alone, for one order."""
    engine = row.engine(offset)
    total = shaking_loads(engine, OperatingPoint("speed", SPEED), fidelity).at(order)
    return np.asarray(total - rotating_loads(engine, SPEED).at(order))


def _cylinder_force(order: int, fidelity: Fidelity) -> float:
    """Return the amplitude of one cylinder's force, F_I or F_II; of the exact mechanism or to first order in lambda."""
    truncated = {1: 1.0, 2: RADIUS / LENGTH}
    exact = abs(piston_acceleration_orders(RADIUS / LENGTH, 0.0, order)[order])
    return UNIT_FORCE * (exact if fidelity is EXACT else truncated[order])


def _extremes(vector: NDArray[np.complex128]) -> tuple[float, float]:
    """Return the largest and smallest length of Re c e^{ix} over a turn of x: the half axes of its ellipse."""
    largest, smallest = np.linalg.svd(np.array([vector.real, vector.imag]), compute_uv=False)
    return float(largest), float(smallest)


def _couples(row: Row, order: int, fidelity: Fidelity) -> tuple[float, float]:
    largest, smallest = _extremes(_loads(row, order, fidelity)[4:])
    unit = _cylinder_force(order, fidelity) * SPACING
    return largest / unit, smallest / unit


@by_fidelity
@by_name
def test_couples_as_printed(row: Row, fidelity: Fidelity) -> None:
    for order, printed, closed in ((1, row.first, row.closed[0]), (2, row.second, row.closed[1])):
        largest, _ = _couples(row, order, fidelity)
        assert largest == pytest.approx(printed, abs=HALF_DIGIT)
        if closed is not None:
            assert largest == pytest.approx(closed, rel=1e-13, abs=0.0)


@pytest.mark.parametrize("offset", [0.0, 0.012])
@by_name
def test_cancelled_forces_are_exactly_zero(row: Row, offset: float) -> None:
    """A star of n even directions leaves no force of orders other than n, 2 n, ...; with an offset too."""
    loads = shaking_loads(row.engine(offset), OperatingPoint("speed", SPEED))
    for order in range(1, 15):
        if order % row.directions:
            assert (loads.at(order)[:3] == 0.0).all(), f"order {order}"


@by_name
def test_forces_that_the_star_does_not_cancel_remain(row: Row) -> None:
    """Order n of n even directions adds up, unless a vee's two banks cancel it; odd orders need an offset."""
    order = row.directions
    cylinders = len(row.layout.positions)
    one = abs(piston_acceleration_orders(RADIUS / LENGTH, 0.012 / LENGTH, order)[order]) * UNIT_FORCE
    force = np.linalg.norm(_loads(row, order, offset=0.012)[1:3])
    assert force > 0.5 * cylinders * one
    if order % 2:
        assert (_loads(row, order)[:3] == 0.0).all()


@pytest.mark.parametrize("row", INLINE, ids=lambda row: row.name)
def test_couples_of_inline_engines_lie_in_one_plane(row: Row) -> None:
    """Upright cylinders shake in their own plane: My only, and no lateral force."""
    for order in range(1, 9):
        loads = _loads(row, order)
        assert loads[1] == 0.0
        assert loads[5] == 0.0


@pytest.mark.parametrize(
    ("row", "orders"),
    [(INLINE[2], range(1, 15)), (INLINE[3], (1, 3, 5, 7, 9)), (V8, (2, 6, 10))],
    ids=lambda v: getattr(v, "name", ""),
)
def test_cancelled_couples_are_exactly_zero(row: Row, orders: tuple[int, ...]) -> None:
    """Check mirrored crankshafts, odd orders of the two-stroke six, and orders 2, 6, 10 of the V8."""
    for order in orders:
        assert (_loads(row, order, offset=0.012 if row is INLINE[2] else 0.0)[4:] == 0.0).all(), f"order {order}"


@by_fidelity
def test_v6_first_order_is_constant_and_second_goes_through_zero(fidelity: Fidelity) -> None:
    """V6 of 90 deg: the first-order couple keeps its length as it turns, the second oscillates about z alone."""
    largest, smallest = _couples(V6, 1, fidelity)
    assert smallest == pytest.approx(largest, rel=1e-14)
    assert _loads(V6, 2, fidelity)[4] == 0.0
    assert _couples(V6, 2, fidelity)[1] == 0.0


@by_fidelity
def test_v8_first_order_turns_with_the_crank(fidelity: Fidelity) -> None:
    """Cross-plane V8: it turns with the crank and keeps its length, so that weights on the crank remove it."""
    couple = _loads(V8, 1, fidelity)
    assert abs(couple[4] - 1j * couple[5]) == pytest.approx(2 * math.sqrt(10) * UNIT_FORCE * SPACING, rel=1e-13)
    assert abs(couple[4] + 1j * couple[5]) <= 1e-14 * abs(couple[4])


@pytest.mark.parametrize("row", INLINE, ids=lambda row: row.name)
def test_turning_couple_has_the_star_of_the_first_order(row: Row) -> None:
    """Rotating masses make the first-order couple of the table, of constant length; their forces cancel exactly."""
    turning = rotating_loads(row.engine(), SPEED).at(1)
    assert (turning[:4] == 0.0).all()
    largest, smallest = _extremes(turning[4:])
    assert largest / (UNIT_FORCE * SPACING) == pytest.approx(row.first, abs=HALF_DIGIT)
    assert smallest == pytest.approx(largest, rel=1e-14)


def test_higher_orders_and_offset_change_the_couple() -> None:
    """The second-order couple is 1.7 % over lambda F_I here, and an offset adds odd orders: leaving them out shows."""
    row = INLINE[0]
    exact, truncated = (abs(_loads(row, 2, fidelity)[4]) for fidelity in (EXACT, TWO_ORDER))
    assert exact / truncated - 1 == pytest.approx(0.25 * (RADIUS / LENGTH) ** 2, rel=0.05)
    assert abs(_loads(row, 4)[4]) > 1e-3 * truncated
    assert _loads(row, 4, TWO_ORDER)[4] == 0.0
    assert _loads(row, 3)[2] == 0.0
    assert abs(_loads(row, 3, offset=0.012)[2]) > 1e-3 * UNIT_FORCE


ROOT = math.sqrt
# ready problem: forces and couples of orders 1 and 2, and the longest firing interval [deg]
READY = {
    "tractor-single": (1.0, 0.0, 1.0, 0.0, 720),
    "tractor-two": (0.0, 1.0, 2.0, 0.0, 540),
    "tractor-three": (0.0, ROOT(3), 0.0, ROOT(3), 240),
    "tractor-four-lanchester": (0.0, 0.0, 4.0, 0.0, 180),
    "inline-five": (0.0, 0.4490, 0.0, 4.9798, 144),
    "tractor-six": (0.0, 0.0, 0.0, 0.0, 120),
    "inline-seven": (0.0, 0.2673, 0.0, 1.0056, 720 / 7),
    "inline-eight": (0.0, 0.0, 0.0, 0.0, 90),
    "inline-ten": (0.0, 0.0, 0.0, 0.0, 72),
    "inline-twelve": (0.0, 0.0, 0.0, 0.0, 60),
    "two-stroke-two": (0.0, 1.0, 2.0, 0.0, 180),
    "two-stroke-three": (0.0, ROOT(3), 0.0, ROOT(3), 120),
    "tractor-two-stroke-four-root-two": (0.0, ROOT(2), 0.0, 4.0, 90),
    "tractor-two-stroke-four-root-ten": (0.0, ROOT(10), 0.0, 0.0, 90),
    "two-stroke-five": (0.0, 0.4490, 0.0, 4.9798, 72),
    "two-stroke-six": (0.0, 0.0, 0.0, 2 * ROOT(3), 60),
    "two-stroke-seven": (0.0, 0.2673, 0.0, 1.0056, 360 / 7),
    "vee-two-90": (1.0, 0.0, ROOT(2), 0.0, 450),
    "vee-six-60": (0.0, 1.5, 0.0, 1.5, 120),
    "vee-six-90": (0.0, ROOT(3), 0.0, ROOT(6), 150),
    "vee-eight-cross": (0.0, ROOT(10), 0.0, 0.0, 90),
    "vee-eight-flat": (0.0, 0.0, 4 * ROOT(2), 0.0, 90),
    # two pairs of opposed cylinders, 50 mm apart along a crank of 125 mm spacing
    "boxer-four": (0.0, 0.0, 0.0, 2 * 0.050 / 0.125, 180),
    # both pistons of a pin move the same way: first order adds up, second cancels (Hasselgruber 1964, Fig. 29)
    "flat-four": (0.0, 2.0, 0.0, 0.0, 180),
    "flat-twelve": (0.0, 0.0, 0.0, 0.0, 60),
}


def _ready(name: str, order: int) -> FreeLoad:
    return free_load(load(PROBLEMS / f"{name}.toml").engine, order, SPACING)


@pytest.mark.parametrize("name", READY)
def test_ready_problems_have_the_free_forces_of_their_layout(name: str) -> None:
    force, couple, second_force, second_couple, longest = READY[name]
    first, second = _ready(name, 1), _ready(name, 2)
    found = (first.force, first.couple, second.force, second.couple)
    assert found == pytest.approx((force, couple, second_force, second_couple), abs=HALF_DIGIT)
    assert math.degrees(max(load(PROBLEMS / f"{name}.toml").engine.firing_intervals)) == pytest.approx(longest)


@pytest.mark.parametrize("name", ["inline-five", "inline-seven", "inline-nine", "inline-eleven", "two-stroke-five"])
@pytest.mark.parametrize("order", [1, 2])
def test_couples_of_odd_engines_follow_from_their_firing_order(name: str, order: int) -> None:
    """The sum of places times directions, cylinder by cylinder as they fire."""
    problem = load(PROBLEMS / f"{name}.toml").engine
    by_firing = sorted(problem.slider_cranks, key=lambda part: part.firing_angle)
    count = len(by_firing)
    step = 2.0 * math.pi * problem.cycle.turns / count
    total = sum(part.x / SPACING * np.exp(1j * order * k * step) for k, part in enumerate(by_firing))
    assert _ready(name, order).couple == pytest.approx(abs(total), rel=1e-9)
    assert _ready(name, order).force == pytest.approx(0.0, abs=1e-12)


def test_backward_shares_of_hasselgruber() -> None:
    """Check Hasselgruber 1964, eq. 33: zero at 90 degrees, half upright; the V8's couple turns with the crank."""
    assert _ready("vee-two-90", 1).force_against == pytest.approx(0.0, abs=1e-12)
    assert _ready("tractor-single", 1).force_against == pytest.approx(0.5)
    assert _ready("vee-eight-cross", 1).couple_against == pytest.approx(0.0, abs=1e-12)
    assert _ready("inline-five", 1).couple_against == pytest.approx(0.5 * 0.4490, abs=HALF_DIGIT)


def test_cylinders_that_differ_have_no_unit() -> None:
    engine = load(PROBLEMS / "tractor-two.toml").engine
    heavy = replace(engine.slider_cranks[0], reciprocating_mass=2.0)
    with pytest.raises(ModelError, match="have no common unit"):
        free_load(replace(engine, slider_cranks=(heavy, engine.slider_cranks[1])), 1, SPACING)
