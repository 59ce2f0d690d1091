"""What an HTML page needs to show any design of a problem by itself: numbers, scripts and styles."""

from laufruhe.live.assets import page_assets
from laufruhe.live.model import live_model
from laufruhe.live.parts import LiveModel

__all__ = ["LiveModel", "live_model", "page_assets"]
