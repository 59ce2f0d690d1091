"""Printed formulas of a textbook on piston machines for the rotary engine."""

from __future__ import annotations

import math

import numpy as np
import pytest

from laufruhe.extensions.rotary.unit import RotaryUnit
from laufruhe.machine import Cycle, Engine, Seiliger
from laufruhe.physics.gas_loads import gas_loads
from one_cylinder import rotating_loads


class TestRotary:
    """Chapters 2.2, 2.4, 2.5.2, 11.1: rotary engine at the book's shaft angle."""

    unit = RotaryUnit("rotor", 0.0, 0.015, math.inf, 0.0, rotating_mass=6.0, rotor_radius=0.105, rotor_width=0.08)

    def test_displacement(self) -> None:
        """Check the factor 3 sqrt(3), where eq. 103 prints 5.2 e R b."""
        assert self.unit.displacement == pytest.approx(5.2 * 0.015 * 0.105 * 0.08, rel=1e-3)

    def test_rotating_force(self) -> None:
        """Check eq. 13, (m_k + m_e) e w^2, a free force that page 2 denies."""
        engine = Engine("rotary", Cycle.TWO_STROKE, (self.unit,))
        (force,) = np.abs(rotating_loads(engine, 600.0).coefficients[1:, 2])
        assert force == pytest.approx(6.0 * 0.015 * 600.0**2, rel=1e-12)

    @pytest.mark.parametrize("degrees", [0, 90, 200, 360, 700, 1000])
    def test_tangential_and_radial_force(self, degrees: int) -> None:
        """Check eqs. 21, 22: T = -F sin(2 phi/3), R = -F cos(2 phi/3), phi from the largest volume."""
        turned = math.radians(degrees)
        push = -complex(self.unit.lean(np, turned + 1.5 * math.pi))
        # seen from the eccentric, which is turned by phi from where the chamber fires
        seen = push * np.exp(-1j * (turned + 1.5 * math.pi))
        assert seen.imag == pytest.approx(-math.sin(2.0 * turned / 3.0), abs=1e-12)
        assert -seen.real == pytest.approx(-math.cos(2.0 * turned / 3.0), abs=1e-12)

    def test_torque_is_that_of_three_tangential_forces(self) -> None:
        """Compare eq. 23, chambers at 0, 360 and 720 degrees, with the work of the gas."""
        gas = Seiliger(compression_ratio=9.0, imep=9e5, peak_pressure=5e6)
        turned = np.linspace(0.1, 6.1, 7)
        torque = np.zeros(len(turned))
        for ahead in (0.0, math.tau, 2.0 * math.tau):
            phi = turned + 0.5 * math.pi + ahead
            force = gas.pressure(self.unit, Cycle.TWO_STROKE, phi - 1.5 * math.pi) - gas.crankcase_pressure
            torque -= 0.015 * force * self.unit.piston_area * np.sin(2.0 * phi / 3.0)
        engine = Engine("rotary", Cycle.TWO_STROKE, (self.unit,))
        result = gas_loads(engine, gas).values(turned - math.pi)[:, 3]
        np.testing.assert_allclose(result, torque, rtol=1e-4)

    @pytest.mark.parametrize("degrees", [0, 77, 400, 1000])
    def test_speed_and_acceleration_of_an_apex(self, degrees: int) -> None:
        """Check eqs. 8, 9 against the largest values, reached with apex and eccentric in line."""
        w, phi = 600.0, math.radians(degrees)
        speed = w * math.hypot(
            0.015 * math.sin(phi) + 0.035 * math.sin(phi / 3), 0.015 * math.cos(phi) + 0.035 * math.cos(phi / 3)
        )
        acceleration = w**2 * math.hypot(
            0.015 * math.cos(phi) + 0.105 / 9 * math.cos(phi / 3), 0.015 * math.sin(phi) + 0.105 / 9 * math.sin(phi / 3)
        )
        largest = w * self.unit.apex_speed, w**2 * self.unit.apex_acceleration
        assert speed <= largest[0] * (1.0 + 1e-12)
        assert acceleration <= largest[1] * (1.0 + 1e-12)
        if degrees == 0:
            assert (speed, acceleration) == pytest.approx(largest)
