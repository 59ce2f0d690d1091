"""Files have a number of their format; a newer one is refused at once."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import laufruhe

NEWER = "is newer than 1, the newest format that this version reads; install a newer Laufruhe"
STUDY = {"title": "x", "study": {"parts": []}}


def test_a_newer_format_is_the_only_complaint(tmp_path: Path) -> None:
    tables = {"format": 2, "title": "x", "motor": {}}
    with pytest.raises(laufruhe.InputError) as refused:
        laufruhe.load(tables)
    assert str(refused.value) == f"problem: format = 2: {NEWER}"
    with pytest.raises(laufruhe.InputError, match=NEWER):
        laufruhe.study({**STUDY, "format": 2})
    with pytest.raises(laufruhe.InputError, match="format = 0"):
        laufruhe.load({**tables, "format": 0})
    result = laufruhe.evaluate("tractor-single")
    result.save(tmp_path / "result.json")
    record = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert record["format"] == 1
    (tmp_path / "result.json").write_text(json.dumps({**record, "format": 7}), encoding="utf-8")
    with pytest.raises(laufruhe.InputError, match="format = 7: is newer"):
        laufruhe.read_result(tmp_path)
    # results of earlier releases have no number
    (tmp_path / "result.json").write_text(json.dumps({k: v for k, v in record.items() if k != "format"}))
    assert laufruhe.read_result(tmp_path).problem == "tractor-single"


def test_the_present_format_changes_nothing() -> None:
    plain = laufruhe.load("tractor-single")
    assert plain.origin is not None
    assert laufruhe.load({**plain.origin.tables, "format": 1}).engine == plain.engine
