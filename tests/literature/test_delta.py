"""Deltic of the textbook's Fig. 3.6: leads round the triangle, remaining loads, and rows that cancel them."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest

import moving_masses as mm
from laufruhe.errors import InputError
from laufruhe.machine import Engine
from laufruhe.numerics.spectrum import order_amplitude
from laufruhe.problem.evaluation import evaluate
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.result import Status
from problem_files import PROBLEMS, changed, loaded
from ready import solved

ROW = (PROBLEMS / "deltic-row.toml").read_text(encoding="utf-8")
RADIUS, ROD, PISTON, SIDE, SPEED = 0.092, 0.368, 6.0, 1.1, 2000.0 * np.pi / 30.0
ONE = PISTON * RADIUS * SPEED**2
HEIGHT = math.sqrt(0.75) * SIDE
CORNERS = {"crankshaft": 0j, "left crankshaft": HEIGHT + 0.5j * SIDE, "right crankshaft": HEIGHT - 0.5j * SIDE}


def masses_of(engine: Engine) -> list[mm.Mass]:
    """Return the masses of pistons whose axes are the sides of the triangle."""
    found = []
    for part in engine.slider_cranks:
        pin = mm.crank_pin(RADIUS, part.throw, part.shaft.ratio, CORNERS[part.shaft.name])
        other = next(p for p in engine.slider_cranks if p.x == part.x and part.faces(p))
        towards = CORNERS[other.shaft.name] - CORNERS[part.shaft.name]
        bank = float(np.angle(towards))
        found.append(mm.Mass(PISTON, part.x, mm.piston(pin, ROD, bank, CORNERS[part.shaft.name])))
    return found


def leads(engine: Engine) -> list[float]:
    """Return the crank angle between inner dead centres of the two pistons of every bank, from their places [deg]."""
    found = []
    for k, part in enumerate(engine.slider_cranks[:3]):
        other = engine.slider_cranks[k + 3]
        assert part.faces(other)
        found.append(math.degrees(math.remainder(other.firing_angle - part.firing_angle, math.tau)))
        for piston in (part, other):
            at = piston.throw + piston.shaft.ratio * piston.firing_angle
            pin = CORNERS[piston.shaft.name] + RADIUS * np.exp(1j * at)
            facing = CORNERS[other.shaft.name if piston is part else part.shaft.name]
            assert abs(facing - pin) == pytest.approx(SIDE - RADIUS, rel=1e-12)
    return found


@pytest.mark.parametrize(("reversed_crank", "lead"), [(0, 60.0), (1, 20.0), (2, 20.0), (3, 20.0)])
def test_equal_leads_are_twenty_degrees_with_one_crank_reversed(
    reversed_crank: int, lead: float, tmp_path: Path
) -> None:
    """Round the triangle the banks turn by 60 degrees at each crank, with its direction: the leads make it up."""
    new = f"reversed_crank = {reversed_crank}" if reversed_crank else ""
    engine = loaded(tmp_path, changed(ROW, "reversed_crank = 1", new)).engine
    assert np.abs(leads(engine)) == pytest.approx([lead] * 3)
    assert len(set(np.round(leads(engine), 9))) == 1


def test_no_lead_leaves_the_third_bank_sixty_degrees(tmp_path: Path) -> None:
    """Two banks in step leave all of it to the third: never are the forces in all three "in balance"."""
    engine = loaded(tmp_path, changed(ROW, "reversed_crank = 1", "reversed_crank = 1\ncrank_leads = [0, 0]")).engine
    assert np.abs(leads(engine)) == pytest.approx([0.0, 0.0, 60.0], abs=1e-9)


@pytest.mark.parametrize("reversed_crank", [1, 2])
def test_forces_are_those_of_the_masses(reversed_crank: int, tmp_path: Path) -> None:
    problem = loaded(tmp_path, changed(ROW, "reversed_crank = 1", f"reversed_crank = {reversed_crank}"))
    wrench = evaluate(problem).loads[0].wrench.sample(mm.STEPS)
    force = mm.force(masses_of(problem.engine), SPEED)
    np.testing.assert_allclose(wrench[:, 2] + 1j * wrench[:, 1], force, atol=1e-6 * ONE)
    # a row alone is not in balance: the leads leave a third of a piston's force, and more
    assert np.abs(force).max() > 0.3 * ONE


@pytest.mark.slow
def test_remaining_forces_of_a_deltic_row() -> None:
    """Weights on the three cranks take the first order off; those on two that turn alike share it as they like."""
    result = solved("deltic-row")
    assert [rank.proof for rank in result.ranks] == [Proof.GLOBAL] * 2
    shaken = result.final.loads[0].wrench
    assert float(order_amplitude(shaken.at(1)[:3])) < 1e-3 * ONE
    pistons = np.fft.fft(mm.force(masses_of(result.problem.engine), SPEED)) / mm.STEPS
    second = math.sqrt(2.0 * (abs(pistons[2]) ** 2 + abs(pistons[-2]) ** 2))
    assert float(order_amplitude(shaken.at(2)[:3])) == pytest.approx(second, rel=0.3)
    # rms of the orders that no weight reaches
    rest = math.sqrt(sum(abs(pistons[h]) ** 2 for h in range(-40, 41) if abs(h) > 1))
    assert result.ranks[0].final == pytest.approx(rest, rel=1e-4)
    ends = {found.name: found for found in result.ranks[1].equal}
    assert set(ends) == {"left.mass", "right.mass"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["deltic-nine", "deltic-eighteen"])
def test_rows_that_cancel(name: str) -> None:
    """The sixth order alone is left of the force; of the couple the least that any such star has."""
    result = solved(name)
    assert result.status is Status.OPTIMAL
    assert [rank.proof for rank in result.ranks] == [Proof.GLOBAL] * 2
    engine, wrench = result.final.engine, result.final.loads[0].wrench
    assert engine.firing_intervals == pytest.approx([math.tau / len(engine.cylinders)] * len(engine.cylinders))
    for order in (1, 2, 4):
        assert not np.any(wrench.at(order)[:3])
    force = np.abs(mm.force(masses_of(engine), SPEED))
    assert np.sqrt(np.mean(force**2)) == pytest.approx(result.ranks[0].final, rel=1e-5)


@pytest.mark.slow
def test_no_star_of_the_eighteen_has_less_couple() -> None:
    """The row's own load times places and phases: of all stars on its steps, and on those of 60 degrees."""
    result = solved("deltic-eighteen")
    engine = result.final.engine
    throws = [math.degrees(part.throw) for part in engine.slider_cranks[:6]]
    places = np.array([part.x for part in engine.slider_cranks[:6]])
    first = [part for part in engine.slider_cranks if part.x == places[0]]
    rotors = [rotor for rotor in engine.rotors if rotor.x == places[0]]
    masses = [mass for mass in masses_of(engine) if mass.x == places[0]]
    assert len(masses) == len(first) == 6
    for rotor in rotors:
        centre = CORNERS[rotor.shaft.name]
        turning = mm.crank_pin(1.0, float(np.angle(rotor.unbalance)), rotor.shaft.ratio, centre)
        masses.append(mm.Mass(abs(rotor.unbalance), rotor.x, turning))
    # unbalances of the throws, whose weights balance them too, are among the rotors
    row = np.fft.fft(mm.force(masses, SPEED)) / mm.STEPS
    orders = np.fft.fftfreq(mm.STEPS, 1.0 / mm.STEPS)

    def couple(star: tuple[float, ...]) -> float:
        late = np.radians(np.array(star) - throws[0])
        star_sum = np.exp(1j * np.outer(orders, late)) @ places
        return float(np.sqrt(np.sum(np.abs(row * star_sum) ** 2)))

    rest = sorted(round(t, 6) for t in throws[1:])
    even = [throws[0] + 60.0 * k for k in range(1, 6)]
    minimum = min(couple((throws[0], *each)) for steps in (rest, even) for each in itertools.permutations(steps))
    assert result.ranks[1].final == pytest.approx(minimum, rel=1e-5)
    assert couple(tuple(throws)) == pytest.approx(minimum, rel=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("cylinders = 3", "cylinders = 4", "engine.cylinders = 4: is no multiple of the 3 banks"),
        ('"two-stroke"', '"four-stroke"', "engine.cycle = four-stroke: has ports in a triangle of cranks"),
        ("reversed_crank = 1", "reversed_crank = 4", "is not one of the three cranks of the triangle; give 1, 2 or 3"),
        ("reversed_crank = 1", "crank_leads = [20]", "engine.crank_leads: has 1 angles"),
        ('crank_distance = "1.1 m"', "", "engine.crank_distance: is missing"),
        ('"1.1 m"', '"0.8 m"', "because their pins meet"),
        ("reversed_crank = 1", 'reversed_crank = 1\nthrows = [{ between = [0, 60] }]', "allows uneven firing"),
    ],
)  # fmt: skip
def test_triangles_that_cannot_be(old: str, new: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, changed(ROW, old, new))
    assert said in str(caught.value).replace('"', "") or said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_leads_too_far_for_gas_are_refused(tmp_path: Path) -> None:
    gas = '[gas]\nmodel = "seiliger"\nimep = "7 bar"\npeak_pressure = "90 bar"\n[[objective]]'
    text = changed(changed(ROW, "[[objective]]", gas), "reversed_crank = 1", "crank_leads = [0, -80]")
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, text)
    assert "deg apart; bring them within 90 deg" in str(caught.value)


def test_inside_the_crankcase_throws_are_given(tmp_path: Path) -> None:
    gas = '[gas]\nmodel = "seiliger"\nimep = "7 bar"\npeak_pressure = "90 bar"\n[[objective]]'
    text = (PROBLEMS / "deltic-nine.toml").read_text(encoding="utf-8")
    text = changed(changed(text, "[[objective]]", gas), '"rms rocking couple"', '"maximum crank-pin force"')
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, text)
    assert "engine.throws: cannot be open in layout 'delta'" in str(caught.value)
