"""The screen and report.md say the same, in words an engineer reads."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from cli import scenes
from laufruhe.present.gas_figures import gas_head, gas_rows
from laufruhe.present.numbers import in_grams
from laufruhe.present.tables import Table, escape_markdown, strip_markdown
from laufruhe.report.document import Bullets, Document, Paragraph
from laufruhe.report.result_report import result_document
from laufruhe.report.screen import show, show_document
from laufruhe.report.sections import elastic, loads, tables_of
from laufruhe.report.sections.weights import weights
from laufruhe.report.wording import added_loads, explained, headline, why_star
from laufruhe.solvers import Result
from laufruhe.studies.text import marked_table
from laufruhe.units import readable, shown_in
from problem_files import PROBLEMS
from ready import solved

_OPEN_FACTOR = """
title = "Single"
operating_points = [{ speed = "3000 rpm" }]
counterweights = [{ name = "web", balance_factor = { between = [0, 1] } }]
objective = { minimise = "rms shaking force" }
[engine]
layout = "inline"
cycle = "four-stroke"
stroke = "90 mm"
rod_ratio = 0.28
reciprocating_mass = "0.6 kg"
throws = [0]
"""


def screen(result: Result) -> str:
    stream = io.StringIO()
    show(result, stream, Path("results/scene"))
    return stream.getvalue()


def test_a_limit_shows_its_price_in_user_units() -> None:
    text = screen(scenes.solved(scenes.TIGHT))
    assert re.search(r"balancer mass +0\.5000 kg +0\.5 kg +active +\d+\.\d N per kg", text)
    assert "the proven optimum" in text
    assert re.search(r"-39\.\d %", text)


def test_the_angle_of_zero_is_a_dash() -> None:
    result = scenes.solved(scenes.TIGHT)
    size, angle = result.decisions[:2]
    rows = {row[0]: row for row in tables_of(replace(result, decisions=(replace(size, value=1e-9), angle)))[0].rows}
    assert rows["left.angle"][2] == "-"
    rows = {row[0]: row for row in tables_of(result)[0].rows}
    assert rows["left.angle"][2].endswith(" deg")


def test_the_screen_names_the_page_to_open_first() -> None:
    assert screen(scenes.solved(scenes.TIGHT)).endswith("Results: results/scene (begin with report.html)\n")


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
    assert not any("initial" in name for name in heads)
    assert "initial" in headline(result)


def test_infeasible_says_which_limits() -> None:
    text = screen(scenes.solved(scenes.IMPOSSIBLE))
    assert "'light shafts' and 'quiet mounts' contradict each other" in text
    assert "broken" in text


def test_the_certificate_takes_two_sentences() -> None:
    assert explained(scenes.solved(scenes.TIGHT)).count(". ") == 1


def test_the_report_holds_everything() -> None:
    result = scenes.solved(scenes.TIGHT)
    text = result_document(result, ("polar", "bars"), "laufruhe solve scene.toml").as_markdown(".png")
    assert text.startswith("# Four in line\n")
    assert "](polar.png)" in text
    assert "spectrum.png" not in text
    for part in ("Result", "Decisions", "Limits", "Mount forces", "Orders", "Proof", "Fidelity", "Inputs", "Reproduce"):
        assert f"\n## {part}" in text
    assert "laufruhe solve scene.toml" in text
    assert "numpy" in text
    widths = [line.count(" | ") for line in text.splitlines() if line.startswith("| left.unbalance")]
    assert widths == [5]


def test_a_page_alone_holds_the_problem() -> None:
    """The file in the report gives the same problem again, and the tables give its numbers."""
    result = solved("tractor-four-lanchester")
    text = result_document(result, (), "laufruhe solve").as_markdown(".png")
    copy = laufruhe.load(text.partition("```toml\n")[2].partition("```")[0])
    assert copy.engine == result.problem.engine
    rows = {
        cells[1]: cells[2:-1] for line in text.splitlines() if len(cells := [c.strip() for c in line.split("|")]) > 3
    }
    assert rows["firing order"] == ["1-3-4-2, after 180, 180, 180, 180 deg"]
    assert rows["rotation"] == ["clockwise"]
    assert "compression\\_exponent 1.35, expansion\\_exponent 1.3" in rows["gas, by default"][0]
    left = next(rotor for rotor in result.final.engine.rotors if rotor.name == "left")
    assert float(rows["left"][5]) == pytest.approx(1e6 * abs(left.unbalance), rel=1e-4)
    assert rows["cylinder 3"] == ["-62.5", "0", "180", "180", "100", "120", "230.77", "0", "1.25"]


def test_a_reader_gets_units_of_his_choice() -> None:
    """Numbers in other units are those in usual units, but for the rounding of both."""
    units = {"N": "lbf", "kg": "lb", "kg m": "oz in", "m": "in"}
    pounds = {"N": 0.45359237 * 9.80665, "g mm": 0.45359237e6 / 16 * 0.0254, "mm": 25.4, "g": 453.59237}
    names = {"N": "lbf", "g mm": "oz in", "mm": "in", "g": "lb", "N, N m": "lbf, N m"}
    result = solved("tractor-four-lanchester")
    usual = tables_of(result)
    with shown_in(units):
        other, line = tables_of(result), headline(result)
    assert " lbf" in line
    seen = set()
    for mine, theirs in zip(usual, other, strict=True):
        for k, (head, other_head) in enumerate(zip(mine.head, theirs.head, strict=True)):
            of_title = re.search(r"\[(N)\]$", mine.title)
            unit = re.search(r"\[(g mm|mm|g)\]$", head) or of_title
            if unit is None or k == 0:
                continue
            assert f"[{names[unit.group(1)]}]" in (theirs.title if unit is of_title else other_head)
            for before, after in zip(mine.rows, theirs.rows, strict=True):
                if "%" not in before[k] and before[k] not in ("-", "–"):
                    assert float(after[k]) == pytest.approx(float(before[k]) / pounds[unit.group(1)], rel=1e-3)
                    seen.add(unit.group(1))
    assert seen >= {"N", "g mm", "mm"}
    assert readable("N") == ("N", 1.0)


def test_torque_and_power_have_units_of_choice_and_unbalances_those_of_mass_and_length() -> None:
    """735.49875 W are a PS; 0.45359237 kg times 0.0254 m are a lb in."""
    text = (PROBLEMS / "compressor-two-stage.toml").read_text(encoding="utf-8")
    units = 'units = { mass = "lb", length = "in", torque = "kp m", power = "PS", inertia = "kg cm^2" }\n'
    problem = laufruhe.load(units + text)
    with shown_in(dict(problem.shown_units)):
        ((_, *rows), head) = (gas_rows(problem)[0], gas_head())
        assert readable("kg m", "g mm") == ("lb in", pytest.approx(1.0 / (0.45359237 * 0.0254), rel=1e-12))
        assert readable("kg m^2") == ("kg cm²", pytest.approx(1e4, rel=1e-12))
    usual = gas_rows(problem)[0][1:]
    brake = ("brake torque [N m]", "friction [N m]", "fmep [bar]")
    assert gas_head()[4:] == ("gas torque [N m]", "gas power [kW]", "power [kW/l]", *brake)
    brake = ("brake torque [kp m]", "friction [kp m]", "fmep [bar]")
    assert head[4:] == ("gas torque [kp m]", "gas power [PS]", "power [PS/l]", *brake)
    factors = (1.0, 1.0, 1.0, 9.80665, 0.73549875, 0.73549875, 9.80665, 9.80665, 1.0)
    for mine, theirs, factor in zip(rows, usual, factors, strict=True):
        assert float(mine) * factor == pytest.approx(float(theirs), rel=2e-3)


def test_units_of_another_dimension_are_refused() -> None:
    text = (PROBLEMS / "tractor-single.toml").read_text(encoding="utf-8")
    with pytest.raises(laufruhe.InputError, match="'mm' is not a unit of a force"):
        laufruhe.load(f'units = {{ force = "mm" }}\n{text}')


def test_source_and_assumptions_are_in_the_report() -> None:
    text = result_document(scenes.solved(scenes.PARTS), (), "").as_markdown("")
    assert "Source: nowhere." in text
    assert "- none" in text


def test_markdown_in_names_means_nothing() -> None:
    assert escape_markdown("a|b\n*c* <d>") == r"a\|b \*c\* \<d\>"


def test_the_winning_star_is_explained_by_its_free_couples() -> None:
    """Check rocking couples of a five, minimised over orders 1 and 2, without a word on order 4."""
    result = solved("inline-five-open")
    assert why_star(result) == (
        "Star 1 beats star 2 by 32 %. Its throws leave a smaller couple of order 1 (0.449 against 1.56). "
        "It leaves a larger couple of order 2 (4.98 against 4.75)."
    )
    assert why_star(result) in " ".join(screen(result).split())
    assert result.phasing is not None
    alone = replace(result, phasing=replace(result.phasing, ranking=result.phasing.ranking[:1]))
    assert why_star(alone) == ""
    twin = replace(result.phasing.ranking[0], throws=tuple(-angle for angle in result.phasing.ranking[0].throws))
    both = replace(result, phasing=replace(result.phasing, ranking=(result.phasing.ranking[0], twin)))
    assert why_star(both) == "Star 2 has the same free forces and couples as star 1."


def test_weights_are_in_grams_and_throws_have_their_balance_factor() -> None:
    tables = {grid.title: grid for grid in tables_of(scenes.solved(scenes.PARTS))}
    weights = tables["Weights of the final design"]
    made = dict(zip(weights.head, weights.rows[0], strict=True))
    assert float(made["final unbalance [g mm]"]) == pytest.approx(1e6 * float(made["final unbalance [kg m]"]), rel=1e-3)
    assert [row[-1] for row in tables["Balance factors"].rows] == ["100.0 %"]
    # a factor of nothing on a throw without rotating mass is no weight
    plain = {grid.title: grid for grid in tables_of(laufruhe.solve(_OPEN_FACTOR))}
    assert [tuple(row) for row in plain["Balance factors"].rows] == [("cylinder 1", "no weight", "50.0 %")]
    tight = {grid.title: grid for grid in tables_of(scenes.solved(scenes.TIGHT))}
    assert re.fullmatch(r"[\d.]+ kg m = [\d.]+ g mm", tight["Decisions"].rows[0][2])


WIDE = Table(
    ("place of the mount", "first number", *(f"number {k} of many" for k in range(9)), "why"),
    [("front left", "0.01230", *(f"{k}234.5678" for k in range(9)), "there is no gas")],
    title="Wide",
    left=(0, 11),
)


def document_on(width: int, *blocks: Bullets | Table | Paragraph) -> list[str]:
    """Return the lines of a document on a screen of some width."""
    stream = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("laufruhe.report.screen.PIPE_WIDTH", width)
        show_document(Document("Title", blocks), stream, Path("out"), "report.html")
    return stream.getvalue().splitlines()


@pytest.mark.parametrize("width", [24, 40, 80, 110, 400])
def test_no_number_of_a_table_is_broken_by_a_narrow_screen(width: int) -> None:
    lines = document_on(width, WIDE)
    assert max(map(len, lines[:-1])) <= width
    assert lines[-1] == "Results: out (begin with report.html)"
    words = " ".join(lines).split()
    for cell in WIDE.rows[0][1:-1]:
        assert words.count(cell) == 1, cell
    # orders beyond the width stand in a further table, whose rows are named again
    assert words.count("front") == words.count("place")
    assert (words.count("front") == 1) == (width == 400)


def test_a_marked_table_has_no_marks_on_the_screen() -> None:
    blocks = (
        Paragraph("**Take** `auto` of *this*", marked=True),
        Paragraph("a * b * c"),
        Bullets("lead", ["`auto` is safe"], marked=True),
        Table(("problem", "take"), [("[single](single.md)", "`two-order`")], left=2, marked=True),
    )
    text = "\n".join(document_on(80, *blocks))
    for line in ("Take auto of this\n", "a * b * c\n", "- auto is safe", "single    two-order"):
        assert line in text
    assert strip_markdown(escape_markdown("a_b [c](d) *e* `f`")) == "a_b [c](d) *e* `f`"


def test_numbers_of_a_study_stand_below_each_other() -> None:
    rows = marked_table(["case", "speed", "force [N]", "change", "proof"], [
        ["one", "6", "704.88", "–", "as given"], ["**one**", "**8**", "**1.2e-05**", "**-14.4 %**", "**proven**"],
    ])  # fmt: skip
    assert rows.texts == {0, 4}
    assert "| --- | ---: | ---: | ---: | --- |" in rows.as_markdown()


def test_rocking_couples_are_shown_by_axis() -> None:
    """Check that three upright cylinders pitch only, and that four in a plane have no couple."""
    pitching = laufruhe.evaluate(laufruhe.load("tractor-three"))
    whole, by_axis = loads.orders(pitching)
    assert by_axis.title.startswith("Rocking couple by axis")
    assert all(row[2].strip() == "0" for row in by_axis.rows)
    couples = {row[0]: row[-1] for row in whole.rows}
    assert all(row[1].strip() == couples[row[0]].strip() for row in by_axis.rows if row[0] in ("1", "2"))
    assert len(loads.orders(laufruhe.evaluate(laufruhe.load("tractor-four-front-force")))) == 1


def test_shaking_forces_are_shown_by_axis_where_these_differ() -> None:
    """Half of the reciprocating mass opposite to the throw: the forces of order 1 along both axes are equal."""
    half, most = (
        loads.orders(laufruhe.evaluate(laufruhe.load(_OPEN_FACTOR).with_values({"web.balance_factor": k})))
        for k in (0.5, 0.8)
    )
    assert all(table.title.startswith("Shaking force by axis") for table in (half[1], most[1]))
    (_, across, up), *rest = most[1].rows
    assert float(across) == pytest.approx(4.0 * float(up), rel=1e-3)
    assert rest[0][1].strip() == "0"
    assert half[1].rows[0][1] == half[1].rows[0][2]
    assert len(loads.orders(laufruhe.evaluate(laufruhe.load("tractor-four-front-force")))) == 1


def test_direction_weights_of_the_objective_are_in_the_headline() -> None:
    """Weights w along z on a single: the best balance factor is w^2 / (1 + w^2), from k^2 + w^2 (1 - k)^2."""
    result = laufruhe.solve(_OPEN_FACTOR.replace('force" }', 'force", direction_weights = [1, 1, 2] }'))
    assert headline(result).startswith("RMS shaking force with direction weights 1, 1, 2 falls from")
    # comparisons and files name the objective too
    assert result.objective is not None
    assert result.objective.name == "rms shaking force with direction weights 1, 1, 2"
    (factor,) = result.decisions
    assert factor.value == pytest.approx(0.8, abs=1e-6)


_FLAT = """
title = "Flat twin"
operating_points = [{ speed = "3000 rpm" }]
main_bearings = [{ name = "front", x = "-80 mm" }, { name = "rear", x = "80 mm" }]
objective = { minimise = "maximum main-bearing force", bearings = ["front"] }
[engine]
layout = "boxer"
cycle = "four-stroke"
stroke = "70 mm"
rod_ratio = 0.28
reciprocating_mass = "0.5 kg"
rotating_mass = "0.5 kg"
firing_order = [1, 2]
cylinder_spacing = "100 mm"
bank_stagger = "30 mm"
[[counterweights]]
name = "web"
opposite_throw = 1
angle = 180
radius = "40 mm"
mass = { between = ["0 g", "900 g"] }
"""


def _first_order(result: Result) -> np.ndarray:
    wrench = result.final.loads[0].wrench
    return np.asarray(wrench.coefficients[round(1.0 / float(wrench.base)), 1:3])


def test_a_design_that_adds_a_free_force_says_so() -> None:
    result = laufruhe.solve(_FLAT)
    force = float(np.abs(_first_order(result)).max())
    assert force > 500.0
    (text,) = added_loads(result)
    assert f"adds a shaking force of order 1, {force:.4g} N, that the initial design does not have" in text
    limit = 'constraints = [{ limit = "rms shaking force", max = "1 N" }]'
    limited = laufruhe.solve(_FLAT.replace("[engine]", f"{limit}\n[engine]"))
    assert not added_loads(limited)
    assert np.abs(_first_order(limited)).max() < 1.01


def test_modes_that_no_load_moves_are_named() -> None:
    (modes, *_) = elastic.modes(laufruhe.evaluate(laufruhe.load("soft-mounts-run-up")))
    still = [row[0] for row in modes.rows if row[2] == "no"]
    assert still
    assert f"No load moves the block in {', '.join(still)}" in modes.note


def test_the_table_of_orders_has_the_largest_of_every_column() -> None:
    """A single has many roll moments of gas, and two orders of shaking force; both stay in the table."""
    result = laufruhe.evaluate(laufruhe.load(PROBLEMS / "tractor-single.toml"))
    table = loads.orders(result)[0]
    assert len(table.rows) == loads.MAX_ORDERS
    assert {"1", "2"} <= {row[0] for row in table.rows}
    assert "with the largest of every column" in table.note


@pytest.mark.parametrize(("size", "words"), [(0.5, " = 500000 g mm"), (2.0, "")])
def test_a_large_unbalance_is_in_kilogram_metres(size: float, words: str) -> None:
    """A million g mm is 1 kg m; the second column in kg m is then the same, and is left out."""
    text = _OPEN_FACTOR.replace(
        "balance_factor = { between = [0, 1] }", f'x = "0 mm", angle = 180, unbalance = "{size} kg m"'
    )
    (table,) = weights(laufruhe.evaluate(laufruhe.load(text)))
    unit = "g mm" if words else "kg m"
    assert [head for head in table.head if "unbalance" in head] == list(
        dict.fromkeys([f"unbalance [{unit}]", "unbalance [kg m]"])
    )
    assert float(table.rows[0][2]) == pytest.approx(size * (1e6 if words else 1.0))
    assert in_grams(size, "kg m", size) == words
