"""Bad input: one line with file, key, value, rule and remedy, before any computation."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from _pytest.mark.structures import ParameterSet

from laufruhe.errors import InputError, ModelError, UncarriedLoadError
from laufruhe.extensions.flywheel.machine import Flywheel
from laufruhe.extensions.recorded_pressure.gas import PressureTrace
from laufruhe.files.reader import load, load_tables, tables_of
from laufruhe.machine import Cycle, Seiliger
from laufruhe.machine.gas.base import CylinderGases
from laufruhe.problem.evaluation import evaluate
from problem_files import FOUR, MOUNTS, PROBLEMS, changed, open_unbalance, shaft, written

WHOLE = "".join([
    FOUR, 'bore = "100 mm"\nthrows = [0, 180, 180, 0]\n', """
[[operating_points]]
name = "rated"
speed = "2500 rpm"

[gas]
model = "seiliger"
peak_pressure = "80 kp/cm^2"
imep = "5.5 kp/cm^2"
""", MOUNTS, """
[[counterweights]]
name = "web"
opposite_throw = 1
radius = "80 mm"
mass = { between = ["0 kg", "3 kg"] }
angle = { between = [0, 360] }
""", shaft("left", 2, "100 mm", open_unbalance()),
    shaft("right", -2, "-100 mm", 'coupled = { to = "left", as = "mirrored" }'), """
[objective]
minimise = "mean mount force"

[[constraints]]
limit = "balancer mass"
max = "4 kg"
"""])  # fmt: skip
PARTS = """
title = "Two geared cranks"
[engine]
layout = "parts"
cycle = "two-stroke"
stroke = "90 mm"
rod_length = "170 mm"
reciprocating_mass = "0.6 kg"
shafts = [{ name = "second", ratio = -1, position = ["0 mm", "460 mm"] }]
slider_cranks = [{ x = "0 mm" }, { x = "0 mm", shaft = "second", throw = 180, bank_angle = 180 }]
[[operating_points]]
speed = "3000 rpm"
"""


def complaint_about(path: Path) -> str:
    """Return the line that refuses a file, without its name."""
    with pytest.raises(InputError) as caught:
        load(path)
    (line,) = str(caught.value).splitlines()
    file, _, rest = line.partition(".toml: ")
    assert file + ".toml" == str(path)
    return rest


def test_the_unchanged_files_are_valid(tmp_path: Path) -> None:
    for text in (WHOLE, PARTS):
        problem = load(written(tmp_path, text))
        assert evaluate(problem).loads


def bad(name: str, old: str, new: str, said: str) -> ParameterSet:
    """Return a parameter: one change to a right file, and the start of its error line."""
    return pytest.param(old, new, said, id=name)


BAD = [
    bad("misspelt key that is needed", "stroke =", "strok =",
        """engine.strok = "120 mm": is not a key here; did you mean 'stroke'?"""),
    bad("misspelt key", "throws =", "thorws =",
        "engine.thorws = [0, 180, 180, 0]: is not a key here; did you mean 'throws'?"),
    bad("key that begins with a space", "stroke =", '" stroke" =',
        """engine." stroke" = "120 mm": is not a key here; did you mean 'stroke'?"""),
    bad("a length that no float can square", '"120 mm"', '"1e-320 mm"',
        """engine.stroke = "1e-320 mm": is too small for any engine; write for example "120 mm", or 0"""),
    bad("a firing order of no cylinder", "[1, 3, 4, 2]", "[]",
        "engine.firing_order = []: names no cylinder; name every cylinder once"),
    bad("a crank of no throw", "throws = [0, 180, 180, 0]", "throws = []",
        "engine.throws = []: names no throw; give the angle of each throw, as in [0, 180, 180, 0]"),
    bad("misspelt table", "[objective]", "[objektive]",
        """objektive = {"minimise": "mean mount force"}: is not a key here; did you mean 'objective'?"""),
    bad("misspelt key of a tagged table", "imep =", "imp =",
        """gas.imp = "5.5 kp/cm^2": is not a key here; did you mean 'imep'?"""),
    bad("misspelt key deep down", "as = ", "ass = ",
        """balancer_shafts[2].unbalances[1].coupled.ass = "mirrored": is not a key here; did you mean 'as'?"""),
    bad("unknown key", "\"1.25 kg\"\n", "\"1.25 kg\"\nzylinder = 4\n",
        "engine.zylinder = 4: is not a key here; did you mean 'cylinders'?"),
    bad("motored and fired", "[gas]", 'motored = true\nimep = "5 bar"\n[gas]',
        "operating_points[1].imep: is given for a motored point, which has no combustion; remove imep or motored"),
    bad("missing key", "stroke = \"120 mm\"\n", "",
        "engine.stroke: is missing; add it"),
    bad("missing unit", '"120 mm"', "120",
        'engine.stroke = 120: has no unit, a length needs one; write for example "120 mm"'),
    bad("missing unit in text", '"120 mm"', '"120"',
        'engine.stroke = "120": has no unit, a length needs one; write'),
    bad("wrong dimension", '"120 mm"', '"120 kg"',
        """engine.stroke = "120 kg": 'kg' is not a unit of a length; write"""),
    bad("unknown unit", '"120 mm"', '"120 furlongz"',
        """engine.stroke = "120 furlongz": unit 'furlongz' is not known; write"""),
    bad("wrong dimension of a speed", '"2500 rpm"', '"2500 mm"',
        """operating_points[1].speed = "2500 mm": 'mm' is not a unit of a speed of"""),
    bad("not a number", "0.26", "nan",
        "engine.rod_ratio = nan: is not finite; give a number"),
    bad("infinite", "0.26", "inf",
        "engine.rod_ratio = inf: is not finite; give a number"),
    bad("an integer beyond floats", "0.26", "1" + "0" * 400,
        "engine.rod_ratio: is a whole number of more than 64 bits; write"),
    bad("infinite length", '"120 mm"', '"1e999 mm"',
        'engine.stroke = "1e999 mm": is not finite; write'),
    bad("an angle that is no number", "throws = [0, 180,", "throws = [0, nan,",
        "engine.throws[2] = nan: is not finite; give a number"),
    bad("lambda too large", "0.26", "1.0",
        'engine.rod_ratio = "1": blocks the crank: (crank radius + |offset|) / rod length = '
        "1 must be under 1; give crank radius over rod length, for example 0.27; for a length write rod_length"),
    bad("rod too short", "rod_ratio = 0.26", 'rod_length = "55 mm"',
        'engine.rod_length = "55 mm": blocks the crank'),
    bad("offset too large", "0.26", "0.26\noffset = \"200 mm\"",
        "engine.offset: no crank makes a stroke of 120 mm with an offset of"),
    bad("no rod", "rod_ratio = 0.26", "",
        "engine.rod_ratio: is missing; give rod_ratio or rod_length"),
    bad("two rods", "0.26", "0.26\nrod_length = \"200 mm\"",
        "engine.rod_ratio = 0.26: is given twice"),
    bad("zero stroke", '"120 mm"', '"0 mm"',
        'engine.stroke = "0 mm": must be more than 0 mm; write for'),
    bad("negative mass", '"1.25 kg"', '"-1.25 kg"',
        'engine.reciprocating_mass = "-1.25 kg": must be at least 0 kg; give a'),
    bad("no speed", '"2500 rpm"', '"0 rpm"',
        'operating_points[1].speed = "0 rpm": must be more than 0 rpm; write'),
    bad("speed missing", 'speed = "2500 rpm"', "",
        "operating_points[1].speed: is missing; give speed or mean_piston_speed"),
    bad("firing order no permutation", "[1, 3, 4, 2]", "[1, 3, 4, 4]",
        "engine.firing_order = [1, 3, 4, 4]: is no permutation of 1 to 4; name"),
    bad("firing order counted wrongly", "[1, 3, 4, 2]", "[2, 3, 4, 5]",
        "engine.firing_order = [2, 3, 4, 5]: is no permutation of 1 to 4; name"),
    bad("firing order impossible", "[1, 3, 4, 2]", "[1, 2, 3, 4]",
        "engine.firing_order = [1, 2, 3, 4]: does not fit the throws: if it is to fire evenly, cylinders 3 (+180 deg)"),
    bad("throws and order differ in number", "[1, 3, 4, 2]", "[1, 3, 2]",
        "engine.throws: gives 4 cylinders, but engine.firing_order gives 3; make"),
    bad("throws and cylinders differ in number", "[0, 180, 180, 0]", "[0, 180, 180, 0]\ncylinders = 5",
        "engine.firing_order: gives 4 cylinders, but engine.cylinders gives 5; make both give the same number"),
    bad("a throw too few", "[0, 180, 180, 0]", "[0, 180, 180]",
        "engine.throws: gives 3 cylinders, but engine.firing_order"),
    bad("bounds reversed", '["0 kg", "3 kg"]', '["3 kg", "0 kg"]',
        'counterweights[1].mass = {"between": ["3 kg", "0 kg"]}: has its bounds reversed; write the smaller one first'),
    bad("angles reversed", "between = [0, 360]", "between = [90, 0]",
        'counterweights[1].angle = {"between": [90, 0]}: has its'),
    bad("one bound", '["0 kg", "3 kg"]', '["0 kg"]',
        'counterweights[1].mass = {"between": ["0 kg"]}: needs two bounds; write'),
    bad("start", '["0 kg", "3 kg"] }', '["0 kg", "3 kg"], start = "4 kg" }',
        "counterweights[1].mass = {"),
    bad("a count left open", "[0, 180, 180, 0]", "[0, 180, 180, 0]\ncylinders = { between = [4, 6] }",
        'engine.cylinders = {"between": [4, 6]}: cannot be left open: it is a count'),
    bad("an open number under its least", "0.26", "{ between = [-0.2, 0.3] }",
        'engine.rod_ratio = {"between": [-0.2, 0.3]}: bound -0.2: must be at least 0; give a larger value'),
    bad("two mounts in one place", '["-1 m", "-250 mm", "0 mm"]', '["-1 m", "250 mm", "0 mm"]',
        "mounts.positions[4] = (-1.0, 0.25, 0.0): two mounts stand in one place; move one"),
    bad("two mounts of one name", "[mounts]", "[mounts]\nnames = [\"a\", \"b\", \"b\", \"c\"]",
        'mounts.names[3] = "b": two mounts have one name; rename one'),
    bad("names of some mounts", "[mounts]", "[mounts]\nnames = [\"a\"]",
        'mounts.names = ["a"]: names 1 of 4 mounts; name each once'),
    bad("mounts of no stiffness", "[mounts]", "[mounts]\nrelative_stiffness = [0, 0, 0]",
        "mounts.relative_stiffness = [0.0, 0.0, 0.0]: is a stiffness of zero in every direction; "
        "give at least one direction a value above zero, such as 1"),
    bad("coupled to nobody", 'to = "left"', 'to = "lefty"',
        'balancer_shafts[2].unbalances[1].coupled.to = "lefty": is not the name of an unbalance that stands '
        "before this one in the file; did you mean 'left'?"),
    bad("coupled to itself", 'to = "left"', 'to = "right"',
        'balancer_shafts[2].unbalances[1].coupled.to = "right": is not the name of an unbalance'),
    bad("coupled to a counterweight", 'to = "left"', 'to = "web"',
        'balancer_shafts[2].unbalances[1].coupled.to = "web": is not the name of an unbalance'),
    bad("coupled in no known way", 'as = "mirrored"', 'as = "mirored"',
        """balancer_shafts[2].unbalances[1].coupled.as = "mirored": is not allowed; did you mean 'mirrored'?"""),
    bad("coupled with an angle", 'as = "mirrored" }', "as = \"mirrored\" }\nangle = 90",
        'balancer_shafts[2].unbalances[1].coupled = "left": cannot stand beside a size or an angle of its own; leave'),
    bad("two shafts of one name", 'name = "right"', 'name = "left"',
        'balancer_shafts[2].name = "left": is already the name of another shaft; give'),
    bad("a second crankshaft", 'name = "right"', 'name = "crankshaft"',
        'balancer_shafts[2].name = "crankshaft": is already the name of another'),
    bad("a shaft at rest", "ratio = -2", "ratio = 0",
        "balancer_shafts[2].ratio = 0: is almost a standing shaft"),
    bad("a shaft that does not return", "ratio = -2", "ratio = 0.3",
        "engine: shaft 'right' with ratio 0.3 does not return within the cycle"),
    bad("opposite no throw", "opposite_throw = 1", "opposite_throw = 7",
        "counterweights[1].opposite_throw = 7: is no throw, the crankshaft has 4; count throws from 1 at the front"),
    bad("counterweight nowhere", "opposite_throw = 1\n", "",
        "counterweights[1].x: is missing; give the counterweight a position, or opposite_throw"),
    bad("mass without radius", "radius = \"80 mm\"\n", "",
        "counterweights[1].radius: is missing, but an unbalance given by its mass needs it; add it"),
    bad("two sizes", '["0 kg", "3 kg"] }', "[\"0 kg\", \"3 kg\"] }\nunbalance = \"1 kg m\"",
        "counterweights[1].unbalance: is given twice, also as mass; give unbalance or mass"),
    bad("no size", "mass = { between = [\"0 kg\", \"3 kg\"] }\n", "",
        "counterweights[1].unbalance: is missing; give"),
    bad("fraction and size", '["0 kg", "3 kg"] }', "[\"0 kg\", \"3 kg\"] }\nbalance_factor = 0.5",
        "counterweights[1].opposite_throw: cannot stand beside balance_factor; leave one of them out"),
    bad("throws of a single weight", "opposite_throw = 1", "opposite_throw = 1\nthrows = [1]",
        "counterweights[1].throws: is only for counterweights with balance_factor"),
    bad("no convex sector", "[0, 360]", "[0, 270]",
        'counterweights[1].angle = "0 to 270 deg": spans more than 180 deg but no full turn; open '
        "it by at most 180 deg, or by 360 deg"),
    bad("a ring is not convex", '["0 kg", "3 kg"]', '["1 kg", "3 kg"]',
        'counterweights[1].mass = "1 kg": is a lower bound above zero, but'),
    bad("unknown objective", '"mean mount force"', '"mean mount forces"',
        """objective.minimise = "mean mount forces": is no quantity; did you mean 'mean mount force'?"""),
    bad("unknown limit", '"balancer mass"', '"balancing mass"',
        """constraints[1].limit = "balancing mass": is no quantity; did you mean 'balancer mass'?"""),
    bad("limit of another dimension", '"4 kg"', '"4 N"',
        """constraints[1].max = "4 N": 'N' is not a unit of a mass; write for example"""),
    bad("negative limit", '"4 kg"', '"-4 kg"',
        'constraints[1].max = "-4 kg": is negative, and a limit on a norm cannot be; give'),
    bad("key of another table", "title =", 'stroke = "90 mm"\ntitle =',
        'stroke = "90 mm": is not a key here; it stands in [engine]'),
    bad("a capital letter", "stroke =", "Stroke =", 'engine.Stroke = "120 mm": is not a key here; did you mean'),
    bad("words in another order", '"mean mount force"', '"mean force on mounts"',
        """objective.minimise = "mean force on mounts": is no quantity; did you mean 'mean mount force'?"""),
    bad("per cent", '"4 kg"', '"4 kg"\n[[counterweights]]\nname = "webs"\nbalance_factor = 50',
        'counterweights[2].balance_factor = 50: must be at most 10; give a smaller value, or "50 %" if per cent is'),
    bad("a bound that is no number", '"4 kg"',
        '"4 kg"\n[[counterweights]]\nname = "webs"\nbalance_factor = { between = [0, "x"] }',
        'counterweights[2].balance_factor = {"between": [0, "x"]}: bound "x": is not a number; write for example 0.26'),
    bad("a start in another unit", '"4 kg"',
        '"4 kg"\n[[counterweights]]\nname = "webs"\nmass = { between = ["0 kg", "1 kg"], start = "2 m" }',
        'counterweights[2].mass = {"between": ["0 kg", "1 kg"], "start": "2 m"}: start "2 m": \'m\' is not a unit of'),
    bad("part of a quantity", '"mean mount force"', '"mean mount"',
        """objective.minimise = "mean mount": is no quantity; use one of: mean mount force, mean mount t"""),
    bad("limit of nobody", '"4 kg"', "\"4 kg\"\nof = [\"lefty\"]",
        'constraints[1].of = "lefty": is no counterweight or balancer here; did'),
    bad("mass that is not known", "radius = \"20 mm\"\n", "",
        """constraints[1] = "balancer mass": counts the mass of 'left', which has no radius"""),
    bad("unknown mount", '"mean mount force"', "\"mean mount force\"\nmounts = [\"mount 5\"]",
        'objective.mounts = "mount 5": is no mount'),
    bad("unknown operating point", '"mean mount force"', "\"mean mount force\"\noperating_points = [\"idle\"]",
        'objective.operating_points = "idle": is no operating point here'),
    bad("mass without a unit", 'max = "4 kg"', "max = 4",
        'constraints[1].max = 4: has no unit, a mass needs one; write for example "1.25 kg"'),
    bad("weights of a moment", '"mean mount force"', "\"mean roll moment\"\ndirection_weights = [1, 1, 0]",
        "objective.direction_weights: means nothing for roll moment; leave it out"),
    bad("gas without bore", "bore = \"100 mm\"\n", "",
        "engine.bore: is missing, but gas pressure acts on the piston; add it"),
    bad("unknown gas model", '"seiliger"', '"seliger"',
        """gas.model = "seliger": is not allowed; did you mean 'seiliger'?"""),
    bad("no gas model", "model = \"seiliger\"\n", "",
        "gas.model: is missing; use one of: seiliger, wiebe, chambers, trace"),
    bad("a vee's throws", '"inline"', '"vee"',
        "engine.throws: gives 8 cylinders, but engine.firing_order gives 4"),
    bad("key of another layout", '"inline"', "\"inline\"\nbank_angle = 90",
        "engine.bank_angle: means nothing in layout 'inline'; leave it out"),
    bad("no spacing", "cylinder_spacing = \"125 mm\"\n", "",
        "engine.cylinder_spacing: is missing; add it"),
    bad("an empty title", 'title = "Four', 'title = ""\n# "Four',
        'title = "": is empty; write something'),
    bad("no TOML", "title =", "title",
        "line 2, column 7: is no TOML: no = follows the key; write key = value"),
    bad("no end of text", 'title = "Four', "title = \"Four\ntitle = \"",
        "line 2, column 14: is no TOML: the text is not closed"),
    bad("a firing order in words", "[1, 3, 4, 2]", '"1-3-4-2"',
        'engine.firing_order = "1-3-4-2": is no list; write [1, 3, 4, 2]'),
    bad("one stiffness", "[mounts]", '[mounts]\nstiffness = "150 N/mm"',
        'mounts.stiffness = "150 N/mm": must be a list in [ ], or tables in [[ ]]; write for example ["150 N/'),
    bad("mass of a ring without its diameter", "[mounts]", '[flywheel]\nmass = "40 kg"\n[mounts]',
        "flywheel.mean_diameter: is missing; give mass and mean_diameter of a ring"),
    bad("a ring and an inertia", "[mounts]",
        '[flywheel]\nmass = "40 kg"\nmean_diameter = "1 m"\ninertia = "1 kg m^2"\n[mounts]',
        "flywheel.mass: is given beside inertia; keep one"),
    bad("a peak of a burn", 'speed = "2500 rpm"', 'speed = "2500 rpm"\nmotored = true\npeak_pressure = "60 bar"',
        "operating_points[1].peak_pressure: is given for a motored point"),
    bad("long number", "0.26", "9" * 5000,
        "file: contains a whole number of thousands of digits; shorten it"),
    bad("key given twice", "layout =", "cycle =",
        "line 5, column 22: is no TOML: cycle is given twice; keep one of them, or write [[ ]]"),
    bad("limit given twice", "[[constraints]]", (
        '[[constraints]]\nlimit = "balancer mass"\nmax = "5 kg"\n[[constraints]]'
        ), "constraints[2].max: limits 'balancer mass' once more, beside constraints[1] ('balancer mass')"),
]  # fmt: skip


def test_all_missing_keys_are_named_at_once() -> None:
    """Check keys missing in the model of the file, the engine, its layout and an operating point."""
    with pytest.raises(InputError) as caught:
        load('title = "x"\n[engine]\nlayout = "inline"\ncycle = "four-stroke"\n[gas]\nmodel = "wiebe"\nimep = "1 bar"\n'
             "start = 0\n[[operating_points]]\nweight = 1\n")  # fmt: skip
    keys = [complaint.where for complaint in caught.value.complaints]
    assert keys == ["gas.duration", *(f"engine.{key}" for key in (
        "stroke", "reciprocating_mass", "bore", "cylinders", "rod_ratio", "cylinder_spacing", "throws"
    ))]  # fmt: skip
    assert all(complaint.rule.startswith("is missing") for complaint in caught.value.complaints)


def test_a_ring_has_the_inertia_of_its_mean_radius(tmp_path: Path) -> None:
    ring = '[flywheel]\nmass = "40 kg"\nmean_diameter = "500 mm"\ncrankshaft_inertia = "0.2 kg m^2"\n'
    wheel = load(written(tmp_path, WHOLE + ring)).engine.extra(Flywheel)
    assert wheel is not None
    assert wheel.inertia == pytest.approx(40.0 * 0.25**2 + 0.2)


def test_pressures_of_an_operating_point(tmp_path: Path) -> None:
    """Check that they replace those of the gas, and that single cylinders keep their ratio."""
    point = (
        '[[operating_points]]\nname = "idle"\nspeed = "800 rpm"\nimep = "1.1 kp/cm^2"\npeak_pressure = "20 kp/cm^2"\n'
    )
    point += 'intake_pressure = "0.4 kp/cm^2"\n'
    single = changed(WHOLE, 'imep = "5.5 kp/cm^2"\n', 'imep = "5.5 kp/cm^2"\nsingle_cylinders = '
                     '[{ cylinders = 2, peak_pressure = "72 kp/cm^2" }]\n')  # fmt: skip
    bar = 9.80665e4
    plain, of_one = (load(written(tmp_path, text + point)).points[1].gas for text in (WHOLE, single))
    assert isinstance(plain, Seiliger)
    assert isinstance(of_one, CylinderGases)
    assert of_one.common == plain
    second = of_one.of_cylinder("cylinder 2")
    assert isinstance(second, Seiliger)
    for gas, peak in ((plain, 20.0), (second, 18.0)):
        numbers = gas.imep, gas.peak_pressure, gas.intake_pressure
        assert numbers == pytest.approx((1.1 * bar, peak * bar, 0.4 * bar))


@pytest.mark.parametrize(("old", "new", "said"), BAD)
def test_one_line_for_one_mistake(old: str, new: str, said: str, tmp_path: Path) -> None:
    line = complaint_about(written(tmp_path, changed(WHOLE, old, new)))
    assert line.startswith(said)
    rule, _, remedy = line.partition("; ")
    assert ": " in rule
    assert remedy
    assert len(line) < 400


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        bad("a second crankshaft", '"second", ratio', '"crankshaft", ratio',
            'engine.shafts[1].name = "crankshaft": is already the name of another'),
        bad("unknown shaft", 'shaft = "second"', 'shaft = "secnd"',
            """engine.slider_cranks[2].shaft = "secnd": is not the name of a shaft of this engine; did you"""),
        bad("two cylinders in one place", 'x = "0 mm", shaft = "second", throw = 180, bank_angle = 180', 'x = "0 mm"',
            "engine: cylinder 2 has the same position as cylinder 1; move one of them"),
        bad("a crank at rest", "ratio = -1", "ratio = 0",
            "engine.shafts[1].ratio = 0: is almost a standing shaft"),
        bad("firing beside the dead centre", "throw = 180", "throw = 180, firing_angle = 10",
            "engine: cylinder 2 fires at 10 deg, "),
        bad("key of another layout", '"two-stroke"', "\"two-stroke\"\nthrows = [1, 2]",
            "engine.throws: means nothing in layout"),
        bad("a crank that cannot turn", '{ x = "0 mm" }, ', '{ x = "0 mm", stroke = "400 mm" }, ',
            'engine.rod_length = "170 mm": blocks'),
    ],
)  # fmt: skip
def test_free_parts(old: str, new: str, said: str, tmp_path: Path) -> None:
    assert complaint_about(written(tmp_path, changed(PARTS, old, new))).startswith(said)


def test_two_cylinders_in_one_place_on_two_shafts(tmp_path: Path) -> None:
    """A second shaft on the same axis leaves no more room."""
    second = changed(PARTS, 'ratio = -1, position = ["0 mm", "460 mm"]', 'ratio = 1, position = ["0 mm", "0 mm"]')
    alike = changed(second, ", throw = 180, bank_angle = 180", "")
    assert "has the same position as cylinder 1" in complaint_about(written(tmp_path, alike))


class TestFiles:
    def test_missing(self, tmp_path: Path) -> None:
        path = tmp_path / "none.toml"
        assert complaint_about(path) == "file: does not exist; check the path"
        (tmp_path / "missing.toml").write_text("", encoding="utf-8")
        assert complaint_about(tmp_path / "misssing.toml").startswith("file: does not exist; did you mean '")

    def test_a_folder(self, tmp_path: Path) -> None:
        path = tmp_path / "folder.toml"
        path.mkdir()
        assert complaint_about(path) == "file: is a folder; name a problem file inside this folder"

    def test_no_text(self, tmp_path: Path) -> None:
        path = tmp_path / "scene.toml"
        path.write_bytes(b"title = '\xff'")
        assert complaint_about(path) == "file: is no UTF-8 text (byte 10); save it as UTF-8"

    def test_several_mistakes_get_a_line_each(self, tmp_path: Path) -> None:
        """Check the lines of all mistakes in the order of the file."""
        text = changed(changed(WHOLE, '"100 mm"', "100"), '"80 kp/cm^2"', '"80 kg"')
        with pytest.raises(InputError) as caught:
            load(written(tmp_path, text))
        lines = str(caught.value).splitlines()
        assert [c.where for c in caught.value.complaints] == ["engine.bore", "gas.peak_pressure"]
        assert len(lines) == 2


class TestOnEvaluation:
    """Errors that only the physics can find."""

    @pytest.mark.parametrize(
        ("stiffness", "direction"),
        [("[0, 1, 0]", "F[xz]|M[xy]"), ("[1, 0, 1]", "Mz|Fy"), ("[1, 0, 0]", "F[yz]|M[xyz]")],
    )
    def test_mounts_that_do_not_carry(self, stiffness: str, direction: str, tmp_path: Path) -> None:
        text = changed(WHOLE, "[mounts]", f"[mounts]\nrelative_stiffness = {stiffness}")
        # uneven throws shake in every direction
        text = changed(text, "throws = [0, 180, 180, 0]", 'throws = [0, 190, 200, 0]\nrotating_mass = "1 kg"')
        problem = load(written(tmp_path, text))
        with pytest.raises(
            UncarriedLoadError, match=rf"drives the engine along ({direction}), which no mount carries; give"
        ):
            evaluate(problem)

    @pytest.mark.parametrize("imep", ["-5 kp/cm^2", "60 kp/cm^2"])
    def test_imep_that_no_cut_off_reaches(self, imep: str, tmp_path: Path) -> None:
        """The message names both pressures and the range."""
        text = changed(changed(WHOLE, "5.5 kp/cm^2", imep), "80 kp/cm^2", "50 kp/cm^2")
        problem = load(written(tmp_path, text))
        with pytest.raises(
            ModelError, match=r"imep .* bar cannot be reached with peak_pressure .* between .* and .*; .*"
        ):
            evaluate(problem)


class TestOperatingPoints:
    """Gas of an operating point."""

    def test_an_unreachable_imep_names_its_operating_point(self, tmp_path: Path) -> None:
        text = changed(
            WHOLE, "[gas]", '[[operating_points]]\nname = "idle"\nspeed = "800 rpm"\nimep = "0.1 bar"\n[gas]'
        )
        with pytest.raises(ModelError, match=r"^at idle: imep 0\.1 bar cannot be reached"):
            evaluate(load(written(tmp_path, text)))

    def test_motored_compresses_and_burns_nothing(self, tmp_path: Path) -> None:
        gas = load(written(tmp_path, changed(WHOLE, "[gas]", "motored = true\n[gas]"))).points[0].gas
        assert isinstance(gas, Seiliger)
        assert gas.imep == 0.0
        assert gas.peak_pressure == gas.intake_pressure * gas.compression_ratio**gas.compression_exponent

    def test_without_gas(self, tmp_path: Path) -> None:
        assert load(written(tmp_path, changed(WHOLE, "[gas]", "gas = false\n[gas]"))).points[0].gas is None


def trace(folder: Path, rows: str, cycle: str = "two-stroke") -> Path:
    (folder / "pressure.csv").write_text(rows, encoding="utf-8")
    text = changed(PARTS, "[[operating", '[gas]\nmodel = "trace"\nfile = "pressure.csv"\n[[operating')
    text = changed(text, 'stroke = "90 mm"', 'stroke = "90 mm"\nbore = "80 mm"')
    return written(folder, changed(text, '"two-stroke"', f'"{cycle}"'))


def rows(last: int, step: int = 5) -> str:
    return "angle,pressure\n" + "".join(f"{a},{1 + 20 * math.exp(-a / 40):.6f}\n" for a in range(0, last, step))


class TestTrace:
    def test_whole_cycle(self, tmp_path: Path) -> None:
        problem = load(trace(tmp_path, rows(360)))
        assert problem.engine.cycle is Cycle.TWO_STROKE
        evaluation = evaluate(problem)
        assert evaluation.loads[0].wrench.coefficients[0, 3].real != 0.0

    @pytest.mark.parametrize("change", [
        lambda text: text.replace(",", ";"),
        lambda text: text.replace(",", ";").replace(".", ","),
        lambda text: text.replace(",", "\t"),
        lambda text: "\ufeff" + text,
        lambda text: "\ufeff# test bench 3; 2500 rpm\n" + text.replace(",", ";"),
        lambda text: text.replace("\n", "\r\n"),
    ])  # fmt: skip
    def test_as_spreadsheets_write_it(self, change: Callable[[str], str], tmp_path: Path) -> None:
        """Semicolons, decimal commas, tabs, a byte order mark and notes say the same."""
        headless = rows(360).split("\n", 1)[1]
        plain = load(trace(tmp_path, headless)).points[0].gas
        assert isinstance(plain, PressureTrace)
        assert len(plain.angles) == 72
        assert load(trace(tmp_path, change(headless))).points[0].gas == plain

    @pytest.mark.parametrize("key", ["angle_unit", "pressure_unit"])
    def test_wrong_unit(self, key: str, tmp_path: Path) -> None:
        path = trace(tmp_path, rows(360))
        text = path.read_text(encoding="utf-8")
        path.write_text(changed(text, '"trace"', f'"trace"\n{key} = "parsec/s"'), encoding="utf-8")
        assert complaint_about(path).startswith(f'gas.{key} = "parsec/s": ')

    def test_part_of_the_cycle(self, tmp_path: Path) -> None:
        """Check that one turn of a four-stroke trace is refused."""
        assert complaint_about(trace(tmp_path, rows(360), "four-stroke")).startswith(
            'gas.file = "pressure.csv": the trace runs from 0 to 355 deg, so 365 of the 720 deg of a four-stroke '
            "cycle are missing; give the whole cycle"
        )

    @pytest.mark.parametrize(
        ("content", "said"),
        [
            (rows(360) + "365,one\n370,1\n", "line 74 has no number in 'pressure'; correct or remove it"),
            ("0,1\n5\n", "has 2 rows, too few for a cycle; give one every degree"),
            ("", "has no columns of crank angle and pressure; give a file with both"),
            (rows(360).replace("\n10,", "\n3,"), "has 3 deg after 5 deg; sort its rows by angle"),
            (rows(360).replace("\n90,3", "\n90,-3"), "has pressures down to -3.108 bar, which are not absolute; write"),
            (rows(360).replace("\n90,", "\n90,nan"), "line 20 has no number in 'pressure'; correct or remove it"),
        ],
    )
    def test_bad_rows(self, content: str, said: str, tmp_path: Path) -> None:
        assert complaint_about(trace(tmp_path, content)).startswith(f'gas.file = "pressure.csv": {said}')

    @pytest.mark.parametrize(
        ("key", "unit", "said"),
        [
            ("angle_unit", "bar", """gas.angle_unit = "bar": 'bar' is not a unit of an angle; use rad, deg ..."""),
            (
                "pressure_unit",
                "deg",
                """gas.pressure_unit = "deg": 'deg' is not a unit of a pressure; use Pa, bar, kp/cm^2, kPa, MPa""",
            ),
            (
                "pressure_unit",
                "x",
                """gas.pressure_unit = "x": unit 'x' is not known; use Pa, bar, kp/cm^2, kPa, MPa""",
            ),
        ],
    )
    def test_units_of_another_dimension(self, key: str, unit: str, said: str, tmp_path: Path) -> None:
        text = trace(tmp_path, rows(360)).read_text("utf-8")
        text = changed(text, 'file = "pressure.csv"', f'file = "pressure.csv"\n{key} = "{unit}"')
        assert complaint_about(written(tmp_path, text)).startswith(said)

    def test_no_file(self, tmp_path: Path) -> None:
        path = trace(tmp_path, rows(360))
        (tmp_path / "pressure.csv").unlink()
        assert complaint_about(path).startswith(
            'gas.file = "pressure.csv": cannot be read (No such file or directory); give'
        )


def test_a_place_that_is_another_name_counts_from_one() -> None:
    """Check a point without a name beside one named by the number of that point."""
    tables = dict(tables_of(PROBLEMS / "tractor-single.toml"))
    points = [{"name": "2", "speed": "1500 rpm"}, {"speed": "2000 rpm", "imep": {"between": ["5 bar", "8 bar"]}}]
    problem = load_tables({**tables, "operating_points": points}, Path("points.toml"))
    assert "operating_points.2.imep" in [decision.name for decision in problem.decisions]
