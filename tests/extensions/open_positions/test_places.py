"""Places of unbalances, compared with another search, closed forms and invariants."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

import laufruhe
from laufruhe.errors import InputError
from laufruhe.extensions.fidelity.trade import trade
from laufruhe.extensions.open_positions.solver import PlaceSearch, _Box
from laufruhe.machine import Engine
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.conclusion import evaluate_design
from problem_files import READY

HEIGHTS = next(path for path in READY if path.stem == "tractor-four-shaft-heights")

ENGINE = """
title = "One, two or four in line"
[engine]
layout = "inline"
cycle = "two-stroke"
bore = "80 mm"
stroke = "90 mm"
rod_ratio = {rod:.3f}
reciprocating_mass = "0.8 kg"
cylinder_spacing = "100 mm"
throws = {throws}
[[operating_points]]
speed = "{speed:.0f} rpm"
[mounts]
names = ["a", "b", "c"]
positions = [["200 mm", "200 mm", "-100 mm"], ["-300 mm", "-150 mm", "-50 mm"], ["-150 mm", "250 mm", "0 mm"]]
[objective]
minimise = "{norm} {load}"
"""

SHAFT = """
[[balancer_shafts]]
name = "{name}"
ratio = {ratio}
position = [{y}, {z}]
[[balancer_shafts.unbalances]]
x = {x}
radius = "30 mm"
unbalance = {unbalance}
angle = {angle}
"""


def _between(low: float, high: float, unit: str = " mm") -> str:
    return f'{{ between = ["{low:g}{unit}", "{high:g}{unit}"] }}'


def _problem(tmp_path: Path, text: str) -> Problem:
    path = tmp_path / "engine.toml"
    path.write_text(text, encoding="utf-8")
    return laufruhe.load(path)


def _engine(throws: list[int] | None = None, load: str = "mount force", norm: str = "mean", **numbers: Any) -> str:
    numbers = {"rod": 0.28, "speed": 2400.0, **numbers}
    return ENGINE.format(throws=throws or [0], load=load, norm=norm, **numbers)


def _shaft(**keys: str) -> str:
    given = {"ratio": "-1", "y": '"0 mm"', "z": '"0 mm"', "x": '"0 mm"', "unbalance": '"0.02 kg m"', "angle": "180"}
    return SHAFT.format(**{"name": "shaft", **given, **keys})


def _searched(problem: Problem, seed: int, samples: int | None, starts: int = 6, penalty: float = 10.0) -> float:
    """Return the least objective of a penalised search of the exact model from several starts."""
    generator = np.random.default_rng(seed)
    sets = [decision.set for decision in problem.decisions]
    low = np.concatenate([[s.lower] if s.width == 1 else [0.0, s.angles[0]] for s in sets])
    high = np.concatenate([[s.upper] if s.width == 1 else [s.upper, s.angles[1]] for s in sets])

    def objective(share: Any) -> float:
        at = iter(low + np.clip(share, 0.0, 1.0) * (high - low))
        values = [next(at) * s.directions[0] if s.width == 1 else next(at) * np.exp(1j * next(at)) for s in sets]
        values = [v.real if d.place_drives else v for d, v in zip(problem.decisions, values, strict=True)]
        found = evaluate(problem, problem.design(values), samples)
        violation = found.violation(problem.limits)
        return objective_value(problem, found) * (1.0 + penalty * max(violation, 0.0)) + (violation > 1e-9) * penalty

    best = np.inf
    for _ in range(starts):
        found = minimize(objective, generator.uniform(size=len(low)), method="Powell", bounds=[(0.0, 1.0)] * len(low))
        best = min(best, float(found.fun))
    return best


class TestAgainstClosedForms:
    @pytest.mark.parametrize("reach", [200.0, 60.0])
    def test_a_shaft_moves_to_where_its_couple_cancels_another(self, reach: float, tmp_path: Path) -> None:
        """Check m r a = U b (eq. 8) of two opposite throws and the two weights of a shaft.

        Loads are affine in such places: one box proves the optimum, at b or at the nearest end.
        """
        text = _engine([0, 180], load="rocking couple", rod=1e-3)
        # half of the reciprocating mass turns with the crank, half against it: a shaft each way, a pair of weights each
        for name, ratio in (("with", "1"), ("against", "-1")):
            pair = _shaft(name=name, ratio=ratio, unbalance='"0.018 kg m"', angle="0", x=_between(-reach, reach))
            text += (
                pair
                + '[[balancer_shafts.unbalances]]\nname = "other"\nx = "0 mm"\nunbalance = "0.018 kg m"\nangle = 180\n'
            )
        problem = _problem(tmp_path, text)
        result = laufruhe.solve(problem)
        assert result.certificate is not None
        assert result.certificate.kind is Proof.GLOBAL
        # m r / 2 = 0.8 x 0.045 / 2 = 0.018 kg m on either shaft, the throws 100 mm apart
        assert result.objective is not None
        left = max(0.1 - 1e-3 * reach, 0.0) / 0.1
        assert result.objective.value == pytest.approx(
            left * result.objective.initial, abs=1e-3 * result.objective.initial
        )
        places = [abs(decision.value) for decision in result.decisions]
        assert places == pytest.approx([min(0.1, 1e-3 * reach)] * 2, rel=1e-3)
        assert "over 1 box of" in result.certificate.method

    def test_heights_turn_against_the_second_order(self) -> None:
        """Check that shafts of unequal height save force that shafts side by side cannot."""
        problem = laufruhe.load(HEIGHTS)
        result = laufruhe.solve(problem)
        assert result.certificate is not None
        assert result.certificate.kind is Proof.GLOBAL
        places = [d for d in problem.decisions if d.place_drives]
        level = problem.design([0.0] * len(places), places)
        level_result = laufruhe.solve(_with_engine(problem, level))
        assert result.objective is not None
        assert level_result.objective is not None
        assert result.objective.value < 0.98 * level_result.objective.value


def _with_engine(problem: Problem, engine: Engine) -> Problem:
    return replace(problem, engine=engine, decisions=problem.unbalances)


CASES = {
    "given": {"x": _between(-200, 50), "z": _between(-100, 150)},
    "sized": {"x": _between(-200, 50), "unbalance": _between(0.0, 0.03, " kg m")},
    "at least": {"x": _between(-200, 50), "y": _between(20, 150), "unbalance": _between(0.01, 0.03, " kg m")},
    "turned": {"x": _between(-150, 150), "unbalance": _between(0.0, 0.03, " kg m"), "angle": "{ between = [90, 270] }"},
    "on one side": {"x": _between(-150, -50), "z": _between(-200, -80), "unbalance": _between(0.0, 0.03, " kg m")},
}
LOADS = ("mount force", "rocking couple", "roll moment")


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("case", CASES)
def test_no_search_finds_better(case: str, load: str, tmp_path: Path) -> None:
    """Check that no design of a search by the exact model is below the bound, or far below the design."""
    seed = LOADS.index(load) * len(CASES) + list(CASES).index(case)
    generator = np.random.default_rng(seed)
    throws = [[0], [0, 180], [0, 120, 240]][seed % 3]
    norm = ("mean", "rms")[seed % 2]
    numbers = {"rod": generator.uniform(0.2, 0.33), "speed": generator.uniform(1500, 4000)}
    problem = _problem(tmp_path, _engine(throws, load=load, norm=norm, **numbers) + _shaft(**CASES[case]))
    result = laufruhe.solve(problem)
    assert result.certificate is not None
    assert result.objective is not None
    assert result.certificate.kind is Proof.GLOBAL
    searched = _searched(problem, seed, result.final.samples, 2)
    assert result.certificate.lower_bound <= searched * (1.0 + 1e-6) + 1e-9
    assert result.objective.value <= searched * (1.0 + 2e-3) + 1e-6 * result.objective.initial


@pytest.mark.usefixtures("small_trade")
def test_a_trade_decides_places_too(tmp_path: Path) -> None:
    """Check that a trade solves each fidelity, and that less physics gives no better design."""
    text = _engine([0, 180]) + _shaft(x=_between(-200, 50), unbalance=_between(0.0, 0.03, " kg m"))
    problem = _problem(tmp_path, text)
    traded, result = trade(problem), laufruhe.solve(problem)
    assert result.objective is not None
    assert traded.optimum == pytest.approx(result.objective.value, rel=1e-3)


def test_masses_are_counted_wherever_they_stand(tmp_path: Path) -> None:
    """Check that a limit on mass holds with equality for an open place."""
    text = _engine([0, 180]) + _shaft(x=_between(-200, 50), unbalance=_between(0.0, 0.03, " kg m"))
    limit = '[[constraints]]\nlimit = "balancer mass"\nmax = "0.1 kg"\n'
    free, bound = (laufruhe.solve(_problem(tmp_path, each)) for each in (text, text + limit))
    assert bound.limits[0].value <= 0.1 * (1.0 + 1e-5)
    assert bound.objective is not None
    assert free.objective is not None
    assert bound.objective.value >= free.objective.value * (1.0 - 1e-3)
    assert bound.certificate is not None
    assert bound.certificate.kind is Proof.GLOBAL
    narrowed = limit.replace("max = ", 'of = ["shaft"]\nmax = ')
    named = laufruhe.solve(_problem(tmp_path, text + narrowed))
    assert named.objective is not None
    assert named.objective.value == pytest.approx(bound.objective.value, rel=1e-3)


def test_more_room_is_never_worse(tmp_path: Path) -> None:
    """Check that wider bounds of a place give no worse optimum."""
    text = _engine([0, 180])
    found = []
    for reach in (0.0, 40.0, 120.0):
        x = _between(-reach, reach) if reach else '"0 mm"'
        result = laufruhe.solve(_problem(tmp_path, text + _shaft(x=x, unbalance=_between(0, 0.03, " kg m"))))
        assert result.objective is not None
        assert result.certificate is not None
        found.append((result.objective.value, result.certificate.lower_bound))
    for (narrow, _), (_, wide) in pairwise(found):
        assert wide <= narrow * (1.0 + 1e-9)


def test_limits_that_no_place_keeps(tmp_path: Path) -> None:
    """Check that no design is claimed, and that the limits are named."""
    text = _engine([0]) + _shaft(z=_between(-100, 100), unbalance=_between(0, 0.001, " kg m"))
    text += '[[constraints]]\nlimit = "mean shaking force"\nmax = "1 N"\n'
    result = laufruhe.solve(_problem(tmp_path, text))
    assert str(result.status) == "infeasible"
    assert result.conflict == ("mean shaking force",)


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(_shaft(x=_between(-10, 10), unbalance='"0 kg m"'), id="nothing follows"),
        pytest.param(_shaft(x=_between(10, -10)), id="reversed"),
        pytest.param(_shaft(x="{ between = [1, 2] }"), id="without a unit"),
    ],
)
def test_meaningless_shafts_are_refused(change: str, tmp_path: Path) -> None:
    """Check that the reader refuses meaningless shafts."""
    with pytest.raises(InputError):
        _problem(tmp_path, _engine() + change)


def test_an_open_crank_beside_places_is_decided_star_by_star(tmp_path: Path) -> None:
    """Compare with each crank given."""
    text = _engine([0, 120, 240]) + _shaft(x=_between(-10, 10))
    both = laufruhe.solve(_problem(tmp_path, text.replace("throws = [0, 120, 240]", 'cylinders = 3\nthrows = "open"')))
    each = [
        laufruhe.solve(_problem(tmp_path, text.replace("[0, 120, 240]", throws))).objective.value
        for throws in ("[0, 120, 240]", "[0, 240, 120]")
    ]
    assert both.objective.value == pytest.approx(min(each), rel=1e-4)


LIMITS = {
    "clear of the crank": ('limit = "shaft distance"\nmin = "120 mm"', 1),
    "near the crank": ('limit = "shaft distance"\nmax = "60 mm"', 1),
    "clear of each other": ('limit = "shaft distance"\nof = ["shaft", "other"]\nmin = "110 mm"', 2),
    "swept": ('limit = "shaft clearance"\nof = ["other", "shaft"]\nmin = "20 mm"', 2),
    "within a radius": ('limit = "envelope radius"\nmax = "100 mm"', 2),
}
AROUND = {"y": _between(-150, 150), "z": _between(-150, 100), "unbalance": '"0.01 kg m"'}


def _enveloped(limit: str, shafts: int) -> str:
    text = "tolerance = 1e-3\n" + _engine([0, 180, 180, 0], load="roll moment") + _shaft(ratio="-2", **AROUND)
    if shafts > 1:
        text += _shaft(name="other", ratio="2", y='"10 mm"', z=_between(-150, 100), unbalance='"0.01 kg m"', angle="0")
    return text + (f"[[constraints]]\n{limit}\n" if limit else "")


@pytest.mark.parametrize("case", LIMITS)
def test_limits_on_distances_hold_and_are_proven(case: str, tmp_path: Path) -> None:
    """Check that the limit is active, and that no search of the exact model is below the bound."""
    limit, shafts = LIMITS[case]
    problem = _problem(tmp_path, _enveloped(limit, shafts))
    free, bound = laufruhe.solve(_problem(tmp_path, _enveloped("", shafts))), laufruhe.solve(problem)
    assert free.objective is not None
    assert bound.objective is not None
    assert bound.certificate is not None
    assert bound.final.violation(problem.limits) <= 1e-6
    assert bound.certificate.lower_bound >= free.certificate.lower_bound * (1.0 - 1e-6) if free.certificate else False
    assert bound.certificate.kind is Proof.GLOBAL
    # the bound of a mean is that of the whole cycle (P7), which fewer angles may miss by more than is asked here
    searched = _searched(problem, 5, 4 * bound.final.samples, 3, 1e4)
    assert bound.certificate.lower_bound <= searched * (1.0 + 1e-6)
    assert bound.objective.value <= searched * (1.0 + 2e-3)


@pytest.mark.parametrize("side", [0, 1])
def test_a_box_is_cut_where_its_program_leaves_most_out(side: int, tmp_path: Path) -> None:
    """Check that the halves cover the box, each with its best design, where one may be better."""
    problem = _problem(tmp_path, _enveloped("", 1) + "[fidelity]\nsamples = 72\n")
    search = PlaceSearch(problem)
    lower, upper = search.bounds
    middle = np.array([0.03, -0.02])
    box = _Box(0.0, False, lower, upper, middle, np.where(np.arange(2) == side, 0.02, 0.01))
    halves = list(search.parts(box, np.inf))
    (low, _), (high, _) = halves
    assert isinstance(low, _Box)
    assert isinstance(high, _Box)
    cut = np.where(np.arange(2) == side, middle, upper)
    assert np.array_equal((low.lower, low.upper), (lower, cut))
    assert np.array_equal((high.lower, high.upper), (np.where(np.arange(2) == side, middle, lower), upper))
    for half, found in halves:
        assert isinstance(half, _Box)
        assert found is not None
        engine, samples = problem.design(half.middle.tolist()), found.design.evaluation.samples
        assert found.design.value == pytest.approx(
            objective_value(problem, evaluate(problem, engine, samples)), rel=1e-12
        )
        assert half.bound <= objective_value(problem, evaluate(problem, engine, 5760)) * (1.0 + 1e-9)
    assert [found for _, found in search.parts(box, 0.0)] == [None, None]


@pytest.mark.parametrize("low", [-150, -90], ids=["about the crank", "beside it"])
@pytest.mark.parametrize(
    "limit",
    ['limit = "shaft distance"\nmax = "60 mm"', 'limit = "envelope radius"\nmax = "90 mm"'],
    ids=["distance", "envelope"],
)
def test_a_limit_on_a_distance_costs_what_its_shaft_would_gain(limit: str, low: float, tmp_path: Path) -> None:
    """Compare the price with the slope of the objective over the height of a shaft."""
    shaft = _shaft(ratio="-2", z=_between(low, 150), unbalance='"0.01 kg m"')
    problem = _problem(tmp_path, _engine([0, 180, 180, 0], load="roll moment") + shaft + f"[[constraints]]\n{limit}\n")

    def value(z: float) -> float:
        return objective_value(problem, evaluate(problem, problem.design([z])))

    slope = {z: (value(z + 1e-5) - value(z - 1e-5)) / 2e-5 for z in (0.06, -0.06)}
    z = min(slope, key=lambda z: slope[z] * z)
    assert slope[z] * z < 0.0
    prices = PlaceSearch(problem).prices(evaluate_design(problem, [z]))
    assert list(prices) == [(problem.limits[0], "at most")]
    (price,) = prices.values()
    assert price.relaxed == pytest.approx(abs(slope[z]), rel=1e-3)
    assert price.tightened == pytest.approx(price.relaxed, rel=1e-9)


def test_distances_by_hand(tmp_path: Path) -> None:
    """Check axes at (y, z) and the crankshaft; weights sweep 30 mm, throws 45 mm."""
    text = _engine() + _shaft(y='"30 mm"', z='"-40 mm"') + _shaft(name="other", y='"-50 mm"', z='"-40 mm"')
    for quantity in ('"shaft distance"\nof = ["shaft"]', '"shaft clearance"\nof = ["shaft"]', '"shaft distance"'):
        text += f'[[constraints]]\nlimit = {quantity}\nmin = "0 mm"\n'
    text += '[[constraints]]\nlimit = "envelope radius"\nof = ["other"]\nmax = "1 m"\n'
    problem = _problem(tmp_path, text)
    initial = evaluate(problem)
    found = [list(initial.values(limit.measure)) for limit in problem.limits]
    assert found[0] == pytest.approx([0.05])
    assert found[1] == pytest.approx([0.05 - 0.03 - 0.045])
    assert sorted(found[2]) == pytest.approx([0.05, np.hypot(0.05, 0.04), 0.08])
    assert found[3] == pytest.approx([np.hypot(0.05, 0.04) + 0.03])


def test_distances_that_no_place_keeps(tmp_path: Path) -> None:
    """Check that the limit is named, with places open or given."""
    text = _enveloped('name = "room"\nlimit = "shaft distance"\nmin = "300 mm"', 1).replace(AROUND["y"], '"0 mm"')
    for own in (text, text.replace(AROUND["z"], '"90 mm"')):
        result = laufruhe.solve(_problem(tmp_path, own))
        assert str(result.status) == "infeasible"
        assert result.conflict == ("room",)


def test_distances_of_what_is_not_there_are_refused(tmp_path: Path) -> None:
    for shaft, limit, said in (
        ("", 'limit = "shaft distance"\nmin = "1 mm"', "needs balancer shafts"),
        (_shaft(), 'limit = "shaft distance"\nof = ["nothing"]\nmin = "1 mm"', "is no shaft here"),
    ):
        with pytest.raises(InputError, match=said):
            _problem(tmp_path, f"{_engine()}{shaft}[[constraints]]\n{limit}\n")
