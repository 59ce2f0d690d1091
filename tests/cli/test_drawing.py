"""Pictures that other processes draw are those that the command would draw itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from cli import scenes
from laufruhe.cli import drawing
from laufruhe.solvers.result import Result
from ready import solved

pytestmark = pytest.mark.slow


def drawn(result: Result, folder: Path, count: int, monkeypatch: pytest.MonkeyPatch) -> dict[str, bytes]:
    monkeypatch.setattr(drawing, "processors", lambda: count + 1)
    with drawing.artist(("png",)) as ask:
        actual = drawing.drawing(ask, result, folder, ("png",))()
    files = {f"{name}.png": (folder / f"{name}.png").read_bytes() for name in actual}
    assert {path.name for path in folder.iterdir()} == set(files)
    return files | {name: svg.encode() for name, svg in actual.items()}


def test_a_picture_does_not_depend_on_its_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compare pictures of an open crank drawn in this process and in two processes."""
    result = solved("inline-five-open")
    here, there = (drawn(result, tmp_path / str(count), count, monkeypatch) for count in (0, 2))
    assert list(here) == list(there)
    assert here == there
    assert {"star.png", "firings.png"} <= set(here)


def test_a_result_that_cannot_be_pickled_is_drawn_in_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = scenes.solved(scenes.SHAKING_ONLY)
    result = replace(result, timing={"none": lambda: None})  # type: ignore[dict-item]
    assert "engine.png" in drawn(result, tmp_path, 1, monkeypatch)
