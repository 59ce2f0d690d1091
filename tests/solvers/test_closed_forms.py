"""Balancers that Hasselgruber gives in closed form come out of the optimiser, gas off (1964, eqs. 24-31).

Two-order kinematics, for which the formulas are exact.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

from laufruhe.machine import Cycle, Engine
from laufruhe.machine.layouts import build, vee
from laufruhe.numerics.norms import NORMS
from laufruhe.problem import channels
from laufruhe.problem.decision import RotorDrive
from laufruhe.problem.measure import Measure, Term
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from mechanisms import mechanism_of
from tractor import LAMBDA, MASS, RADIUS, SPACING, engine, free_unbalance, problem, shaft_rotor, web

HALF = 0.5 * MASS * RADIUS


def first_order_couple() -> tuple[Term, ...]:
    return (Term(Measure(channels.ROCKING_COUPLE, NORMS["mean"], orders=(1.0,))),)


@pytest.mark.parametrize(
    ("throws", "cycle", "factor"),
    [
        ([0, 180], Cycle.FOUR_STROKE, 1.0),
        ([0, 240, 120], Cycle.FOUR_STROKE, math.sqrt(3.0)),
        ([0, 180, 90, 270], Cycle.TWO_STROKE, math.sqrt(2.0)),
        ([0, 270, 90, 180], Cycle.TWO_STROKE, math.sqrt(10.0)),
    ],
    ids=["eq. 24", "eq. 25", "eq. 30", "eq. 31"],
)
def test_first_order_shaft(throws: list[float], cycle: Cycle, factor: float) -> None:
    """A counter-rotating shaft at crank speed with U s = m r a / 2 times the star's factor.

    The forward half of the couple is left to counterweights on the crank.
    """
    s = 0.4
    rotors = [shaft_rotor("shaft.front", -1, 0.5 * s), shaft_rotor("shaft.rear", -1, -0.5 * s)]
    rotors += [web("web front", 0.2), web("web rear", -0.2)]
    names = [rotor.name for rotor in rotors]
    result = solve(problem(engine(throws, rotors, cycle), names, objective=first_order_couple()))
    assert result.objective is not None
    assert result.objective.initial > 100.0
    assert result.objective.value <= 1e-6 * result.objective.initial
    size = {rotor.name: abs(rotor.unbalance) for rotor in result.final.engine.rotors}
    expected = HALF * SPACING * factor
    assert size["shaft.front"] * s == pytest.approx(expected, rel=1e-5)
    assert size["shaft.rear"] * s == pytest.approx(expected, rel=1e-5)
    assert size["web front"] * s == pytest.approx(expected, rel=1e-5)


def _couple(throws: list[float]) -> complex:
    count = len(throws)
    return sum(((count - 1) / 2 - k) * cmath.exp(1j * math.radians(t)) for k, t in enumerate(throws))


def test_star_factors_are_those_of_the_crank() -> None:
    """The factors of eqs. 24, 25, 30, 31 are the stars' own first-order couples."""
    assert abs(_couple([0, 180])) == pytest.approx(1.0)
    assert abs(_couple([0, 240, 120])) == pytest.approx(math.sqrt(3.0))
    assert abs(_couple([0, 90, 270, 180])) == pytest.approx(math.sqrt(10.0))
    assert abs(_couple([0, 180, 90, 270])) == pytest.approx(math.sqrt(2.0))


def test_lanchester_pair() -> None:
    """Eq. 26: each of two shafts at twice crank speed carries m r lambda / 2.

    Four cylinders make 4 m r lambda w^2; two shafts make 2 U (2 w)^2.
    """
    rotors = [shaft_rotor("left", 2, 0.0, 0.1), shaft_rotor("right", -2, 0.0, -0.1)]
    force = (Term(Measure(channels.SHAKING_FORCE, NORMS["mean"])),)
    result = solve(problem(engine([0, 180, 180, 0], rotors), ["left", "right"], objective=force))
    assert result.objective is not None
    assert result.objective.value <= 1e-6 * result.objective.initial
    for rotor in result.final.engine.rotors:
        assert abs(rotor.unbalance) == pytest.approx(0.5 * MASS * RADIUS * LAMBDA, rel=1e-6)
        assert rotor.unbalance.real < 0.0


def test_moment_pair() -> None:
    """Eq. 27: U x = m r^2 / 2 on two shafts that turn with the crank, opposite each other.

    Four cylinders each have the second-order roll moment m r^2 w^2 / 2; a pair with its
    axes x apart gives U x (2 w)^2.
    """
    apart = 0.2
    rotors = [shaft_rotor("left", 2, 0.0, 0.5 * apart), shaft_rotor("right", 2, 0.0, -0.5 * apart)]
    machine = engine([0, 180, 180, 0], rotors)
    roll = Measure(channels.ROLL_MOMENT, NORMS["mean"], orders=(2.0,))
    force = Measure(channels.SHAKING_FORCE, NORMS["mean"], orders=(2.0,))
    pure = problem(machine, ["left"], objective=[Term(roll)])
    drives = (RotorDrive("left", 1.0), RotorDrive("right", -1.0))
    coupled = replace(pure, decisions=(replace(free_unbalance("left"), drives=drives),))
    result = solve(coupled)
    assert result.objective is not None
    assert result.objective.value <= 1e-6 * result.objective.initial
    assert abs(result.final.engine.rotors[0].unbalance) * apart == pytest.approx(0.5 * MASS * RADIUS**2, rel=1e-6)
    assert result.final.value(force) == pytest.approx(result.initial.value(force), rel=1e-9)


def test_half_balance_of_a_single() -> None:
    """Fig. 10: with equal weight on both directions the best balance factor of a single is one half."""
    rotor = web("web", 0.0)
    result = solve(
        problem(engine([0], [rotor]), ["web"], objective=[Term(Measure(channels.SHAKING_FORCE, NORMS["rms"]))])
    )
    unbalance = result.final.engine.rotors[0].unbalance
    assert unbalance.real == pytest.approx(-0.5 * MASS * RADIUS, rel=1e-5)
    assert abs(unbalance.imag) < 1e-9
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL


def test_ninety_degree_vee_needs_no_shaft() -> None:
    """Fig. 29: a counterweight alone removes the first order of a 90 degree V-twin."""
    cylinders, _ = build(
        Cycle.FOUR_STROKE, vee(2, 1.0, math.pi / 2), mechanism_of(RADIUS, RADIUS / LAMBDA, MASS), [math.pi / 4]
    )
    machine = Engine("vee", Cycle.FOUR_STROKE, cylinders, (web("web", 0.0),))
    first = (Term(Measure(channels.SHAKING_FORCE, NORMS["maximum"], orders=(1.0,))),)
    result = solve(problem(machine, ["web"], objective=first))
    assert result.objective is not None
    assert result.objective.value <= 1e-6 * result.objective.initial
    assert np.isclose(abs(result.final.engine.rotors[0].unbalance), MASS * RADIUS, rtol=1e-6)
