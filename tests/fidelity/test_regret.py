"""The bound of a regret is not below the regret, and none is stated where the omitted loads depend on decisions."""

from __future__ import annotations

import json
import math
import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from cli import scenes
from fidelity.scenes import random_problem
from lanes import first_fast
from laufruhe.machine import Rotor, Shaft
from laufruhe.numerics.norms import NORMS
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem import channels
from laufruhe.problem.decision import Decision, Kind, RotorDrive
from laufruhe.problem.dependence import keeps_omitted, open_kinds
from laufruhe.problem.error_bounds import regret_bound, signals
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Sector
from laufruhe.report.json_result import as_dict
from laufruhe.report.wording import fidelity_of
from laufruhe.solvers import evaluate_only
from laufruhe.solvers.cones.unbalances import solve_unbalances
from problem_files import PROBLEMS, READY, written
from random_decisions import random_decisions

# a thousand problems, of which `make test` has the first 40
BLOCKS = [(0, 12), (12, 28), (40, 60), *((first, 100) for first in range(100, 1000, 100))]
FIDELITIES = (
    Fidelity("two-order", 96, gas_samples=1440), Fidelity(samples=96, orders=2, gas_samples=1440),
    Fidelity(samples=96, orders=4, gas_samples=1440), Fidelity(samples=96, rod="mass-only", gas_samples=1440),
    Fidelity(samples=96, gas=False), Fidelity(samples=96, gas_orders=3, gas_samples=1440),
)  # fmt: skip


def _scene(rng: random.Random) -> Problem:
    """Return a random engine with an open unbalance on one or two shafts."""
    problem = random_problem(rng)
    size = 2.0 * sum(part.reciprocating_mass * part.crank_radius for part in problem.engine.slider_cranks)
    rotors, decisions = list(problem.engine.rotors), []
    for k, ratio in enumerate(rng.sample([-2.0, -1.0, 1.0, 2.0], rng.choice([1, 1, 2]))):
        name = f"shaft {k}"
        rotors.append(Rotor(name, rng.uniform(-0.2, 0.2), 0j, Shaft(name, ratio, rng.uniform(-0.1, 0.1), 0.05)))
        decisions.append(Decision(f"{name}.unbalance", "kg m", Sector(size), 0j, (RotorDrive(name, 1.0),)))
    channel = rng.choice([channels.MOUNT_FORCE, channels.MOUNT_FORCE, channels.SHAKING_FORCE])
    norm = NORMS[rng.choice(["mean", "rms", "maximum"])]
    return replace(
        problem, engine=replace(problem.engine, rotors=tuple(rotors)), decisions=tuple(decisions),
        objective=(Term(Measure(channel, norm)),),
    )  # fmt: skip


@pytest.mark.parametrize(("first", "count"), first_fast(BLOCKS, 1, 2))
def test_bound_is_not_below_the_regret(first: int, count: int) -> None:
    """Compare the regret bound of optima at cheap fidelities with the exact optimum of the same engine."""
    stated = []
    for seed in range(first, first + count):
        rng = random.Random(60_000 + seed)
        problem = _scene(rng)
        cheap = solve_unbalances(problem.at(rng.choice(FIDELITIES)))
        best = solve_unbalances(problem.at(Fidelity(samples=360, gas_samples=1440)))
        assert cheap.status.has_design
        bound = cheap.regret_bound
        if bound is None:
            continue
        exact = problem.at(Fidelity(samples=5760, gas_samples=1440))
        value, minimum = (objective_value(exact, evaluate(exact, each.final.engine)) for each in (cheap, best))
        assert value / minimum - 1.0 <= bound + 1e-5, seed
        stated.append(bound)
    assert len(stated) > count // 3
    assert min(stated) < 0.3


@pytest.mark.parametrize("path", first_fast(READY, 8, 30), ids=lambda path: path.stem)
def test_omitted_loads_are_the_same_for_all_designs(path: Path) -> None:
    """Check that two random designs omit the same signal if the table of dependences says so."""
    problem = replace(laufruhe.load(path).balance, phasing=None)
    terms = [term.measure for term in problem.objective if term.measure.is_load]
    variant, whole = problem.at(Fidelity(samples=96, orders=2)), problem.at(Fidelity(samples=96))
    for measure in terms if problem.decisions else ():
        same = keeps_omitted(measure.channel, open_kinds(variant), variant)
        assert same or open_kinds(variant) != {Kind.UNBALANCE}
        if not same:
            continue
        designs = [variant.design(list(values)) for values in random_decisions(variant, 2)]
        lacks = [_omitted(measure, whole, variant, engine) for engine in designs]
        scale = max(np.abs(lack).max() for lack in lacks)
        sizes = [np.abs(s.coefficients).max() for s in signals(measure, evaluate(whole, designs[0]))]
        assert np.abs(lacks[0] - lacks[1]).max() <= 1e-9 * max(scale, *sizes)


def _omitted(measure: Measure, whole: Problem, own: Problem, engine: Any) -> Any:
    ours, theirs = (signals(measure, evaluate(problem, engine)) for problem in (whole, own))
    differences = [(x + y.mapped(np.negative)).coefficients for x, y in zip(ours, theirs, strict=True)]
    length = max(map(len, differences))
    return np.stack([np.pad(d, ((0, length - len(d)), (0, 0), (0, 0))) for d in differences])


@pytest.mark.parametrize(
    ("name", "fidelity"),
    [
        ("vee-six-open", Fidelity(orders=4)),
        ("opposed-pistons-masses", Fidelity(orders=4)),
        ("powertrain-least-force", Fidelity(orders=4)),
        ("geared-three-leads", Fidelity(orders=4)),
        ("tractor-four-lanchester", Fidelity(orders=4, crank_inertia=0.5)),
    ],
)
def test_no_bound_where_the_omitted_loads_depend_on_decisions(name: str, fidelity: Fidelity) -> None:
    problem = laufruhe.load(PROBLEMS / f"{name}.toml")
    design = evaluate_only(replace(problem.at(fidelity), decisions=(), phasing=None)).final
    assert regret_bound(problem.at(fidelity), design, 0.9 * objective_value(problem, design)) is None
    # with nothing left out the bound is that of the objective
    exact = problem.at(Fidelity(samples=1440))
    design = evaluate_only(replace(exact, decisions=(), phasing=None)).final
    bound = 0.9 * objective_value(exact, design)
    assert regret_bound(exact, design, bound) == pytest.approx(1.0 / 0.9 - 1.0, rel=1e-9)


def test_no_bound_where_a_limit_lacks_loads(tmp_path: Path) -> None:
    limit = '\n[[constraints]]\nlimit = "maximum mount force"\nmax = "1 MN"\n'
    for more, is_known in (("", True), (limit, False)):
        text = scenes.TIGHT + more + '\n[fidelity]\nkinematics = "two-order"\n'
        result = laufruhe.solve(laufruhe.load(written(tmp_path, text)))
        assert (result.regret_bound is not None) is is_known


SIX = """
title = "Six cylinders with open throws"
[engine]
layout = "inline"
cylinders = 6
cycle = "four-stroke"
bore = "100 mm"
stroke = "120 mm"
rod_ratio = 0.26
reciprocating_mass = "1.25 kg"
cylinder_spacing = "125 mm"
throws = "open"

[[operating_points]]
speed = "2000 rpm"

[[counterweights]]
name = "web"
opposite_throw = 1
radius = "80 mm"
mass = { between = ["1 kg", "6 kg"] }

[objective]
minimise = "counterweight mass"

[[constraints]]
limit = "rms rocking couple"
max = "1 kN m"

[fidelity]
kinematics = "two-order"
"""


def test_no_bound_where_a_limit_lacks_loads_in_other_designs(tmp_path: Path) -> None:
    """The pistons of a mirrored crank have no couple in any order, but those of other cranks have."""
    problem = laufruhe.load(written(tmp_path, SIX))
    assert problem.phasing is not None
    couple = problem.limits[0].measure
    omitted = {}
    for steps in ((0, 1, 2, 2, 1, 0), (0, 0, 1, 1, 2, 2)):
        star = problem.phasing.problem_of(problem.phasing.star(steps, 3, (None, None), ()))
        design, exact = (evaluate(star.at(each)) for each in (star.fidelity, Fidelity(samples=1440)))
        omitted[steps] = exact.value(couple) - design.value(couple)
        assert regret_bound(problem, design, 1.0) is None
    mirrored, other = omitted.values()
    assert mirrored == pytest.approx(0.0, abs=1e-9)
    assert other > 1e-3


def test_bound_is_stated(tmp_path: Path) -> None:
    """Check the bound in result, file and report; with all physics it is the gap of the proof."""
    text = scenes.TIGHT + '\n[fidelity]\nkinematics = "two-order"\n'
    result, exact = (laufruhe.solve(laufruhe.load(written(tmp_path, each))) for each in (text, scenes.TIGHT))
    assert result.regret_bound is not None
    assert exact.regret_bound is not None
    assert as_dict(result)["fidelity"]["regret_bound"] == result.regret_bound
    assert "better by at most" in fidelity_of(result)
    assert "better by at most" not in fidelity_of(exact)
    assert exact.certificate is not None
    assert exact.regret_bound == pytest.approx(exact.certificate.gap, abs=1e-5)
    assert result.regret_bound > exact.regret_bound
    evaluated = laufruhe.evaluate(laufruhe.load(written(tmp_path, text)))
    assert json.loads(json.dumps(as_dict(evaluated)["fidelity"]["regret_bound"])) is None
    assert not math.isnan(result.regret_bound)
