"""Torsional vibration of the crankshaft: natural modes, vector sums, forced twist, absorbers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

import laufruhe
from laufruhe.errors import ModelError
from laufruhe.extensions.torsion.machine import Absorber, Disc, ShaftSection, Torsion, stiffness_of
from laufruhe.extensions.torsion.physics import (
    absorber_heat,
    chain_of,
    critical_speed,
    main_orders,
    natural_modes,
    receptances,
    section_stiffness,
    shaft_stress,
    shaft_torque,
    throw_torques,
    twist,
    vector_sums,
)
from laufruhe.machine import Engine, OperatingPoint, SliderCrank
from laufruhe.physics.fidelity import EXACT
from laufruhe.physics.torque import crank_torque, reduced_inertia
from laufruhe.physics.uneven_speed import moving_inertia
from problem_files import PROBLEMS


def chain(inertias: list[float], stiffness: list[float], *absorbers: Absorber, **losses: float) -> Torsion:
    discs = tuple(Disc(f"{k}", j, losses.get("damping", 0.0)) for k, j in enumerate(inertias))
    loss = losses.get("loss_factor", 0.0)
    return Torsion(discs, tuple(ShaftSection(f"{k}", s, loss_factor=loss) for k, s in enumerate(stiffness)), absorbers)


def random_chain(seed: int, discs: int = 6) -> Torsion:
    rng = np.random.default_rng(seed)
    rubber = Absorber("rubber", "0", 0.004, stiffness=3e3, loss_factor=0.2, damping=0.05)
    viscous = Absorber("viscous", "2", 0.01, damping=4.0)
    own = chain(list(rng.uniform(0.005, 0.05, discs)), list(rng.uniform(1e5, 1e6, discs - 1)), rubber, viscous)
    sections = tuple(replace(s, damping=float(rng.uniform(0, 5)), loss_factor=0.01) for s in own.sections)
    return replace(own, sections=sections, discs=tuple(replace(d, damping=0.3) for d in own.discs))


@pytest.fixture(scope="module")
def five() -> tuple[Engine, OperatingPoint]:
    problem = laufruhe.load(PROBLEMS / "inline-five-torsion.toml")
    return problem.engine, problem.points[0]


def test_two_discs() -> None:
    """Check w^2 = k (J1 + J2) / (J1 J2)."""
    result = natural_modes(chain([0.3, 0.05], [2e5]))
    assert result.frequencies == pytest.approx([math.sqrt(2e5 * 0.35 / (0.3 * 0.05)) / math.tau], rel=1e-13)
    # the node divides the shaft as the inertias do
    assert result.shapes[:, 0] == pytest.approx([0.05 / 0.3, -1.0])


def test_three_discs() -> None:
    """Check w^4 - w^2 (k1/J1 + (k1 + k2)/J2 + k2/J3) + k1 k2 (J1 + J2 + J3)/(J1 J2 J3) = 0."""
    (a, b, c), (k, m) = (0.02, 0.05, 0.4), (3e5, 8e5)
    roots = np.roots([1.0, -(k / a + (k + m) / b + m / c), k * m * (a + b + c) / (a * b * c)])
    assert natural_modes(chain([a, b, c], [k, m])).frequencies == pytest.approx(
        np.sort(np.sqrt(roots)) / math.tau, rel=1e-12
    )


def test_a_motorcycle_engine() -> None:
    """Compare four cylinders with the published frequencies of their crankshaft: 1169 and 2085 Hz."""
    inertias = [1.99e-5, 1.6958e-3, 2.1595e-3, 1.8157e-3, 1.2602e-3, 1.54e-5]
    stiffness = [math.degrees(k) for k in (3014, 2562, 2430, 2636, 2562)]
    assert natural_modes(chain(inertias, stiffness)).frequencies[:2] == pytest.approx([1169, 2085], abs=0.5)


@pytest.mark.parametrize("seed", range(4))
def test_modes_are_those_of_the_generalised_eigenproblem(seed: int) -> None:
    """Compare modes with SciPy's K q = w^2 J q on independent matrices; the ring in oil is free."""
    own = random_chain(seed)
    count = len(own.discs)
    inertia = np.diag([d.inertia for d in own.discs] + [a.inertia for a in own.absorbers])
    stiffness = np.zeros((count + 2, count + 2))
    for k, section in enumerate(own.sections):
        stiffness[k : k + 2, k : k + 2] += section.stiffness * np.array([[1, -1], [-1, 1]])
    stiffness[np.ix_([0, count], [0, count])] += 3e3 * np.array([[1, -1], [-1, 1]])
    squares, shapes = eigh(stiffness, inertia)
    result = natural_modes(own)
    assert result.frequencies == pytest.approx(np.sqrt(squares[2:]) / math.tau, rel=1e-9)
    for mode in range(count - 1):
        theirs = shapes[:, mode + 2]
        ours = np.concatenate([result.shapes[:, mode], result.rings[:, mode]])
        assert abs(ours @ inertia @ theirs) == pytest.approx(math.sqrt(ours @ inertia @ ours), rel=1e-9)
        assert np.abs(ours).max() == pytest.approx(1.0)


def test_stiffness_of_round_pieces() -> None:
    """Compare stiffness with G I_p / l, compliances added; a bore takes its own stiffness off."""
    one = stiffness_of([(0.2, 0.05, 0.0)], 80e9)
    assert one == pytest.approx(80e9 * math.pi / 32 * 0.05**4 / 0.2)
    assert stiffness_of([(0.2, 0.05, 0.0), (0.2, 0.05, 0.0)], 80e9) == pytest.approx(one / 2)
    hollow = stiffness_of([(0.2, 0.05, 0.03)], 80e9)
    assert hollow == pytest.approx(one - stiffness_of([(0.2, 0.03, 0.0)], 80e9))


def test_half_the_reciprocating_mass_turns_with_the_throw() -> None:
    """Check half the mass for a long rod (textbook 2.9), else the mean over a turn by a finer sum."""
    yoke = SliderCrank("a", 0.0, 0.05, math.inf, 2.0, rotating_mass=1.0)
    assert reduced_inertia(yoke) == pytest.approx((1.0 + 0.5 * 2.0) * 0.05**2, rel=1e-14)
    short = replace(yoke, rod_length=0.15, rod_inertia_deficit=-2e-4)
    phi = math.tau * (np.arange(4000) + 0.5) / 4000
    swing = np.arcsin(np.sin(phi) / 3.0)
    speed = 0.05 * (np.sin(phi) + np.cos(phi) * np.tan(swing))
    rate = np.cos(phi) / (3.0 * np.cos(swing))
    expected = 0.05**2 + 2.0 * np.mean(speed**2) - 2e-4 * np.mean(rate**2)
    assert reduced_inertia(short) == pytest.approx(expected, rel=1e-9)


def test_discs_and_pistons_hold_the_energy_of_all_that_turns() -> None:
    """Compare the mean energy of the rigid chain with flywheel, pistons and rods (V14, F3)."""
    engine = laufruhe.load(PROBLEMS / "inline-five-damper.toml").engine
    angles = 2.0 * math.pi * np.arange(720) / 720
    of_pistons = moving_inertia(engine, EXACT, angles)[0]
    own = chain_of(engine)
    beside = own.turning_inertia(engine.slider_cranks)
    assert float(np.mean(beside + of_pistons)) == pytest.approx(sum(disc.inertia for disc in own.discs), rel=1e-12)


@pytest.mark.parametrize("name", ["radial-seven", "vee-eight-cross", "boxer-four", "two-stroke-five"])
def test_any_mechanism_drives_its_throw(name: str) -> None:
    """Compare the sum over cylinders, each later by its firing, with all at once: rods, banks, two-strokes."""
    problem = laufruhe.load(PROBLEMS / f"{name}.toml")
    discs = [Disc("front", 0.01), Disc("rear", 0.3)]
    parts = [Disc(part.name, 0.02, cylinders=(part.name,)) for part in problem.engine.slider_cranks]
    own = (discs[0], *parts, discs[1])
    engine = problem.engine.with_extra(Torsion(own, tuple(ShaftSection(d.name, 1e5) for d in own[1:])))
    together = throw_torques(engine, problem.points[0]).coefficients.sum(axis=1)
    whole = crank_torque(engine, problem.points[0]).with_finer_base(engine.cycle.base_order).coefficients
    count = min(len(together), len(whole))
    assert together[:count] == pytest.approx(whole[:count], abs=1e-9 * np.abs(whole).max())
    assert np.abs(together[count:]).max(initial=0.0) < 1e-9 * np.abs(whole).max()


def test_other_pistons_turn_with_their_throws(five: tuple[Engine, OperatingPoint]) -> None:
    engine, _ = five
    heavier = tuple(replace(part, reciprocating_mass=part.reciprocating_mass + 0.1) for part in engine.slider_cranks)
    moved = chain_of(engine).moved({}, engine.slider_cranks, heavier)
    expected = reduced_inertia(heavier[0]) - reduced_inertia(engine.slider_cranks[0])
    assert moved.discs[3].inertia - chain_of(engine).discs[3].inertia == pytest.approx(expected)
    assert moved.discs[0] == chain_of(engine).discs[0]


def test_throws_together_have_the_torque_of_the_crank(five: tuple[Engine, OperatingPoint]) -> None:
    engine, point = five
    together = throw_torques(engine, point).coefficients.sum(axis=1)
    whole = crank_torque(engine, point).coefficients
    assert together[: len(whole)] == pytest.approx(whole, abs=1e-9 * np.abs(whole).max())


def test_every_disc_obeys_its_torques(five: tuple[Engine, OperatingPoint]) -> None:
    """Check J q'' of every disc against its torque, adjacent shafts and cylinder friction, in every order."""
    engine, point = five
    own, torques = chain_of(engine), throw_torques(engine, point)
    orders = torques.orders[1:]
    rate = (orders * point.speed)[:, None]
    passed = shaft_torque(engine, point).coefficients[1:]
    twisted = twist(engine, point).coefficients[1:]
    inertia, damping = np.array([d.inertia for d in own.discs]), np.array([d.damping for d in own.discs])
    # angles from the twists and one disc, which the sum of all torques tells
    below = np.concatenate([np.cumsum(twisted[:, ::-1], axis=1)[:, ::-1], np.zeros((len(orders), 1))], axis=1)
    dynamic = 1j * rate * damping - rate**2 * inertia
    last = (torques.coefficients[1:].sum(axis=1) - (dynamic * below).sum(axis=1)) / dynamic.sum(axis=1)
    angles = below + last[:, None]
    nothing = np.zeros((len(orders), 1))
    left = torques.coefficients[1:] + np.hstack([nothing, passed]) - np.hstack([passed, nothing]) - dynamic * angles
    assert np.abs(left).max() < 1e-8 * np.abs(torques.coefficients).max()


def test_the_load_takes_the_mean(five: tuple[Engine, OperatingPoint]) -> None:
    """Check the mean torque per shaft against the sum of the throws before it, for a load behind and at throw 2."""
    engine, point = five
    each = throw_torques(engine, point).coefficients[0].real
    mean = shaft_torque(engine, point).coefficients[0].real
    assert mean == pytest.approx(np.cumsum(each)[:-1], abs=1e-9 * each.sum())
    driven = engine.with_extra(replace(chain_of(engine), output="throw 2"))
    forward = shaft_torque(driven, point).coefficients[0].real
    assert forward == pytest.approx(mean - np.array([0, 0, *[each.sum()] * 4]), abs=1e-9 * each.sum())


def test_stress_is_torque_over_the_section_modulus(five: tuple[Engine, OperatingPoint]) -> None:
    """Check tau = M / W_p, W_p = pi d^3 / 16 (textbook 2.9)."""
    engine, point = five
    torque, stress = shaft_torque(engine, point).coefficients, shaft_stress(engine, point).coefficients
    assert stress[:, 1] == pytest.approx(torque[:, 1] * 16.0 / (math.pi * 0.048**3))


@pytest.mark.parametrize("seed", range(3))
def test_work_of_the_torques_becomes_heat(seed: int) -> None:
    """Check that the work of every order on the discs is lost in shafts, cylinders and absorbers."""
    own, speed = random_chain(seed), 200.0
    cylinder = SliderCrank("one", 0.0, 0.045, 0.16, 0.6)
    own = replace(own, discs=(*own.discs[:3], replace(own.discs[3], cylinders=("one",)), *own.discs[4:]))
    engine = Engine("e", laufruhe.load(PROBLEMS / "inline-five-torsion.toml").engine.cycle, (cylinder,), extras=(own,))
    point = OperatingPoint("p", speed)
    torques = throw_torques(engine, point)
    orders, driven = torques.orders[1:], torques.coefficients[1:, 3]
    rate = orders * speed
    twists = twist(engine, point).coefficients[1:]
    stiff = section_stiffness(own, orders, speed)
    shafts = 0.5 * np.sum((stiff.imag * np.abs(twists) ** 2) * rate[:, None])
    # the angle of the driven disc, from a dense solve of its own
    angles = dense_angles(own, rate, driven, 3)
    put_in = 0.5 * np.sum((driven.conj() * 1j * rate * angles[:, 3]).real)
    friction = 0.5 * np.sum(0.3 * np.abs(rate[:, None] * angles[:, : len(own.discs)]) ** 2)
    assert shafts + friction + absorber_heat(engine, point).sum() == pytest.approx(put_in, rel=1e-9)


def dense_angles(own: Torsion, rates: np.ndarray, torque: np.ndarray, disc: int) -> np.ndarray:
    """Return the angles of discs and rings, each order by itself [rad]."""
    count = len(own.discs) + len(own.absorbers)
    found = []
    for rate, drive in zip(rates, torque, strict=True):
        dynamic = np.zeros((count, count), dtype=complex)
        for k, d in enumerate(own.discs):
            dynamic[k, k] += 1j * rate * d.damping - rate**2 * d.inertia
        pairs = [(k, k + 1, s.stiffness * (1 + 1j * s.loss_factor), s.damping) for k, s in enumerate(own.sections)]
        for k, a in enumerate(own.absorbers, len(own.discs)):
            dynamic[k, k] -= rate**2 * a.inertia
            pairs.append((int(a.on), k, a.stiffness * (1 + 1j * a.loss_factor), a.damping))
        for a, b, stiffness, damping in pairs:
            link = stiffness + 1j * rate * damping
            dynamic[np.ix_([a, b], [a, b])] += link * np.array([[1, -1], [-1, 1]])
        drives = np.zeros(count, dtype=complex)
        drives[disc] = drive
        found.append(np.linalg.solve(dynamic, drives))
    return np.array(found)


def test_a_pendulum_holds_its_disc_still_in_its_order() -> None:
    """Check that a pendulum cancels its order n, and adds an inertia J / (1 - h^2/n^2) in order h."""
    bare = chain([0.02, 0.05, 0.3], [3e5, 8e5], damping=0.1)
    own = replace(bare, absorbers=(Absorber("pendulum", "0", 0.004, order=2.5),))
    inertia = 0.02 + 0.004 / (1.0 - 2.0**2 / 2.5**2)
    equal = replace(bare, discs=(replace(bare.discs[0], inertia=inertia), *bare.discs[1:]))
    for speed in (80.0, 200.0, 500.0):
        # a torque on the disc itself is taken up whole
        assert np.abs(receptances(own, np.array([2.5]), speed)[0, :, 0]).max() < 1e-18
        assert np.abs(receptances(bare, np.array([2.5]), speed)[0, :, 0]).max() > 1e-8
        ours, theirs = (receptances(each, np.array([2.0]), speed) for each in (own, equal))
        assert ours == pytest.approx(theirs, rel=1e-9)


def test_a_tuned_ring_takes_its_frequency_away() -> None:
    """Check that a ring tuned to a resonance replaces it by one on either side."""
    bare = chain([0.02, 0.05, 0.3], [3e5, 8e5])
    (first, _) = natural_modes(bare).frequencies
    tuned = replace(bare, absorbers=(Absorber("ring", "0", 0.004, stiffness=0.004 * (math.tau * first) ** 2),))
    below, above, _ = natural_modes(tuned).frequencies
    assert below < 0.9 * first < 1.1 * first < above


def test_a_resonance_that_nothing_damps_is_an_error() -> None:
    own = chain([0.3, 0.05], [2e5])
    speed = critical_speed(natural_modes(own).frequencies[0], 2.0)
    with pytest.raises(ModelError, match="order 2 meets a natural frequency"):
        receptances(own, np.array([1.0, 2.0]), speed)


def test_main_orders_do_not_hang_on_the_firing_order() -> None:
    """Check that main orders have the sum of the swings in all firing orders, and others differ (textbook 2.9)."""
    sums = []
    for order in ([1, 2, 4, 5, 3], [1, 3, 5, 4, 2], [1, 5, 2, 3, 4], [1, 4, 3, 2, 5]):
        tables = laufruhe.files.reader.tables_of(PROBLEMS / "inline-five-torsion.toml")
        tables["engine"] |= {"firing_order": order}
        tables["engine"].pop("throws", None)
        engine = laufruhe.files.reader.load_tables(tables, PROBLEMS / "five.toml").engine
        modes = natural_modes(chain_of(engine))
        sums.append(vector_sums(engine, (0.5, 1.0, 1.5, 2.5, 5.0), modes))
        assert main_orders(engine, 6.0) == (2.5, 5.0)
        assert sums[-1][3] == pytest.approx(np.abs(modes.shapes[1:6].sum(axis=0)))
    first = sums[0]
    # the other way round is the same star seen from behind
    assert sums[1] == pytest.approx(first)
    assert all(each[3:] == pytest.approx(first[3:]) for each in sums)
    assert sums[2][:3] != pytest.approx(first[:3], rel=0.1)


def test_scaling() -> None:
    """Check half the twist at twice the inertia and stiffness, and 1/L of the frequency in a similar chain."""
    own = random_chain(7)
    doubled = replace(
        own,
        discs=tuple(replace(d, inertia=2 * d.inertia, damping=2 * d.damping) for d in own.discs),
        sections=tuple(replace(s, stiffness=2 * s.stiffness, damping=2 * s.damping) for s in own.sections),
        absorbers=tuple(
            replace(a, inertia=2 * a.inertia, stiffness=2 * a.stiffness, damping=2 * a.damping) for a in own.absorbers
        ),
    )
    assert natural_modes(doubled).frequencies == pytest.approx(natural_modes(own).frequencies)
    orders = np.array([0.0, 0.5, 2.0])
    assert receptances(doubled, orders, 150.0) == pytest.approx(0.5 * receptances(own, orders, 150.0))
    like = own.scaled(2.0, 8.0)
    assert natural_modes(like).frequencies == pytest.approx(0.5 * natural_modes(own).frequencies)
    assert receptances(like, orders, 75.0) == pytest.approx(receptances(own, orders, 150.0) / 8.0)


def test_a_chain_that_cannot_be() -> None:
    for wrong, said in (
        (lambda: Disc("a", 0.0), "must be positive"),
        (lambda: ShaftSection("a", 0.0), "stiffness of 0"),
        (lambda: ShaftSection("a", 1.0, diameter=0.02, bore=0.02), "bore"),
        (lambda: Absorber("a", "0", 0.0, damping=1.0), "no inertia"),
        (lambda: Absorber("a", "0", 1.0), "nothing holds"),
        (lambda: chain([1.0], []), "two discs"),
        (lambda: chain([1.0, 1.0], [1.0], Absorber("a", "7", 1.0, damping=1.0)), "no disc '7'"),
    ):
        with pytest.raises(ModelError, match=said):
            wrong()


def test_an_uneven_speed_is_refused(five: tuple[Engine, OperatingPoint]) -> None:
    with pytest.raises(ModelError, match="constant crank speed"):
        twist(*five, replace(EXACT, crank_inertia=0.3))
