"""Leads of geared shafts, compared with scans and with masses on their paths, and refused input."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import moving_masses as mm
from laufruhe.errors import InputError, ModelError
from laufruhe.extensions.phase_leads.solver import LeadSearch, _Box
from laufruhe.files.reader import load
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.result import Status
from problem_files import PROBLEMS, changed, loaded

THREE = (PROBLEMS / "geared-three-leads.toml").read_text(encoding="utf-8")
RADIUS, ROD, PISTON, SPEED = 0.04, 0.16, 0.8, 1500.0 * np.pi / 30.0
FEW = changed(THREE, "[objective]", "[fidelity]\nsamples = 180\n[objective]")


@pytest.mark.slow
def test_the_ready_problem_is_proven_and_the_least_of_a_scan() -> None:
    """Compare with forces and roll of three pistons on two mounts from their paths, over a grid of leads."""
    result = solve(problem := load(PROBLEMS / "geared-three-leads.toml"))
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    steps = 48
    up, turning = [], []
    for ratio in (1.0, 1.0, -1.0):
        pin = mm.crank_pin(RADIUS, 0.0, ratio)
        path = mm.piston(pin, ROD, 0.0)
        force = mm.force([mm.Mass(PISTON, 0.0, path)], SPEED).real
        rate = mm.differentiated(path, times=1).real
        up.append(force)
        # the torque that the piston takes from the cranks, and the block from them
        turning.append(force * rate)
    places, shift = (0.0, 0.15, -0.15), mm.STEPS // steps // 2 * 2
    minimum = np.inf
    for j in range(0, mm.STEPS, shift):
        for k in range(0, mm.STEPS, shift):
            forces = [np.roll(signal, -by) for signal, by in zip(up, (0, j, k), strict=True)]
            torque = sum(np.roll(signal, -by) for signal, by in zip(turning, (0, j, k), strict=True))
            moment = torque + sum(y * force for y, force in zip(places, forces, strict=True))
            left, right = (0.5 * sum(forces) + side * moment / 0.6 for side in (1.0, -1.0))
            minimum = min(minimum, 0.5 * float(np.mean(np.abs(left)) + np.mean(np.abs(right))))
    value = objective_value(problem, result.final)
    assert value <= minimum * (1.0 + 1e-6)
    assert minimum <= 1.05 * value
    assert result.certificate.lower_bound <= value


def test_forces_with_a_lead_are_those_of_the_masses(tmp_path: Path) -> None:
    text = changed(THREE, "{ between = [0, 360], start = 0 }", "40")
    text = changed(text, "{ between = [0, 360], start = 0 }", "-75")
    wrench = evaluate(loaded(tmp_path, text)).loads[0].wrench.sample(mm.STEPS)
    masses = []
    for ratio, lead, centre in ((1.0, 0.0, 0j), (1.0, 40.0, 0.15j), (-1.0, -75.0, -0.15j)):
        pin = mm.crank_pin(RADIUS, ratio * np.radians(lead), ratio, centre)
        masses.append(mm.Mass(PISTON, 0.0, mm.piston(pin, ROD, 0.0, centre)))
    one = PISTON * RADIUS * SPEED**2
    np.testing.assert_allclose(wrench[:, 2] + 1j * wrench[:, 1], mm.force(masses, SPEED), atol=1e-6 * one)


def test_two_that_turn_alike_are_best_half_a_turn_apart(tmp_path: Path) -> None:
    """Check that the first order vanishes at a lead of 180 deg, and that a narrower range ends at its bound."""
    text = changed(FEW, '[[engine.slider_cranks]]\nshaft = "right"\nx = "0 mm"\n', "")
    text = changed(text, 'ratio = -1\nposition = ["-150 mm", "0 mm"]\nlead = { between = [0, 360], start = 0 }',
                   'position = ["-150 mm", "0 mm"]')  # fmt: skip
    text = changed(text, '"mean mount force"', '"rms shaking force"\norders = [1]')
    result = solve(loaded(tmp_path, text))
    assert result.status is Status.OPTIMAL
    assert np.degrees(result.decisions[0].value) == pytest.approx(180.0, abs=1e-4)
    narrow = solve(loaded(tmp_path, changed(text, "[0, 360], start = 0", "[10, 120]")))
    assert narrow.status is Status.OPTIMAL
    assert np.degrees(narrow.decisions[0].value) == pytest.approx(120.0, abs=1e-6)
    one = PISTON * RADIUS * SPEED**2
    assert narrow.objective is not None
    assert narrow.objective.value == pytest.approx(2.0 * np.cos(np.pi / 3.0) * one / np.sqrt(2.0), rel=1e-5)


def test_a_limit_holds_the_lead_away(tmp_path: Path) -> None:
    """Check that the lead of opposed pistons ends at its bound, and that a limit on the roll moment is kept."""
    text = (PROBLEMS / "opposed-pistons-masses.toml").read_text(encoding="utf-8")
    text = changed(text, '{ between = ["1 kg", "3 kg"] }', '"2 kg"')
    text = changed(text, "crank_lead = 12", "crank_lead = { between = [8, 20] }")
    text = changed(text, "[objective]", "[fidelity]\nsamples = 180\n[objective]")
    result = solve(loaded(tmp_path, text))
    assert result.status is Status.OPTIMAL
    assert np.degrees(result.decisions[0].value) == pytest.approx(8.0, abs=1e-9)
    at_twelve = evaluate(loaded(tmp_path, changed(text, "{ between = [8, 20] }", "12")))
    limit = '[[constraints]]\nlimit = "rms roll moment"\nmax = "{:.9f} N m"\n[objective]'
    measured = np.sqrt(np.mean(at_twelve.loads[0].wrench.sample(360)[:, 3] ** 2))
    held = loaded(tmp_path, changed(text, "[objective]", limit.format(measured)))
    solution = solve(held)
    assert solution.final.value(held.limits[0].measure) <= measured * (1.0 + 2e-5)


def test_bounds_beyond_the_ports_are_refused(tmp_path: Path) -> None:
    text = (PROBLEMS / "opposed-pistons-masses.toml").read_text(encoding="utf-8")
    text = changed(text, "crank_lead = 12", "crank_lead = { between = [0, 30] }\nport_arc = 25")
    with pytest.raises(InputError, match="may exceed the angle for which the ports are open, 25 deg"):
        loaded(tmp_path, text)


COUPLED = (PROBLEMS / "two-machines-angle.toml").read_text(encoding="utf-8")
ALONE = "[[counterweights]]" + COUPLED.split("[[counterweights]]", 1)[1].split("[[operating_points]]")[0]
BARE = changed(changed(COUPLED, ALONE, ""), "[0, 180]", "[0, 360]")
BARE = BARE.split("[[constraints]]")[0] + "[fidelity]\nsamples = 180\n"
JOURNALS = "".join(
    f'[[main_bearings]]\nname = "{name}"\nx = "{x} mm"\nshaft = "{shaft}"\n'
    for name, x, shaft in (
        ("a", 250, "crankshaft"), ("b", 50, "crankshaft"), ("c", -50, "second machine"), ("d", -250, "second machine"),
    )
)  # fmt: skip


LIMIT = '[[constraints]]\nname = "c"\nlimit = "{}"\nmax = "{}"\n[objective]'


def turned(text: str, angle: float) -> str:
    """Return the machines on one crankshaft, the second throw at an angle and fired earlier by it."""
    given = changed(
        text,
        "[[engine.shafts]]                       # on the axis of the first, coupled to it at an angle\n"
        'name = "second machine"\nposition = ["0 mm", "0 mm"]\nlead = { between = [0, 360], start = 90 }\n',
        "",
    )
    return changed(given, 'x = "-150 mm"\nshaft = "second machine"\n',
                   f'x = "-150 mm"\nthrow = {angle}\nfiring_angle = {(360.0 - angle) % 360.0}\n')  # fmt: skip


@pytest.mark.parametrize(
    "objective",
    [
        '"degree of irregularity"', '"peak to peak stored work"', '"rms roll moment"\norders = [1, 2, 3]',
        pytest.param('"maximum crank torque"', marks=pytest.mark.slow),
        pytest.param('"mean mount force"', marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_the_angle_between_machines_is_the_least_of_a_scan(objective: str, tmp_path: Path) -> None:
    """Compare with a scan of the same machines on one crankshaft without a lead."""
    text = changed(BARE, '"rms mount force"', objective)
    result = solve(loaded(tmp_path, text))
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    # at as many angles as it was told at
    fine = result.problem.fidelity
    fixed = [loaded(tmp_path, turned(text, angle)).at(fine) for angle in np.linspace(0.0, 345.0, 24)]
    minimum = min(objective_value(each, evaluate(each)) for each in fixed)
    value = objective_value(result.problem, result.final)
    assert result.certificate.lower_bound <= value <= minimum * (1.0 + 1e-6)
    at_best = loaded(tmp_path, turned(text, float(np.degrees(result.decisions[0].value)))).at(fine)
    assert objective_value(at_best, evaluate(at_best)) == pytest.approx(value, rel=1e-6)


ELASTIC = """[block]
mass = "120 kg"
centre_of_gravity = ["0 mm", "0 mm", "50 mm"]
inertia = ["5 kg m^2", "8 kg m^2", "7 kg m^2"]
[mounts]
kind = "elastic"
stiffness = ["200 N/mm", "200 N/mm", "400 N/mm"]
loss_factor = 0.1
"""
LONGER = (
    ('cycle  = "two-stroke"', 'cycle  = "four-stroke"'), ('imep = "4 bar"', 'imep = "8 bar"'),
    ('"50 bar"', '"70 bar"'), ("[0, 360]", "[0, 720]"),
)  # fmt: skip


def test_on_elastic_mounts_and_over_two_turns_no_angle_is_better(tmp_path: Path) -> None:
    soft, longer = changed(BARE, "[mounts]\n", ELASTIC), BARE
    for old, new in LONGER:
        longer = changed(longer, old, new)
    for text, maximum in ((soft, 360.0), (longer, 720.0)):
        result = solve(loaded(tmp_path, text))
        assert result.certificate is not None
        assert result.certificate.kind is Proof.GLOBAL
        values = []
        for angle in np.linspace(0.0, maximum, 49):
            each = loaded(tmp_path, changed(text, f"{{ between = [0, {maximum:.0f}], start = 90 }}", str(float(angle))))
            values.append(objective_value(each, evaluate(each)))
        value = objective_value(result.problem, result.final)
        assert result.certificate.lower_bound <= value <= min(values) * (1.0 + 1e-6)
        assert max(values) > 1.05 * value


@pytest.mark.slow
def test_weights_and_the_angle_are_proven_together(tmp_path: Path) -> None:
    """Check that no angle of a scan with its best weights is better, and a further limit is no better."""
    coarse = changed(COUPLED, "samples = 360", "samples = 120")
    problem = replace(loaded(tmp_path, coarse), tolerance=1e-3)
    result = solve(problem)
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    value = objective_value(problem, result.final)
    values = {}
    for angle in (90, 165, 175, 178):
        each = solve(loaded(tmp_path, changed(coarse, "{ between = [0, 180], start = 90 }", str(angle))))
        if each.status is Status.OPTIMAL:
            values[angle] = objective_value(each.problem, each.final)
    assert result.certificate.lower_bound <= min(values.values())
    assert value <= min(values.values()) * (1.0 + problem.tolerance)
    assert set(values) == {165, 175, 178}
    free = solve(loaded(tmp_path, COUPLED.split("[[constraints]]")[0] + "[fidelity]\nsamples = 120\n"))
    assert objective_value(free.problem, free.final) <= value * (1.0 + 1e-4)


def test_a_box_near_the_best_design_is_bounded_at_all_angles(tmp_path: Path) -> None:
    """Check that a box far from the best design takes a quarter of the angles, a near one all."""
    text = changed(COUPLED.split("[[constraints]]")[0], '"rms mount force"', '"maximum mount force"')
    search = LeadSearch(loaded(tmp_path, text + "[fidelity]\nsamples = 96\n"))
    for low, high in np.radians([[176.0, 177.0], [150.0, 150.1]]):
        ends = np.array([low]), np.array([high])
        far = search.box(*ends)
        assert isinstance(far, _Box)
        values = [far.bound * factor for factor in (1.0 + search.problem.tolerance, 2.0, 0.5)]
        near, above, under = (search.box(*ends, 0.0, value) for value in values)
        assert isinstance(near, _Box)
        assert isinstance(above, _Box)
        assert isinstance(under, _Box)
        assert near.bound > 1.002 * far.bound
        for lead in np.linspace(low, high, 3):
            program, _ = search.model.at(np.array([lead]), search.samples)
            weights = solve_cones(program).x
            assert weights is not None
            assert near.bound <= program.objective(weights) * (1.0 + 1e-9)
        assert above.bound == under.bound == far.bound


def test_limits_that_no_angle_keeps_are_named(tmp_path: Path) -> None:
    for limit, maximum in (("degree of irregularity", "1/70"), ("peak to peak stored work", "180 J")):
        text = changed(
            BARE, "[objective]", f'[[constraints]]\nname = "c"\nlimit = "{limit}"\nmax = "{maximum}"\n[objective]'
        )
        result = solve(loaded(tmp_path, text))
        assert result.status is Status.INFEASIBLE
        assert result.conflict == ("c",)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"rms mount force"', '"mean main-bearing force"', "no objective or limit depends on it"),
    ],
)  # fmt: skip
def test_unsupported_quantities_with_leads_are_refused(old: str, new: str, said: str, tmp_path: Path) -> None:
    text = changed(BARE, "[objective]", JOURNALS + "[objective]")
    with pytest.raises((InputError, ModelError)) as caught:
        solve(loaded(tmp_path, changed(text, old, new)))
    assert said in str(caught.value)
