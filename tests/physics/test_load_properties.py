"""Laws that the shaking loads of every engine obey, tried on random engines.

Engines are drawn from rigid bodies (pistons, rods, pins, rotors), so that loads can be
compared with the change of momentum and angular momentum of those bodies.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from laufruhe.extensions.recorded_pressure.gas import PressureTrace
from laufruhe.machine import CRANKSHAFT, Cycle, Engine, OperatingPoint, Rod, Rotor, Seiliger, Shaft, SliderCrank
from laufruhe.numerics.exact_angles import as_turn, cis
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.gas_loads import gas_loads
from laufruhe.physics.shaking_loads import (
    EXACT,
    Fidelity,
    reciprocating_loads,
    shaking_loads,
)
from one_cylinder import rod_inertia_loads, rotating_loads

SPEED = 260.0
GAS = Seiliger(peak_pressure=78.5e5, imep=5.4e5)
COARSE = Fidelity(samples=144)
STROKES = {Cycle.TWO_STROKE: 1, Cycle.FOUR_STROKE: 2}


@dataclass(frozen=True)
class Bodies:
    """Rigid bodies of a cylinder; the rod is None for a Scotch yoke."""

    part: SliderCrank
    piston_mass: float
    rod: Rod | None


@dataclass(frozen=True)
class Scene:
    """An engine and the bodies that it was made of."""

    engine: Engine
    bodies: tuple[Bodies, ...]


ANGLES = st.one_of(
    st.integers(-360, 720).map(lambda degrees: math.radians(degrees)), st.floats(-6.0, 6.0, allow_subnormal=False)
)
PLACES = st.floats(-0.5, 0.5).map(lambda x: round(x, 6))


@st.composite
def bodies(draw: st.DrawFn, cycle: Cycle, shafts: Sequence[Shaft], number: int, alike: tuple[float, ...]) -> Bodies:
    """Return a cylinder at its own place; with `alike` the mechanism is that of the other cylinders."""
    radius, rod_ratio, offset_share, piston, mass, gravity, inertia = alike or draw(mechanisms())
    shaft, throw, bank = draw(st.sampled_from(shafts)), draw(ANGLES), draw(ANGLES)
    rod = Rod(radius / rod_ratio, mass, gravity * radius / rod_ratio, inertia) if rod_ratio else None
    dead_centre, between = (bank - throw) / shaft.ratio, 1.0 / abs(shaft.ratio)
    turns = draw(st.integers(0, STROKES[cycle] - 1))
    part = SliderCrank(
        f"cylinder {number}",
        x=draw(PLACES) + 2.0 * number,
        crank_radius=radius,
        rod_length=rod.length if rod else math.inf,
        reciprocating_mass=piston + (rod.reciprocating_mass if rod else 0.0),
        throw=throw,
        bank=bank,
        offset=offset_share * (rod.length - radius) if rod else 0.0,
        rotating_mass=rod.rotating_mass if rod else 0.0,
        rod_inertia_deficit=rod.inertia_deficit if rod else 0.0,
        bore=0.1,
        firing_angle=math.tau * ((dead_centre / math.tau) % between + turns * between),
        shaft=shaft,
    )
    return Bodies(part, piston, rod)


@st.composite
def mechanisms(draw: st.DrawFn) -> tuple[float, ...]:
    """Draw radius, rod ratio (0 a yoke), share of offset, masses of piston and rod, centre of gravity, inertia."""
    return (
        draw(st.floats(0.02, 0.2)),
        draw(st.one_of(st.just(0.0), st.floats(0.05, 0.6))),
        draw(st.one_of(st.just(0.0), st.floats(-0.6, 0.6))),
        draw(st.floats(0.0, 3.0).map(lambda mass: round(mass, 9))),
        draw(st.floats(0.1, 3.0)),
        draw(st.floats(0.05, 0.95)),
        draw(st.floats(1e-4, 0.1)),
    )


@st.composite
def scenes(draw: st.DrawFn, ratios: Sequence[float] = (-1.0,)) -> Scene:
    """Return the up to five cylinders, alike or each its own, on one crank or two, and up to three rotors.

    The second crank has one of the `ratios`, and with half ratios the cycle four strokes.
    """
    halves = any(ratio % 1.0 for ratio in ratios)
    cycle = Cycle.FOUR_STROKE if halves else draw(st.sampled_from(Cycle))
    geared = Shaft("geared crank", draw(st.sampled_from(ratios)), draw(PLACES), draw(PLACES))
    shafts = [CRANKSHAFT, geared][: draw(st.integers(1, 2))]
    alike = draw(st.one_of(st.just(()), mechanisms()))
    cylinders = tuple(draw(bodies(cycle, shafts, k + 1, alike)) for k in range(draw(st.integers(1, 5))))
    rotors = tuple(
        Rotor(
            f"rotor {k}",
            draw(PLACES),
            cmath.rect(draw(st.floats(1e-3, 0.1)), draw(ANGLES)),
            Shaft(f"shaft {k}", draw(st.sampled_from([1.0, -1.0, 2.0, -2.0, *ratios])), draw(PLACES), draw(PLACES)),
        )
        for k in range(draw(st.integers(0, 3)))
    )
    return Scene(Engine("random", cycle, tuple(b.part for b in cylinders), rotors), cylinders)


def loads_of(engine: Engine, gas: Seiliger | None = None, speed: float = SPEED) -> Spectrum:
    return shaking_loads(engine, OperatingPoint("any", speed, gas), COARSE)


def of_parts(engine: Engine, change: Callable[[SliderCrank], SliderCrank]) -> Engine:
    return replace(engine, slider_cranks=tuple(change(part) for part in engine.slider_cranks))


def assert_same(found: Spectrum, expected: NDArray[np.complex128], tolerance: float = 1e-12) -> None:
    """Check that coefficients agree within rounding of the largest load; positions are in metres."""
    size = max(float(np.abs(expected).max()), float(np.abs(found.coefficients).max()))
    length = max(len(expected), len(found.coefficients))

    def padded(c: NDArray[np.complex128]) -> NDArray[np.complex128]:
        return np.concatenate([c, np.zeros((length - len(c), 6))])

    np.testing.assert_allclose(padded(found.coefficients), padded(expected), rtol=0.0, atol=tolerance * size)


class TestSymmetry:
    @given(scenes(), st.randoms(use_true_random=False))
    def test_relabelling_changes_nothing(self, scene: Scene, random: object) -> None:
        """Cylinders and rotors are a set: their order is a matter of names."""
        engine = scene.engine
        parts, rotors = list(engine.slider_cranks), list(engine.rotors)
        random.shuffle(parts)  # type: ignore[attr-defined]
        random.shuffle(rotors)  # type: ignore[attr-defined]
        renamed = tuple(replace(part, name=f"other {k}") for k, part in enumerate(parts))
        other = replace(engine, slider_cranks=renamed, rotors=tuple(rotors))
        assert_same(loads_of(other, GAS), loads_of(engine, GAS).coefficients)

    @given(scenes(), ANGLES)
    def test_turning_the_crank_reference_shifts_every_order(self, scene: Scene, delta: float) -> None:
        """Counting phi from delta onwards turns order h by e^{i h delta}, gas and half orders included."""
        engine = scene.engine

        def turned(part: SliderCrank) -> SliderCrank:
            later = (part.firing_angle - delta) % engine.cycle.angle
            return replace(part, throw=part.throw + part.shaft.ratio * delta, firing_angle=later)

        rotors = tuple(replace(r, unbalance=r.unbalance * cmath.exp(1j * r.shaft.ratio * delta)) for r in engine.rotors)
        result = loads_of(replace(of_parts(engine, turned), rotors=rotors), GAS)
        before = loads_of(engine, GAS)
        phases = np.exp(1j * delta * before.orders)[:, None]
        assert_same(result, before.coefficients * phases, 1e-10)

    @given(scenes(), PLACES, PLACES, PLACES)
    def test_moving_the_engine_adds_r_cross_f(self, scene: Scene, dx: float, dy: float, dz: float) -> None:
        """The same engine about another origin: forces stay, moments gain d x F."""
        engine = scene.engine

        def moved(shaft: Shaft) -> Shaft:
            return replace(shaft, name=f"moved {shaft.name}", y=shaft.y + dy, z=shaft.z + dz)

        shifted = replace(
            of_parts(engine, lambda part: replace(part, x=part.x + dx, shaft=moved(part.shaft))),
            rotors=tuple(replace(r, x=r.x + dx, shaft=moved(r.shaft)) for r in engine.rotors),
        )
        expected = loads_of(engine, GAS).coefficients.copy()
        expected[:, 3:] += np.cross(np.array([dx, dy, dz]), expected[:, :3])
        assert_same(loads_of(shifted, GAS), expected)

    @given(scenes())
    def test_the_mirrored_engine_mirrors_its_loads(self, scene: Scene) -> None:
        """Seen in the plane y = 0 an engine turns the other way: Fy and Mz change sign, Fx, Fz and My stay.

        The output still turns with phi, so the reaction to the torque of the gas stays too.
        """
        engine = scene.engine

        def seen(shaft: Shaft) -> Shaft:
            return Shaft(f"seen {shaft.name}", -shaft.ratio, -shaft.y, shaft.z)

        mirrored = replace(
            of_parts(
                engine,
                lambda p: replace(p, throw=-p.throw, bank=-p.bank, offset=-p.offset, shaft=seen(p.shaft)),
            ),
            rotors=tuple(replace(r, unbalance=r.unbalance.conjugate(), shaft=seen(r.shaft)) for r in engine.rotors),
        )
        signs = np.array([1.0, -1.0, 1.0, 0.0, 1.0, -1.0])
        result, before = loads_of(mirrored), loads_of(engine).coefficients
        without_roll = result.coefficients * np.abs(signs)
        assert_same(Spectrum(result.base, without_roll), before * signs)
        assert_same(gas_loads(mirrored, GAS, COARSE), gas_loads(engine, GAS, COARSE).coefficients)

    @given(scenes(), st.floats(1e-6, 1e6), st.floats(1e-3, 1e3))
    def test_loads_scale_with_mass_and_the_square_of_speed(self, scene: Scene, mass: float, speed: float) -> None:
        engine = scene.engine
        heavier = replace(
            of_parts(
                engine,
                lambda p: replace(
                    p,
                    reciprocating_mass=mass * p.reciprocating_mass,
                    rotating_mass=mass * p.rotating_mass,
                    rod_inertia_deficit=mass * p.rod_inertia_deficit,
                ),
            ),
            rotors=tuple(replace(r, unbalance=mass * r.unbalance) for r in engine.rotors),
        )
        before = loads_of(engine).coefficients
        assert_same(loads_of(heavier), mass * before)
        assert_same(loads_of(engine, speed=speed * SPEED), speed**2 * before)

    @given(scenes())
    def test_parts_add_up(self, scene: Scene) -> None:
        """The whole is the sum of engines of one part each."""
        engine = scene.engine
        alone = [replace(engine, slider_cranks=(part,), rotors=()) for part in engine.slider_cranks]
        alone += [replace(engine, slider_cranks=(), rotors=(rotor,)) for rotor in engine.rotors]
        total = loads_of(alone[0], GAS)
        for single in alone[1:]:
            total = total + loads_of(single, GAS)
        assert_same(loads_of(engine, GAS), total.coefficients)


class TestMomentum:
    @given(scenes(), st.lists(st.floats(0.0, 12.6), min_size=2, max_size=2))
    def test_loads_are_the_change_of_momentum(self, scene: Scene, angles: list[float]) -> None:
        """Compare all orders at an angle with -d/dt of momentum and angular momentum of all moving bodies.

        The flywheel, too heavy to change its speed, takes the torque that the kinetic
        energy of the others gives or needs (C7).
        """
        loads = loads_of(scene.engine)
        expected = np.array([_momentum_change(scene, angle) for angle in angles])
        np.testing.assert_allclose(loads.values(np.array(angles)), expected, rtol=0.0, atol=1e-11 * _size(loads))

    @given(scenes(ratios=(-1.5, 0.5, 2.5)), st.floats(0.0, 12.6))
    def test_cranks_and_shafts_of_any_ratio(self, scene: Scene, angle: float) -> None:
        """The same for second cranks beside the first one, at ratios whose loads have half orders."""
        loads, expected = loads_of(scene.engine), _momentum_change(scene, angle)
        assert loads.values(np.array([angle]))[0] == pytest.approx(expected, rel=0.0, abs=1e-11 * _size(loads))

    @given(scenes())
    def test_inertia_does_no_work_at_constant_speed(self, scene: Scene) -> None:
        """Kinetic energy returns every cycle, so the mean torque and with it the mean roll moment is zero."""
        for loads in (reciprocating_loads(scene.engine, SPEED), rod_inertia_loads(scene.engine, SPEED)):
            roll = loads.coefficients[:, 3]
            assert abs(roll[0]) <= 1e-12 * float(np.abs(roll).max())


def _size(loads: Spectrum) -> float:
    """Return the largest order of loads plus 1e-9, a size that is not zero at any angle."""
    return float(np.abs(loads.coefficients).max()) + 1e-9


def _momentum_change(scene: Scene, angle: float) -> NDArray[np.float64]:
    """Return the wrench on the block by differences of momentum and energy; with 50 digits their error is nothing."""
    with mp.workdps(50):
        step, phi = mp.mpf(10) ** -12, mp.mpf(angle)
        after, before = (_momentum(scene, phi + s * step) for s in (1, -1))
        *change, power = (-(a - b) / (2 * step) * mp.mpf(SPEED) ** 2 for a, b in zip(after, before, strict=True))
        change[3] += power
        return np.array([float(c) for c in change])


def _momentum(scene: Scene, phi: mp.mpf) -> list[mp.mpf]:
    """Return momentum and angular momentum per unit of crank speed, and kinetic energy per its square."""
    step = mp.mpf(10) ** -15
    total = [mp.mpf(0)] * 7
    now, later, earlier = (_places(scene, phi + s * step) for s in (0, 1, -1))
    for (mass, x, place, inertia, _), (*_, ahead, _, tilt_ahead), (*_, behind, _, tilt_behind) in zip(
        now, later, earlier, strict=True
    ):
        velocity, rate = (ahead - behind) / (2 * step), (tilt_ahead - tilt_behind) / (2 * step)
        y, z, vy, vz = place.imag, place.real, velocity.imag, velocity.real
        # positive angles go from z to y, against the right-hand sense of x (C3)
        roll = mass * (y * vz - z * vy) - inertia * rate
        energy = (mass * (vy**2 + vz**2) + inertia * rate**2) / 2
        parts = (0, mass * vy, mass * vz, roll, -x * mass * vz, x * mass * vy, energy)
        total = [t + p for t, p in zip(total, parts, strict=True)]
    return total


def _places(scene: Scene, phi: mp.mpf) -> list[tuple[mp.mpf, mp.mpf, mp.mpc, mp.mpf, mp.mpf]]:
    """Return the mass, x, place zeta = z + i y, inertia, and tilt of every rigid body."""
    out = []
    for body in scene.bodies:
        part = body.part
        centre = mp.mpc(part.shaft.z, part.shaft.y)
        axis = mp.expj(part.bank)
        pin = part.crank_radius * mp.expj(mp.mpf(part.shaft.ratio) * phi + mp.mpf(part.throw))
        local = pin * mp.conj(axis)
        across = mp.mpf(part.offset) - local.imag
        along = mp.sqrt(mp.mpf(part.rod_length) ** 2 - across**2) if body.rod else mp.mpf(0)
        piston = (local.real + along + mp.mpc(0, part.offset)) * axis
        out.append((mp.mpf(body.piston_mass), mp.mpf(part.x), centre + piston, mp.mpf(0), mp.mpf(0)))
        if body.rod:
            share = mp.mpf(body.rod.centre_of_gravity) / mp.mpf(body.rod.length)
            tilt = mp.atan2(across, along)
            place = centre + pin + share * (piston - pin)
            out.append((mp.mpf(body.rod.mass), mp.mpf(part.x), place, mp.mpf(body.rod.inertia), tilt))
    for rotor in scene.engine.rotors:
        # one kilogram on an arm of the unbalance
        arm = mp.mpmathify(rotor.unbalance) * mp.expj(mp.mpf(rotor.shaft.ratio) * phi)
        place = mp.mpc(rotor.shaft.z, rotor.shaft.y) + arm
        out.append((mp.mpf(1), mp.mpf(rotor.x), place, mp.mpf(0), mp.mpf(0)))
    return out


class TestGas:
    @given(scenes())
    def test_gas_closes_inside_the_engine(self, scene: Scene) -> None:
        """No force and no rocking couple, not even rounding; a roll moment there is."""
        loads = gas_loads(scene.engine, GAS, COARSE).coefficients
        assert (loads[:, [0, 1, 2, 4, 5]] == 0.0).all()
        assert np.abs(loads[:, 3]).max() > 0.0

    @given(scenes())
    def test_mean_roll_moment_is_the_work_of_the_cycle(self, scene: Scene) -> None:
        """imep times displacement of all cylinders, over the angle of the cycle."""
        engine = scene.engine
        work = sum(GAS.imep * part.piston_area * part.stroke for part in engine.slider_cranks)
        mean = gas_loads(engine, GAS, Fidelity(samples=1440)).coefficients[0, 3]
        assert mean.real == pytest.approx(work / engine.cycle.angle, rel=2e-3)

    def test_crankcase_pressure_acts_from_below(self) -> None:
        """Check that a cylinder at crankcase pressure gives no torque."""
        trace = PressureTrace(tuple(np.radians(np.arange(0, 360, 10)).tolist()), (2e5,) * 36, 2e5)
        part = SliderCrank("cylinder 1", 0.0, 0.06, 0.2, 1.0, bore=0.1)
        engine = Engine("single", Cycle.TWO_STROKE, (part,))
        assert np.abs(gas_loads(engine, trace, COARSE).coefficients).max() < 1e-12 * 2e5
        other = replace(trace, crankcase_pressure=1e5)
        expected = 1e5 * part.piston_area * part.crank_radius
        assert np.abs(gas_loads(engine, other, COARSE).coefficients[1, 3]) == pytest.approx(expected, rel=0.05)

    def test_half_orders_matter(self) -> None:
        """Check half orders of a four-stroke's gas, larger than those above the second; a two-stroke has none."""
        part = SliderCrank("cylinder 1", 0.0, 0.06, 0.06 / 0.26, 1.25, bore=0.1)
        loads = gas_loads(Engine("single", Cycle.FOUR_STROKE, (part,)), GAS)
        halves = np.abs(loads.coefficients[1::2, 3])
        assert halves[0] > 0.3 * float(np.abs(loads.at(1)[3]))
        whole = Spectrum(Fraction(1), loads.coefficients[::2])
        first_cycle, all_of_it = whole.sample(720)[:, 3], loads.sample(1440)[:, 3]
        assert np.abs(all_of_it[:720] - first_cycle).max() > 0.3 * np.abs(all_of_it).max()
        two_stroke = gas_loads(Engine("single", Cycle.TWO_STROKE, (part,)), GAS)
        assert two_stroke.base == 1


def _star(count: int, order: Sequence[int], offset: float = 0.0, deficit: float = 0.0) -> Engine:
    """Return an inline engine with an even star, its throws taken in any order."""
    parts = tuple(
        SliderCrank(
            f"cylinder {k + 1}",
            0.1 * k,
            0.06,
            0.06 / 0.26,
            1.25,
            throw=math.radians(360.0 * place / count),
            offset=offset,
            rotating_mass=0.7,
            rod_inertia_deficit=deficit,
            bore=0.1,
            firing_angle=math.tau * ((-place / count) % 1.0),
        )
        for k, place in enumerate(order)
    )
    return Engine(f"star of {count}", Cycle.TWO_STROKE, parts)


class TestStars:
    @pytest.mark.parametrize("offset", [0.0, 0.01], ids=["central", "offset"])
    @pytest.mark.parametrize("count", range(2, 13))
    def test_even_stars_cancel_exactly(self, count: int, offset: float) -> None:
        """Orders that are no multiple of the number of throws are 0.0, others are not."""
        rng = np.random.default_rng(count)
        for _ in range(3):
            engine = _star(count, rng.permutation(count).tolist(), offset, deficit=-0.004)
            loads = shaking_loads(engine, OperatingPoint("any", SPEED, GAS), COARSE).coefficients
            orders = np.arange(len(loads))
            others = orders % count != 0
            assert (loads[others][:, :4] == 0.0).all()
            assert np.abs(loads[~others][1:, 3]).max() > 0.0
            even = count if count % 2 == 0 or offset else 2 * count
            assert np.abs(loads[even, 2]) > 0.0

    def test_a_star_a_little_uneven_does_not_cancel(self) -> None:
        """A hundredth of a degree is a design, not a rounding."""
        engine = _star(3, [0, 1, 2])
        first = replace(engine.slider_cranks[0], throw=math.radians(0.01), firing_angle=math.radians(359.99))
        bent = replace(engine, slider_cranks=(first, *engine.slider_cranks[1:]))
        loads = loads_of(bent).at(1)
        force = (1.25 + 0.7) * 0.06 * SPEED**2
        assert abs(loads[2]) == pytest.approx(force * math.radians(0.01), rel=1e-3)

    def test_geared_twin_crank_cancels_lateral_forces(self) -> None:
        """Check twice the vertical force and zero lateral force of two contra-rotating cranks."""

        def engine(ratio: float) -> Engine:
            parts, rotors = [], []
            for k, (n, y) in enumerate(((1.0, 0.2), (ratio, -0.2))):
                shaft = Shaft(f"crank {k}", n, y, 0.05)
                parts.append(
                    SliderCrank(
                        f"cylinder {k}", 0.0, 0.06, 0.2, 1.25, offset=0.01 * n, rotating_mass=0.9,
                        rod_inertia_deficit=-0.003, shaft=shaft,
                    )
                )  # fmt: skip
                rotors.append(Rotor(f"weight {k}", 0.03, -0.04 * cis(as_turn(0.3 * n)), shaft))
            return Engine("twin", Cycle.TWO_STROKE, tuple(parts), tuple(rotors))

        twin = loads_of(engine(-1.0))
        one = loads_of(replace(engine(-1.0), slider_cranks=engine(-1.0).slider_cranks[:1], rotors=()))
        assert (twin.coefficients[:, [1, 5]] == 0.0).all()
        assert twin.at(1)[2] == pytest.approx(
            2
            * loads_of(
                replace(engine(-1.0), slider_cranks=engine(-1.0).slider_cranks[:1], rotors=engine(-1.0).rotors[:1])
            ).at(1)[2],
            rel=1e-14,
        )
        assert np.abs(one.at(1)[1]) > 1000.0
        assert np.abs(loads_of(engine(1.0)).at(1)[1]) > 1000.0


SINGLE = SliderCrank("cylinder 1", 0.0, 0.06, 0.06 / 0.26, 1.25, rotating_mass=0.7)


class TestNothingIsLeftOut:
    def test_rod_inertia_matters(self) -> None:
        """A rod of 2 kg with 65 % of the two-mass inertia changes the roll moment by half, far above rounding."""
        rod = Rod(0.06 / 0.26, 2.0, 0.07, 0.65 * 2.0 * 0.07 * (0.06 / 0.26 - 0.07))
        part = replace(SINGLE, reciprocating_mass=0.6 + rod.reciprocating_mass, rod_inertia_deficit=rod.inertia_deficit)
        with_it = loads_of(Engine("single", Cycle.TWO_STROKE, (part,))).sample(720)[:, 3]
        without = loads_of(Engine("single", Cycle.TWO_STROKE, (replace(part, rod_inertia_deficit=0.0),))).sample(720)
        assert np.abs(with_it - without[:, 3]).max() > 0.2 * np.abs(with_it).max()

    @pytest.mark.parametrize(("offset", "change"), [(0.001, 2e-3), (0.01, 0.02), (-0.01, 0.02)])
    def test_offset_matters(self, offset: float, change: float) -> None:
        """An offset adds a third order of force, and a first order of roll moment."""
        central = loads_of(Engine("single", Cycle.TWO_STROKE, (SINGLE,)))
        offset_loads = loads_of(Engine("single", Cycle.TWO_STROKE, (replace(SINGLE, offset=offset),)))
        assert (central.at(3)[:3] == 0.0).all()
        assert abs(offset_loads.at(3)[2]) > 0.05 * change * abs(central.at(1)[2])
        assert abs(offset_loads.at(1)[3] - central.at(1)[3]) > change * abs(central.at(1)[3])

    def test_rotating_share_of_the_rod_matters(self) -> None:
        engine = Engine("single", Cycle.TWO_STROKE, (SINGLE,))
        assert abs(rotating_loads(engine, SPEED).at(1)[1]) == pytest.approx(0.7 * 0.06 * SPEED**2, rel=1e-14)

    def test_exact_kinematics_matter(self) -> None:
        """The fourth order, left out by two-order kinematics, is there."""
        engine = Engine("single", Cycle.TWO_STROKE, (SINGLE,))
        assert abs(reciprocating_loads(engine, SPEED, EXACT).at(4)[2]) > 2e-3 * 1.25 * 0.06 * SPEED**2
        assert (reciprocating_loads(engine, SPEED, Fidelity("two-order")).at(4) == 0.0).all()
