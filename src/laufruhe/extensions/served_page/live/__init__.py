"""Data, scripts and styles of a page that evaluates any design of a problem by itself."""

from functools import cache
from importlib.resources import files

from laufruhe.extensions.served_page.live.model import decided, live_model
from laufruhe.extensions.served_page.live.parts import LiveModel

__all__ = ["LiveModel", "decided", "live_model", "page_assets"]

SCRIPT, STYLE = "live.js", "live.css"
PARTS = ("signals", "norms", "numbers", "design", "drawing", "figures", "controls", "judge", "page")
"""Parts of the script, in the order of their dependence."""


@cache
def page_assets() -> dict[str, str]:
    """Return script (`window.laufruheLive`) and style of a live page, by file name."""
    folder = files("laufruhe.extensions.served_page.live") / "page"
    parts = [(folder / f"{name}.js").read_text(encoding="utf-8") for name in PARTS]
    script = "\n".join(['"use strict";', "(() => {", *parts, "})();", ""])
    return {SCRIPT: script, STYLE: (folder / STYLE).read_text(encoding="utf-8")}
