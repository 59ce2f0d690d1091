"""Objectives in order: each rank is proven under the earlier ones, and equal optima are named.

The singles are those of the textbook's chapter 3: Fig. 3.3 (road roller), Fig. 3.4 (bob weights), and a weight and a
counter shaft that share the first order between them.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import moving_masses as mm
from laufruhe.errors import InputError
from laufruhe.extensions.fidelity.trade import trade
from laufruhe.extensions.objectives_in_order.solver import solve_lexicographic
from laufruhe.files.reader import load
from laufruhe.numerics.spectrum import order_amplitude
from laufruhe.problem.evaluation import evaluate
from laufruhe.prove.certificate import Proof
from laufruhe.report.sections import tables_of
from laufruhe.report.wording import explained
from laufruhe.solvers import solve
from laufruhe.solvers.result import Status
from problem_files import changed, loaded
from ready import solved

RADIUS, ROD, PISTON, TURNING, AT = 0.1, 0.4, 8.0, 6.0, 0.1
SPEED = 600.0 * np.pi / 30.0
FIRST = PISTON * RADIUS * SPEED**2
# balance factor of the crank's weight, and the masses of the shafts with and against the crank
MACHINES = {
    "single-road-roller": (1.0, -4.0, 4.0),
    "single-bob-weights": (0.0, 4.0, 4.0),
    "single-counter-shaft": (0.5, 0.0, 4.0),
    "single-three-balances": (0.5, 0.0, 4.0),
}
PLACES = {"single-road-roller": (-0.1 + 0.4j), "single-bob-weights": (-0.29 + 0.16j), "single-counter-shaft": -0.38,
          "single-three-balances": (-0.34 + 0.18j)}  # fmt: skip


def masses_of(name: str) -> list[mm.Mass]:
    """Return the single with these weights, as masses on their ways."""
    factor, along, against = MACHINES[name]
    pin = mm.crank_pin(RADIUS)
    place = complex(PLACES[name])
    found = [
        mm.Mass(PISTON, 0.0, mm.piston(pin, ROD, 0.0)),
        mm.Mass(TURNING, 0.0, pin),
        mm.Mass(TURNING + factor * PISTON, 0.0, mm.crank_pin(AT, np.pi)),
    ]
    if along:
        found.append(mm.Mass(abs(along), 0.0, mm.crank_pin(AT, np.pi if along > 0 else 0.0, 1.0, place)))
    return [*found, mm.Mass(against, 0.0, mm.crank_pin(AT, np.pi, -1.0, place.conjugate()))]


def bearing_force(factor: float) -> float:
    """Return the mean force on each of two main bearings: piston and rod on the pin, and the weight, shared evenly."""
    pin = mm.crank_pin(RADIUS)
    piston = mm.piston(pin, ROD, 0.0)
    push = -PISTON * SPEED**2 * mm.differentiated(piston).real
    rod = pin - piston
    on_pin = push * rod / -rod.real * -1.0
    turning = TURNING * RADIUS * np.exp(1j * mm.angles()) - (TURNING + factor * PISTON) * AT * np.exp(1j * mm.angles())
    return float(np.mean(np.abs(mm.finer(on_pin + turning * SPEED**2)))) / 2.0


@pytest.mark.slow
@pytest.mark.parametrize("name", MACHINES)
def test_each_cancels_the_first_order_and_has_its_own_mass(name: str) -> None:
    """Figs. 3.3, 3.4: "at best ... primary balance"; the second order m r A2 w^2 stays."""
    factor, along, against = MACHINES[name]
    result = solved(name)
    assert result.status is Status.OPTIMAL
    assert [rank.proof for rank in result.ranks] == [Proof.GLOBAL] * 3
    first, mass, bearing = result.ranks
    assert first.final == pytest.approx(0.0, abs=1e-9 * FIRST)
    assert mass.final == pytest.approx(TURNING + factor * PISTON + abs(along) + against, rel=1e-6)
    assert bearing.final == pytest.approx(bearing_force(factor), rel=2e-6)
    shaken = result.final.loads[0].wrench
    own = np.fft.fft(mm.force(masses_of(name), SPEED)) / mm.STEPS
    for order in (1, 2, 4):
        expected = own[order] + np.conj(own[-order])
        assert shaken.at(order)[2] == pytest.approx(expected, abs=1e-6 * FIRST)
        assert float(order_amplitude(shaken.at(order)[:2])) == pytest.approx(0.0, abs=1e-6 * FIRST)


@pytest.mark.slow
def test_the_roll_moment_is_that_of_the_masses() -> None:
    """Compare the roll moment with that of the masses, the shafts beside the crank included."""
    for name in ("single-road-roller", "single-bob-weights"):
        wrench = solved(name).final.loads[0].wrench.sample(2 * mm.STEPS)[: mm.STEPS, 3]
        expected = mm.roll(masses_of(name), SPEED)
        pin = mm.crank_pin(RADIUS)
        path = mm.piston(pin, ROD, 0.0).real
        # pistons drive the crank, whose torque the block takes; weights that turn evenly need none
        slope = mm.differentiated(path.astype(complex), times=1).real
        torque = -PISTON * SPEED**2 * mm.differentiated(path.astype(complex)).real * slope
        np.testing.assert_allclose(wrench, expected + torque, atol=1e-6 * FIRST * RADIUS)


@pytest.mark.slow
def test_equal_optima_are_named() -> None:
    """Bob weights and counter shaft have one added mass; the bearings choose between them."""
    ranks = solved("single-three-balances").ranks
    ends = [{found.name: (found.low, found.high) for found in rank.equal} for rank in ranks]
    assert ends[1]["web.balance_factor"] == pytest.approx((0.0, 0.5), abs=1e-5)
    assert ends[1]["forward.mass"] == pytest.approx((0.0, 4.0), abs=1e-5)
    assert "backward.mass" not in ends[0]
    assert ends[2] == {}
    tables = {grid.title: grid.rows for grid in tables_of(solved("single-three-balances"))}
    assert ("web.balance_factor", "0 to 1", "0 to 0.5", "0.5") in tables["Equal optima"]


@pytest.mark.slow
def test_the_three_differ_as_the_chapter_says() -> None:
    """Check "uses less metal than the first" of the second, and the least bearing load of half the weight."""
    roller, bob, counter = (solved(name).ranks for name in list(MACHINES)[:3])
    assert roller[1].final == pytest.approx(22.0, rel=1e-6)
    assert [bob[1].final, counter[1].final] == pytest.approx([14.0, 14.0], rel=1e-6)
    assert counter[2].final < bob[2].final < roller[2].final


SCENE = """
title = "Single"
[engine]
layout = "inline"
cycle = "four-stroke"
stroke = "200 mm"
rod_ratio = 0.25
reciprocating_mass = "8 kg"
throws = [0]
[[operating_points]]
speed = "600 rpm"
[[counterweights]]
name = "web"
opposite_throw = 1
radius = "100 mm"
mass = { between = ["0 kg", "20 kg"] }
[fidelity]
samples = 120
"""
TWO = SCENE + '[[objective]]\nminimise = "rms shaking force"\n[[objective]]\nminimise = "added mass"\n'


def test_an_order_of_one_is_that_objective(tmp_path: Path) -> None:
    one = solve(loaded(tmp_path, SCENE + '[[objective]]\nminimise = "rms shaking force"\n'))
    plain = solve(loaded(tmp_path, SCENE + '[objective]\nminimise = "rms shaking force"\n'))
    assert one.ranks == ()
    assert one.objective == plain.objective


def test_a_rank_without_a_proof_has_no_bound(tmp_path: Path) -> None:
    result = solve_lexicographic(loaded(tmp_path, TWO), lambda stage: replace(solve(stage), certificate=None))
    assert len(result.ranks) == 2
    for rank in result.ranks:
        assert (rank.lower_bound, rank.proof) == (0.0, Proof.NONE)
        assert rank.gap == np.inf


def test_the_second_objective_may_cost_a_share_of_the_first(tmp_path: Path) -> None:
    """Compare the least mass within 2 % of the least force with a scan of 4001 masses."""
    result = solve(loaded(tmp_path, changed(TWO, 'shaking force"\n', 'shaking force"\nwithin = 0.02\n')))
    masses = np.linspace(0.0, 8.0, 4001)
    pin = mm.crank_pin(RADIUS)
    up = -PISTON * mm.differentiated(mm.piston(pin, ROD, 0.0))[:, None]
    shaken = np.sqrt(np.mean(np.abs(up - masses * AT * np.exp(1j * mm.angles())[:, None]) ** 2, axis=0))
    minimum = masses[shaken <= 1.02 * shaken.min()].min()
    assert result.ranks[1].final == pytest.approx(minimum, abs=0.004)
    assert result.ranks[0].final == pytest.approx(1.02 * result.ranks[0].minimum, rel=1e-5)
    least, value = (f"{number:.6g} N" for number in (result.ranks[0].minimum, result.objective.value))
    assert f"the least found is {least}, a gap of" in explained(result)
    assert f"this one has {value}, as `within` allows" in explained(result)
    # the allowed loss of the first objective is no gap of the proof
    assert result.certificate.gap == max(rank.gap for rank in result.ranks)
    assert result.certificate.kind is result.ranks[0].proof is result.ranks[1].proof is Proof.GLOBAL


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"added mass"', '"added mass"\nwithin = 0.1', "objective[2].within = 0.1: is for all objectives except"),
        ('minimise = "rms shaking force"', 'terms = [{ quantity = "rms shaking force" }, { quantity = "added mass" }]',
         "objective[1].terms: is a weighted sum, which only the last"),
        ('"added mass"', '"added moss"', "objective[2].minimise"),
        ("samples = 120", 'kinematics = "auto"', "fidelity.kinematics: needs a single objective"),
    ],
)  # fmt: skip
def test_refusals(old: str, new: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, changed(TWO, old, new))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_infeasible_first_rank_is_infeasible(tmp_path: Path) -> None:
    limited = TWO + '[[constraints]]\nlimit = "maximum shaking force"\nmax = "1 N"\n'
    assert solve(loaded(tmp_path, limited)).status is Status.INFEASIBLE


@pytest.mark.usefixtures("small_trade")
def test_a_trade_is_of_the_first_objective(tmp_path: Path) -> None:
    one, two = (trade(loaded(tmp_path, text)) for text in (TWO.replace(TWO[TWO.rindex("[[objective]]") :], ""), TWO))
    assert two.problem.ranks == ()
    assert two.optimum == pytest.approx(one.optimum, rel=1e-9)


@pytest.mark.parametrize("samples", [48, 60, 72])
def test_the_value_of_an_earlier_rank_is_read_at_many_angles(samples: int) -> None:
    """The last rank is proven at few angles, which misread the mean of the first by up to 0.3 %."""
    problem = load(
        {
            "title": "single",
            "engine": {
                "layout": "inline", "cycle": "two-stroke", "stroke": "100 mm", "rod_ratio": 0.3,
                "reciprocating_mass": "1 kg", "throws": [3],
            },
            "operating_points": [{"speed": "3000 rpm"}],
            "counterweights": [{"name": "w", "x": "0 mm", "radius": "50 mm", "angle": 183,
                                "mass": {"between": ["0 kg", "1 kg"]}}],
            "fidelity": {"samples": samples},
            "objective": [
                {"minimise": "mean shaking force", "orders": [2], "within": 0.2},
                {"minimise": "rms shaking force", "orders": [1]},
            ],
        }
    )  # fmt: skip
    result = solve(problem)
    first = problem.ranks[0].terms[0].measure
    assert result.ranks[0].final == pytest.approx(evaluate(problem, result.final.engine, 5760).value(first), rel=1e-5)
