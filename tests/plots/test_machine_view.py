"""The drawing of the engine is to scale."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from cli import scenes
from laufruhe.files.reader import load
from laufruhe.plots.machine_view import EngineView, planes_of, reaches
from laufruhe.plots.results import engine
from laufruhe.present.poses import STEEL, THICKNESS, Pose, half_disc
from laufruhe.solvers import evaluate_only
from picture_faults import faults_of
from problem_files import PROBLEMS


@pytest.mark.parametrize("name", ["vee-six-60", "radial-seven", "boxer-four", "vr-six"])
def test_pistons_go_through_their_stroke_on_their_axes(name: str) -> None:
    for part in load(PROBLEMS / f"{name}.toml").engine.slider_cranks:
        poses = [Pose.at_angle(part, phi) for phi in np.linspace(0.0, math.tau, 361)]
        along = np.array([(pose.piston - pose.crank) * cmath.exp(-1j * part.bank) for pose in poses])
        assert np.ptp(along.real) == pytest.approx(part.stroke, rel=0.02)
        assert np.abs(along.imag - part.offset).max() < 1e-9
        rods = [abs(pose.piston - pose.pin) for pose in poses]
        if name != "radial-seven":
            assert rods == pytest.approx([part.rod_length] * len(rods))


def test_pins_turn_clockwise_seen_from_the_front() -> None:
    """C3: a pin at (y, z) = r (sin phi, cos phi)."""
    part = load(PROBLEMS / "tractor-single.toml").engine.slider_cranks[0]
    pin = Pose.at_angle(part, 0.25 * math.pi).pin
    assert (pin.imag, pin.real) == pytest.approx((part.crank_radius * math.sqrt(0.5),) * 2)


def test_a_half_disc_has_the_unbalance_that_it_stands_for() -> None:
    radius = half_disc(0.03)
    r, a = np.meshgrid((np.arange(2000) + 0.5) / 2000 * radius, (np.arange(400) + 0.5) / 400 * math.pi)
    moment = (r * np.sin(a) * r).mean() * radius * math.pi * STEEL * THICKNESS
    assert moment == pytest.approx(0.03, rel=1e-4)


def test_decided_parts_are_marked() -> None:
    result = scenes.solved(scenes.TIGHT)
    view = EngineView.from_result(result)
    assert view.rotors == {rotor.name for rotor in result.final.engine.rotors}
    assert not view.cranks
    labels = [text.get_text() for text in engine.figure(result).legends[0].get_texts()]
    assert "weight, optimised" in labels
    front, side = reaches(view)
    assert front
    assert side


@pytest.mark.parametrize(
    ("name", "cranks", "pistons", "rods"),
    [
        ("single-rod-length", 0, 0, True), ("worked-diesel-sizes", 1, 0, True), ("geared-three-leads", 2, 0, False),
        ("opposed-pistons-masses", 0, 1, False), ("vee-eight-open", 1, 0, False),
    ],
)  # fmt: skip
def test_leads_masses_and_sizes_that_are_open_are_marked(name: str, cranks: int, pistons: int, rods: bool) -> None:
    result = evaluate_only(load(PROBLEMS / f"{name}.toml"))
    view = EngineView.from_result(result)
    assert (len(view.cranks), len(view.pistons), view.rods) == (cranks, pistons, rods)
    labels = {text.get_text() for text in engine.figure(result).legends[0].get_texts()}
    counts = {"crank, open": cranks, "piston, open": pistons, "rod, open": rods}
    assert {label for label, count in counts.items() if count} == labels & set(counts)


@pytest.mark.parametrize(
    ("name", "ahead", "beside"), [("radial-seven", 7, 0), ("deltic-row", 6, 0), ("vee-six-60", 0, 6)]
)
def test_cylinders_are_numbered_where_they_do_not_cover_each_other(name: str, ahead: int, beside: int) -> None:
    problem = load(PROBLEMS / f"{name}.toml")
    drawn = engine.figure(evaluate_only(problem))
    assert not faults_of(drawn, problem.title)
    front, side = drawn.axes
    for axes, count in ((front, ahead), (side, beside)):
        numbers = [number for text in axes.texts for number in text.get_text().split(", ")]
        assert sorted(map(int, numbers)) == list(range(1, count + 1))


def test_a_weight_stands_where_no_rod_runs() -> None:
    """Check halves on the webs if its plane is that of a rod, else the place of the file."""
    bores = {"tractor-single": 0.1, "tractor-six-bearings": 0.1}
    for name, bore in bores.items():
        view = EngineView.from_result(evaluate_only(load(PROBLEMS / f"{name}.toml")))
        for rotor in view.engine.rotors:
            planes = planes_of(view, rotor)
            assert sum(x * thickness for x, thickness in planes) == pytest.approx(rotor.x * THICKNESS)
            for x, thickness in planes:
                gaps = [abs(x - part.x) - 0.5 * thickness - 0.08 * bore for part in view.engine.slider_cranks]
                assert min(gaps) > 0.0
