"""Counterweights for main-bearing loads: optima, compared with independent searches, and refused input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

import laufruhe
from laufruhe.errors import InputError
from laufruhe.extensions.bearing_loads.channels import MAIN_BEARING_FORCE
from laufruhe.extensions.bearing_loads.machine import bearings_of
from laufruhe.problem.problem import Problem
from laufruhe.problem.static_load import with_loads
from laufruhe.report.json_result import as_dict
from problem_files import MOUNTS
from ready import solved

THREE = """
title = "Three with bearings"
[engine]
layout = "inline"
cycle = "four-stroke"
bore = "100 mm"
stroke = "120 mm"
rod_ratio = 0.26
reciprocating_mass = "2 kg"
rotating_mass = "2.5 kg"
cylinder_spacing = "125 mm"
firing_order = [1, 3, 2]
[[operating_points]]
speed = "2600 rpm"
[gas]
model = "wiebe"
imep = "6 bar"
start = "-8 deg"
duration = "60 deg"
""" + "".join(f'[[main_bearings]]\nx = "{x} mm"\ndiameter = "70 mm"\nwidth = "30 mm"\n' for x in (190, 62, -62, -190))


def web(throw: int, open_: bool = True) -> str:
    """Return a counterweight opposite a throw, beside its middle."""
    mass = '{ between = ["0 kg", "4 kg"] }' if open_ else '"0 kg"'
    x = {1: 150, 2: 20, 3: -140}[throw]
    return (f'[[counterweights]]\nname = "web {throw}"\nx = "{x} mm"\nopposite_throw = {throw}\nradius = "80 mm"\n'
            f"mass = {mass}\n")  # fmt: skip


def minimise(quantity: str, narrowed: str = "") -> str:
    return f'[objective]\nminimise = "{quantity}"\n{narrowed}\n'


def limited(quantity: str, maximum: str) -> str:
    return f'[[constraints]]\nlimit = "{quantity}"\nmax = "{maximum}"\n'


WEBS = web(1) + web(2) + web(3)


def read(tmp_path: Path, text: str) -> Problem:
    path = tmp_path / "three.toml"
    path.write_text(text, encoding="utf-8")
    return laufruhe.load(path)


def bearings_by_hand(problem: Problem, masses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the force on each bearing from the bare crank and weights by lever rule, shape (720, 4, 2)."""
    bare = problem.design([0.0] * len(masses))
    initial = laufruhe.evaluate(bare, problem.points).final.loads[0]
    force = MAIN_BEARING_FORCE.signal(initial).sample(720)[..., 1:]
    angles = 4.0 * np.pi * np.arange(720) / 720
    speed, x = problem.points[0].speed, [bearing.x for bearing in bearings_of(problem.engine)]
    for mass, rotor in zip(masses, problem.engine.rotors[-len(masses) :], strict=True):
        throw = {150: 1, 20: 2, -140: 3}[round(1e3 * rotor.x)]
        at = problem.engine.slider_cranks[throw - 1].throw + np.pi
        pull = mass * 0.080 * speed**2 * np.stack([np.sin(angles + at), np.cos(angles + at)], axis=1)
        k = next(j for j in range(3) if x[j] >= rotor.x >= x[j + 1])
        far = (x[k] - rotor.x) / (x[k] - x[k + 1])
        force[:, k] += (1.0 - far) * pull
        force[:, k + 1] += far * pull
    return force


NORMS = {
    "mean": lambda rows: np.linalg.norm(rows, axis=-1).mean(),
    "maximum": lambda rows: np.linalg.norm(rows, axis=-1).max(),
    "rms": lambda rows: np.sqrt((rows**2).sum(axis=-1).mean()),
}


@pytest.mark.parametrize("norm", NORMS)
def test_no_search_finds_less(tmp_path: Path, norm: str) -> None:
    problem = read(
        tmp_path, THREE + WEBS + minimise(f"{norm} main-bearing force") + limited("counterweight mass", "4 kg")
    )
    result = laufruhe.solve(problem)
    assert result.status == "optimal"
    assert result.certificate is not None
    value = NORMS[norm]
    masses = np.array([d.value for d in result.decisions])
    # a largest value is sought between these angles as well
    assert result.objective.value == pytest.approx(value(bearings_by_hand(problem, masses)), rel=2e-4)
    rng = np.random.default_rng(3)
    for _ in range(2):
        start = rng.dirichlet([1.0, 1.0, 1.0, 1.0])[:3] * 4.0
        found = minimize(
            lambda m: value(bearings_by_hand(problem, m)), start, method="SLSQP", bounds=[(0.0, 4.0)] * 3,
            constraints={"type": "ineq", "fun": lambda m: 4.0 - m.sum()},
        )  # fmt: skip
        assert found.fun > result.certificate.lower_bound * (1.0 - 2e-4)
        assert found.fun > result.objective.value * (1.0 - 3e-4)
    assert result.objective.value < 0.97 * result.objective.initial


def test_price_of_mass_is_what_more_of_it_brings(tmp_path: Path) -> None:
    def solved(maximum: float) -> laufruhe.Result:
        text = THREE + WEBS + minimise("mean main-bearing force") + limited("counterweight mass", f"{maximum} kg")
        return laufruhe.solve(read(tmp_path, text + "\n"))

    low, middle, high = (solved(maximum) for maximum in (3.9, 4.0, 4.1))
    slope = (low.objective.value - high.objective.value) / 0.2
    assert slope > 100.0
    assert middle.limits[0].shadow_price == pytest.approx(slope, rel=0.02)


def test_more_freedom_is_never_worse(tmp_path: Path) -> None:
    values = []
    for text in (web(1) + web(2, open_=False) + web(3, open_=False), web(1) + web(2) + web(3, open_=False), WEBS):
        values.append(
            laufruhe.solve(read(tmp_path, THREE + text + minimise("maximum main-bearing force"))).objective.value
        )
    assert values[0] >= values[1] * (1.0 - 1e-4)
    assert values[1] >= values[2] * (1.0 - 1e-4)


@pytest.mark.slow
def test_mounts_and_bearings_limit_each_other(tmp_path: Path) -> None:
    """Check that each force, least under a limit on the other, gives the same design."""
    near = "tolerance = 1e-3\n" + THREE + MOUNTS + WEBS
    first = laufruhe.solve(
        read(tmp_path, near + minimise("mean main-bearing force") + limited("mean mount force", "600 N"))
    )
    maximum = first.objective.value
    text = near + minimise("mean mount force") + limited("mean main-bearing force", f"{maximum} N")
    second = laufruhe.solve(read(tmp_path, text))
    assert first.limits[0].active
    assert second.objective.value == pytest.approx(first.limits[0].value, rel=3e-4)


def test_pressure_is_force_over_area(tmp_path: Path) -> None:
    force, pressure = (
        laufruhe.solve(read(tmp_path, THREE + WEBS + minimise(f"maximum main-bearing {what}"))).objective.value
        for what in ("force", "pressure")
    )
    assert pressure == pytest.approx(force / (0.070 * 0.030), rel=1e-4)


def test_friction_power_is_what_the_bearings_lose_in_sum(tmp_path: Path) -> None:
    """Compare with mu |F| v summed by hand (B7), for all bearings, one, and less mass."""
    rubbing = THREE.replace('width = "30 mm"', 'width = "30 mm"\nfriction = 0.012')
    problem = read(tmp_path, rubbing + WEBS + minimise("mean friction power") + limited("counterweight mass", "4 kg"))
    result = laufruhe.solve(problem)
    forces = bearings_by_hand(problem, np.array([d.value for d in result.decisions]))
    lost = 0.012 * 0.035 * problem.points[0].speed * np.linalg.norm(forces, axis=-1).mean(axis=0)
    assert result.objective.value == pytest.approx(lost.sum(), rel=2e-4)
    assert result.certificate is not None
    assert result.certificate.kind == "global"
    assert [one["mean"] for one in as_dict(result)["friction"]] == pytest.approx(lost.tolist(), rel=2e-4)
    # one coefficient and one diameter for all: the design of least mean force
    force = laufruhe.solve(
        read(tmp_path, THREE + WEBS + minimise("mean main-bearing force") + limited("counterweight mass", "4 kg"))
    )
    assert force.objective.value * 4 * 0.012 * 0.035 * problem.points[0].speed == pytest.approx(lost.sum(), rel=2e-4)
    alone = read(tmp_path, rubbing + WEBS + minimise("mean friction power", 'bearings = ["2"]'))
    measure = alone.objective[0].measure
    assert result.final.value(measure) == pytest.approx(lost[1], rel=2e-4)
    with pytest.raises(InputError, match=r"objective\.alternating.*means nothing for .*; leave it out"):
        read(tmp_path, rubbing + WEBS + minimise("mean friction power", "alternating = true"))
    assert with_loads(alone, alternating=True).objective == alone.objective


@pytest.mark.slow
def test_a_weight_is_placed_along_the_crank_for_bearings(tmp_path: Path) -> None:
    """Compare with the best of six places, each with proven weights."""
    text = THREE + WEBS + minimise("mean main-bearing force")
    found = laufruhe.solve(read(tmp_path, text.replace('x = "150 mm"', 'x = { between = ["100 mm", "150 mm"] }')))
    assert found.certificate.kind == "global"
    row = (read(tmp_path, text.replace('x = "150 mm"', f'x = "{x} mm"')) for x in (100, 110, 120, 130, 140, 150))
    assert found.objective.value <= min(laufruhe.solve(one).objective.value for one in row) * (1.0 + 1e-4)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (('x = "62 mm"', 'x = "175 mm"'), r"main_bearings\[2\].x = \"175 mm\": lets its journal overlap"),
        (('x = "62 mm"', 'x = "0 mm"'), "is the place of a crank pin"),
        (('x = "-190 mm"', 'x = "-100 mm"'), "leaves the throw of cylinder 3 at x = -125 mm on one side of all"),
        (('diameter = "70 mm"', "friction = 0.01"), r"main_bearings\[1\].friction = .*: needs the diameter"),
        (('mean main-bearing force"', 'maximum friction power"'), "is no quantity"),
        (('x = "62 mm"', 'shaft = "left"\nx = "62 mm"'), "is no shaft with cranks"),
        (('x = "62 mm"', 'name = "1"\nx = "62 mm"'), "is already the name of another bearing"),
        (('mean main-bearing force"', 'mean main-bearing force"\nbearings = ["7"]'), "is no main bearing here"),
        (('mean main-bearing force"', 'mean main-bearing force"\nmounts = ["a"]'), "means nothing for main-b"),
        (('"mean main-bearing force"', '"mean shaking force"\nbearings = ["1"]'), "means nothing for shaking force"),
    ],
)  # fmt: skip
def test_one_line_for_what_is_wrong(tmp_path: Path, change: tuple[str, str], line: str) -> None:
    text = (THREE + WEBS + minimise("mean main-bearing force")).replace(*change)
    with pytest.raises(InputError, match=line):
        read(tmp_path, text)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tractor-four-bearings", "tractor-three-bearings"])
def test_ready_problems_are_proven(name: str) -> None:
    result = solved(name)
    assert result.status == "optimal"
    assert result.certificate is not None
    assert result.certificate.kind == "global"
    assert result.objective.value < 0.55 * result.objective.initial
