"""Replications: the language of their files, their results and verdicts, and the ready ones."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from laufruhe.cli import app
from laufruhe.errors import ModelError
from laufruhe.extensions.replication.expressions import ExpressionError, check, fill_in, numbers_of, value_of
from laufruhe.extensions.replication.judging import CONFIRMED, NOT_CONFIRMED, count_confirmed, judge_statements, rows
from laufruhe.extensions.replication.models import Hue, StatementTable
from laufruhe.extensions.replication.part import Replication
from laufruhe.plots.picture import colour_of, draw
from laufruhe.present.tables import Table
from laufruhe.studies.scenes import ProblemFiles
from problem_files import PROBLEMS

READY = {
    "replication-five-cylinder": (6, ["Second-order couple (Fig. 2.8.13)"]),
    "replication-free-couples": (17, []),
    "replication-three-mounts": (12, []),
    "replication-crank-pin": (8, ["Gas force (first line)"]),
    "replication-worked-diesel": (
        20,
        [
            "Piston area (A3)",
            "A2 of the mean pressure of 4 at (G b5)",
            "Load for the friction, where it is used (G c V2)",
            "Flywheel in all, where it is used (G b3)",
            "Pull on an arm of the flywheel (E b2)",
            "Modulus of the web, by the 1/8 that is printed (G c II)",
            "Buckling of the rod, by the 15^3 that is printed (H a4)",
            "Fuel of a stroke (J 4)",
        ],
    ),
}
GRID = xr.DataArray([4.0, 1.0, 3.0], dims="k", coords={"k": [0.0, 1.0, 2.0]})
NAMES = {"x": 2.0, "y": {"a": GRID}, "throws": [0, 180, 180, 0]}


class TestExpressions:
    """Arithmetic, comparisons and named functions, and nothing else."""

    @pytest.mark.parametrize(("text", "value"), [
        ("1 + 2 * x ** 3 / 4 % 5", 5.0),
        ("-x < 0 <= 1 and not x > 3", True),
        ("x > 3 or x == 2", True),
        ("max(y['a']) - min(y['a'])", 3.0),
        ("argmin(y['a'])", 1.0),
        ("at(y['a'], k=1.8)", 3.0),
        ("y['a'][0]", 4.0),
        ("sum(y['a'] * 2)", 16.0),
        ("max([x, 7, 3])", 7.0),
        ("rising([1, 2, 3]) and not rising(y['a'])", True),
        ("len(throws)", 4),
        ("abs(couple_star([0, 240, 120]))", 3.0**0.5),
        ("degrees(couple_star([0, 180]))", 0.0),
        ("negligible < noticeable", True),
        ("lever_share([0, 4, 6], 1, 1)", 0.75),
        ("excursion([3, 1, -1, -3], 2)", 8.0),
    ])  # fmt: skip
    def test_values(self, text: str, value: Any) -> None:
        assert value_of(text, NAMES) == pytest.approx(value)
        check(text, dict.fromkeys(NAMES, ()), ["a"])

    @pytest.mark.parametrize("text", [
        "x.real", "().__class__", "__import__('os').system('ls')", "(lambda: 1)()", "[k for k in throws]",
        "x if x else 0", "open('f')", "f'{x}'", "throws.append(1)",
        "x := 3", "{1: 2}", "max(*throws)", "x @ x", "b'a'", "None", "1j", "throws[0:2]", "(x, x)", "Add(x, x)",
        "'{0.__class__}'.format(x)", "'{}'.format(x)", "max.__globals__", "y['a'].values", "[max][0](x)",
    ])  # fmt: skip
    def test_expressions_beyond_arithmetic_are_refused(self, text: str) -> None:
        with pytest.raises(ExpressionError):
            value_of(text, NAMES)

    @pytest.mark.parametrize("text", [
        "'a' * 1000000000", "throws * 1000000000", "'%1000000000d' % 1", "9 ** 9 ** 9 ** 9", "-" * 1990 + "x", "1 / 0",
        "y['b']", "throws[9]", "max([])", "1[0]", "1 < throws", "",
        "(" * 900 + "x" + ")" * 900, "x" * 3000, "sqrt(throws, 1, 2, 3)",
    ])  # fmt: skip
    def test_nothing_takes_long_or_escapes(self, text: str) -> None:
        started = time.process_time()
        with pytest.raises(ExpressionError):
            value_of(text, NAMES)
        assert time.process_time() - started < 10.0

    def test_texts_are_filled(self) -> None:
        template = {"a": ["{x} kg", "{throws}", 3], "b": "{x:.2f} and {2 * x:.0f} %", "c": "plain"}
        assert fill_in(template, NAMES) == {"a": ["2.0 kg", [0, 180, 180, 0], 3], "b": "2.00 and 4 %", "c": "plain"}
        for wrong in ("{x", "{x:1000000000f}", "{x:d}", "{z}"):
            with pytest.raises(ExpressionError):
                fill_in(wrong, NAMES)

    def test_numbers_build_on_one_another(self) -> None:
        tables = {"r": 2, "area": "pi * r**2", "k": {"from": 0, "to": 1, "points": 3}, "half": "k / 2"}
        result = numbers_of({**tables, "r": 3}, {})
        assert result["area"] == pytest.approx(9.0 * np.pi)
        assert result["half"].values.tolist() == [0.0, 0.25, 0.5]
        with pytest.raises(ExpressionError, match="'k' is no grid"):
            numbers_of({"k": {"from": 0}}, {})


def _verdict(**more: Any) -> str:
    statement = StatementTable.model_validate({"text": "s", "printed": "1", "value": "x", **more})
    return str(judge_statements([statement], {"": NAMES})["verdict"][1][0][0])


@pytest.mark.parametrize(("more", "verdict"), [
    ({"is": 2.1, "within": "5 %"}, CONFIRMED),
    ({"is": 2.2, "within": "5 %"}, NOT_CONFIRMED),
    ({"is": "2 + 0.25", "within": 0.25}, CONFIRMED),
    ({"holds": "value > 1"}, CONFIRMED),
    ({"holds": "value > 2"}, NOT_CONFIRMED),
    ({"holds": "value > 1", "printed": None}, "not in the study"),
    ({"holds": "value > 2", "printed": None}, "not in the study"),
])  # fmt: skip
def test_verdicts(more: dict[str, Any], verdict: str) -> None:
    assert _verdict(**more) == verdict


def test_table_and_count() -> None:
    both = [
        {"text": "holds", "where": "p. 3", "printed": "2", "value": "x", "is": 2, "within": 0},
        {"text": "fails", "printed": "3 kp", "value": "x", "unit": "kp", "is": 3, "within": 0, "why": "{x:.1f}"},
    ]
    statements = [StatementTable.model_validate(one) for one in both]
    data = xr.Dataset(coords=judge_statements(statements, {"": NAMES}))
    (table,) = rows(data)
    assert isinstance(table, Table)
    assert table.rows == [["holds (p. 3)", "2", "2", "yes", ""], ["fails", "3 kp", "2 kp", "**no**", "2.0"]]
    assert count_confirmed([data, xr.Dataset()]) == "1 of 2 statements are confirmed."


def test_readings_stand_side_by_side() -> None:
    """A part without readings counts in each of them."""
    statement = {"text": "s", "printed": "3", "value": "x", "is": 3, "within": 0, "why": "{x:.0f} found"}
    table = StatementTable.model_validate(statement)
    in_two = xr.Dataset(coords=judge_statements([table], {"as printed": NAMES, "as meant": {**NAMES, "x": 3.0}}))
    in_one = xr.Dataset(coords=judge_statements([table], {"": {"x": 3.0}}))
    (shown,) = rows(in_two)
    assert isinstance(shown, Table)
    assert list(shown.head) == ["statement", "source", "as printed", "confirmed", "as meant", "confirmed", "reason"]
    assert shown.rows == [["s", "3", "2", "**no**", "3", "yes", "as printed: 2 found<br>as meant: 3 found"]]
    expected = "as printed: 1 of 2 statements are confirmed. as meant: 2 of 2 statements are confirmed."
    assert count_confirmed([in_one, in_two]) == expected


def _part(**more: Any) -> Replication:
    return Replication.model_validate({
        "name": "p", "kind": "replication", "title": "t", "numbers": {"kappa": 0, "cm": 10},
        "problems": {"web": {"like": "tractor-single.toml", "gas": {"imep": "5 kp/cm^2"},
                             "operating_points": [{"mean_piston_speed": "{cm} m/s"}],
                             "counterweights": [{"name": "web", "balance_factor": "{kappa}"}]}},
        "quantities": {"mean": "mean mount force", "each": "mean force by mount"}, **more,
    })  # fmt: skip


def _data(part: Replication) -> xr.Dataset:
    points = part.points(ProblemFiles(PROBLEMS))
    return part.dataset(points, [part.answer(point, ProblemFiles(PROBLEMS)) for point in points])


def test_cases_sweep_and_keep_their_own_dimensions() -> None:
    """Check two swept numbers, a case without any, and mounts that one engine lacks."""
    sweep = {"cm": {"values": [6, 9]}, "kappa": {"from": 0, "to": 1, "points": 3}}
    part = _part(cases=[
        {"name": "swept", "problem": "web", "sweep": sweep},
        {"name": "half", "problem": "web", "numbers": {"kappa": 0.5, "cm": 9}},
        {"name": "set", "problem": "web", "numbers": {"kappa": 1},
         "set": {"operating_points.1.mean_piston_speed": "{3 * 3} m/s"}},
        {"name": "three", "problem": "tractor-three.toml"},
    ])  # fmt: skip
    (names,) = part.names(_data(part)).values()
    mean, each = names["mean"], names["each"]
    assert mean["swept"].dims == ("cm", "kappa")
    assert mean["half"] == value_of("at(mean['swept'], cm=9, kappa=0.5)", names)
    assert mean["set"] == value_of("at(mean['swept'], cm=9, kappa=1)", names)
    assert each["half"]["mount"].values.tolist() == ["left", "right"]
    assert each["three"].sizes == {"mount": 4}
    assert value_of("mean(each['half'])", names) == pytest.approx(mean["half"])


def test_cases_may_sweep_in_any_order() -> None:
    """Check that two cases that nest their sweeps the other way round give the same values."""
    cm, kappa = {"values": [6, 9]}, {"values": [0, 0.5, 1]}
    part = _part(cases=[
        {"name": "one", "problem": "web", "sweep": {"cm": cm, "kappa": kappa}},
        {"name": "other", "problem": "web", "sweep": {"kappa": kappa, "cm": cm}},
    ])  # fmt: skip
    (names,) = part.names(_data(part)).values()
    for speed in (6, 9):
        for share in (0, 0.5, 1):
            found = [value_of(f"at(mean['{case}'], cm={speed}, kappa={share})", names) for case in ("one", "other")]
            assert found[0] == found[1]


def test_readings_change_numbers_and_repeat_panels() -> None:
    """Check that a case's own numbers stay, and that common panels are drawn once."""
    panels = [{"title": "a", "curves": [{"x": "[0, 1]", "y": "[0, mean['given']]"}]}, {"title": "b", "once": True}]
    readings = {"slow": {"cm": 6}, "fast": {"cm": 9}}
    cases = [{"name": "given", "problem": "web"}, {"name": "own", "problem": "web", "numbers": {"cm": 9}}]
    part = _part(cases=cases, readings=readings, picture={"panels": panels})
    data = _data(part)
    slow, fast = part.names(data)["slow"]["mean"], part.names(data)["fast"]["mean"]
    assert slow["given"] < slow["own"] == fast["own"] == fast["given"]
    picture = Replication.picture(data)
    assert [panel.title for panel in picture.panels] == ["a, slow", "a, fast", "b"]


def test_picture_says_what_the_file_says() -> None:
    panels = [{
        "x": {"ends": [0, "2 * 0.5"]},
        "curves": [{"x": "kappa", "y": "at(mean['swept'], cm=v)", "for": {"v": [6, 9]}, "end": "end {v}"}],
        "words": [{"x": 0.5, "y": 1, "text": "{max(mean['swept']):.0f} N"}],
        "areas": [{"x": [0, 1], "y": [0, 10]}],
    }]  # fmt: skip
    cases = [{"name": "swept", "problem": "web", "sweep": {"cm": {"values": [6, 9]}, "kappa": {"values": [0, 1]}}}]
    data = _data(_part(cases=cases, picture={"title": "T", "panels": panels}))
    picture = Replication.picture(data)
    (axes,) = draw(picture).axes
    assert picture.title == "T"
    assert axes.get_xlim() == (0.0, 1.0)
    assert [line.get_xdata().tolist() for line in axes.get_lines()] == [[0.0, 1.0], [0.0, 1.0]]
    assert [text.get_text().strip() for text in axes.texts] == ["end 6", "end 9", f"{float(data['mean'].max()):.0f} N"]


@pytest.mark.parametrize(("more", "said"), [
    ({"define": {"a": "b", "b": "1"}}, "'b' is no name here"),
    ({"readings": {"r": {"mass": 2}}}, "'mass' is no number here"),
    ({"picture": {"panels": [{"curves": [{"y": "mean['given'] / kq"}]}]}}, "'kq' is no name here"),
    ({"picture": {"panels": [{"curves": [{"y": "mean['give']"}]}]}}, "'give' is no case here; did you mean 'given'"),
    ({"picture": {"panels": [{"curves": [{"y": "mean[k]", "for": {"k": ["given", "gibt"]}}]}]}}, "'gibt' is no case"),
    ({"picture": {"panels": [{"curves": [{"x": "order * angel", "y": "mean['given']"}]}]}}, "'angel' is no name here"),
    ({"picture": {"panels": [{"y": {"ends": [0, "maxx(kappa)"]}}]}}, "'maxx' is no function here"),
    ({"picture": {"panels": [{"title": "{cm:.1f} and {kapa}"}]}}, "'kapa' is no name here"),
    ({"picture": {"panels": [{"words": [{"x": 0, "y": 0, "text": "{cm:d}"}]}]}}, "'d' is no format"),
    ({"picture": {"panels": [{"x": {"names": ["{1 +}"]}}]}}, "'1 \\+' is no expression"),
    ({"picture": {"panels": [{"bars": {"filled": "[value]"}}]}}, "'value' is no name here"),
])  # fmt: skip
def test_refused(more: dict[str, Any], said: str) -> None:
    cases = [{"name": "given", "problem": "web"}]
    with pytest.raises(ValueError, match=said):
        _part(**{"cases": cases, **more})


@pytest.mark.parametrize("name", READY)
def test_ready_replication(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Check by its command that every statement is confirmed except those whose source is wrong."""
    confirmed, wrong = READY[name]
    monkeypatch.chdir(tmp_path)
    answer = CliRunner().invoke(app, ["study", str(PROBLEMS / f"{name}.toml")])
    assert answer.exit_code == 0, answer.output
    page = (tmp_path / "results" / name / "report.md").read_text(encoding="utf-8")
    assert f"{confirmed} of {confirmed + len(wrong)} statements are confirmed." in page
    assert [line.split(" | ")[0].strip("| ") for line in page.splitlines() if "**no**" in line] == wrong
    assert "Source:" in page


def test_second_order_couple_of_five_cylinders(worth: Callable[..., Any]) -> None:
    """The textbook draws 3260 Nm; the star of 1-2-4-5-3 has 4.98 F a = 3.7 kN m."""
    assert worth("example-5", "second", "replication-five-cylinder") == pytest.approx(3686.1, abs=0.1)


@pytest.mark.parametrize(("panel", "said"), [
    ({"curves": [{"y": "mean['one']"}]}, "'mean['one']' has no dimension for the horizontal axis; give the curve an x"),
    ({"curves": [{"y": "each['one']", "x": "[1, 2, 3]"}]}, "shape mismatch"),
    ({"curves": [{"y": "'text'", "x": "1"}]}, "panel 1 cannot be drawn: could not convert"),
    ({"words": [{"x": "each['one']", "y": 0, "text": "t"}]}, "'each['one']' is no single number"),
    ({"title": "{each['one']:.1f}"}, "is no single number"),
    ({"y": {"ends": [0, "each['one']"]}}, "is no single number"),
    ({"bars": {"filled": "[]"}}, "cannot be drawn"),
    ({"bars": {"filled": "[1]", "labels": ["a"], "for": {"k": [0, 1]}}}, "cannot be drawn: list index out of range"),
    ({"x": {"names": "{mean['one']}"}}, "cannot be drawn"),
])  # fmt: skip
def test_a_panel_that_cannot_be_drawn_is_named(panel: dict[str, Any], said: str) -> None:
    part = _part(cases=[{"name": "one", "problem": "web"}], picture={"panels": [panel]})
    with pytest.raises(ModelError) as found:
        Replication.picture(_data(part))
    assert said in str(found.value)
    assert str(found.value).startswith("panel 1 cannot be drawn: ")
    assert found.value.where == "part 'p', picture"


@pytest.mark.parametrize("more", [{"value": "y['a']", "is": 1, "within": 0}, {"holds": "y['a'] > 1"},
                                  {"is": "y['a']", "within": 0}, {"holds": "x", "why": "{y:.1f}"}])  # fmt: skip
def test_statements_are_judged_by_single_numbers(more: dict[str, Any]) -> None:
    with pytest.raises(ExpressionError, match="is no single number; take one of its numbers"):
        _verdict(**more)


@pytest.mark.parametrize(("key", "value"), [
    ("colours", ["mauve"]), ("colours", []), ("marker", "zz"), ("width", -1), ("dash", [1, -1]), ("dash", [1, 2, 3]),
])  # fmt: skip
def test_marks_that_cannot_be_drawn_are_refused_when_read(key: str, value: Any) -> None:
    with pytest.raises(ValueError, match=key):
        _part(cases=[], picture={"panels": [{"curves": [{"y": 1, key: value}]}]})


def test_every_colour_is_one_of_the_pictures() -> None:
    assert all(colour_of(name).startswith("#") for name in get_args(Hue))


@pytest.mark.parametrize("within", ["5", "five %", "-5 %", "%"])
def test_a_tolerance_is_a_number_or_a_share(within: str) -> None:
    with pytest.raises(ValueError, match="within"):
        _verdict(**{"is": 1, "within": within})


@pytest.mark.parametrize("like", ["a", "b", ["a"], 3])
def test_a_problem_like_itself_is_refused_before_anything_is_computed(like: Any) -> None:
    part = _part(problems={"a": {"like": "b"}, "b": {"like": like}}, cases=[{"name": "c", "problem": "a"}])
    with pytest.raises(ModelError, match="refers to itself by `like`, or its `like` is not a name; correct `like`"):
        part.points(ProblemFiles(PROBLEMS))
