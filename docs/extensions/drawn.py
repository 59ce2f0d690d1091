"""Pictures of gallery examples: every figure that a block of code leaves in a name of its own or as its last value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst


def scraper(block: tuple[str, str, int], block_vars: Mapping[str, Any], gallery_conf: Mapping[str, Any]) -> str:
    """Save the new figures among the names of an example."""
    paths = []
    for value in list(block_vars["example_globals"].values()):
        if isinstance(value, Figure) and not hasattr(value, "in_gallery"):
            value.in_gallery = True  # type: ignore[attr-defined]
            path = str(next(block_vars["image_path_iterator"]))
            value.savefig(path, dpi=90)
            paths.append(path)
    return figure_rst(paths, gallery_conf["src_dir"])


def _get_sg_image_scraper() -> Callable[..., str]:
    return scraper
