"""Numbers that several numbers of a file follow: read, open, and from outside."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import pytest

import laufruhe
from laufruhe.errors import InputError
from laufruhe.prove.certificate import Proof

SINGLE = Path(__file__).parents[2] / "problems" / "single-stroke-offset.toml"


def tables(ratio: Any, **engine: Any) -> dict[str, Any]:
    """Return the tractor single with a ratio of stroke to bore, its stroke 120 mm and its bore 100 mm."""
    data = tomllib.loads(SINGLE.read_text(encoding="utf-8"))
    data["engine"] |= {"stroke": "120 mm", "offset": "0 mm", **engine}
    data["quantities"] = {"stroke_over_bore": ratio}
    data["counterweights"][0]["balance_factor"] = 0.5
    return data


@pytest.mark.parametrize("ratio", [0.8, 1.5])
def test_stroke_and_bore_follow_at_the_displacement(ratio: float) -> None:
    (part,) = laufruhe.load(tables(ratio)).engine.slider_cranks
    bore = part.swept.piston.bore
    assert bore is not None
    assert part.stroke / bore == pytest.approx(ratio, rel=1e-12)
    assert math.pi / 4.0 * bore**2 * part.stroke == pytest.approx(math.pi / 4.0 * 0.1**2 * 0.12, rel=1e-12)


@pytest.mark.slow
def test_an_open_ratio_is_decided_as_the_best_of_those_that_are_given() -> None:
    """Compare the decided stroke over bore with a scan of 15 given values."""
    open_ratio = tables({"between": [0.8, 1.5], "start": 1.2})
    open_ratio["constraints"] = []
    result = laufruhe.solve(open_ratio)
    assert result.certificate is not None
    assert result.objective is not None
    assert result.certificate.kind is Proof.LOCAL
    scan = []
    for k in range(15):
        closed = tables(0.8 + 0.05 * k)
        closed["constraints"] = []
        evaluated = laufruhe.evaluate(closed).objective
        assert evaluated is not None
        scan.append(evaluated.value)
    assert result.objective.value <= min(scan) * (1.0 + 1e-6)
    assert [decision.name for decision in result.decisions] == ["quantities.stroke_over_bore"]


@pytest.mark.parametrize(
    ("ratio", "engine", "said"),
    [
        (-1.0, {}, "quantities.stroke_over_bore"),
        ("long", {}, "quantities.stroke_over_bore"),
        (1.0, {"stroke": {"between": ["80 mm", "160 mm"]}, "bore": None}, "engine.bore"),
    ],
)
def test_quantities_that_cannot_follow_are_refused(ratio: Any, engine: dict[str, Any], said: str) -> None:
    settings = tables(ratio, **engine)
    settings["engine"] = {key: value for key, value in settings["engine"].items() if value is not None}
    with pytest.raises(InputError, match=said):
        laufruhe.load(settings)


def test_an_unknown_quantity_is_refused() -> None:
    settings = tables(1.0)
    settings["quantities"] = {"stroke_to_bore": 1.0}
    with pytest.raises(InputError, match="stroke_over_bore"):
        laufruhe.load(settings)
