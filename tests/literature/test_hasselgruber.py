"""H. Hasselgruber, "Massnahmen zur Verbesserung der Laufruhe von Verbrennungskraftmaschinen, insbesondere von
Schleppermotoren", lecture at the 22nd Tagung der Landmaschinen-Konstrukteure, Braunschweig 1964. Eqs. (14) to (35).

Balancer unbalances: with the sizes that the paper prints, what they are for is gone. Sizes are taken from the
equations, angles from the crank star: U_A removes the half of an oscillating couple that turns against the crank,
counterweights on the crank the half that turns with it. The study's kinematics have two orders.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from numpy.typing import NDArray

from laufruhe.machine import CRANKSHAFT, Cycle, Engine, OperatingPoint, Role, Rotor, Shaft
from laufruhe.machine.firing import firing_turns, intervals_of
from laufruhe.machine.layouts import Layout, boxer, build, inline, stations, vee
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.order_coefficients import inertia_roll_orders, piston_acceleration_orders
from laufruhe.physics.shaking_loads import rotor_loads, shaking_loads
from laufruhe.studies.equal_power import equal_power_scale
from mechanisms import mechanism_of

TWO_ORDER = Fidelity(kinematics="two-order")
# Figs. 2, 5 and 12: s = 120 mm, m_osc = 1.25 kg, n = 2500 rpm, a = 125 mm; lambda is not printed
RADIUS, MASS, SPACING, SPEED = 0.060, 1.25, 0.125, 2500 * math.tau / 60
RATIO = 0.26
FORCE = MASS * RADIUS * SPEED**2
ROUNDING = 2e-14
QUARTER = 0.5 * math.pi

by_kinematics = pytest.mark.parametrize("fidelity", [TWO_ORDER, EXACT], ids=lambda fidelity: fidelity.kinematics)


def _engine(
    layout: Layout, throws: tuple[float, ...], *rotors: Rotor, cycle: Cycle = Cycle.FOUR_STROKE, offset: float = 0.0
) -> Engine:
    mechanism = mechanism_of(RADIUS, RADIUS / RATIO, MASS, offset=offset)
    cylinders, _ = build(cycle, layout, mechanism, throws)
    return Engine(layout.name, cycle, cylinders, rotors)


def _loads(engine: Engine, fidelity: Fidelity = TWO_ORDER) -> Spectrum:
    return shaking_loads(engine, OperatingPoint("2500 rpm", SPEED), fidelity)


def _star(throws: tuple[float, ...]) -> complex:
    """Return the couple star of an inline engine, sum of x_k e^{i theta_k}, in distances of cylinders."""
    places = stations(len(throws), 1.0)
    return sum(x * cmath.exp(1j * theta) for x, theta in zip(places, throws, strict=True))


def _couple(name: str, shaft: Shaft, apart: float, unbalance: complex, role: Role) -> tuple[Rotor, Rotor]:
    """Return the two opposite unbalances on a shaft, a distance apart, about the middle of the engine."""
    return (
        Rotor(f"{name} front", 0.5 * apart, unbalance, shaft, role),
        Rotor(f"{name} rear", -0.5 * apart, -unbalance, shaft, role),
    )


# throws, printed root of U_A s = m_osc r / 2 a sqrt(n), equation
FIRST_ORDER_SHAFTS = [
    pytest.param(Cycle.FOUR_STROKE, (0.0, math.pi), 1.0, id="two-cylinder, eq. 24"),
    pytest.param(Cycle.FOUR_STROKE, (0.0, -2 * math.tau / 3, -math.tau / 3), math.sqrt(3), id="three-cylinder, eq. 25"),
    pytest.param(Cycle.TWO_STROKE, (0.0, math.pi, QUARTER, -QUARTER), math.sqrt(2), id="two-stroke four, eq. 30"),
    pytest.param(Cycle.TWO_STROKE, (0.0, QUARTER, -QUARTER, math.pi), math.sqrt(10), id="two-stroke four, eq. 31"),
]


class TestFirstOrderShaft:
    """Figs. 14, 16, 26, 27: one shaft against the crank at its speed, with two unbalances U_A a distance s apart."""

    apart = 0.410
    shaft = Shaft("balancer", ratio=-1.0, y=0.11, z=-0.07)

    def balanced(self, cycle: Cycle, throws: tuple[float, ...], root: float, scale: float = 1.0) -> Engine:
        unbalance = scale * 0.5 * MASS * RADIUS * SPACING * root / self.apart
        star = _star(throws)
        along = star / abs(star)
        weights = _couple("weight", CRANKSHAFT, self.apart, -unbalance * along, Role.COUNTERWEIGHT)
        balancer = _couple("balancer", self.shaft, self.apart, -unbalance * along.conjugate(), Role.BALANCER)
        return _engine(inline(len(throws), SPACING), throws, *weights, *balancer, cycle=cycle)

    @by_kinematics
    @pytest.mark.parametrize(("cycle", "throws", "root"), FIRST_ORDER_SHAFTS)
    def test_removes_all_of_first_order(
        self, cycle: Cycle, throws: tuple[float, ...], root: float, fidelity: Fidelity
    ) -> None:
        """Force and couple of first order vanish; the first order of an engine without offset has no higher terms."""
        bare = _loads(_engine(inline(len(throws), SPACING), throws, cycle=cycle), fidelity)
        assert abs(bare.at(1)[4]) == pytest.approx(root * FORCE * SPACING, rel=1e-13)
        left = _loads(self.balanced(cycle, throws, root), fidelity).at(1)
        assert (left[:3] == 0.0).all()
        assert np.abs(left[4:]).max() <= ROUNDING * FORCE * SPACING

    @pytest.mark.parametrize(("cycle", "throws", "root"), FIRST_ORDER_SHAFTS)
    def test_each_half_is_needed(self, cycle: Cycle, throws: tuple[float, ...], root: float) -> None:
        """The crank's weights alone leave half of the couple, turning against the crank; 1 % more or less shows."""
        engine = self.balanced(cycle, throws, root)
        weights_only = replace(engine, rotors=engine.rotors[:2])
        left = _loads(weights_only).at(1)
        half = 0.5 * root * FORCE * SPACING
        assert abs(left[4]) == pytest.approx(half, rel=1e-13)
        # My + i Mz of a couple that turns backwards
        assert abs(left[4] - 1j * left[5]) <= ROUNDING * FORCE * SPACING
        detuned = _loads(self.balanced(cycle, throws, root, scale=1.01)).at(1)
        assert abs(detuned[4]) == pytest.approx(0.02 * half, rel=1e-9)

    def test_second_order_remains_on_the_two_cylinder(self) -> None:
        """Text below eq. 24: the free force of second order is not touched, 2 m r lambda w^2."""
        left = _loads(self.balanced(Cycle.FOUR_STROKE, (0.0, math.pi), 1.0)).at(2)
        assert abs(left[2]) == pytest.approx(2 * RATIO * FORCE, rel=1e-14)

    @by_kinematics
    def test_two_cylinder_with_its_shaft_is_as_a_four(self, fidelity: Fidelity) -> None:
        """Text above the three-cylinder: each order of a four is twice that of a two with its shaft."""
        two = _loads(self.balanced(Cycle.FOUR_STROKE, (0.0, math.pi), 1.0), fidelity)
        four = _loads(_engine(inline(4, SPACING), (0.0, math.pi, math.pi, 0.0)), fidelity)
        for order in range(1, 7):
            assert 2.0 * two.at(order) == pytest.approx(four.at(order), abs=ROUNDING * FORCE)

    def test_two_cylinder_fires_evenly_as_a_two_stroke_alone(self) -> None:
        """Text on the two-stroke two: intervals of 180 deg, against 180 and 540 deg of the four-stroke."""
        layout, throws, order = inline(2, SPACING), (0.0, math.pi), (1, 2)
        turns = firing_turns(layout, throws, order)
        assert intervals_of(Cycle.TWO_STROKE, turns) == pytest.approx((math.pi, math.pi))
        assert sorted(intervals_of(Cycle.FOUR_STROKE, turns)) == pytest.approx([math.pi, 3.0 * math.pi])

    def test_second_order_couple_remains_on_the_three_cylinder(self) -> None:
        """Text below eq. 25: a free couple of second order remains, that star's sqrt(3)."""
        throws = (0.0, -2 * math.tau / 3, -math.tau / 3)
        left = _loads(self.balanced(Cycle.FOUR_STROKE, throws, math.sqrt(3))).at(2)
        assert (left[:3] == 0.0).all()
        assert abs(left[4]) == pytest.approx(math.sqrt(3) * RATIO * FORCE * SPACING, rel=1e-13)


class TestTwoStrokeFour:
    """Figs. 26 and 27: the cross-shaped crank of the two-stroke four-cylinder."""

    def couples(self, throws: tuple[float, ...]) -> tuple[float, float]:
        loads = _loads(_engine(inline(4, SPACING), throws, cycle=Cycle.TWO_STROKE))
        assert (loads.at(1)[:3] == 0.0).all()
        assert (loads.at(2)[:3] == 0.0).all()
        unit = FORCE * SPACING
        return abs(loads.at(1)[4]) / unit, abs(loads.at(2)[4]) / (RATIO * unit)

    def test_best_star_without_a_shaft(self) -> None:
        """Text below eq. 30: Fig. 26 is the cross of the least couple of first order; one of second remains."""
        every = [self.couples((0.0, *rest)) for rest in permutations((QUARTER, math.pi, -QUARTER))]
        minimum = min(every)
        assert minimum == pytest.approx((math.sqrt(2), 4.0), rel=1e-13)
        assert self.couples((0.0, math.pi, QUARTER, -QUARTER)) == pytest.approx(minimum, rel=1e-13)

    def test_best_star_with_a_shaft(self) -> None:
        """Text below eq. 31: the cross of Fig. 27 alone is free of second order; its first order is the largest."""
        every = {rest: self.couples((0.0, *rest)) for rest in permutations((QUARTER, math.pi, -QUARTER))}
        free = [rest for rest, (_, second) in every.items() if second == 0.0]
        assert sorted(free) == sorted([(QUARTER, -QUARTER, math.pi), (-QUARTER, QUARTER, math.pi)])
        assert all(every[rest][0] == pytest.approx(math.sqrt(10), rel=1e-13) for rest in free)
        assert max(first for first, _ in every.values()) == pytest.approx(math.sqrt(10), rel=1e-13)


class TestFourCylinder:
    """Figs. 18 to 24: shafts of twice the crank's speed under the four-cylinder, firing order 1-3-4-2."""

    throws = (0.0, math.pi, math.pi, 0.0)

    def engine(self, *rotors: Rotor) -> Engine:
        return _engine(inline(4, SPACING), self.throws, *rotors)

    def lanchester(self, unbalance: float) -> tuple[Rotor, ...]:
        shafts = (Shaft("with", 2.0, y=0.06, z=-0.10), Shaft("against", -2.0, y=-0.06, z=-0.10))
        return tuple(Rotor(f"force {s.name}", 0.0, -unbalance, s, Role.BALANCER) for s in shafts)

    def moment_pair(self, unbalance: float, apart: float) -> tuple[Rotor, Rotor]:
        """Return two opposite unbalances that turn with the crank side by side, along their distance at phi = 0.

        The engine's roll moment goes with sin 2 phi.
        """
        left, right = Shaft("left", 2.0, y=0.5 * apart, z=0.03), Shaft("right", 2.0, y=-0.5 * apart, z=0.03)
        return (
            Rotor("moment left", 0.26, -1j * unbalance, left, Role.BALANCER),
            Rotor("moment right", 0.26, 1j * unbalance, right, Role.BALANCER),
        )

    @by_kinematics
    def test_first_order_is_balanced_by_the_crank(self, fidelity: Fidelity) -> None:
        loads = _loads(self.engine(), fidelity).at(1)
        assert (loads == 0.0).all()

    def test_lanchester(self) -> None:
        """Eq. 26: U_Kr = m_osc r lambda / 2 of each shaft removes the force of second order and adds no other load."""
        left = _loads(self.engine(*self.lanchester(0.5 * MASS * RADIUS * RATIO))).at(2)
        bare = _loads(self.engine()).at(2)
        assert abs(bare[2]) == pytest.approx(4 * RATIO * FORCE, rel=1e-14)
        assert np.abs(left[:3]).max() <= ROUNDING * abs(bare[2])
        assert np.abs(left[3:] - bare[3:]).max() <= ROUNDING * abs(bare[2]) * SPACING

    def test_lanchester_of_the_exact_mechanism(self) -> None:
        """Check eq. 26 with exact kinematics, where lambda becomes lambda + lambda^3/4 + ...

        The printed size leaves 1.8 % of the force at this rod.
        """
        second = abs(piston_acceleration_orders(RATIO, 0.0, 2)[2])
        bare = abs(_loads(self.engine(), EXACT).at(2)[2])
        exact = _loads(self.engine(*self.lanchester(0.5 * MASS * RADIUS * second)), EXACT).at(2)
        printed = _loads(self.engine(*self.lanchester(0.5 * MASS * RADIUS * RATIO)), EXACT).at(2)
        assert np.abs(exact[:3]).max() <= ROUNDING * bare
        assert abs(printed[2]) == pytest.approx(4 * FORCE * (RATIO**3 / 4 + 15 * RATIO**5 / 128), rel=0.02)
        assert abs(printed[2]) > 0.015 * bare

    @pytest.mark.parametrize("apart", [0.12, 0.30])
    def test_moment_pair(self, apart: float) -> None:
        """Eq. 27: U_Mom x = m_osc r^2 / 2 removes the roll moment of second order and adds no force or couple."""
        left = _loads(self.engine(*self.moment_pair(0.5 * MASS * RADIUS**2 / apart, apart))).at(2)
        bare = _loads(self.engine()).at(2)
        assert abs(bare[3]) == pytest.approx(2 * FORCE * RADIUS, rel=1e-14)
        assert abs(left[3]) <= ROUNDING * abs(bare[3])
        assert np.abs(np.delete(left - bare, 3)).max() <= ROUNDING * FORCE

    def test_moment_pair_of_the_exact_mechanism(self) -> None:
        """Check eq. 27 with exact kinematics, where the half becomes 1/2 + lambda^4/32 + ..."""
        half = abs(inertia_roll_orders(RATIO, 0.0, 1.0, 2)[2])
        assert half - 0.5 == pytest.approx(RATIO**4 / 32, rel=0.1)
        left = _loads(self.engine(*self.moment_pair(half * MASS * RADIUS**2 / 0.2, 0.2)), EXACT).at(2)
        assert abs(left[3]) <= ROUNDING * FORCE * RADIUS

    def test_share_of_the_moment_pair(self) -> None:
        """Eq. 28: U_Mom = m_osc r^2 / (2 x) Phi takes the share Phi = 50 % of the inertia's moment."""
        share, apart = 0.5, 0.2
        left = _loads(self.engine(*self.moment_pair(0.5 * MASS * RADIUS**2 / apart * share, apart))).at(2)
        assert left[3] == pytest.approx((1 - share) * _loads(self.engine()).at(2)[3], rel=1e-13)

    def test_force_and_moment_from_one_pair(self) -> None:
        """Fig. 24, eq. 29: two unbalances 0.72 U_Kr against each other, one above the other by 0.7 r / lambda, give
        72 % of the force and 0.72 0.7 m_osc r^2 / 2, "0.25 m_osc r^2", of the moment. 0.25 is 0.252 to two digits."""
        apart = 0.7 * RADIUS / RATIO
        unbalance = 0.72 * 0.5 * MASS * RADIUS * RATIO
        shafts = (Shaft("above", 2.0, z=0.5 * apart), Shaft("below", -2.0, z=-0.5 * apart))
        pair = tuple(Rotor(s.name, 0.0, -unbalance, s, Role.BALANCER) for s in shafts)
        bare, left = _loads(self.engine()).at(2), _loads(self.engine(*pair)).at(2)
        assert left[2] == pytest.approx((1 - 0.72) * bare[2], rel=1e-13)
        assert abs(left[1]) <= ROUNDING * FORCE
        made = (bare[3] - left[3]) / bare[3]
        assert made == pytest.approx(0.72 * 0.7, rel=1e-13)
        # the moment of the whole engine is 2 m r^2 w^2 and a pair at twice the speed makes 4 w^2 times U x
        moment = rotor_loads(pair, SPEED, Cycle.FOUR_STROKE).at(2)[3]
        assert abs(moment) / (4 * MASS * RADIUS**2 * SPEED**2) == pytest.approx(0.25, abs=0.005)


def _turning_parts(wrench: NDArray[np.complex128]) -> tuple[float, float]:
    """Return the amplitudes of the parts of a force that turn with and against the crank (R_Ir and R_Il of Fig. 29)."""
    return abs(wrench[2] + 1j * wrench[1]) / 2, abs(wrench[2] - 1j * wrench[1]) / 2


class TestVee:
    """Fig. 29, eqs. 32 to 35: two cylinders on one throw at the angle alpha."""

    def engine(self, degrees: float, *rotors: Rotor) -> Engine:
        return _engine(vee(2, SPACING, math.radians(degrees)), (0.0,), *rotors)

    @by_kinematics
    @pytest.mark.parametrize("degrees", [15, 45, 60, 75, 90, 120, 180])
    def test_first_order_parts(self, degrees: float, fidelity: Fidelity) -> None:
        """Eqs. 32, 33: P_I = m_osc r w^2 split into halves: R_Ir = P_I at any angle, R_Il = P_I |cos alpha|."""
        forward, backward = _turning_parts(_loads(self.engine(degrees), fidelity).at(1))
        assert forward == pytest.approx(FORCE, rel=1e-14)
        assert backward == pytest.approx(FORCE * abs(math.cos(math.radians(degrees))), rel=1e-13, abs=ROUNDING * FORCE)

    @by_kinematics
    def test_right_angle_is_balanced_by_a_crank_weight(self, fidelity: Fidelity) -> None:
        """R_Il vanishes at 90 deg, so that a weight m_osc r on the crank removes the whole first order."""
        weight = Rotor("weight", 0.0, -MASS * RADIUS)
        left = _loads(self.engine(90, weight), fidelity).at(1)
        assert np.abs(np.delete(left, 3)).max() <= ROUNDING * FORCE
        others = _loads(self.engine(75, weight), fidelity).at(1)
        assert np.linalg.norm(others[1:3]) > 0.1 * FORCE

    @by_kinematics
    def test_second_order_of_a_flat_shared_throw_vanishes(self, fidelity: Fidelity) -> None:
        """Eqs. 34, 35, lower part of Fig. 29: at 180 deg on one throw R_II is zero, and so is every even order."""
        loads = _loads(self.engine(180), fidelity)
        for order in (2, 4, 6):
            assert (loads.at(order)[:3] == 0.0).all()
        assert np.linalg.norm(_loads(self.engine(90), fidelity).at(2)[1:3]) > 0.3 * FORCE

    @by_kinematics
    def test_v8_on_the_cross_of_fig_27(self, fidelity: Fidelity) -> None:
        """Text below eq. 33: second order is balanced from the V8 on, with the crank of Fig. 27."""
        throws = (0.0, QUARTER, -QUARTER, math.pi)
        loads = _loads(_engine(vee(8, SPACING, QUARTER), throws), fidelity)
        assert (np.delete(loads.at(2), 3) == 0.0).all()
        assert (loads.at(1)[:3] == 0.0).all()
        weights = _couple("weight", CRANKSHAFT, 0.4, -MASS * RADIUS * SPACING * _star(throws) / 0.4, Role.COUNTERWEIGHT)
        left = _loads(_engine(vee(8, SPACING, QUARTER), throws, *weights), fidelity).at(1)
        assert np.abs(left[4:]).max() <= ROUNDING * FORCE * SPACING * math.sqrt(10)


class TestBoxerAgainstInline:
    """Fig. 30: four cylinders, four-stroke, in line and opposed on throws set off by 180 deg."""

    stagger = 0.055

    @by_kinematics
    @pytest.mark.parametrize("offset", [0.0, 0.008])
    def test_boxer(self, fidelity: Fidelity, offset: float) -> None:
        """Both orders leave no force, the second a couple about the upright axis: M_II = 2 P_II times the stagger."""
        throws = (0.0, math.pi, math.pi, 0.0)
        loads = _loads(_engine(boxer(4, SPACING, self.stagger), throws, offset=offset), fidelity)
        assert (loads.at(1)[:3] == 0.0).all()
        assert (loads.at(2)[:3] == 0.0).all()
        assert np.abs(loads.at(1)[4:]).max() <= ROUNDING * FORCE * SPACING
        couple = loads.at(2)[4:]
        second = abs(piston_acceleration_orders(RATIO, offset * RATIO / RADIUS, 2)[2]) if fidelity is EXACT else RATIO
        assert couple[0] == 0.0
        assert abs(couple[1]) == pytest.approx(2 * second * FORCE * self.stagger, rel=1e-13)

    @by_kinematics
    def test_inline(self, fidelity: Fidelity) -> None:
        """First order balanced, second adds up to R_II = 4 P_II, without a couple."""
        loads = _loads(_engine(inline(4, SPACING), (0.0, math.pi, math.pi, 0.0)), fidelity)
        assert (loads.at(1) == 0.0).all()
        second = abs(piston_acceleration_orders(RATIO, 0.0, 2)[2]) if fidelity is EXACT else RATIO
        assert abs(loads.at(2)[2]) == pytest.approx(4 * second * FORCE, rel=1e-13)
        assert (loads.at(2)[4:] == 0.0).all()


class TestEqualPower:
    """Eqs. 14 to 23: engines of z similar cylinders with the same power, brake pressure and piston speed."""

    reference = 4

    @pytest.mark.parametrize("cylinders", [1, 2, 3, 4, 6])
    def test_power_and_piston_speed_are_invariant(self, cylinders: int) -> None:
        """Eqs. 14 to 17: power z D^2 s n and piston speed s n stay, and with them z D^2."""
        scale, share = equal_power_scale(cylinders, self.reference), cylinders / self.reference
        assert share * scale.length**2 * scale.length * scale.speed == pytest.approx(1.0, rel=1e-15)
        assert scale.length * scale.speed == pytest.approx(1.0, rel=1e-15)
        assert share * scale.length**2 == pytest.approx(1.0, rel=1e-15)

    @pytest.mark.parametrize("cylinders", [1, 2, 3, 4, 6])
    def test_exponents(self, cylinders: int) -> None:
        """Eqs. 18 to 23: D and s as z^-1/2, n as z^1/2, V_h1 as z^-3/2, V_h,ges as z^-1/2, forces as D^2 or 1/z."""
        scale, z = equal_power_scale(cylinders, self.reference), cylinders / self.reference
        volume = scale.length**3
        printed = (
            (scale.length, -0.5),
            (scale.speed, 0.5),
            (volume, -1.5),
            (z * volume, -0.5),
            (scale.length**2, -1.0),
        )
        for factor, exponent in printed:
            assert factor == pytest.approx(z**exponent, rel=1e-14)

    def test_forces_against_figure_12(self) -> None:
        """Text below eq. 23: with four cylinders for reference the forces of two and three rise, those of six fall."""
        forces = [equal_power_scale(z, self.reference).length ** 2 for z in (2, 3, 4, 6)]
        assert forces == pytest.approx([2, 4 / 3, 1, 2 / 3])

    @pytest.mark.parametrize("cylinders", [1, 2, 3, 6])
    def test_scaled_engine_has_the_scaled_loads(self, cylinders: int) -> None:
        """Eq. 23 holds for inertia: with lengths, masses and speed scaled, an engine shakes with the scaled force."""
        scale = equal_power_scale(cylinders, self.reference)
        throws = (0.0, 0.7, 2.0)
        mechanism = mechanism_of(
            RADIUS, RADIUS / RATIO, MASS, rod_rotating_mass=0.8, rod_inertia_deficit=-4.2e-4, offset=0.004
        )
        small = mechanism_of(
            RADIUS * scale.length,
            RADIUS / RATIO * scale.length,
            MASS * scale.mass,
            rod_rotating_mass=0.8 * scale.mass,
            rod_inertia_deficit=-4.2e-4 * scale.mass * scale.length**2,
            offset=0.004 * scale.length,
        )
        loads = []
        for part, size, speed in ((mechanism, 1.0, SPEED), (small, scale.length, SPEED * scale.speed)):
            cylinder_list, _ = build(Cycle.FOUR_STROKE, inline(3, SPACING * size), part, throws)
            engine = Engine("three", Cycle.FOUR_STROKE, cylinder_list)
            loads.append(shaking_loads(engine, OperatingPoint("speed", speed)))
        for order in (1, 2, 3, 4):
            reference, scaled = (spectrum.at(order) for spectrum in loads)
            np.testing.assert_allclose(scaled[:3], reference[:3] * scale.length**2, rtol=1e-12, atol=1e-12 * FORCE)
            np.testing.assert_allclose(
                scaled[3:], reference[3:] * scale.length**3, rtol=1e-12, atol=1e-12 * FORCE * SPACING
            )
