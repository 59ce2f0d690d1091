"""Sliders on the page of a result."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from laufruhe.extensions.served_page.live import SCRIPT, STYLE, live_model, page_assets
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result

HEADING = "Move the decisions"


def sliders(result: Result) -> Mapping[str, Any] | None:
    """Return heading, model, script and style of the sliders, or why there are none; None if nothing is open."""
    live = live_model(result.problem, result)
    if not live.sliders and not live.without_slider:
        return None
    if why := live.why_not or live.too_large:
        return {"heading": HEADING, "sentences": (why, *live.notes)}
    # these texts are safe: the package makes them, and the JSON has no opening bracket
    texts = {"model": live.as_json(), "style": page_assets()[STYLE], "script": page_assets()[SCRIPT]}
    return {"heading": HEADING, **{name: Markup(text) for name, text in texts.items()}}


SLIDERS = Section("sliders", lambda _: False, controls=sliders)
