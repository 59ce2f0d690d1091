"""Open places with bearings, sizes and leads: bounds, compared with an independent model (P20)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from attack.crossings import leads_and_places, places_and_bearings, sizes_and_places
from attack.families import toml
from attack.openings import Openings
from attack.plain_loads import number
from lanes import first_fast
from laufruhe.extensions.open_positions.relaxation import Relaxation, without_places
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.methods import METHODS

READING = 2e-5
DRAWN = {
    "bearings": (places_and_bearings, "rms main-bearing force"),
    "sizes": (sizes_and_places, "rms mount force"),
    "leads": (leads_and_places, "rms mount force"),
}


def _narrowed(value: Any, rng: np.random.Generator, width: float) -> Any:
    """Narrow every open place to a share of its bounds."""
    if isinstance(value, list):
        return [_narrowed(each, rng, width) for each in value]
    if not isinstance(value, dict):
        return value
    if value == {"between": ["-0.2 m", "0.2 m"]}:
        low = -0.2 + 0.4 * (1.0 - width) * rng.random()
        return {"between": [f"{low:.9f} m", f"{low + 0.4 * width:.9f} m"]}
    return {key: _narrowed(each, rng, width) for key, each in value.items()}


def _drawn(kind: str, seed: int, width: float) -> tuple[dict[str, Any], np.random.Generator]:
    """Return a random problem whose places lie in a random box, and the generator that goes on from there."""
    make, measure = DRAWN[kind]
    rng = np.random.default_rng([seed, len(kind)])
    table = make(rng)
    for key in ("constraints", "search", "gas"):
        table.pop(key, None)
    table["title"], table["objective"], table["search"] = kind, {"minimise": measure}, {"boxes": 40, "starts": 2}
    return _narrowed(table, rng, width), rng


def _bound(problem: Problem) -> float:
    """Return the bound of all places within their bounds, with the method of the other open numbers."""
    relaxed = without_places(problem)
    method = next(each for each in METHODS if each.suits(relaxed))
    result = method.solve(relaxed)
    assert result.certificate is not None
    return float(result.certificate.lower_bound)


def _loaded(table: dict[str, Any], folder: Path) -> Problem:
    path = folder / "crossing.toml"
    path.write_text(toml(table), encoding="utf-8")
    return laufruhe.load(path)


@pytest.mark.parametrize("seed", first_fast(range(2), 0, 1))
@pytest.mark.parametrize("width", [1.0, 0.3, 1e-5])
@pytest.mark.parametrize("kind", DRAWN)
def test_no_design_of_a_box_goes_under_its_bound(kind: str, width: float, seed: int, tmp_path: Path) -> None:
    """Compare bounds with designs of a model that shares nothing with the package."""
    table, rng = _drawn(kind, seed, width)
    bound = _bound(_loaded(table, tmp_path))
    openings = Openings(table)
    found = [openings.scene(openings.random(rng)).objective for _ in range(30)]
    assert min(found) >= bound * (1.0 - READING)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["bearings", "sizes"])
def test_places_in_narrow_bounds_have_a_tight_bound(kind: str, tmp_path: Path) -> None:
    """Check that the bound of a place that hardly moves is the optimum."""
    table, _ = _drawn(kind, 1, 1e-5)
    found = laufruhe.solve(_loaded({**table, "search": {"boxes": 100, "starts": 2}}, tmp_path))
    assert found.objective is not None
    assert found.certificate is not None
    assert 0.999 <= found.certificate.lower_bound / found.objective.value <= 1.0 + 1e-9


def _carried(x: Any, mass: Any) -> dict[str, Any]:
    """Return one cylinder on three bearings whose crank carries a weight."""
    return {
        "title": "one weight over three bearings",
        "engine": {
            "layout": "inline", "cycle": "two-stroke", "bore": "80 mm", "stroke": "80 mm", "rod_ratio": 0.28,
            "reciprocating_mass": "0.5 kg", "rotating_mass": "0.4 kg", "cylinder_spacing": "100 mm", "throws": [0, 180],
        },
        "operating_points": [{"speed": "3000 rpm"}],
        "main_bearings": [{"x": "110 mm"}, {"x": "10 mm"}, {"x": "-110 mm"}],
        "mounts": {"names": ["a", "b", "c"],
                   "positions": [["0.2 m", "0.2 m", "0 m"], ["0.2 m", "-0.2 m", "0 m"], ["-0.3 m", "0 m", "0 m"]]},
        "counterweights": [{"name": "w", "x": x, "radius": "50 mm", "mass": mass, "angle": 180}],
    }  # fmt: skip


PLACE = {"between": ["-150 mm", "150 mm"]}


@pytest.mark.parametrize("measure", ["maximum main-bearing force", "rms main-bearing force", "mean main-bearing force"])
@pytest.mark.parametrize("mass", ["0.6 kg", {"between": ["0.2 kg", "1 kg"]}], ids=["given", "open"])
@pytest.mark.slow
def test_the_best_place_is_that_of_a_row_of_places(measure: str, mass: Any, tmp_path: Path) -> None:
    tables = {**_carried(PLACE, mass), "objective": {"minimise": measure}, "fidelity": {"samples": 180}}
    found = laufruhe.solve(_loaded(tables, tmp_path))
    assert found.certificate.kind is Proof.GLOBAL
    problem = _loaded(tables, tmp_path)
    masses = [number(mass)] if isinstance(mass, str) else np.linspace(0.2, 1.0, 5).tolist()
    row = []
    for x in np.linspace(-0.15, 0.15, 31):
        for each in masses:
            values = [float(x)] if isinstance(mass, str) else [_value(d, float(x), each) for d in problem.decisions]
            row.append(objective_value(problem, evaluate(problem, problem.design(values))))
    assert found.certificate.lower_bound <= min(row) * (1.0 + 1e-9)
    assert found.objective.value <= min(row) * (1.0 + 1e-4)


def _value(decision: Any, x: float, mass: float) -> complex | float:
    """Return the value of a decision, an unbalance of a mass or a place."""
    return mass * 0.05 * decision.set.directions[0] if decision.is_affine else x


@pytest.mark.slow
def test_a_bound_that_knows_no_bearing_is_false(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that a bound without corners at the middle bearing is false."""
    tables = {**_carried(PLACE, "0.6 kg"), "objective": {"minimise": "maximum main-bearing force"}}
    problem = _loaded({**tables, "fidelity": {"samples": 180}}, tmp_path)
    whole = _bound(problem)
    initialise = Relaxation.__init__

    def without_kinks(relaxation: Relaxation, *args: Any) -> None:
        initialise(relaxation, *args)
        relaxation._kinks = [np.zeros(0) for _ in relaxation.places]

    monkeypatch.setattr(Relaxation, "__init__", without_kinks)
    minimum = min(
        objective_value(problem, evaluate(problem, problem.design([float(x)]))) for x in np.linspace(-0.15, 0.15, 61)
    )
    assert whole <= minimum
    assert _bound(problem) > 1.01 * minimum


def test_a_beam_is_not_taken_for_a_shaft_that_is_cut(tmp_path: Path) -> None:
    tables = {**_carried(PLACE, "0.6 kg"), "objective": {"minimise": "maximum main-bearing force"}}
    beam = _loaded({**tables, "fidelity": {"samples": 60, "crankshaft": "beam"}}, tmp_path)
    cut = _loaded({**tables, "fidelity": {"samples": 60}}, tmp_path)
    assert not any(method.suits(beam) for method in METHODS[:-1])
    assert any(method.suits(cut) for method in METHODS[:-1])
