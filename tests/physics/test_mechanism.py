"""Momentum of a motion against the closed forms of the slider-crank (L2-L4, L7)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from laufruhe.errors import ModelError
from laufruhe.extensions.bearing_loads.physics import piston_pin_forces
from laufruhe.machine import Cycle, Engine, OperatingPoint, Shaft, SliderCrank
from laufruhe.numerics.arrays import ComplexArray
from laufruhe.physics import mechanism
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.torque import crank_torque
from one_cylinder import inertia_coefficients

ROUNDING = 2e-13


@st.composite
def parts(draw: st.DrawFn) -> SliderCrank:
    rod_ratio = draw(st.floats(0.0, 0.7))
    rod = 0.05 / rod_ratio if rod_ratio > 1e-3 else math.inf
    offset = 0.0 if math.isinf(rod) else draw(st.floats(-0.25, 0.25)) * rod
    ratio = draw(st.sampled_from([1.0, -1.0, 2.0, -0.5]))
    deficit = 0.0 if math.isinf(rod) else draw(st.floats(-0.01, 0.01))
    return SliderCrank("part", 0.1, 0.05, rod, 1.3, 0.4, 0.2, offset, 0.5, deficit, shaft=Shaft("crank", ratio))


@settings(max_examples=60, deadline=None)
@given(part=parts())
def test_momentum_gives_the_closed_forms(part: SliderCrank) -> None:
    axial, across, roll = inertia_coefficients(part, 100.0)
    table = mechanism.momentum_orders(part) * (part.shaft.ratio * 100.0) ** 2
    count = max(len(axial), table.shape[1])
    closed = np.array([np.pad(row, (0, count - len(row))) for row in (axial, across, roll)])
    given_by = np.pad(np.stack([table[0], table[1], table[2] + table[3]]), ((0, 0), (0, count - table.shape[1])))
    # the mean of the roll moment is zero, and rounds to it
    closed[:, 0] = 0.0
    assert np.abs(closed[:2] - given_by[:2]).max() <= ROUNDING * np.abs(axial).max()
    assert np.abs(closed[2] - given_by[2]).max() <= ROUNDING * np.abs(closed[2]).max() + 1e-14 * np.abs(axial).max()


def test_the_transform_stops_where_the_tail_is_gone() -> None:
    part = SliderCrank("part", 0.0, 0.05, 0.05 / 0.97, 1.0)
    table = np.abs(mechanism.momentum_orders(part)[0])
    assert len(table) > 64
    assert table[-1] < 1e-15 * table.max()


def torque(part: SliderCrank) -> ComplexArray:
    engine = Engine("one", Cycle.FOUR_STROKE, (part,))
    return crank_torque(engine, OperatingPoint("rated", 300.0)).coefficients[:, None].T


def pin_force(part: SliderCrank) -> ComplexArray:
    engine = Engine("one", Cycle.FOUR_STROKE, (part,))
    return piston_pin_forces(engine, OperatingPoint("rated", 300.0)).coefficients.reshape(-1, 2).T


@pytest.mark.parametrize("orders", [mechanism.momentum_orders, torque, pin_force])
def test_masses_do_not_decide_how_many_orders_there_are(orders: Callable[[SliderCrank], ComplexArray]) -> None:
    """Loads are affine in the masses: a signal with kinks beside them is then the same for every mass."""
    part = SliderCrank("part", 0.0, 0.05, 0.14, 1.0, offset=0.01, rod_inertia_deficit=-0.002)
    tables = [orders(replace(part, reciprocating_mass=mass)) for mass in (0.0, 1e-9, 0.3, 1.5)]
    assert len({table.shape for table in tables}) == 1
    mixed = 0.8 * tables[0] + 0.2 * tables[3]
    assert np.abs(tables[2] - mixed).max() <= 1e-15 * np.abs(tables[2]).max()


def test_a_crank_that_all_but_locks_is_refused() -> None:
    part = SliderCrank("part", 0.0, 0.05, 0.05 / (1.0 - 1e-12), 1.0)
    with pytest.raises(ModelError, match="too close to locking"):
        mechanism.momentum_orders(part)


@pytest.mark.parametrize("fidelity", [Fidelity(kinematics="two-order"), Fidelity(orders=3), Fidelity(rod="mass-only")])
def test_other_fidelities_are_parts_of_the_exact_table(fidelity: Fidelity) -> None:
    class Other(SliderCrank):
        """Without closed forms."""

    own = Other("part", 0.0, 0.05, 0.17, 1.0, rod_inertia_deficit=-0.001)
    exact, cut = inertia_coefficients(own, 50.0), inertia_coefficients(own, 50.0, fidelity)
    if fidelity.rod == "mass-only":
        assert not np.allclose(cut[2], exact[2][: len(cut[2])], rtol=1e-3)
        return
    last = 3 if fidelity.orders else 2
    assert cut[0][last + 1 :].any() == np.False_
    assert np.array_equal(cut[0][: last + 1], exact[0][: last + 1])
