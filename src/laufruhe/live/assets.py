"""Script and style of a live page, which stand in files of their own."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

SCRIPT, STYLE = "live.js", "live.css"
PARTS = ("signals", "norms", "numbers", "design", "drawing", "figures", "controls", "judge", "page")
"""Parts of the script, in the order of their dependence."""


@cache
def page_assets() -> dict[str, str]:
    """Return script (`window.laufruheLive`) and style of a live page, by file name."""
    folder = files("laufruhe.live") / "page"
    parts = [(folder / f"{name}.js").read_text(encoding="utf-8") for name in PARTS]
    script = "\n".join(['"use strict";', "(() => {", *parts, "})();", ""])
    return {SCRIPT: script, STYLE: (folder / STYLE).read_text(encoding="utf-8")}
