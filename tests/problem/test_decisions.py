"""Decisions act on the rotors as the file says: couplings, counterweights, balance factors (eq. 13)."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from laufruhe.files.reader import load
from laufruhe.machine import Role
from laufruhe.physics.shaking_loads import rotor_loads
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem
from one_cylinder import rotating_loads
from problem_files import PROBLEMS, changed, loaded, open_unbalance, shaft, written

ENGINE = """
title = "Vee"
[engine]
layout = "vee"
cycle = "four-stroke"
stroke = "120 mm"
rod_ratio = 0.26
reciprocating_mass = "1.0 kg"
rotating_mass = "0.5 kg"
cylinder_spacing = "125 mm"
bank_angle = 90
throws = [45, 135]
[engine.rod]
mass = "0.9 kg"
centre_of_gravity = "80 mm"
inertia = "60 kg cm^2"
[[operating_points]]
speed = "2500 rpm"
[objective]
minimise = "mean shaking force"
"""
SENSES = {
    "equal": lambda u: u,
    "opposite": lambda u: -u,
    "mirrored": lambda u: u.conjugate(),
    "mirrored opposite": lambda u: -u.conjugate(),
}
VALUES = st.tuples(st.floats(0.0, 1.0), st.floats(-math.pi, math.pi)).map(lambda p: cmath.rect(*p))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scenes")


def problem_of(folder: Path, text: str) -> Problem:
    return loaded(folder, ENGINE + text)


def coupled(how: str, then: str) -> str:
    """Return the shafts of a leader, of its follower, and of the follower of that."""
    leader = shaft("leader", 2, "100 mm", open_unbalance("1 kg m", '"0.3 kg m"', "40"))
    followers = f"""
name = "front"
x = "50 mm"
coupled = {{ to = "leader", as = "{how}" }}
[[balancer_shafts.unbalances]]
name = "rear"
x = "-50 mm"
coupled = {{ to = "follower.front", as = "{then}" }}
"""
    return leader + shaft("follower", -2, "-100 mm", followers)


def unbalances(problem: Problem, *values: complex) -> dict[str, complex]:
    return {rotor.name: rotor.unbalance for rotor in problem.design(values).rotors}


class TestDesign:
    def test_the_start_is_the_design_as_given(self, folder: Path) -> None:
        problem = problem_of(folder, coupled("mirrored", "opposite"))
        assert problem.design(problem.start) == problem.engine
        assert problem.start == (pytest.approx(cmath.rect(0.3, math.radians(40))),)

    @given(VALUES)
    def test_only_rotors_change(self, folder: Path, value: complex) -> None:
        """Cylinders, mounts and throws stay."""
        problem = problem_of(folder, coupled("mirrored", "opposite"))
        design = problem.design([value])
        assert design.slider_cranks == problem.engine.slider_cranks
        throws = [r for r in design.rotors if r.role is Role.THROW]
        assert throws == [r for r in problem.engine.rotors if r.role is Role.THROW]
        assert len(throws) == 2

    def test_as_many_values_as_decisions(self, folder: Path) -> None:
        problem = problem_of(folder, coupled("equal", "equal"))
        with pytest.raises(ValueError, match="shorter"):
            problem.design([])


class TestCouplings:
    @pytest.mark.parametrize("then", SENSES)
    @pytest.mark.parametrize("how", SENSES)
    def test_followers_follow(self, folder: Path, how: str, then: str) -> None:
        """Check that one decision moves the leader, its follower, and the follower of that."""
        problem = problem_of(folder, coupled(how, then))
        (decision,) = problem.decisions
        assert decision.name == "leader.unbalance"
        assert [drive.rotor for drive in decision.drives] == ["leader", "follower.front", "follower.rear"]
        for value in (decision.start, 0j, 0.2 + 0.1j, cmath.rect(1.0, -2.0)):
            result = unbalances(problem, value)
            assert result["leader"] == pytest.approx(value)
            assert result["follower.front"] == pytest.approx(SENSES[how](value))
            assert result["follower.rear"] == pytest.approx(SENSES[then](SENSES[how](value)))
        by_name = {rotor.name: rotor for rotor in problem.engine.rotors}
        assert all(by_name[name].radius == 0.02 for name in ("leader", "follower.front", "follower.rear"))

    def test_a_mirrored_pair_makes_an_upright_force(self, folder: Path) -> None:
        """Check that the lateral forces of two contra-rotating shafts cancel at any angle."""
        problem = problem_of(folder, coupled("mirrored", "equal"))
        rotors = [r for r in problem.design([0.2 + 0.1j]).rotors if r.name in ("leader", "follower.front")]
        force = rotor_loads(rotors, 100.0, problem.engine.cycle).at(2)
        assert force[1] == 0.0
        assert abs(force[2]) == pytest.approx(2 * abs(0.2 + 0.1j) * 200.0**2)

    def test_a_fixed_leader_is_followed_too(self, folder: Path) -> None:
        text = coupled("mirrored", "opposite")
        text = text.replace('{ between = ["0 kg m", "1 kg m"], start = "0.3 kg m" }', '"0.3 kg m"')
        problem = problem_of(folder, text.replace("{ between = [0, 360], start = 40 }", "40"))
        assert problem.decisions == ()
        result = unbalances(problem)
        assert result["follower.front"] == pytest.approx(cmath.rect(0.3, math.radians(-40)))
        assert result["follower.rear"] == pytest.approx(-cmath.rect(0.3, math.radians(-40)))


ROD_LENGTH = 0.06 / 0.26
RECIPROCATING = 1.0 + 0.9 * 0.08 / ROD_LENGTH
ROTATING = 0.5 + 2 * (0.9 - 0.9 * 0.08 / ROD_LENGTH)
THROWS = (45.0, 135.0)


class TestCounterweights:
    @given(st.floats(-1.0, 2.0))
    def test_balance_factor(self, folder: Path, fraction: float) -> None:
        """Eq. (13): opposite each throw its rotating mass, rods included, and the share of its reciprocating mass."""
        text = '[[counterweights]]\nname = "web"\nbalance_factor = { between = [-1, 2], start = 0.25 }\n'
        problem = problem_of(folder, text)
        (decision,) = problem.decisions
        assert (decision.name, decision.unit, decision.lower, decision.upper) == ("web.balance_factor", "", -1.0, 2.0)
        for value in (fraction, decision.start):
            result = unbalances(problem, value)
            for k, throw in enumerate(THROWS):
                mass = ROTATING + value * 2 * RECIPROCATING
                expected = -mass * 0.06 * cmath.exp(1j * math.radians(throw))
                assert result[f"web.{k + 1}"] == pytest.approx(expected)

    @pytest.mark.parametrize("fraction", [0.0, 0.5, 1.0])
    def test_a_fixed_fraction_is_no_decision(self, folder: Path, fraction: float) -> None:
        text = f'[[counterweights]]\nname = "web"\nbalance_factor = {fraction}\nthrows = [2]\n'
        problem = problem_of(folder, text)
        assert problem.decisions == ()
        result = unbalances(problem)
        assert "web.1" not in result
        mass = ROTATING + fraction * 2 * RECIPROCATING
        assert result["web.2"] == pytest.approx(-mass * 0.06 * cmath.exp(1j * math.radians(135)))

    def test_rotating_masses_balanced(self, folder: Path) -> None:
        """Check that a balance factor of zero leaves no rotating load."""
        balanced = problem_of(folder, '[[counterweights]]\nname = "web"\nbalance_factor = 0\n')
        left = rotating_loads(balanced.engine, 100.0).coefficients
        assert abs(left[:, :3]).max() <= 1e-12

    @given(VALUES)
    def test_angles_count_from_opposite_the_throw(self, folder: Path, value: complex) -> None:
        """A weight opposite throw 2 at angle zero stands opposite it; elsewhere upright is zero."""
        text = """
        [[counterweights]]
        name = "web"
        opposite_throw = 2
        radius = "80 mm"
        mass = { between = ["0 kg", "1 kg"] }
        angle = { between = [0, 360] }
        [[counterweights]]
        name = "disc"
        x = "200 mm"
        unbalance = { between = ["0 kg m", "1 kg m"] }
        angle = { between = [0, 360] }
        """
        problem = problem_of(folder, text)
        assert [(d.name, d.unit) for d in problem.decisions] == [("web.mass", "kg"), ("disc.unbalance", "kg m")]
        result = unbalances(problem, value, value)
        assert result["web"] == pytest.approx(0.08 * value * cmath.exp(1j * math.radians(135 + 180)))
        assert result["disc"] == pytest.approx(value)
        by_name = {rotor.name: rotor for rotor in problem.engine.rotors}
        assert (by_name["web"].x, by_name["disc"].x) == pytest.approx((-0.0625, 0.2))

    @pytest.mark.parametrize(
        ("between", "fixed", "free"),
        [("[0, 360]", False, True), ("[0, 359.9999999]", False, True), ("[-180, 180]", False, True),
         ("[10, 190]", False, False), ("[30, 30]", True, False)],
    )  # fmt: skip
    def test_bounds_of_an_angle_are_a_sector_or_a_disc(
        self, folder: Path, between: str, fixed: bool, free: bool
    ) -> None:
        """A whole turn but for a rounding is a whole turn: the disc, not a sliver of it."""
        text = f"""
        [[counterweights]]
        name = "web"
        opposite_throw = 1
        radius = "80 mm"
        mass = {{ between = ["0 kg", "1 kg"] }}
        angle = {{ between = {between} }}
        """
        (decision,) = problem_of(folder, text).decisions
        assert (decision.set.width == 1, decision.set.free_angle) == (fixed, free)

    @given(st.floats(0.0, 1.0), st.sampled_from([(0.0, math.tau), (0.2, 1.2), (-3.0, -1.0)]), st.floats(0.0, 1.0))
    def test_split_names_size_and_angle(
        self, folder: Path, size: float, bounds: tuple[float, float], share: float
    ) -> None:
        """Check that the reported size and angle make the value again, within the bounds of the angle."""
        low, high = (math.degrees(b) for b in bounds)
        text = f"""
        [[counterweights]]
        name = "web"
        x = "0 mm"
        unbalance = {{ between = ["0 kg m", "1 kg m"] }}
        angle = {{ between = [{low}, {high}] }}
        """
        (decision,) = problem_of(folder, text).decisions
        value = cmath.rect(size, bounds[0] + share * (bounds[1] - bounds[0]))
        found, angle = decision.set.split(value)
        assert cmath.rect(found, angle) == pytest.approx(value, abs=1e-15)
        assert angle >= decision.set.angles[0]


@given(VALUES)
def test_loads_change_by_those_of_the_rotors_decided(folder: Path, value: complex) -> None:
    """Check that the exact model is linear in a decision: it adds the loads of its rotors."""
    problem = problem_of(folder, coupled("mirrored", "opposite"))
    design, bare = problem.design([value]), problem.design([0.0])
    (with_it,), (without,) = evaluate(problem, design).loads, evaluate(problem, bare).loads
    driven = {drive.rotor for drive in problem.decisions[0].drives}
    alone = rotor_loads([r for r in design.rotors if r.name in driven], problem.points[0].speed, design.cycle)
    for order in (1, 2, 4):
        change = with_it.wrench.at(order) - without.wrench.at(order)
        np.testing.assert_allclose(change, alone.at(order), rtol=0.0, atol=1e-10 * np.abs(with_it.wrench.at(2)).max())


def test_the_earlier_name_of_the_balance_factor_is_read_as_before(tmp_path: Path) -> None:
    text = (PROBLEMS / "tractor-single.toml").read_text(encoding="utf-8")
    earlier = load(written(tmp_path, changed(text, "balance_factor", "balance_fraction")))
    problem = load(PROBLEMS / "tractor-single.toml")
    assert [decision.name for decision in earlier.decisions] == ["web.balance_fraction"]
    assert [replace(d, name="") for d in earlier.decisions] == [replace(d, name="") for d in problem.decisions]
    assert earlier.engine.rotors == problem.engine.rotors
