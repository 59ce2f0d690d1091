"""Leads of two cranks that share chambers with gas: bound of torques, optima, and refused input."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from laufruhe.errors import ModelError
from laufruhe.extensions.phase_leads.shared_gas import CELLS, SharedGasBoxes, torque_change
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.machine import Cycle, Seiliger, Shaft, SliderCrank
from laufruhe.machine.facing import with_shared_chambers
from laufruhe.physics.gas_loads import chamber_torque
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from problem_files import PROBLEMS
from searched import searched

READY = tables_of(PROBLEMS / "opposed-pistons-lead.toml")


def problem(quantity: str, lead: Any, **more: Any) -> Problem:
    tables = {key: value for key, value in READY.items() if key != "counterweights"}
    tables["engine"] = {**tables["engine"], "crank_lead": lead, **more.pop("engine", {})}
    tables |= {
        "objective": {"minimise": quantity},
        "tolerance": 1e-2,
        "fidelity": {"samples": 180, "gas_samples": 720},
        **more,
    }
    return load_tables({key: value for key, value in tables.items() if value is not None}, Path("shared.toml"))


def between(low: float, high: float, **more: float) -> dict[str, Any]:
    return {"between": [low, high], **more}


def pair(ahead: float, ratio: float, rods: tuple[float, float], radii: tuple[float, float], cycle: Cycle) -> Any:
    """Return two pistons in one cylinder, the upper one with a lead."""
    lower = SliderCrank("lower", 0.0, radii[0], radii[0] / rods[0], 1.0, bore=0.08)
    shaft = Shaft("upper", ratio, 0.0, 1.0)
    upper = SliderCrank(
        "upper", 0.0, radii[1], radii[1] / rods[1], 1.0, math.pi + ratio * ahead, math.pi, bore=0.08, shaft=shaft,
        firing_angle=-ahead % cycle.angle,
    )  # fmt: skip
    return with_shared_chambers((lower, upper), cycle.angle)


@pytest.mark.parametrize("seed", [*range(6), 7, 9])
def test_torque_changes_by_no_more_than_its_bound(seed: int) -> None:
    """Check that the torque at every lead of a box differs by no more than the bound, which is tight."""
    random = np.random.default_rng(seed)
    cycle = (Cycle.TWO_STROKE, Cycle.FOUR_STROKE)[seed % 2]
    ratio, rods, radii = float(random.choice([-1.0, 1.0])), random.uniform(0.1, 0.35, 2), random.uniform(0.03, 0.08, 2)
    geometry, ahead = (tuple(rods), tuple(radii), cycle), 0.0 if seed == 5 else random.uniform(-1.2, 1.2)
    # more than what expands to its end has left
    behind = {"exhaust_pressure": 12e5} if seed > 5 else {}
    gas = Seiliger(peak_pressure=90e5, imep=14e5, compression_ratio=float(random.uniform(12.0, 18.0)), **behind)
    count = CELLS * cycle.turns
    angles = np.sort(np.concatenate([cycle.angle * (np.arange(count) + s) / count for s in (0.01, 0.5, 0.99)]))

    def torque(lead: float) -> np.ndarray:
        parts = pair(lead, ratio, *geometry)
        return sum(chamber_torque(gas, part, cycle, angles - part.firing_angle) for part in parts)

    for half in (1e-4, 3e-3, 0.05):
        maximum = np.repeat(torque_change(gas, pair(ahead, ratio, *geometry)[0], cycle, half), 3)
        here, result = torque(ahead), np.zeros(len(angles))
        for by in (-1.0, -0.6, 0.3, 1.0):
            result = np.maximum(result, np.abs(torque(ahead + by * half) - here))
        assert (result <= maximum * (1.0 + 1e-9) + 1e-9 * np.abs(here).max()).all()
        if half < 0.01:
            assert np.sqrt(np.mean(maximum**2)) < 3.0 * np.sqrt(np.mean(result**2))


SPEEDS = [{"name": "loud", "speed": "2400 rpm", "weight": 3}, {"name": "calm", "speed": "900 rpm"}]


def two_speeds(quantity: str) -> Problem:
    """Return a problem of two operating points, each with its own gas."""
    variant = problem(quantity, between(5, 40), operating_points=SPEEDS)
    loud, calm = variant.points
    return replace(variant, points=(loud, replace(calm, gas=replace(calm.gas, peak_pressure=60e5, imep=3e5))))


@pytest.mark.parametrize("norm", ["rms", "mean", "maximum", "peak to peak"])
def test_a_torque_changes_a_norm_by_no_more_than_its_bound(norm: str) -> None:
    """Compare the bound with the norm of a torque at one point or both, without another load."""
    variant = two_speeds(f"{norm} roll moment")
    (measure,), random = variant.measures, np.random.default_rng(4)
    boxes, weights = SharedGasBoxes(variant), (0.75, 0.25)
    assert measure.shares(variant.points) == pytest.approx(weights)
    for times in ((1.0, 0.0), (0.0, 1.0), (0.3, 2.0)):
        changes = [time * np.abs(random.normal(size=CELLS)) for time in times]
        torques = [np.where(random.random(CELLS) < 0.5, -each, each) for each in changes]
        sizes = np.abs(torques)
        true = {
            "rms": math.sqrt(weights @ np.mean(sizes**2, axis=1)),
            "mean": weights @ np.mean(sizes, axis=1),
            "maximum": sizes.max(),
            "peak to peak": np.ptp(torques, axis=1).max(),
        }[norm]
        bound = boxes._gas_change(measure, changes)
        assert true * (1.0 - 1e-12) <= bound <= 3.0 * true


@pytest.mark.slow
@pytest.mark.parametrize("quantity", ["rms mount force", "maximum roll moment", "peak to peak mount force"])
def test_no_lead_of_a_box_is_under_its_bound(quantity: str) -> None:
    """Check bounds of boxes, which are tight for narrow ones."""
    variant = two_speeds(quantity)
    boxes = SharedGasBoxes(variant)
    for middle, half in ((10.0, 1.0), (25.0, 8.0), (30.0, 0.01)):
        low, high = math.radians(middle - half), math.radians(middle + half)
        bound = float(boxes.bounds(np.array([[low]]), np.array([[high]]))[0][0])
        values = [objective_value(variant, evaluate(variant, variant.design([x]))) for x in np.linspace(low, high, 5)]
        assert bound <= min(values) * (1.0 + 1e-9)
        if half < 0.1:
            assert bound > 0.97 * min(values)


CASES = {
    "largest lead": problem("rms roll moment", between(0, 40)),
    "from no lead on, inside": problem("mean mount force", between(-25, 60)),
    "with the crank": problem("mean mount force", between(5, 60, start=10), engine={"crank_ratio": 1}),
    "a peak": problem("maximum roll moment", between(0, 40, start=5), search={"boxes": 50}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_no_lead_is_better_than_the_bound(name: str) -> None:
    """Check that none of nine leads is below the bound, and the design against a file with this lead."""
    own = CASES[name]
    result = laufruhe.solve(own)
    (decision,) = own.decisions
    grid = [
        objective_value(own, evaluate(own, own.design([float(lead)])))
        for lead in np.linspace(decision.lower, decision.upper, 9)
    ]
    assert result.certificate.lower_bound <= min(grid) * (1.0 + 1e-9)
    assert result.objective.value <= min(grid) * (1.0 + 1e-6)
    if own.search.boxes is None:
        assert str(result.certificate.kind) == "global"
    lead = math.degrees(result.decisions[0].value)
    variant = problem("rms roll moment", lead, engine={"crank_ratio": int(own.engine.shafts[1].ratio)})
    again = replace(variant, objective=own.objective)
    assert objective_value(own, evaluate(again)) == pytest.approx(result.objective.value, rel=1e-9)


@pytest.mark.slow
def test_limits_on_a_shared_lead_are_kept_or_excluded() -> None:
    """Check the least roll moment under a limit on the force, and a limit that no lead keeps."""
    force = [{"limit": "rms shaking force", "max": "300 N"}]
    variant = problem("rms roll moment", between(0, 40), constraints=force)
    result = laufruhe.solve(variant)
    assert result.limits[0].value == pytest.approx(300.0, rel=1e-3)
    assert result.limits[0].value <= 300.0 * (1.0 + 1e-6)
    assert str(result.certificate.kind) == "global"
    maximum = objective_value(variant, evaluate(variant, variant.design([math.radians(40.0)])))
    none = [{"limit": "rms roll moment", "max": f"{0.9 * maximum} N m"}]
    assert str(laufruhe.solve(problem("rms shaking force", between(0, 40), constraints=none)).status) == "infeasible"


@pytest.mark.slow
def test_gas_without_a_net_force_leaves_leads_decidable() -> None:
    """Check that gas, whose forces cancel, leaves the shaking force as without gas."""
    tables = {key: READY[key] for key in ("counterweights",)}
    with_gas, without = (
        laufruhe.solve(problem("rms shaking force", between(3, 40), **tables, **more)) for more in ({}, {"gas": None})
    )
    assert with_gas.objective.value == pytest.approx(without.objective.value, rel=1e-4)
    assert str(with_gas.certificate.kind) == "global"


ARMS = {"count": 5, "at_rim": ["30 mm", "40 mm"], "at_hub": ["60 mm", "20 mm"], "hub_diameter": "80 mm"}
RIM = {"mean_diameter": "300 mm", "width": "60 mm", "height": "40 mm", "arms": ARMS}


@pytest.mark.slow
@pytest.mark.parametrize("start", [0, 60])
def test_a_lead_moves_the_mean_torque_that_arms_hand_on(start: float) -> None:
    """Check that a limit on the stress of arms is judged at each lead, not at the initial one."""
    limit = {"limit": "arm stress", "max": "13.5 MPa"}
    more = {"flywheel": {"rim": RIM}, "operating_points": [{"speed": "300 rpm"}]}
    stress = [
        evaluate(own).violation(own.limits)
        for own in (problem("rms shaking force", lead, constraints=[limit], **more) for lead in (0, 60))
    ]
    assert stress[0] > 0.0 > stress[1]
    searched(problem("rms shaking force", between(0, 60, start=start), constraints=[limit], **more))


@pytest.mark.parametrize(
    ("more", "quantity", "words"),
    [
        ({"gas": {"model": "wiebe", "imep": "7 bar", "start": -8, "duration": 60}}, "rms roll moment", "seiliger"),
    ],
)
def test_unsupported_quantities_of_shared_chambers_are_refused(more: dict[str, Any], quantity: str, words: str) -> None:
    with pytest.raises(ModelError, match=words) as caught:
        laufruhe.solve(problem(quantity, between(0, 40), **more))
    assert len(str(caught.value).splitlines()) == 1


def test_without_boxes_the_whole_range_is_bounded_once() -> None:
    result = laufruhe.solve(problem("rms roll moment", between(5, 40), search={"boxes": 0, "starts": 1}))
    assert result.certificate.method.endswith("lower bound on 1 box of leads")
