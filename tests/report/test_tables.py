"""The screen and report.md say the same, in words an engineer reads."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path

from cli import scenes
from laufruhe.report.grid import escaped
from laufruhe.report.markdown import as_markdown
from laufruhe.report.screen import show
from laufruhe.report.sections import tables_of
from laufruhe.report.wording import explained, headline
from laufruhe.solvers import Result


def screen(result: Result) -> str:
    stream = io.StringIO()
    show(result, stream, Path("results/scene"))
    return stream.getvalue()


def test_a_limit_shows_its_price_in_user_units() -> None:
    text = screen(scenes.solved(scenes.TIGHT))
    assert re.search(r"balancer mass +0\.5000 kg +0\.5 kg +active +\d+\.\d N per kg", text)
    assert "the proven optimum" in text
    assert re.search(r"-39\.\d %", text)


def test_the_angle_of_nothing_is_a_dash() -> None:
    result = scenes.solved(scenes.TIGHT)
    size, angle = result.decisions[:2]
    rows = {row[0]: row for row in tables_of(replace(result, decisions=(replace(size, value=1e-9), angle)))[0].rows}
    assert rows["left.angle"][2] == "-"
    rows = {row[0]: row for row in tables_of(result)[0].rows}
    assert rows["left.angle"][2].endswith(" deg")


def test_a_bound_is_marked() -> None:
    result = scenes.solved(scenes.PARTS)
    rows = {row[0]: row for row in tables_of(result)[0].rows}
    assert rows["webs.balance_factor"][4] == "upper"
    assert rows["webs.balance_factor"][5].endswith(" N")


def test_every_operating_point_has_its_mounts() -> None:
    mounts = next(grid for grid in tables_of(scenes.solved(scenes.TWO_POINTS)) if grid.head[0] == "at")
    assert [row[:2] for row in mounts.rows] == [(p, f"mount {k}") for p in ("idle", "rated") for k in (1, 2, 3, 4)]


def test_an_evaluated_design_has_no_before_and_after() -> None:
    result = scenes.stated(scenes.GIVEN)
    heads = {name for grid in tables_of(result) for name in grid.head}
    assert "mean" in heads
    assert not any("before" in name for name in heads)
    assert "as given" in headline(result)


def test_infeasible_says_which_limits() -> None:
    text = screen(scenes.solved(scenes.IMPOSSIBLE))
    assert "'light shafts' and 'quiet mounts' contradict each other" in text
    assert "broken" in text


def test_the_certificate_takes_two_sentences() -> None:
    assert explained(scenes.solved(scenes.TIGHT)).count(". ") == 1


def test_the_report_holds_everything() -> None:
    result = scenes.solved(scenes.TIGHT)
    text = as_markdown(result, ("polar.png", "bars.png"), "laufruhe solve scene.toml")
    assert text.startswith("# Four in line\n")
    assert "](polar.png)" in text
    assert "spectrum.png" not in text
    for part in ("Result", "Decisions", "Limits", "Mount forces", "Orders", "Proof", "Fidelity", "Reproduce"):
        assert f"\n## {part}" in text
    assert "laufruhe solve scene.toml" in text
    assert "numpy" in text
    widths = [line.count(" | ") for line in text.splitlines() if line.startswith("| left.unbalance")]
    assert widths == [5]


def test_source_and_assumptions_are_told() -> None:
    text = as_markdown(scenes.solved(scenes.PARTS), (), "")
    assert "Source: nowhere." in text
    assert "- none" in text


def test_markdown_in_names_means_nothing() -> None:
    assert escaped("a|b\n*c* <d>") == r"a\|b \*c\* \<d\>"
