"""The page of one task in three libraries: lists are as long as it says, and give the answers that it says."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import re
from pathlib import Path
from typing import Any

import pytest

PAGE = (Path(__file__).parents[2] / "docs" / "one-task.md").read_text(encoding="utf-8")
LISTINGS = dict(re.findall(r"^## (\w+)\n.*?```python\n(.*?)```", PAGE, re.MULTILINE | re.DOTALL))
ROWS = {name: (int(lines), float(newtons))
        for name, lines, newtons in re.findall(r"^\| (\w+) \| (\d+) \| ([\d.]+) N \|", PAGE, re.MULTILINE)}  # fmt: skip


def run(name: str) -> tuple[dict[str, Any], str]:
    """Return the names that a listing defines, and the text that it prints."""
    names: dict[str, Any] = {}
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(LISTINGS[name], name, "exec"), names)
    return names, printed.getvalue()


def test_lines_are_counted_and_ours_are_fewest() -> None:
    assert set(LISTINGS) == set(ROWS) == {"Laufruhe", "CVXPY", "AeroSandbox"}
    counts = {name: sum(bool(line.strip()) for line in text.splitlines()) for name, text in LISTINGS.items()}
    assert counts == {name: lines for name, (lines, _) in ROWS.items()}
    assert min(counts, key=lambda name: counts[name]) == "Laufruhe"
    assert all(len(line) <= 120 for text in LISTINGS.values() for line in text.splitlines())


@pytest.mark.slow
def test_two_libraries_agree_and_the_bound_is_below_both() -> None:
    ours, printed = run("Laufruhe")
    assert printed == f"{ROWS['Laufruhe'][1]} N, proof: global\n"
    theirs, printed = run("CVXPY")
    assert printed == f"{ROWS['CVXPY'][1]} N\n"
    # a step of half a degree misses a maximum of order 2 by less than 4e-5
    assert theirs["program"].value == pytest.approx(ours["result"].objective.value, rel=1e-4)
    assert ours["result"].certificate.lower_bound <= ours["result"].objective.value


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("aerosandbox") is None, reason="AeroSandbox is not installed")
@pytest.mark.filterwarnings("ignore")
def test_aerosandbox_finds_the_same() -> None:
    assert run("AeroSandbox")[1] == f"{ROWS['AeroSandbox'][1]} N\n"
