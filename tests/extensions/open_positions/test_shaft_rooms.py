"""Limits on places of optional shafts, which a shaft that is left out does not break."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from laufruhe.files.reader import load_tables
from laufruhe.solvers import solve
from laufruhe.solvers.result import Result


def _shaft(name: str, ratio: int, y: str) -> dict[str, Any]:
    unbalance = {"between": ["0 kg m", "0.02 kg m"]}
    weight = {"x": "0 mm", "radius": "20 mm", "unbalance": unbalance, "angle": {"between": [0, 360]}}
    return {"name": name, "ratio": ratio, "position": [y, "-60 mm"], "optional": True, "shaft_mass": "1 kg",
            "unbalances": [weight]}  # fmt: skip


def _solved(limits: list[dict[str, Any]], throws: Any = (0, 180, 180, 0), **phasing: Any) -> Result:
    engine = {"layout": "inline", "cycle": "four-stroke", "stroke": "100 mm", "rod_ratio": 0.25}
    engine |= {"reciprocating_mass": "1 kg", "cylinder_spacing": "110 mm"}
    engine |= {"throws": list(throws)} if throws != "open" else {"throws": "open", "cylinders": 4}
    tables = {
        "title": "Four with two shafts that may be left out", "engine": engine,
        "operating_points": [{"speed": "3000 rpm"}], "objective": {"minimise": "rms shaking force"},
        "balancer_shafts": [_shaft("near", 2, "60 mm"), _shaft("far", -2, "-400 mm")], "constraints": limits,
        "phasing": phasing,
    }  # fmt: skip
    return solve(load_tables(tables, Path("rooms.toml")))


def _built(result: Result) -> dict[str, float]:
    return {d.name.split()[0]: d.value for d in result.decisions if d.name.endswith(" built")}


LIMITS = {
    "one is beyond the envelope": ({"limit": "envelope radius", "max": "200 mm"}, ("far",)),
    "one is too near the crank": ({"limit": "shaft distance", "of": ["near"], "min": "90 mm"}, ("near",)),
    "two are too near": ({"limit": "shaft distance", "of": ["near", "far"], "min": "470 mm"}, ()),
}


@pytest.mark.slow
@pytest.mark.parametrize("throws", [(0, 180, 180, 0), "open"])
@pytest.mark.parametrize("name", LIMITS)
def test_a_shaft_without_room_is_left_out(name: str, throws: Any) -> None:
    """Check that of two equal shafts the one with room is built, for half of the force."""
    limit, gone = LIMITS[name]
    result = _solved([limit], throws, time_limit="60 s")
    assert result.certificate is not None
    assert result.certificate.gap <= 1e-4
    assert sum(_built(result).values()) == 1.0
    assert all(_built(result)[shaft] == 0.0 for shaft in gone)
    free = _solved([], throws, most_shafts=1)
    assert result.objective is not None
    assert free.objective is not None
    assert math.isclose(result.objective.value, free.objective.value, rel_tol=1e-3)


def test_needed_shafts_without_room_are_infeasible() -> None:
    """Check that shafts without room are infeasible if a limit on the force needs them."""
    maximum = {"limit": "rms shaking force", "max": "1000 N", "name": "force"}
    result = _solved([LIMITS["one is beyond the envelope"][0], maximum])
    assert str(result.status) == "infeasible"


def test_a_limit_may_name_a_shaft_that_is_not_built() -> None:
    """Check that the distance to a shaft that is not built is infinite and not active."""
    result = _solved([{"limit": "shaft distance", "of": ["near", "far"], "min": "470 mm"}], most_shafts=1)
    assert result.limits[0].value == math.inf
    assert not result.limits[0].active
