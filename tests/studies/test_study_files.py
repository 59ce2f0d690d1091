"""Study files: input that is refused in one line before any computation."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from cli import scenes
from laufruhe.cli import app
from laufruhe.errors import InputError
from laufruhe.extensions.sweeps.sweep import SweepTable, axis_of
from laufruhe.extensions.sweeps.swept import dataset
from laufruhe.files.complaints import Refused
from laufruhe.files.reader import load
from laufruhe.files.study_tables import CaseTable, field_at, keys_of
from laufruhe.studies.equal_power import at_equal_power
from laufruhe.studies.reader import load_study
from laufruhe.studies.runner import run
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.studies.solved import solve_scene
from problem_files import PROBLEMS

SPEED = "operating_points.1.mean_piston_speed"
FRACTION = "counterweights.web.balance_factor"


def study(
    kind: str = "counterweight fraction", sweep: str = "", problem: str = "tractor-single", more: str = ""
) -> str:
    return (
        f'title = "t"\n[study]\n[[study.parts]]\nname = "p"\nkind = "{kind}"\ntitle = "t"\n{more}\n{sweep}\n'
        f'[[study.parts.cases]]\nname = "one"\nproblem = "{PROBLEMS / problem}.toml"\n'
    )


def swept(quantity: str, text: str) -> str:
    return f'[[study.parts.sweep]]\nquantity = "{quantity}"\n{text}\n'


def case(name: str, problem: str, more: str = "") -> str:
    return f'[[study.parts.cases]]\nname = "{name}"\nproblem = "{problem}"\n{more}\n'


VEE = PROBLEMS / "vee-six-60.toml"
FOUR = PROBLEMS / "tractor-four-lanchester.toml"
REPLICA = """
title = "t"
[study]
common = { numbers = { m = 2 } }
[[study.parts]]
name = "p"
kind = "replication"
title = "t"
problems = { one = { like = "tractor-single.toml", engine = { reciprocating_mass = "{m} kg" } } }
quantities = { mean = "mean mount force" }
cases = [{ name = "given", problem = "one" }]
[[study.parts.statements]]
text = "s"
value = "mean['given']"
is = 1
within = "5 %"
""".replace("tractor-single.toml", str(PROBLEMS / "tractor-single.toml"))
BY_PLACE = "counterweights.1.balance_factor"
MANY = "from = 0\nto = 1\npoints = 100000"
LONGER = case("T", str(FOUR), 'set = { "engine.stroke" = "100 mm" }')
BAD = [
    (study().replace('name = "p"', 'name = "My part/.."'), "must have small letters, digits and"),
    (study().replace(f"{PROBLEMS / 'tractor-single'}", f"{PROBLEMS / 'tractor-sweeps'}"),
     "study: makes this a study file; name a problem file in the case"),
    (study(sweep=swept(FRACTION, "from = 0\nto = nan\npoints = 3")), "sweep[1].to = [NaN]: is not finite"),
    (study("counterweight fracton"), "did you mean 'counterweight fraction'?"),
    (study().replace('kind = "counterweight fraction"', ""), "study.parts[1].kind: is missing; use one of:"),
    (study(sweep=swept(FRACTION, "values = []")), "study.parts[1].sweep[1].values = []: is empty"),
    (study(sweep=swept(FRACTION, "values = [0.5]")), "holds one value, which is no sweep"),
    (study(sweep=swept(FRACTION, "values = [0.5, 0.5]")), "names a value twice"),
    (study(sweep=swept(SPEED, 'values = ["6 m/s", "600 cm/s"]')), "names a value twice"),
    (study(sweep=swept(SPEED, 'values = ["6 m/s", "8 kg"]')), "'kg' is not a unit of a speed"),
    (study(sweep=swept(SPEED, 'values = ["6 m/s", "8"]')), "has no unit"),
    (study(sweep=swept(SPEED, 'values = [8, "6 m/s"]')), "mixes numbers with and without a unit"),
    (study(sweep=swept(SPEED, 'from = "6 m/s"\nto = "12 m/s"\npoints = 1')), "points = 1: makes no sweep"),
    (study(sweep=swept(SPEED, 'from = "6 m/s"\nto = "12 m/s"\npoints = 1000000')), "is more than"),
    (study(sweep=swept(SPEED, 'from = "12 m/s"\nto = "6 m/s"\npoints = 3')), "does not lie below to"),
    (study(sweep=swept(SPEED, 'from = "6 m/s"\nto = "6 m/s"\npoints = 3')), "does not lie below to"),
    (study(sweep=swept(SPEED, 'from = "6 m/s"\nto = "12 mm"\npoints = 3')), "'mm' is not a unit of a speed"),
    (study(sweep=swept(SPEED, 'from = "fast"\nto = "faster"\npoints = 3')), "is not a number with a unit"),
    (study(sweep=swept(SPEED, 'from = "6 m/s"\npoints = 3')), "sweep[1].to: is missing"),
    (study(sweep=swept(SPEED, "")), "values: is missing; add values, or from, to and points"),
    (study(sweep=swept(SPEED, 'values = ["6 m/s", "8 m/s"]\npoints = 3')), "are given, but also from"),
    (study(sweep=swept(FRACTION, 'from = 0\nto = 1\npoints = 3\nspacing = "log"')), "a logarithmic sweep cannot begin"),
    (study(sweep=swept(FRACTION, "from = 0\nto = inf\npoints = 3")), "is not finite"),
    (REPLICA.replace("value = \"mean", "value = \"maen"), "study.parts[1]"),
    (REPLICA.replace("value = \"mean", "value = \"maen"), "'maen' is no name here; did you mean 'mean'?"),
    (REPLICA.replace("mean['given']", "mean['givn']"), "'givn' is no case here; did you mean 'given'?"),
    (REPLICA.replace("mean['given']", "mean.values"), "'mean.values' is not allowed here"),
    (REPLICA.replace("mean['given']", "__import__('os')"), "'__import__' is no function here"),
    (REPLICA.replace("mean['given']", "(lambda: 1)()"), "is no function"),
    (REPLICA.replace("mean['given']", "1 +"), "is no expression; write for example"),
    (REPLICA.replace("mean mount force", "mean mount farce"), "did you mean 'mean mount force'?"),
    (REPLICA.replace("{m} kg", "{mm} kg"), "'mm' is no name here; did you mean 'm'?"),
    (REPLICA.replace("{m} kg", "{m kg"), "cannot be read"),
    (REPLICA.replace("numbers = {", "nummbers = {") + REPLICA[REPLICA.index("[[study.parts]]"):].replace('"p"', '"q"'),
     "study.common.nummbers"),
    (REPLICA.replace("{m} kg", "{m} mm"), "'mm' is not a unit of a mass"),
    (REPLICA.replace("within", "witin"), "did you mean 'within'?"),
    (REPLICA.replace('within = "5 %"', ""), "is a statement that needs `is` and `within` together; give both"),
    (REPLICA.replace("is = 1", 'holds = "value > 1"\nis = 1'), "is a statement with `is` and `within`"),
    (REPLICA.replace('problem = "one"', 'problem = "two"'), "does not exist"),
    (REPLICA.replace('problem = "one"', 'problem = "one", sweep = { m = { from = 1 } }'), "is no grid; give values"),
    (study(sweep=swept(FRACTION, 'from = 0\nto = 1\npoints = 3\nspacing = "cubic"')), "use one of: linear, log"),
    (study(sweep=swept(FRACTION, f"values = [0, 1{400 * '0'}]")), "more than 64 bits"),
    (study(sweep=swept(FRACTION, "from = -1e308\nto = 1e308\npoints = 3")), "is too far from the other end"),
    (study(sweep=swept(FRACTION, f"from = 0\nto = 1{400 * '0'}\npoints = 3")), "more than 64 bits"),
    (study(sweep=swept("title", "values = [1, 2]")), "title = 1: must be text"),
    (study(sweep=swept("engine", 'values = ["a", "b"]')), "engine = \"a\""),
    (study(sweep=swept("engine.throws.9", "values = [0, 1]")), "is not the path of a quantity of this problem"),
    (study(sweep=swept("operating_points..speed", "values = [0, 1]")), "is not the path of a quantity of this problem"),
    (study(sweep=2 * swept(FRACTION, "values = [0, 1]")), "is swept twice"),
    (study(sweep=swept(FRACTION, "values = [0, 1]") + swept(BY_PLACE, "values = [0, 1]")), "is swept twice"),
    (study(sweep=swept(FRACTION, "values = [0, 1]")) + f'set = {{ "{BY_PLACE}" = 0.5 }}', "is swept, and set by"),
    (study(sweep=swept(FRACTION, MANY) + swept(SPEED, 'from = "6 m/s"\nto = "7 m/s"\npoints = 100000')),
     "makes 10000000000 points; a study takes 100000"),
    (study("layout comparison", sweep=swept(FRACTION, MANY)) + case("b", "x.toml"), "makes 200000 points"),
    (study(sweep=swept(FRACTION, MANY)) + study(sweep=swept(FRACTION, MANY)).partition("[study]")[2]
     .replace('"p"', '"q"'), "make 200000 points"),
    (study("balancer sizing", swept("gas.imep", 'from = "5 bar"\nto = "6 bar"\npoints = 40000'),
           "tractor-four-lanchester-and-moment"), "makes 160000 points"),
    (REPLICA.replace('problem = "one"', f'problem = "one", sweep = {{ m = {{ {MANY.replace(chr(10), ", ")} }}, '
     'k = { values = [1, 2] } }'), "makes 200000 points"),
    (study(sweep=swept(FRACTION, "values = [0, 1]")) + f'set = {{ "{FRACTION}" = 0.5 }}', "is swept, and set by"),
    (study(sweep=swept("engine.rod_ration", "values = [0.2, 0.3]")), "did you mean 'rod_ratio'?"),
    (study(sweep=swept("block.mass", 'values = ["1 kg", "2 kg"]')), "block.inertia: is missing"),
    (study(sweep=swept("blok.mass", 'values = ["1 kg", "2 kg"]')), "is not the path of a quantity of this problem"),
    (study(sweep=swept("engine.rod_ratio", "values = [0.2, 1.2]")), "rod_ratio"),
    (study(problem="tractor-four-lanchester"), "has no open balance factor"),
    (study("balancer sizing"), "no balancer shaft to size"),
    (study("layout comparison", problem="nowhere"), "file: is named by the study, but does not exist; paths begin in"),
    (study(sweep=swept("stroke", 'values = ["100 mm", "110 mm"]')), "write the whole path, engine.stroke"),
    (study(sweep=swept("operating_points.mean_piston_speed", 'from = "6 m/s"\nto = "8 m/s"\npoints = 3')),
     "is not the path of a number in the problem file; write its whole path, such as operating_points.1.speed"),
    (study(sweep=swept(FRACTION, 'from = "0,1"\nto = 1\npoints = 3')), 'decimals follow a point; write 0.1'),
    (study(sweep=swept(SPEED, 'values = ["6 m/s", "8 m/s"]\nunit = "x"')), "write the unit with its number"),
    (study("layout comparison", problem="tractor-study"), "makes this a study file"),
    (study("layout comparison") + case("one", "x.toml"), "two cases with the same name"),
    (study("layout comparison") + case("V", str(VEE)) + "equal_power_to = 4", "differs between cases"),
    (study("layout comparison", problem="tractor-four-lanchester") + LONGER,
     "compare layouts of one cylinder"),
    (study("layout comparison", more='metric = "mean mount torque"'), "did you mean"),
    (study() + 'without = ["gass"]', "did you mean 'gas'?"),
    ('title = "a problem"\n', "so this is not a study file"),
    ('title = "t"\n[study]\n', "study.parts: is missing; add"),
    (REPLICA.replace("common = { numbers = { m = 2 } }", "common = 1.5"), "study.common = 1.5: "),
    (study(sweep=swept("counterweights.wb.mass", "values = [0, 1]")) + 'set = { "counterweights.web.name" = 1.5 }',
     "counterweights.wb: is not the path of a quantity of this problem; use one of: 1"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "said"), BAD, ids=[said for _, said in BAD])
def test_refused_in_one_line_and_nothing_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(text, encoding="utf-8")
    answer = CliRunner().invoke(app, ["study", "s.toml"])
    assert answer.exit_code == 2, answer.output
    assert said in answer.stderr
    assert answer.stderr.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["s.toml"]


def test_a_renamed_part_is_swept_by_its_new_name(tmp_path: Path) -> None:
    named = 'set = { "counterweights.web.name" = "inner" }'
    (tmp_path / "s.toml").write_text(
        study(sweep=swept("counterweights.inner.balance_factor", "values = [0, 1]")) + named
    )
    (part,) = load_study(tmp_path / "s.toml").study.parts
    assert len(part.points(ProblemFiles(tmp_path))) == 3


def test_problem_given_to_study_and_study_to_solve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="use laufruhe solve for a problem"):
        load_study(PROBLEMS / "tractor-single.toml")
    for command in ("solve", "evaluate", "explain"):
        answer = CliRunner().invoke(app, [command, str(PROBLEMS / "tractor-sweeps.toml")])
        assert answer.exit_code == 2
        assert "makes this a study file; use laufruhe study" in answer.stderr
    with pytest.raises(InputError, match="use laufruhe study"):
        load(PROBLEMS / "tractor-sweeps.toml")
    assert not list(tmp_path.iterdir())


def test_equal_power_needs_one_cylinder(tmp_path: Path) -> None:
    """Two cylinders of different stroke on one crank have no one scale."""
    text = (
        'title = "t"\n[engine]\nlayout = "parts"\ncycle = "two-stroke"\nstroke = "100 mm"\nrod_ratio = 0.25\n'
        'reciprocating_mass = "1 kg"\n[[engine.slider_cranks]]\nx = "0 mm"\n'
        '[[engine.slider_cranks]]\nx = "100 mm"\nstroke = "120 mm"\n'
        '[[operating_points]]\nspeed = "2000 rpm"\n[objective]\nminimise = "rms shaking force"\n'
    )
    (tmp_path / "banks.toml").write_text(text, encoding="utf-8")
    banks = CaseTable(name="banks", problem="banks.toml", equal_power_to=4)
    assert ProblemFiles(tmp_path).problem(Point(banks.model_copy(update={"equal_power_to": None})))
    with pytest.raises(
        InputError, match=r"equal_power_to = \"banks\": cylinders differ in bore or stroke.*; give all the same size"
    ):
        ProblemFiles(tmp_path).problem(Point(banks))


@pytest.mark.parametrize(
    ("quantity", "keys", "unit", "numbers"),
    [
        (SPEED, {"from": "6 m/s", "to": "12 m/s", "points": 4}, "m/s", (6.0, 8.0, 10.0, 12.0)),
        (SPEED, {"values": ["6 m/s", "36 km/h"]}, "m/s", (6.0, 10.0)),
        ("operating_points.1.speed", {"values": ["600 rpm", "20 mm"]}, None, None),
        ("engine.rod_ratio", {"from": 0.1, "to": 0.3, "points": 3}, "1", (0.1, 0.2, 0.3)),
        ("engine.throws.2", {"values": [90, 180]}, "deg", (90.0, 180.0)),
        ("gas.imep", {"from": "1 bar", "to": "100 bar", "points": 3, "spacing": "log"}, "bar", (1.0, 10.0, 100.0)),
        ("engine.layout", {"values": ["inline", "vee"]}, "", None),
        ("operating_points.1.motored", {"values": [True, False]}, "", None),
    ],
)  # fmt: skip
def test_swept_values_are_numbers_with_their_unit(
    quantity: str, keys: dict[str, object], unit: str | None, numbers: tuple[float, ...] | None
) -> None:
    sweep = SweepTable.model_validate({"quantity": quantity, **keys})
    if unit is None:
        with pytest.raises(Exception, match="mm"):
            axis_of(sweep)
        return
    axis = axis_of(sweep)
    assert axis.unit == unit
    if numbers is None:
        assert axis.numbers is None
    else:
        assert axis.numbers == pytest.approx(numbers, rel=1e-11)


def test_paths_know_their_field() -> None:
    result = field_at("balancer_shafts.front.unbalances.1.unbalance")
    assert result is not None
    assert result.unit == "kg m"
    assert field_at("engine.layout") is None
    assert field_at("engine.no.such.path") is None


def test_equal_power_is_eq_23(tmp_path: Path) -> None:
    """Rebuilt and evaluated, forces are those of the reference over the ratio of cylinders."""
    more = 'without = ["balancer_shafts"]\n'
    text = study("layout comparison", problem="tractor-two") + more
    found = []
    for power in ("", "equal_power_to = 4\n"):
        path = tmp_path / "s.toml"
        path.write_text(text + power, encoding="utf-8")
        found.append(run(load_study(path), tmp_path, tmp_path / "kept" / "k")[0]["p"])
    # gas samples and the solver's grid are the same, so only rounding is left
    assert found[1]["objective_given"].values == pytest.approx(2.0 * found[0]["objective_given"].values, rel=1e-9)
    assert found[1]["objective"].values == pytest.approx(2.0 * found[0]["objective"].values, rel=1e-4)
    assert found[1].attrs["at"] == "the power of 4 cylinders"
    assert "size" not in found[0]
    size = {name: found[1]["size"].sel(size_name=name).item() for name in found[1]["size_name"].values}
    assert size["bore"] == pytest.approx(0.1 * math.sqrt(2.0))
    assert size["stroke"] == pytest.approx(0.12 * math.sqrt(2.0))
    # mean pressure and mean piston speed of the file, on the piston area of four cylinders
    mean_pressure, area = 9.0 * 98066.5, 4 * 0.25 * math.pi * 0.1**2
    assert size["power"] == pytest.approx(mean_pressure * area * 10.0 / 4.0, rel=1e-3)
    assert size["displacement"] * size["speed"] / math.tau / 2.0 * mean_pressure == pytest.approx(size["power"])
    mounts = load(PROBLEMS / "tractor-two.toml").engine.mounts
    assert found[1]["mount_x"].values[0] == pytest.approx([math.sqrt(2.0) * mount.position[0] for mount in mounts])


def test_an_open_stroke_is_decided_at_equal_power() -> None:
    """A number that rebuilds the engine gives the engine of the file with this number, resized."""
    text = (PROBLEMS / "single-stroke-offset.toml").read_text(encoding="utf-8")
    problem, fixed = load(text), load(text.replace('{ between = ["80 mm", "160 mm"], start = "120 mm" }', '"150 mm"'))
    names = [decision.name for decision in problem.decisions]
    values = [0.15 if name == "engine.stroke" else start for name, start in zip(names, problem.start, strict=True)]
    built, expected = at_equal_power(problem, 4).fixed_at(values), at_equal_power(fixed, 4)
    (part,), (resized,) = built.engine.slider_cranks, expected.engine.slider_cranks
    assert (part.bore, part.stroke) == pytest.approx((0.2, 0.3))
    assert part.reciprocating_mass == pytest.approx(resized.reciprocating_mass)
    assert built.points[0].speed == pytest.approx(expected.points[0].speed)


@pytest.mark.parametrize(("name", "setting", "left_out"), [
    ("vee", {"layout": "vee", "cylinders": 8, "bank_angle": 90, "split_pin_angle": 0}, ()),
    ("boxer", {"layout": "boxer", "firing_order": [1, 2, 3, 4], "bank_stagger": "40 mm"}, ("phasing", "engine.throws")),
])  # fmt: skip
def test_one_problem_file_has_many_layouts(name: str, setting: dict[str, object], left_out: tuple[str, ...]) -> None:
    files, path = ProblemFiles(PROBLEMS), "compare-inline.toml"
    keys = {f"engine.{key}": value for key, value in setting.items()}
    case_of_one = CaseTable(name=name, problem=path, without=list(left_out), set=keys)
    own, other = files.tables(Point(case_of_one)), files.file(f"compare-{name}.toml")
    assert {key: own[key] for key in own if key not in ("title", "assumptions")} == {
        key: other[key] for key in other if key not in ("title", "assumptions")
    }


READ = """readings = { "as printed" = { "engine.reciprocating_mass" = "1.25 kg" }, "2.25 kg" = { "engine.reciprocating_mass" = "2.25 kg" } }"""  # noqa: E501


def test_a_part_is_read_in_every_reading(tmp_path: Path) -> None:
    """Check one part for each reading, with its value in all cases that do not set their own."""
    path = tmp_path / "s.toml"
    own = case("own", str(FOUR), 'set = { "engine.reciprocating_mass" = "3 kg" }')
    path.write_text(study("layout comparison", more=READ) + own, encoding="utf-8")
    printed, meant = load_study(path).study.parts
    assert [printed.name, meant.name] == ["p-as-printed", "p-2-25-kg"]
    assert [printed.title, meant.title] == ["t; as printed", "t; 2.25 kg"]
    masses = [[one.set["engine.reciprocating_mass"] for one in part.cases] for part in (printed, meant)]
    assert masses == [["1.25 kg", "3 kg"], ["2.25 kg", "3 kg"]]


def test_readings_of_one_name_are_refused(tmp_path: Path) -> None:
    """Two readings that make one file name, and one that makes the name of another part."""
    path = tmp_path / "s.toml"
    other = study("layout comparison").split("[study]")[1].replace('name = "p"', 'name = "p-2-25-kg"')
    for text in (study("layout comparison", more=READ.replace("as printed", "2.25-kg")),
                 study("layout comparison", more=READ) + other):  # fmt: skip
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match="is given twice"):
            load_study(path)


def test_a_table_may_replace_a_number_of_all_parts(tmp_path: Path) -> None:
    """A grid in place of the common number; the other way round as well."""
    grid = "numbers = { m = { values = [1, 2] } }\nquantities"
    path = tmp_path / "s.toml"
    for text in (REPLICA.replace("quantities", grid), REPLICA.replace("{ m = 2 }", "{ m = { values = [1, 2] } }")):
        path.write_text(text, encoding="utf-8")
        assert load_study(path).study.parts[0].name == "p"


def test_every_bad_expression_is_named_with_its_place(tmp_path: Path) -> None:
    """Check one line for each bad expression: key, value, rule and nearest name."""
    panel = 'picture = { panels = [{ title = "{m:d}", curves = [{ y = "mean[\'givn\'] / m" }] }] }\nquantities'
    path = tmp_path / "s.toml"
    path.write_text(REPLICA.replace("quantities", panel).replace("is = 1", 'is = "2 * mm"'), encoding="utf-8")
    with pytest.raises(InputError) as found:
        load_study(path)
    assert [str(one) for one in found.value.complaints] == [
        "study.parts[1].statements[1].is = \"2 * mm\": 'mm' is no name here; did you mean 'm'?",
        "study.parts[1].picture.panels[1].title = \"{m:d}\": 'd' is no format for a number; "
        "write for example .1f, .3g or .0f",
        "study.parts[1].picture.panels[1].curves[1].y = \"mean['givn'] / m\": 'givn' is no case here; "
        "did you mean 'given'?",
    ]


def test_a_limit_has_the_name_that_results_show() -> None:
    limits: list[dict[str, object]] = [
        {"limit": "maximum mount force", "max": "1 kN", "orders": [0.5], "mounts": ["left"]},
        {"limit": "balancer mass", "max": "4 kg"},
        {"limit": "balancer mass", "max": "2 kg", "of": ["front"]},
        {"limit": "counterweight mass", "max": "4 kg", "name": "webs"},
    ]
    tables = {"constraints": limits}
    assert keys_of(tables, "constraints.maximum mount force of order 0.5 on left.max") == ("constraints", 0, "max")
    assert keys_of(tables, "constraints.webs.max") == ("constraints", 3, "max")
    assert keys_of(tables, "constraints.2.max") == ("constraints", 1, "max")
    # two limits of one name are told apart by their numbers alone
    with pytest.raises(Refused, match="is not the path of a quantity of this problem"):
        keys_of(tables, "constraints.balancer mass.max")


def test_forces_by_order_and_prices_of_limits_are_kept() -> None:
    result = scenes.solved(scenes.TIGHT)
    record = solve_scene(result.problem)
    limit = result.limits[0]
    assert record["shadow_price"] == {limit.name: pytest.approx(limit.shadow_price, rel=1e-3)}
    assert record["limit_units"] == {"balancer mass": "kg"}
    forces = result.final.loads[0].mount_forces
    assert forces is not None
    second = np.linalg.norm(forces.at(2.0)[:, 1:], axis=1)
    assert np.mean(second) >= record["order_force"]["2"] > 0.5 * np.mean(second)
    assert record["order_force_given"]["2"] > record["order_force"]["2"]
    data = dataset([Point(CaseTable(name="a", problem="a.toml"))], [record], {}, {})
    assert data["shadow_price"].sel(limit="balancer mass").item() == record["shadow_price"]["balancer mass"]
    assert data["price_unit"].values.tolist() == ["N per kg"]
    assert 2.0 in data["order"].values
