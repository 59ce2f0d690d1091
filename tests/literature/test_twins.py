"""Parallel, vee and flat twins of the course notes on piston machines, chapters 4 and 5; masses moved step by step."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from laufruhe.errors import InputError
from laufruhe.extensions.twins import picture as twins
from laufruhe.files.reader import load, load_tables
from laufruhe.machine.crank_names import CRANKS, name_of_crank
from laufruhe.physics.rigid_body import turning_parts
from laufruhe.solvers import solve
from laufruhe.solvers.result import Result
from problem_files import PROBLEMS, changed, loaded
from ready import solved

ComplexArray = NDArray[np.complex128]

TWINS = ["parallel-360", "parallel-180", "parallel-270", "vee-open", "vee-offset-pins", "boxer"]


def _solved(name: str) -> Result:
    return solved(f"twin-{name}")


def _shares(result: Result, order: int, columns: tuple[int, int]) -> tuple[float, float]:
    """Return the sizes of the forward and the backward part of an order, in forces of one piston's first order."""
    part, speed = result.final.engine.slider_cranks[0], result.problem.points[0].speed
    unit = part.reciprocating_mass * part.crank_radius * speed**2
    values = result.final.loads[0].wrench.at(order)
    forward, backward = turning_parts(*values[list(columns)])
    return abs(forward) / unit, abs(backward) / unit


def _masses(result: Result, phi: NDArray[np.float64]) -> list[tuple[float, float, ComplexArray]]:
    """Return the mass, place along the crank and place across it of all that moves, by plain geometry."""
    found = []
    for part in result.final.engine.slider_cranks:
        alpha = phi + part.throw - part.bank
        along = part.crank_radius * np.cos(alpha) + np.sqrt(
            part.rod_length**2 - (part.crank_radius * np.sin(alpha)) ** 2
        )
        found.append((part.reciprocating_mass, part.x, along * np.exp(1j * part.bank)))
        turning = part.crank_radius * np.exp(1j * (phi + part.throw))
        found.append((part.rotating_mass, part.x, turning))
    for rotor in result.final.engine.rotors:
        axis = complex(rotor.shaft.z, rotor.shaft.y)
        found.append((1.0, rotor.x, axis + rotor.unbalance * np.exp(1j * rotor.shaft.ratio * phi)))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", TWINS)
def test_designs_against_masses_that_are_moved_step_by_step(name: str) -> None:
    """Compare force, couple and roll moment with Newton's law by differences and energy (C7)."""
    result = _solved(name)
    point, step, phi = result.problem.points[0], 2e-3, np.linspace(0.0, 2.0 * math.tau, 49)
    around = [_masses(result, phi + k * step) for k in (-2, -1, 0, 1, 2)]
    expected, size = np.zeros((len(phi), 6)), 0.0
    for (mass, x, a), (_, _, b), (_, _, c), (_, _, d), (_, _, e) in zip(*around, strict=True):
        velocity = point.speed * (8.0 * (d - b) - (e - a)) / (12.0 * step)
        acceleration = point.speed**2 * (16.0 * (d + b) - (e + a) - 30.0 * c) / (12.0 * step**2)
        force = -mass * acceleration
        expected[:, 1] += force.imag
        expected[:, 2] += force.real
        expected[:, 3] += mass * (
            (np.conj(c) * acceleration).imag - (np.conj(velocity) * acceleration).real / point.speed
        )
        expected[:, 4] -= x * force.real
        expected[:, 5] += x * force.imag
        size += float(np.abs(force).max())
    found = result.final.loads[0].wrench.values(phi)
    columns = [1, 2, 4, 5] if point.gas is not None else [1, 2, 3, 4, 5]
    np.testing.assert_allclose(found[:, columns], expected[:, columns], atol=1e-6 * size)


@pytest.mark.slow
@pytest.mark.parametrize("name", TWINS)
def test_every_twin_is_proven(name: str) -> None:
    result = _solved(name)
    assert result.certificate is not None
    assert str(result.certificate.kind) == "global"
    assert result.certificate.gap <= result.problem.tolerance


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "intervals"),
    [("parallel-360", (360, 360)), ("parallel-180", (180, 540)), ("parallel-270", (270, 450)), ("boxer", (360, 360))],
)
def test_firings(name: str, intervals: tuple[float, float]) -> None:
    """Check chapter 4: in step, even; at 180 degrees, uneven in four strokes."""
    assert np.degrees(_solved(name).final.engine.firing_intervals) == pytest.approx(intervals)


def test_a_right_angled_vee_fires_at_270_and_450_degrees() -> None:
    """Chapter 5: two power strokes at 270 degrees, then a gap of 450."""
    engine = load(PROBLEMS / "vee-two-90.toml").engine
    assert sorted(np.degrees(engine.firing_intervals)) == pytest.approx([270, 450])


@pytest.mark.slow
class TestBalance:
    """Remaining forces, in units of one piston's first order."""

    def test_in_step_as_a_single_of_both_pistons(self) -> None:
        """Check that half the mass in the weights leaves half of the force, all backward."""
        forward, backward = _shares(_solved("parallel-360"), 1, (1, 2))
        assert (forward, backward) == pytest.approx((0.0, 1.0), abs=1e-5)

    def test_at_180_degrees_secondary_forces_add_up(self) -> None:
        """Fig. 4.3: no primary force; the secondary one is twice that of a single piston."""
        result = _solved("parallel-180")
        assert _shares(result, 1, (1, 2)) == pytest.approx((0.0, 0.0), abs=1e-6)
        part = result.final.engine.slider_cranks[0]
        ratio = part.rod_ratio
        assert sum(_shares(result, 2, (1, 2))) == pytest.approx(
            2.0 * (ratio + ratio**3 / 4 + 15 * ratio**5 / 128), rel=1e-4
        )

    def test_at_270_degrees_no_secondary_force_is_left(self) -> None:
        """Check that one balancer and the webs take all of order 1, and that couples of order 2 remain."""
        result = _solved("parallel-270")
        assert _shares(result, 2, (1, 2)) == pytest.approx((0.0, 0.0), abs=1e-9)
        assert _shares(result, 1, (1, 2)) == pytest.approx((0.0, 0.0), abs=1e-6)
        assert _shares(result, 1, (4, 5)) == pytest.approx((0.0, 0.0), abs=1e-6)
        assert sum(_shares(result, 2, (4, 5))) > 0.01

    def test_the_best_bank_lies_near_a_right_angle(self) -> None:
        """Chapter 5: at 90 degrees weights take the primary force; the secondary forces shift the best."""
        result = _solved("vee-open")
        assert 85.0 < math.degrees(result.phasing.ranking[0].bank_angle) < 90.0
        assert _shares(result, 1, (1, 2))[0] < 1e-6

    def test_offset_pins_leave_no_primary_force(self) -> None:
        """S31: backward parts are e^{i (2 b - o)} of each cylinder, so 2 beta + delta = 180 degrees."""
        text = (PROBLEMS / "twin-vee-offset-pins.toml").read_text(encoding="utf-8")
        first = changed(text, 'minimise = "rms shaking force"', 'minimise = "rms shaking force"\norders = [1]')
        result = solve(load_tables(tomllib.loads(first), PROBLEMS / "twin.toml"))
        assert math.degrees(result.phasing.ranking[0].split_pin) == pytest.approx(76.0, abs=0.01)
        # with the second order it moves to where both together are least
        both = _solved("vee-offset-pins")
        assert 60.0 < math.degrees(both.phasing.ranking[0].split_pin) < 76.0

    def test_a_flat_twin_has_a_couple_alone(self) -> None:
        """Fig. 5.3: forces of both orders cancel."""
        result = _solved("boxer")
        for order in (1, 2):
            wrench = np.abs(result.initial.loads[0].wrench.at(order))
            assert wrench[1:3] == pytest.approx([0.0, 0.0], abs=1e-9 * wrench[4:].max())


class TestNames:
    """Cranks as riders call them."""

    @pytest.mark.parametrize("name", CRANKS)
    def test_a_crank_has_its_name_however_it_is_turned(self, name: str) -> None:
        throws = [math.radians(angle) for angle in CRANKS[name]]
        assert name_of_crank(throws) == name
        assert name_of_crank([angle + 1.0 for angle in throws]) == name
        assert name_of_crank([-angle for angle in throws][::-1]) == name

    def test_others_have_none(self) -> None:
        assert not name_of_crank([0.0, 1.0])
        assert not name_of_crank([0.0])

    def test_an_unknown_twin_name_is_refused(self, tmp_path: Path) -> None:
        text = (PROBLEMS / "twin-parallel-270.toml").read_text(encoding="utf-8")
        with pytest.raises(InputError, match='"parallel-270"') as caught:
            loaded(tmp_path, changed(text, '"parallel-270"', '"parallel-275"'))
        assert len(str(caught.value).splitlines()) == 1

    def test_a_crank_of_another_number_of_throws_is_refused(self, tmp_path: Path) -> None:
        text = (PROBLEMS / "twin-parallel-270.toml").read_text(encoding="utf-8")
        with pytest.raises(InputError, match=r"engine\."):
            loaded(tmp_path, changed(text, '"parallel-270"', '"cross-plane"'))


def test_forward_and_backward_part_make_the_whole() -> None:
    """z + i y = F e^{i h phi} + B e^{-i h phi} at every angle."""
    lateral, vertical = 0.3 - 0.8j, -1.1 + 0.2j
    forward, backward = turning_parts(lateral, vertical)
    phi = np.linspace(0.0, 6.0, 7)
    whole = (vertical * np.exp(1j * phi)).real + 1j * (lateral * np.exp(1j * phi)).real
    np.testing.assert_allclose(forward * np.exp(1j * phi) + backward * np.exp(-1j * phi), whole, atol=1e-14)


@pytest.mark.slow
def test_the_picture_shows_the_firings_and_both_parts() -> None:
    drawn = twins.figure(_solved("parallel-270"))
    words = [text.get_text() for axes in drawn.axes for text in axes.texts]
    assert {"270°", "450°"} <= set(words)
    titles = {axes.get_title(loc="left") for axes in drawn.axes}
    assert {"primary force", "secondary force", "primary couple", "secondary couple"} <= titles
    assert twins.applies(_solved("boxer"))


def _words(name: str) -> str:
    drawn = twins.figure(solved(name))
    return " ".join([*(text.get_text() for text in drawn.texts), *(axes.get_title(loc="left") for axes in drawn.axes)])


@pytest.mark.slow
def test_the_picture_names_the_cranks_of_parallel_twins_alone() -> None:
    """Check that a vee on one pin, with throws of a parallel-360, has no such name."""
    assert "; crank parallel-270." in _words("twin-parallel-270")
    assert "parallel" not in _words("twin-vee-open")


@pytest.mark.slow
def test_the_picture_says_of_no_steam_engine_that_it_fires() -> None:
    words = _words("steam-two-crank")
    assert "iring" not in words
    assert "Dead centres at the head end, and forward and backward loads" in words
