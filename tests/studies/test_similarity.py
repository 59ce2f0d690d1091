"""Engines of equal power, H. Hasselgruber, lecture Braunschweig 1964, eqs. (14) to (23)."""

from __future__ import annotations

import math
from dataclasses import astuple, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from laufruhe.machine import Cycle, Engine, OperatingPoint, Seiliger, SliderCrank
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.studies.equal_power import EqualPowerScale, equal_power_scale

COUNTS = st.integers(1, 48)


class TestLaws:
    @given(COUNTS, COUNTS)
    def test_power_and_piston_speed_stay(self, z: int, reference: int) -> None:
        """Eqs. (14) to (17): z D^2 is constant at equal mean pressure and mean piston speed."""
        scale = equal_power_scale(z, reference)
        ratio = z / reference
        assert ratio * scale.length**2 == pytest.approx(1.0)
        assert scale.length * scale.speed == pytest.approx(1.0)
        power = ratio * scale.length**3 * scale.speed
        assert power == pytest.approx(1.0)

    @given(COUNTS, COUNTS)
    def test_sizes(self, z: int, reference: int) -> None:
        """Eqs. (18) to (22): volumes are cubes of lengths, masses go with volumes."""
        scale = equal_power_scale(z, reference)
        assert scale.mass == pytest.approx(scale.length**3)

    @given(COUNTS, COUNTS)
    def test_forces(self, z: int, reference: int) -> None:
        """Eq. (23): gas p D^2 and inertia m s n^2 fall alike with the number of cylinders."""
        scale = equal_power_scale(z, reference)
        assert scale.length**2 == pytest.approx(reference / z)
        assert scale.length**2 == pytest.approx(scale.mass * scale.length * scale.speed**2)

    @given(COUNTS, COUNTS, COUNTS)
    def test_a_chain_of_engines(self, a: int, b: int, c: int) -> None:
        """Check that the scale from a to b times b to c is that from a to c, and of a to a is one."""
        one, two, both = equal_power_scale(a, b), equal_power_scale(b, c), equal_power_scale(a, c)
        assert np.multiply(astuple(one), astuple(two)) == pytest.approx(astuple(both))
        assert equal_power_scale(a, a) == EqualPowerScale(1.0, 1.0, 1.0)

    @pytest.mark.parametrize(
        ("z", "reference", "length", "speed", "displacement"),
        [
            (1, 4, 2.0, 0.5, 2.0),
            (4, 1, 0.5, 2.0, 0.5),
            (2, 8, 2.0, 0.5, 2.0),
            (6, 4, math.sqrt(2 / 3), math.sqrt(1.5), None),
        ],
    )
    def test_numbers(self, z: int, reference: int, length: float, speed: float, displacement: float | None) -> None:
        """A single of the power of a four has twice its bore, half its speed and twice its displacement."""
        scale = equal_power_scale(z, reference)
        assert (scale.length, scale.speed) == pytest.approx((length, speed))
        if displacement is not None:
            assert z / reference * scale.length**3 == pytest.approx(displacement)


@pytest.mark.parametrize("z", [1, 2, 6])
def test_loads_of_similar_cylinders(z: int) -> None:
    """Forces and moments of one cylinder, gas and inertia together, scale as eq. (23) says."""
    scale = equal_power_scale(z, 4)
    part = SliderCrank("c", 0.1, 0.06, 0.06 / 0.26, 1.25, rod_inertia_deficit=-0.004, rotating_mass=0.4, bore=0.1)
    lengths = ("x", "crank_radius", "rod_length", "bore")
    similar = replace(
        part,
        **{name: scale.length * getattr(part, name) for name in lengths},
        reciprocating_mass=scale.mass * part.reciprocating_mass,
        rotating_mass=scale.mass * part.rotating_mass,
        rod_inertia_deficit=scale.mass * scale.length**2 * part.rod_inertia_deficit,
    )
    gas = Seiliger(78.5e5, 5.4e5)
    fidelity = Fidelity(samples=288)
    one = shaking_loads(Engine("one", Cycle.FOUR_STROKE, (part,)), OperatingPoint("p", 260.0, gas), fidelity)
    other = shaking_loads(
        Engine("other", Cycle.FOUR_STROKE, (similar,)), OperatingPoint("p", 260.0 * scale.speed, gas), fidelity
    )
    factors = scale.length**2 * np.array([1.0, 1.0, 1.0, *[scale.length] * 3])
    size = np.abs(one.coefficients).max()
    np.testing.assert_allclose(other.coefficients / factors, one.coefficients, rtol=0.0, atol=1e-11 * size)
