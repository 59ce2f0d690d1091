"""Rows affine in the decisions against rows of the exact model, at random decisions."""

from __future__ import annotations

import cmath
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from laufruhe.extensions.bearing_loads.channels import BEARINGS, MAIN_BEARING_FORCE
from laufruhe.extensions.bearing_loads.machine import Bearing, MainBearings
from laufruhe.extensions.sizes.machine import Bolts, PistonPin, RunningGear, Shank, Webs
from laufruhe.load_models.affine import AffineModel, AffineProblem
from laufruhe.machine import OperatingPoint
from laufruhe.numerics.norms import NORMS, Grid, lengths
from laufruhe.problem import channels
from laufruhe.problem.channels import LoadChannel, MassChannel
from laufruhe.problem.decision import Decision, RotorDrive
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Limit, Measure, Term
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Interval, Sector
from tractor import GAS, SPEED, TWO_ORDER, engine, problem, shaft_rotor, web

# travel needs elastic mounts, and is tested with them
ALL_LOADS = tuple(c for c in channels.CHANNELS.values() if isinstance(c, LoadChannel))
LOADS = tuple(c for c in ALL_LOADS if c is not channels.MOUNT_TRAVEL and c.is_block_load)
# twist needs discs and shafts, and is tested with them
OF_CRANKCASE = (channels.Needs.UNCONDITIONAL, BEARINGS)
INSIDE = tuple(
    Measure(c, NORMS[norm]) for c in ALL_LOADS if c.needs in OF_CRANKCASE and not c.is_block_load for norm in c.norms
)
MASSES = tuple(c for c in channels.CHANNELS.values() if isinstance(c, MassChannel))
HALF_ORDERS = Measure(channels.ROLL_MOMENT, NORMS["rms"], orders=(0.5, 1.5), points=("slow",))
QUANTITIES = (
    *(Measure(subject, norm) for subject in LOADS for norm in NORMS.values()),
    *(Measure(subject, NORMS["mean"]) for subject in MASSES),
    Measure(channels.ADDED_MASS, NORMS["mean"], rotors=("rear", "left")),
    Measure(channels.MOUNT_FORCE, NORMS["mean"], at=("rear left", "front right")),
    Measure(channels.MOUNT_FORCE, NORMS["rms"], direction_weights=(1.0, 1.0, 0.5)),
    Measure(channels.MOUNT_FORCE, NORMS["mean"], orders=(1.0,)),
    Measure(channels.SHAKING_FORCE, NORMS["maximum"], orders=(2.0, 4.0)),
    HALF_ORDERS,
    Measure(channels.MOUNT_FORCE, NORMS["mean"], points=("motored",)),
    Measure(channels.ROCKING_COUPLE, NORMS["mean"], points=("rated", "motored")),
)


@lru_cache(maxsize=2)
def scene(cylinders: int) -> Problem:
    """Return the decisions of every kind, started off zero, on three operating points of different weight and load."""
    rotors = [
        shaft_rotor("left", 2, 0.25, 0.1, -0.1),
        shaft_rotor("right", -2, 0.2, -0.1, -0.1),
        shaft_rotor("slow shaft", -1, -0.1, 0.05, 0.02),
        web("front", 0.2),
        web("rear", -0.2),
    ]
    starts = {"left": cmath.rect(0.004, 0.5), "slow shaft": cmath.rect(-0.003, 0.7), "front": cmath.rect(0.01, 2.0)}
    decisions = (
        Decision(
            "pair", "kg m", Sector(0.02), starts["left"],
            (RotorDrive("left", 1.0), RotorDrive("right", -1.0, mirrored=True)),
        ),
        Decision(
            "shaft", "kg m", Interval(-0.01, 0.01, 0.7), starts["slow shaft"], (RotorDrive("slow shaft", 1.0),),
        ),
        Decision(
            "webs", "kg", Sector(0.5, (1.0, 2.5)), starts["front"] / 0.08,
            (RotorDrive("front", 0.08j), RotorDrive("rear", -0.08, mirrored=True)),
        ),
    )  # fmt: skip
    given_so = {rotor.name: 0j for rotor in rotors}
    for decision in decisions:
        for drive in decision.drives:
            given_so[drive.rotor] += drive.gain * (decision.start.conjugate() if drive.mirrored else decision.start)
    # a part of one rotor is not decided on
    given_so["rear"] += 0.002 - 0.001j
    machine = engine(
        [0.0, 180.0, 180.0, 0.0][:cylinders],
        [replace(rotor, unbalance=given_so[rotor.name]) for rotor in rotors],
        firing_order=[1, 3, 4, 2] if cylinders == 4 else [1, 2],
    )
    points = (
        OperatingPoint("rated", SPEED, GAS),
        OperatingPoint("slow", 0.4 * SPEED, replace(GAS, imep=5e5), weight=3.0),
        OperatingPoint("motored", 0.8 * SPEED, None, weight=0.5),
    )
    return replace(
        problem(machine, [], objective=[Term(q) for q in QUANTITIES]),
        points=points,
        decisions=decisions,
        fidelity=replace(TWO_ORDER, kinematics="exact", samples=96),
    )


@lru_cache(maxsize=2)
def model(cylinders: int) -> AffineModel:
    return AffineModel(scene(cylinders))


@lru_cache(maxsize=8)
def at(cylinders: int, samples: int) -> AffineProblem:
    return model(cylinders).at(samples)


COLUMNS = st.lists(st.floats(-1.0, 1.0), min_size=5, max_size=5).map(np.array)


def steps_of(rows: np.ndarray, grid: Grid) -> np.ndarray:
    """Return the rows without those at bends, of which a cycle has more than a period."""
    blocks = rows.reshape(-1, grid.steps, rows.shape[-1])
    return blocks[:, : grid.steps - grid.kinks].reshape(-1, rows.shape[-1])


@pytest.mark.parametrize(("cylinders", "samples"), [(4, 24), (4, 25), (4, 48), (2, 24), (2, 49)])
@settings(max_examples=12)
@given(x=COLUMNS)
def test_rows_are_those_of_the_exact_model(cylinders: int, samples: int, x: np.ndarray) -> None:
    """Compare V0 + B x of every kind of quantity with the evaluated design, row by row and period by period."""
    p, m, affine = scene(cylinders), model(cylinders), at(cylinders, samples)
    periods = int(m.base / p.engine.cycle.base_order)
    x = x * affine.scales
    exact = evaluate(p, p.design([d.complex_value(x) for d in m.domains]), samples * periods)
    for quantity, (_, norm) in zip(QUANTITIES, affine.terms, strict=True):
        expected, result = exact.rows(quantity), steps_of(norm.rows(x), norm.grid)
        given = steps_of(expected.vectors, expected.grid)
        size = float(np.abs(given).max() + np.abs(norm.constant).max() + np.abs(norm.slope @ affine.scales).max())
        # a load has the rows of its own period alone
        own = len(result) if quantity.is_mass else norm.grid.steps - norm.grid.kinks
        again = 1 if quantity.is_mass else samples * periods // own
        whole = given.reshape(-1, again, own, given.shape[1])
        for k in range(again):
            one = whole[:, k].reshape(len(result), -1)
            np.testing.assert_allclose(lengths(result), lengths(one), rtol=0.0, atol=1e-11 * size)
            # components that are always zero are left out, the others keep their order
            used = one.any(axis=0)
            if used.sum() == result.shape[1]:
                np.testing.assert_allclose(result, one[:, used], rtol=0.0, atol=1e-11 * size)
        assert norm.grid.weights.sum() == pytest.approx(expected.grid.weights.sum(), rel=1e-12)
        assert norm.value(x) == pytest.approx(expected.value, rel=1e-11, abs=1e-11 * size)
        # otherwise every design and every gradient copies them
        assert norm.slope.flags.c_contiguous
        assert norm.constant.flags.c_contiguous


@settings(max_examples=4)
@given(x=COLUMNS)
def test_loads_inside_the_crankcase_are_those_of_the_exact_model(x: np.ndarray) -> None:
    """Compare rows inside the crankcase, whose period may be the whole cycle, with the exact model."""
    p, m, affine = inside()
    assert m.base == p.engine.cycle.base_order
    x = x * affine.scales
    exact = evaluate(p, p.design([d.complex_value(x) for d in m.domains]), 96)
    for measure, (_, norm) in zip(INSIDE, affine.terms, strict=True):
        expected, result = exact.rows(measure), steps_of(norm.rows(x), norm.grid)
        used = expected.vectors.any(axis=0)
        size = float(np.abs(expected.vectors).max())
        # the torque of the crank repeats within the cycle, and has the rows of its own period alone
        own = norm.grid.steps - norm.grid.kinks
        whole = steps_of(expected.vectors[:, used], expected.grid).reshape(-1, 96 // own, own, used.sum())
        for period in np.moveaxis(whole, 1, 0):
            np.testing.assert_allclose(result, period.reshape(result.shape), rtol=0.0, atol=1e-11 * size)
        assert norm.value(x) == pytest.approx(expected.value, rel=1e-11)
    acts = [np.abs(norm.slope).max() for measure, (_, norm) in zip(INSIDE, affine.terms, strict=True)
            if measure.channel is MAIN_BEARING_FORCE]  # fmt: skip
    assert min(acts) > 0.0


@lru_cache(maxsize=1)
def inside() -> tuple[Problem, AffineModel, AffineProblem]:
    """Return the five bearings between and beside the throws; its model, and that at 96 steps."""
    whole = scene(4)
    bearings = tuple(Bearing(str(k), 0.25 - 0.12 * k, 0.06, 0.025, 0.01) for k in range(5))
    parts = tuple(replace(part, big_end=(0.05, 0.03)) for part in whole.engine.slider_cranks)
    gear = RunningGear(
        webs=Webs(0.08, 0.02), rod=Shank(0.022), piston_pin=PistonPin(0.028, 0.016, 0.07), bolts=Bolts(2, 0.008)
    )
    engine = replace(whole.engine, slider_cranks=parts, extras=(gear, MainBearings(bearings)))
    own = replace(whole, engine=engine, objective=tuple(Term(measure) for measure in INSIDE))
    model = AffineModel(own)
    return own, model, model.at(96)


def test_the_scenes_test_what_they_should() -> None:
    """Four cylinders repeat every turn; two that fire unevenly have half orders and the whole cycle as period."""
    assert (model(4).base, model(2).base) == (1, 0.5)
    half = QUANTITIES.index(HALF_ORDERS)
    assert at(2, 24).terms[half][1].value(np.zeros(5)) > 10.0
    assert at(4, 24).terms[half][1].value(np.zeros(5)) == 0.0
    # every decision moves every load that it can
    for norm in (norm for _, norm in at(2, 24).terms[:3]):
        assert norm.slope.any(axis=(0, 1)).all()


def test_objective_and_limits_keep_their_weights() -> None:
    p = scene(4)
    weighted = replace(
        p,
        objective=(Term(QUANTITIES[0], 2.0), Term(QUANTITIES[3], 0.25)),
        limits=(Limit("mass", Measure(channels.BALANCER_MASS, NORMS["mean"]), 1.5),),
    )
    affine = AffineModel(weighted).at(24)
    x = 0.3 * affine.scales
    parts = [norm.value(x) for _, norm in at(4, 24).terms]
    assert affine.objective(x) == pytest.approx(2.0 * parts[0] + 0.25 * parts[3], rel=1e-12)
    assert [maximum for maximum, _ in affine.limits] == [1.5]


def test_rows_cover_one_period_and_no_more() -> None:
    """Without half orders and without first orders half a turn is enough; gas of one cylinder needs two."""
    flat = engine([0.0, 180.0, 180.0, 0.0], [shaft_rotor("left", 2, 0.0)], firing_order=[1, 3, 4, 2])
    with_shaft = problem(flat, ["left"])
    assert AffineModel(with_shaft).base == 2
    assert AffineModel(with_shaft).full_samples == TWO_ORDER.samples // 4
    single = engine([0.0], [shaft_rotor("left", 2, 0.0)])
    assert AffineModel(problem(single, ["left"], GAS)).base == 0.5


def test_a_decision_lengthens_the_period() -> None:
    """A shaft of first order under an engine of second order: its order counts before it has an unbalance."""
    flat = engine([0.0, 180.0, 180.0, 0.0], [shaft_rotor("left", -1, 0.0)], firing_order=[1, 3, 4, 2])
    assert AffineModel(problem(flat, ["left"])).base == 1


def test_nothing_to_decide() -> None:
    flat = engine([0.0, 180.0, 180.0, 0.0], firing_order=[1, 3, 4, 2])
    p = problem(flat, [])
    affine = AffineModel(p).at(96)
    assert affine.size == 0
    exact = evaluate(p, samples=96 * 4).value(p.objective[0].measure)
    assert affine.objective(np.zeros(0)) == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("bounds", [{"maximum": 1.5}, {"minimum": -2.0, "maximum": 0.0}, {"outside": (1.0, 2.0)}, {}])
def test_slacks_of_many_values_are_those_of_each(bounds: dict[str, float]) -> None:
    limit = Limit("mass", Measure(channels.BALANCER_MASS, NORMS["mean"]), **bounds)
    values = np.linspace(-3.0, 4.0, 29)
    assert list(limit.slacks(values)) == [limit.slack(float(value))[0] for value in values]
