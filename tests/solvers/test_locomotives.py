"""Two-cylinder locomotive: hammer blow, surging and swaying against closed forms and masses followed one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

import laufruhe
from laufruhe.errors import InputError
from laufruhe.extensions.bearing_loads.physics import hammer_blows
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.problem.problem import Problem
from laufruhe.report.wording import headline
from laufruhe.solvers import Result
from problem_files import PROBLEMS

pytestmark = pytest.mark.slow

MASS, PIN, RADIUS, ROD = 320.0, 290.0, 0.33, 2.6
APART, GAUGE, SPEED = 2.1, 1.5, 300.0 * math.tau / 60.0
FORCE = MASS * RADIUS * SPEED**2


def limited(share: float) -> Problem:
    """Return the surging and swaying as a balanced share of the reciprocating masses leaves them."""
    return laufruhe.load(PROBLEMS / "locomotive-two-cylinder.toml").with_values(
        {
            "constraints.surging.max": f"{math.sqrt(2.0) * (1.0 - share) * FORCE} N",
            "constraints.swaying.max": f"{(1.0 - share) * FORCE * APART / math.sqrt(2.0)} N m",
        }
    )


@pytest.fixture(scope="module")
def solved() -> Result:
    return laufruhe.solve(limited(0.4))


@pytest.mark.parametrize("share", [0.15, 0.75])
def test_least_hammer_blow_is_that_of_the_balanced_share(share: float) -> None:
    """Check B9: a share of each crank's mass is no worse than any weights in the wheels."""
    result = laufruhe.solve(limited(share))
    assert result.certificate.kind == "global"
    assert result.objective.value == pytest.approx(
        share * FORCE * math.sqrt(0.5 * (1.0 + (APART / GAUGE) ** 2)), rel=1e-5
    )


def test_one_share_for_both_throws_is_the_same(solved: Result) -> None:
    problem = laufruhe.load(PROBLEMS / "locomotive-balanced-share.toml").with_values(
        {
            f"constraints.{limit.name}.max": f"{limit.maximum} {limit.measure.channel.unit}"
            for limit in solved.problem.limits
        }
    )
    result = laufruhe.solve(problem)
    assert result.certificate.kind == "global"
    assert result.final.value(result.problem.objective[0].measure) == pytest.approx(solved.objective.value, rel=1e-5)
    assert [decision.value for decision in result.decisions] == pytest.approx([0.4], rel=1e-5)
    assert "goes from 0 N, which breaks a limit, to" in headline(result)


def test_loads_are_those_of_masses_that_are_followed(solved: Result) -> None:
    """Places of all masses along the track and upwards, differentiated twice over a turn."""
    engine, point = solved.final.engine, solved.problem.points[0]
    steps = 512
    phi = math.tau * np.arange(steps) / steps
    orders = np.fft.fftfreq(steps, 1.0 / steps)

    def pull(mass: float, place: np.ndarray) -> np.ndarray:
        return -mass * SPEED**2 * np.fft.ifft(-(orders**2) * np.fft.fft(place)).real

    surging, swaying, upwards, couple = (np.zeros(steps) for _ in range(4))
    for x, lead in ((0.5 * APART, 0.0), (-0.5 * APART, 0.5 * math.pi)):
        along = RADIUS * np.cos(phi + lead) + np.sqrt(ROD**2 - (RADIUS * np.sin(phi + lead)) ** 2)
        forces = pull(MASS, along) + pull(PIN, RADIUS * np.cos(phi + lead))
        lifts = pull(PIN, -RADIUS * np.sin(phi + lead))
        surging, swaying, upwards, couple = surging + forces, swaying + x * forces, upwards + lifts, couple + x * lifts
    wheels = [rotor.unbalance for rotor in engine.rotors if "wheel" in rotor.name]
    for x, weight in zip((0.5 * GAUGE, -0.5 * GAUGE), wheels, strict=True):
        arm = abs(weight) * np.exp(1j * (phi + np.angle(weight)))
        forces, lifts = pull(1.0, arm.imag), pull(1.0, arm.real)
        surging, swaying, upwards, couple = surging + forces, swaying + x * forces, upwards + lifts, couple + x * lifts
    wrench, rails = shaking_loads(engine, point).values(phi), hammer_blows(engine, point).values(phi)[..., 0]
    assert wrench[:, 1] == pytest.approx(surging, abs=1e-6 * FORCE)
    assert wrench[:, 5] == pytest.approx(swaying, abs=1e-6 * FORCE)
    assert rails.sum(axis=1) == pytest.approx(upwards, abs=1e-6 * FORCE)
    assert 0.5 * GAUGE * (rails[:, 0] - rails[:, 1]) == pytest.approx(couple, abs=1e-6 * FORCE)
    assert np.abs(rails).max() == pytest.approx(solved.objective.value, rel=1e-4)


def test_more_surging_allowed_never_hammers_more(solved: Result) -> None:
    looser = solved.problem.with_values({"constraints.surging.max": "120 kN"})
    assert laufruhe.solve(looser).objective.value <= solved.objective.value * (1.0 + 1e-6)


def test_turned_to_the_other_side_of_the_track() -> None:
    """Both cylinders to the right with throws turned alike: the same blows, a mirror image of the weights."""
    tables = dict(laufruhe.files.reader.tables_and_path(PROBLEMS / "locomotive-two-cylinder.toml")[0])
    for part in tables["engine"]["slider_cranks"]:
        part["bank_angle"], part["throw"] = -90, part["throw"] - 180
    turned, result = laufruhe.evaluate(tables), laufruhe.evaluate(PROBLEMS / "locomotive-two-cylinder.toml")
    for name in ("maximum hammer blow", "maximum surging force", "maximum swaying couple"):
        one, other = (
            next(d.final.value(m) for m in d.problem.measures if m.name.startswith(name)) for d in (turned, result)
        )
        assert one == pytest.approx(other, rel=1e-9)


def test_axles_hang_over_at_both_ends_and_nothing_else_does() -> None:
    text = (PROBLEMS / "locomotive-two-cylinder.toml").read_text(encoding="utf-8")
    with pytest.raises(InputError, match="on one side of all bearings"):
        laufruhe.load(text.replace('x = "0.75 m"', 'x = "-1.2 m"', 1))
