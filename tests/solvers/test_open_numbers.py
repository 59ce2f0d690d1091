"""Any open number of the file: optima, compared with independent models, dependent keys, and keys that stay closed."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, minimize

import laufruhe
from files.test_reader import complaint_about
from laufruhe.errors import InputError, ModelError
from laufruhe.files.nested import number_at, walk, with_value_at
from laufruhe.files.problem_file import file_model
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.problem.evaluation import evaluate, objective_value
from problem_files import PROBLEMS, changed, loaded, written
from searched import searched

ASIDE = """
title = "Single whose mounts stand aside"
[engine]
layout = "inline"
cycle = "two-stroke"
stroke = { between = ["80 mm", "100 mm"], start = "90 mm" }
offset = { between = ["-12 mm", "25 mm"], start = "0 mm" }
rod_length = "150 mm"
reciprocating_mass = "0.8 kg"
throws = [0]
[[operating_points]]
name = "rated"
speed = "3000 rpm"
[mounts]
names = ["left", "right"]
positions = [["0 mm", "70 mm", "0 mm"], ["0 mm", "-50 mm", "0 mm"]]
[[counterweights]]
name = "web"
balance_factor = { between = [0, 1] }
radius = "50 mm"
[objective]
minimise = "rms mount force"
"""
MASS, ROD, SPEED, STEPS = 0.8, 0.15, 3000.0 * math.pi / 30.0, 720


def _radius(stroke: float, offset: float) -> float:
    """Return the crank radius [m] whose piston travels the stroke on a path beside the crank axis."""

    def travel(radius: float) -> float:
        return math.sqrt((ROD + radius) ** 2 - offset**2) - math.sqrt((ROD - radius) ** 2 - offset**2)

    return float(brentq(lambda radius: travel(radius) - stroke, 0.3 * stroke, 0.6 * stroke, xtol=1e-15))


def _rms_mount_force(stroke: float, offset: float, share: float) -> float:
    """Return the root mean square force [N] on two mounts at y = 70 and -50 mm, level with the crank axis."""
    radius, turn = _radius(stroke, offset), 2.0 * np.pi * np.arange(STEPS) / STEPS
    # the crank turns from upright towards the left, the piston's path stands at y = offset
    height = radius * np.cos(turn) + np.sqrt(ROD**2 - (radius * np.sin(turn) - offset) ** 2)
    orders, spectrum = np.fft.fftfreq(STEPS, 1.0 / STEPS), np.fft.fft(height)
    climb = np.fft.ifft(spectrum * 1j * orders).real
    pushed = MASS * np.fft.ifft(spectrum * orders**2).real * SPEED**2
    weight = share * MASS * radius * SPEED**2
    upward, leftward = pushed - weight * np.cos(turn), -weight * np.sin(turn)
    # about the crank axis: the piston pushes at its own path, and the block holds against the torque of its inertia
    moment = pushed * (offset + climb)
    left = (moment + 0.05 * upward) / 0.12
    right = upward - left
    return float(np.sqrt(np.mean(np.stack([left**2, right**2]) + (leftward / 2.0) ** 2)))


def _minimum() -> tuple[float, ...]:
    """Return the least force of a grid and of a search from its best point, with stroke, offset and share."""
    grid = [
        (_rms_mount_force(stroke, offset, share), stroke, offset, share)
        for stroke in (0.08, 0.09, 0.10)
        for offset in np.linspace(-0.012, 0.025, 12)
        for share in np.linspace(0.0, 1.0, 9)
    ]
    bounds = [(0.08, 0.10), (-0.012, 0.025), (0.0, 1.0)]
    result = minimize(lambda x: _rms_mount_force(*x) / 100.0, min(grid)[1:], bounds=bounds, method="L-BFGS-B")
    return min(grid)[0], 100.0 * float(result.fun), *map(float, result.x)


def test_a_pin_offset_and_a_stroke_are_those_of_an_independent_search(tmp_path: Path) -> None:
    """Check that the offset centres the piston between the mounts, and that the stroke is its travel."""
    result = searched(loaded(tmp_path, ASIDE))
    on_grid, minimum, stroke, offset, share = _minimum()
    decided = {entry.name: entry.value for entry in result.decisions}
    assert result.objective.value <= on_grid
    assert result.objective.value == pytest.approx(minimum, rel=1e-5)
    assert decided["engine.stroke"] == pytest.approx(stroke, rel=1e-6)
    assert decided["engine.offset"] == pytest.approx(offset, abs=2e-5)
    assert decided["web.balance_factor"] == pytest.approx(share, abs=2e-3)
    assert 0.003 < offset < 0.02
    part = result.final.engine.slider_cranks[0]
    assert part.crank_radius == pytest.approx(_radius(stroke, decided["engine.offset"]), rel=1e-9)


@pytest.mark.parametrize(("stroke", "offset", "share"), [(0.09, 0.0, 0.0), (0.085, 0.02, 0.4), (0.1, -0.01, 1.0)])
def test_every_value_is_that_of_a_file_with_it(stroke: float, offset: float, share: float, tmp_path: Path) -> None:
    problem = loaded(tmp_path, ASIDE)
    values = {"web.balance_factor": share, "engine.stroke": stroke, "engine.offset": offset}
    held = problem.fixed_at([values[decision.name] for decision in problem.decisions])
    given = problem.with_values(
        {name: value if name.endswith("factor") else f"{value!r} m" for name, value in values.items()}
    )
    forces = [objective_value(each, evaluate(each)) for each in (held, given)]
    assert forces[0] == pytest.approx(forces[1], rel=1e-12)
    assert forces[0] == pytest.approx(_rms_mount_force(stroke, offset, share), rel=1e-6)


def test_dependent_keys_follow_an_open_number(tmp_path: Path) -> None:
    """Check that spacing moves the throws, a speed the loads, and places of mounts the forces."""
    text = changed(ASIDE, "throws = [0]", 'throws = [0, 180]\ncylinder_spacing = { between = ["90 mm", "120 mm"] }')
    problem = loaded(tmp_path, text)
    spacing = next(decision for decision in problem.decisions if decision.name == "engine.cylinder_spacing")
    places = [part.x for part in problem.fixed_at([0.1], [spacing]).engine.slider_cranks]
    assert places[0] - places[1] == pytest.approx(0.1, rel=1e-12)
    text = changed(changed(ASIDE, '"3000 rpm"', '{ between = ["2000 rpm", "4000 rpm"] }'), '"70 mm"',
                   '{ between = ["60 mm", "90 mm"] }')  # fmt: skip
    problem = loaded(tmp_path, text)
    assert [decision.name for decision in problem.decisions][-2:] == [
        "operating_points.rated.speed", "mounts.positions.1.2",
    ]  # fmt: skip
    held = problem.fixed_at([300.0, 0.08], problem.decisions[-2:])
    assert (held.points[0].speed, held.engine.mounts[0].position[1]) == pytest.approx((300.0, 0.08))


@pytest.mark.slow
def test_limits_are_kept_by_what_is_searched() -> None:
    """The ready single: both limits hold it, and no design of a coarse grid within them is better."""
    problem = laufruhe.load(PROBLEMS / "single-stroke-offset.toml")
    result = searched(problem)
    assert all(limit.active for limit in result.limits)
    for stroke in np.linspace(0.12, 0.15, 3):
        for offset in np.linspace(0.0, 0.02, 3):
            held = problem.fixed_at([stroke, offset], problem.decisions[-2:])
            if max(evaluate(held).check_limit(limit).violation for limit in held.limits) <= 0.0:
                assert laufruhe.solve(held).objective.value >= result.objective.value * (1.0 - 1e-5)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("throws = [0]", "throws = [0]\ncylinders = { between = [1, 2] }", "it is a count"),
        ('name = "rated"', 'name = { between = ["a", "b"] }', "a name or a choice"),
        ('"rms mount force"', '"rms mount force"\ndirection_weights = [1, 1, { between = [0, 1] }]',
         "it defines the objective or a limit"),
        ("[objective]", "[search]\nseed = { between = [1, 2] }\n[objective]", "it is a setting of the search"),
        ("[objective]", '[[balancer_shafts]]\nname = "s"\nratio = { between = [1, 2] }\nposition = ["0 m", "0 m"]\n'
         '[[balancer_shafts.unbalances]]\nx = "0 m"\nunbalance = "0 kg m"\n[objective]', "it is a gear ratio"),
        ('name = "rated"\nspeed = "3000 rpm"', 'speed = { between = ["2000 rpm", "3000 rpm"] }',
         "list the operating points one by one"),
        ('speed = "3000 rpm"', 'speed = "3000 rpm"\ngas = false\n[gas]\nmodel = "seiliger"\nimep = "8 bar"\n'
         'peak_pressure = { between = ["60 bar", "80 bar"] }', "is open but has no effect in this engine"),
        ('["80 mm", "100 mm"], start = "90 mm"', '["0 mm", "100 mm"]', "must be more than 0 m"),
        ('["80 mm", "100 mm"], start = "90 mm"', '["80 mm", "100 mm"], start = "120 mm"', "starts outside its bounds"),
        ('["80 mm", "100 mm"], start = "90 mm"', '["80 mm", "100 kg"]', "bound \"100 kg\""),
        ("offset = {", "ofset = {", "is not a key here"),
    ],
)  # fmt: skip
def test_keys_that_cannot_be_open_are_refused_with_a_reason(old: str, new: str, said: str, tmp_path: Path) -> None:
    line = complaint_about(written(tmp_path, changed(ASIDE, old, new)))
    assert said in line
    assert "\n" not in line


def test_the_limit_of_time_keeps_the_best_so_far(tmp_path: Path) -> None:
    result = searched(loaded(tmp_path, ASIDE), 0.2)
    assert "time limit" in result.certificate.method


@pytest.mark.slow
def test_an_engine_that_cannot_turn_is_left_out_and_not_built(tmp_path: Path) -> None:
    """Short rods of long strokes do not let the crank turn: such values are no designs, and the rest is searched."""
    text = changed(ASIDE, '"150 mm"', '{ between = ["40 mm", "150 mm"], start = "150 mm" }')
    problem = loaded(tmp_path, text)
    rod = next(decision for decision in problem.decisions if decision.name == "engine.rod_length")
    with pytest.raises(ModelError, match="blocks the crank"):
        problem.fixed_at([0.04], [rod])
    result = searched(problem)
    part = result.final.engine.slider_cranks[0]
    assert part.rod_length > part.crank_radius + abs(part.offset)
    assert result.objective.value <= searched(problem.fix("engine.rod_length")).objective.value * (1.0 + 1e-6)


def test_a_bound_of_a_number_given_twice_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="rod_ratio"):
        loaded(
            tmp_path,
            changed(ASIDE, 'rod_length = "150 mm"', 'rod_length = "150 mm"\nrod_ratio = { between = [0.2, 0.3] }'),
        )


def _every_number(name: str) -> Iterator[tuple[dict[str, Any], tuple[str | int, ...]]]:
    """Yield the tables of a ready problem with one number open about where it stands, and its address, for each."""
    tables = tables_of(PROBLEMS / f"{name}.toml")
    for place, node in walk(tables):
        number = None if isinstance(node, dict | list | bool) else number_at(file_model(), place)
        match = None if number is None else re.fullmatch(r"\s*([-+.\deE]+)(\D*.*)", str(node))
        if match is not None:
            value, unit = float(match[1]), match[2] if isinstance(node, str) else ""
            ends = [0.97 * value, 1.03 * value] if value else [0.0, 0.01]
            low, high = ((f"{end!r}{unit}" if unit else end) for end in sorted(ends))
            yield with_value_at(tables, place, {"between": [low, high], "start": node}), place


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["tractor-single", "boxer-four", "powertrain-torque-roll", "inline-five-torsion", "deltic-nine"]
)
def test_every_number_of_a_file_is_open_or_refused_in_a_line(name: str) -> None:
    """The middle of its bounds is an engine as the file with that number draws it."""
    opened, refused = 0, list[str]()
    for tables, place in _every_number(name):
        try:
            problem = load_tables(tables, Path(f"{name}.toml"))
        except InputError as error:
            refused.append(str(error))
            continue
        numbers = [decision for decision in problem.decisions if decision.address_drives]
        opened += len(numbers)
        for decision in numbers:
            middle = 0.5 * (decision.lower + decision.upper)
            (drive,) = decision.address_drives
            drawn = load_tables(with_value_at(tables, place, drive.written(middle)), Path(f"{name}.toml"))
            held = problem.fixed_at([middle], [decision])
            assert (held.engine, held.points) == (drawn.engine, drawn.points)
    assert opened > 5
    assert not [line for line in refused if "\n" in line]
