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
        found = drawing.drawing(ask, result, folder, ("png",))()
    files = {f"{name}.png": (folder / f"{name}.png").read_bytes() for name in found}
    assert {path.name for path in folder.iterdir()} == set(files)
    return files | {name: svg.encode() for name, svg in found.items()}


def test_by_whom_a_picture_is_drawn_cannot_be_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = scenes.solved(scenes.SHAKING_ONLY)
    here, there = (drawn(result, tmp_path / str(count), count, monkeypatch) for count in (0, 3))
    assert list(here) == list(there)
    assert here == there


def test_a_crank_that_was_open_is_drawn_by_another_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = solved("two-stroke-four-open")
    assert {"star.png", "firings.png"} <= set(drawn(result, tmp_path, 1, monkeypatch))


def test_what_cannot_be_told_to_another_process_is_drawn_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = scenes.solved(scenes.SHAKING_ONLY)
    result = replace(result, timing={"none": lambda: None})  # type: ignore[dict-item]
    assert "engine.png" in drawn(result, tmp_path, 1, monkeypatch)
