"""The registry: every figure computed, drawn and judged."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import xarray as xr

from laufruhe.report.tractor_study import FIGURES, verdict_table
from laufruhe.studies.tractor import COMPUTE, Verdict


def test_registry_is_complete() -> None:
    from laufruhe.plots.tractor import DRAW

    assert list(FIGURES) == list(COMPUTE) == list(DRAW)
    assert all(figure.name == name and figure.title and figure.paper for name, figure in FIGURES.items())


@pytest.mark.parametrize("name", list(COMPUTE))
def test_picture(figure: Callable[[str], xr.Dataset], name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.png"
    FIGURES[name].draw(figure(name), path)
    assert path.read_bytes().startswith(b"\x89PNG")
    assert path.stat().st_size > 20_000


def test_verdict_table() -> None:
    rows = {"a": (Verdict("holds", "1", 1.0, "kp", True, "exact"), Verdict("fails", "2", 1e-12, "", False, "why"))}
    table = verdict_table(rows).splitlines()
    assert table[2:] == ["| holds | 1 | 1 kp | yes | exact |", "| fails | 2 | 0 | **no** | why |"]
