"""Data, scripts and styles of a page that evaluates any design of a problem by itself."""

from laufruhe.live.assets import page_assets
from laufruhe.live.model import decided, live_model
from laufruhe.live.parts import LiveModel

__all__ = ["LiveModel", "decided", "live_model", "page_assets"]
