"""Optional shafts with given throws, and angles that cannot be open then."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

import laufruhe
from laufruhe.errors import InputError

INPUTS = Path(__file__).parent / "inputs"


def table(**engine: Any) -> dict[str, Any]:
    """Return the scene with these keys of its engine."""
    data = tomllib.loads((INPUTS / "optional-shaft-uneven-throws.toml").read_text())
    rest = {key: value for key, value in data["engine"].items() if key not in engine}
    return data | {"engine": rest | {key: value for key, value in engine.items() if value is not None}}


def with_shaft(scene: dict[str, Any]) -> dict[str, Any]:
    """Return the scene with its shaft built."""
    (shaft,) = scene["balancer_shafts"]
    own = {key: value for key, value in shaft.items() if key not in ("optional", "shaft_mass")}
    return scene | {"balancer_shafts": [own]}


@pytest.mark.slow
@pytest.mark.parametrize(
    "engine",
    [
        {"throws": [0, 90]},
        {"throws": [0, 90], "firing_order": [1, 2]},
        {"throws": [0, 100, 190], "cycle": "two-stroke"},
        {"throws": [0, 70], "layout": "vee", "bank_angle": 50},
    ],
    ids=["uneven", "with an order", "two-stroke", "vee"],
)
def test_an_optional_shaft_has_the_value_of_a_built_one(engine: dict[str, Any]) -> None:
    """Compare an optional shaft with the same shaft built, with free firing intervals."""
    scene = table(**engine)
    free, built = laufruhe.solve(scene), laufruhe.solve(with_shaft(scene))
    assert free.status == "optimal"
    assert free.objective.value == pytest.approx(built.objective.value, rel=1e-6)
    fires = [[part.firing_angle for part in found.final.engine.slider_cranks] for found in (free, built)]
    assert fires[0] == pytest.approx(fires[1])


@pytest.mark.slow
def test_two_throws_at_a_right_angle() -> None:
    assert laufruhe.solve(table()).objective.value == pytest.approx(1884.49, abs=0.01)


def test_intervals_that_are_given_still_hold() -> None:
    result = laufruhe.solve(table() | {"phasing": {"intervals": {"largest_deviation": "10 deg"}}})
    assert result.status == "infeasible"
    assert "from 270 to 450 deg" in result.message


@pytest.mark.slow
def test_angles_beside_given_throws_are_decided_locally() -> None:
    """Check a local optimum of 33.279 N; with open throws the bound is 33.263 N."""
    result = laufruhe.solve((INPUTS / "vee-bank-and-split-open.toml").read_text())
    assert (result.status, result.certificate.kind, result.certificate.lower_bound) == ("feasible", "local", 0.0)
    assert 33.2627 < result.objective.value < 33.5
    assert result.objective.initial > 250.0


def test_two_open_angles_are_refused_with_intervals_that_help() -> None:
    text = (INPUTS / "vee-bank-and-split-open.toml").read_text().replace("throws=[0]", 'throws = "open"\ncylinders = 2')
    even = text.replace('intervals={min="0 deg",max="360 deg"}', "")
    with pytest.raises(InputError, match=r"split_pin_angle: .*intervals = .* in \[phasing\]"):
        laufruhe.load(even)
