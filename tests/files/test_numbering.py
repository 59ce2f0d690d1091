"""Maker's numbers, which change names only: every layout, open cranks, bearings, torsion, gas; and messages."""

from __future__ import annotations

import math
from functools import cache
from random import Random
from typing import Any, ClassVar

import numpy as np
import pytest

import laufruhe
from laufruhe.errors import InputError
from laufruhe.extensions.torsion.physics import chain_of
from laufruhe.machine.firing import from_one
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.physics.torque import crank_torque
from laufruhe.problem.problem import Problem
from laufruhe.report.wording import fired
from laufruhe.solvers.result import Result
from laufruhe.solvers.throws.throw_windows import firing_bounds, windows_of

Table = dict[str, Any]
SIZES: Table = {
    "cycle": "four-stroke",
    "bore": "90 mm",
    "stroke": "88 mm",
    "rod_length": "150 mm",
    "reciprocating_mass": "0.6 kg",
    "rotating_mass": "0.4 kg",
}
SPACED: Table = {**SIZES, "cylinder_spacing": "106 mm"}
GAS = {"model": "seiliger", "compression_ratio": 9, "peak_pressure": "50 bar", "imep": "8 bar"}
ENGINES: dict[str, Table] = {
    "inline": {"layout": "inline", "firing_order": [1, 2, 4, 5, 3]},
    "vee": {
        "layout": "vee",
        "bank_angle": 90,
        "split_pin_angle": 30,
        "bank_stagger": "20 mm",
        "firing_order": [1, 6, 3, 5, 2, 4],
    },
    "uneven vee": {"layout": "vee", "bank_angle": 90, "throws": [45, 285, 165], "firing_order": [1, 6, 3, 5, 2, 4]},
    "boxer": {"layout": "boxer", "bank_stagger": "40 mm", "firing_order": [1, 6, 2, 4, 3, 5]},
    "x-engine": {"layout": "x-engine", "throws": [0, 90], "firing_order": [1, 5, 4, 2, 6, 8, 7, 3]},
    "opposed-piston": {"layout": "opposed-piston", "crank_distance": "600 mm", "firing_order": [1, 3, 2]},
    "radial": {"layout": "radial", "cylinders": 5, "knuckle_radius": "50 mm"},
    "rows": {
        "layout": "vee",
        "bank_angle": 72,
        "row_angle": 15,
        "offset": "10 mm",
        "throws": [0, 120],
        "firing_order": [1, 2, 3, 4],
    },
}


def loaded(engine: Table, **tables: Any) -> Problem:
    sizes = SIZES if engine["layout"] in ("radial", "parts") else SPACED
    points = [{"speed": "3000 rpm"}]
    return laufruhe.load({"title": "One", "engine": {**sizes, **engine}, "operating_points": points, **tables})


def renumbered(engine: Table, numbers: list[int]) -> Table:
    """Return the same engine with cylinder k of the layout numbered numbers[k - 1]."""
    changed: Table = {**engine, "numbering": numbers}
    if order := engine.get("firing_order"):
        new = [numbers[k - 1] for k in order]
        changed["firing_order"] = new
    if throws := engine.get("throws"):
        count = len(throws)
        first = [min(numbers[k] for k in range(pin, len(numbers), count)) for pin in range(count)]
        changed["throws"] = [throws[pin] for pin in sorted(range(count), key=first.__getitem__)]
    return changed


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("seed", range(3))
def test_numbers_change_names_only(name: str, seed: int) -> None:
    """Cylinders stand, turn and fire as before, and so do all loads: at orders of the crank and of gas."""
    engine = ENGINES[name]
    plain = loaded(engine, gas=GAS)
    count = len(plain.engine.cylinders)
    numbers = Random(seed).sample(range(1, count + 1), count)
    other = loaded(renumbered(engine, numbers), gas=GAS)
    cycle = plain.engine.cycle.angle
    parts, others = plain.engine.cylinders, other.engine.cylinders
    assert [part.name for part in others] == [f"cylinder {k + 1}" for k in range(count)]
    turned = others[numbers[0] - 1].throw - parts[0].throw
    delay = others[numbers[0] - 1].firing_angle - parts[0].firing_angle
    for k, part in enumerate(parts):
        twin = others[numbers[k] - 1]
        assert (twin.x, twin.bank) == (part.x, part.bank)
        assert math.remainder(twin.throw - part.throw - turned, math.tau) == pytest.approx(0.0, abs=1e-9)
        if name != "radial":
            assert math.remainder(twin.firing_angle - part.firing_angle - delay, cycle) == pytest.approx(0.0, abs=1e-9)
    if name == "radial":
        # the master rod goes by number
        return
    loads = [np.abs(shaking_loads(p.engine, p.points[0], p.fidelity).coefficients) for p in (plain, other)]
    torques = [np.abs(crank_torque(p.engine, p.points[0]).coefficients) for p in (plain, other)]
    scale = loads[0].max()
    np.testing.assert_allclose(loads[1], loads[0], atol=1e-9 * scale)
    np.testing.assert_allclose(torques[1], torques[0], atol=1e-9 * torques[0].max())


def test_numbers_of_a_radial_engine_may_run_against_the_rotation() -> None:
    """The master rod is that of cylinder 1; every second cylinder along the rotation fires."""
    plain, other = loaded(ENGINES["radial"]), loaded({**ENGINES["radial"], "numbering": [1, 5, 4, 3, 2]})
    banks = [round(math.degrees(part.bank)) for part in other.engine.cylinders]
    assert banks == [0, 288, 216, 144, 72]
    order = sorted(range(5), key=lambda k: other.engine.cylinders[k].firing_angle)
    assert [k + 1 for k in order] == [1, 4, 2, 5, 3]
    assert other.engine.firing_intervals == pytest.approx(plain.engine.firing_intervals)


def test_a_counter_clockwise_engine_is_the_mirror_image() -> None:
    """Sides change, so that cylinder 1 on the right has the angles of one on the left of the other engine."""
    engine = {
        "layout": "vee",
        "bank_angle": 60,
        "split_pin_angle": 60,
        "numbering": "alternating",
        "firing_order": [1, 2, 3, 4, 5, 6],
    }
    right = loaded({**engine, "first_bank": "right", "bank_stagger": "20 mm"})
    left = loaded({**engine, "rotation": "counter-clockwise", "bank_stagger": "-20 mm"})
    assert left.engine.slider_cranks == right.engine.slider_cranks
    assert any("y points to the right" in line for line in left.assumptions)


def open_vee(deviation: int) -> tuple[Table, Table]:
    engine = {"layout": "vee", "bank_angle": 90, "split_pin_angle": 30, "cylinders": 6, "throws": "open"}
    tables: Table = {"objective": {"minimise": "rms rocking couple"}}
    if deviation:
        tables["phasing"] = {"intervals": {"largest_deviation": f"{deviation} deg"}}
    return engine, tables


@cache
def plain_result(deviation: int) -> Result:
    engine, tables = open_vee(deviation)
    return laufruhe.solve(loaded(engine, **tables))


@pytest.mark.parametrize(
    "keys",
    [
        {"numbering": "alternating"},
        {"first_bank": "right"},
        {"numbering": "alternating", "first_bank": "right", "first_end": "flywheel"},
        {"numbering": [6, 5, 4, 1, 2, 3]},
        {"numbering": [2, 3, 6, 1, 4, 5]},
    ],
)
@pytest.mark.parametrize("deviation", [0, pytest.param(30, marks=pytest.mark.slow)])
def test_an_open_crank_is_decided_in_the_numbers_of_the_file(keys: Table, deviation: int) -> None:
    """The optimum is that of plain numbers; its order and throws, written into the file, give it again."""
    engine, tables = open_vee(deviation)
    plain, result = plain_result(deviation), laufruhe.solve(loaded({**engine, **keys}, **tables))
    assert plain.objective is not None
    assert result.objective is not None
    assert result.objective.value == pytest.approx(plain.objective.value, rel=1e-6)
    assert result.certificate.kind == plain.certificate.kind
    assert result.phasing is not None
    best = result.phasing.ranking[0]
    written = {
        **engine,
        **keys,
        "throws": [math.degrees(angle) for angle in best.throws],
        "firing_order": list(best.firing_orders[0].order),
    }
    again = laufruhe.solve(loaded(written, objective=tables["objective"]))
    assert again.objective is not None
    assert again.objective.value == pytest.approx(result.objective.value, rel=1e-6)
    assert plain.phasing is not None
    # neighbours stand side by side along the crank, whatever the numbers of their throws
    assert best.firing_orders[0].neighbours == plain.phasing.ranking[0].firing_orders[0].neighbours
    intervals = loaded(written).engine.firing_intervals
    assert intervals == pytest.approx(best.firing_orders[0].intervals, abs=1e-6)


@pytest.mark.parametrize(
    "engine",
    [
        {"layout": "inline", "numbering": [2, 1, 4, 3, 5], "cylinders": 5, "throws": "open"},
        {
            "layout": "vee",
            "bank_angle": 90,
            "split_pin_angle": 30,
            "numbering": [2, 5, 4, 1, 6, 3],
            "cylinders": 6,
            "throws": "open",
        },
        {"layout": "inline", "numbering": [2, 1, 4, 3], "throws": [0, 180, 180, 0], "firing_order": "open"},
    ],
)
def test_open_cranks_need_throws_in_their_order(engine: Table) -> None:
    """Searches leave out mirror images, which swap the ends of a list of throws."""
    with pytest.raises(InputError, match="counts throws out of their order along the crank"):
        loaded(engine, objective={"minimise": "rms rocking couple"})


@pytest.mark.parametrize("numbers", [[1, 2, 3, 4, 5], [5, 4, 3, 2, 1]])
def test_every_firing_window_has_an_image_that_is_searched(numbers: list[int]) -> None:
    """Mirror images exchange cylinders at equal distances from the middle, or turn the other way."""
    engine = {"layout": "inline", "numbering": numbers, "cylinders": 5, "throws": "open"}
    tables: Table = {
        "phasing": {"intervals": {"largest_deviation": "40 deg"}},
        "objective": {"minimise": "rms rocking couple"},
    }
    problem = loaded(engine, **tables)
    phasing = problem.phasing
    assert phasing is not None
    searched = {window.order for window in windows_of(problem, phasing) or []}
    everything = [window.order for window in firing_bounds(phasing).windows()]
    assert len(searched) < len(everything)
    for order in everything:
        mirrored = tuple(6 - number for number in order)
        assert searched & {from_one(image) for image in (order, mirrored, order[::-1], mirrored[::-1])}


def test_bearings_and_discs_have_the_numbers_of_the_file() -> None:
    """Weights, discs and lists for throws go from the flywheel if cylinder 1 stands there."""
    engine = {"layout": "inline", "throws": [0, 180, 180, 0], "firing_order": [1, 3, 4, 2], "first_end": "flywheel"}
    tables: Table = {
        "counterweights": [{"name": "weight", "opposite_throw": 1, "mass": "1 kg", "radius": "50 mm"}],
        "torsion": {
            "throw_inertia": [f"0.0{k} kg m^2" for k in range(1, 5)],
            "crank": {"stiffness": "4e5 N m/rad"},
            "discs": [{"name": "wheel", "end": "rear", "inertia": "1 kg m^2", "shaft": {"stiffness": "4e5 N m/rad"}}],
        },
    }
    built = loaded(engine, **tables).engine
    assert [part.x for part in built.cylinders] == sorted(part.x for part in built.cylinders)
    weight = next(rotor for rotor in built.rotors if rotor.name == "weight")
    assert weight.x == built.cylinders[0].x
    discs = chain_of(built).discs
    assert [disc.name for disc in discs] == ["throw 4", "throw 3", "throw 2", "throw 1", "wheel"]
    assert [disc.cylinders for disc in discs[:4]] == [(f"cylinder {k}",) for k in (4, 3, 2, 1)]
    assert discs[0].inertia - discs[3].inertia == pytest.approx(0.03)


def warnings(engine: Table) -> list[str]:
    return [str(warning) for warning in loaded(engine).plausibility_warnings]


FLAT_FOUR = {"layout": "boxer", "bank_stagger": "45 mm", "firing_order": [1, 3, 2, 4]}
ODD_SIX = {"layout": "vee", "bank_angle": 90, "throws": [0, 120, 240], "firing_order": [1, 6, 5, 4, 3, 2]}


def test_opposed_pistons_in_one_direction_are_reported_with_a_remedy() -> None:
    (line,) = warnings(FLAT_FOUR)
    assert "cylinders 1 and 3, 2 and 4" in line
    assert 'write numbering = "alternating"; in the present numbers the order is 1-2-3-4' in line
    assert warnings({**FLAT_FOUR, "numbering": "alternating"}) == []
    (crank,) = loaded({**FLAT_FOUR, "numbering": "alternating"}).points
    engine = loaded({**FLAT_FOUR, "numbering": "alternating"}).engine
    forces = np.abs(shaking_loads(engine, crank).coefficients[:, :3])
    assert forces.max() < 1e-9


@pytest.mark.parametrize("own", [{"first_end": "flywheel"}, {"first_bank": "right"}])
def test_the_smallest_change_of_numbers_is_proposed(own: Table) -> None:
    """The order fits with both keys changed as well as with one."""
    (line,) = warnings({**FLAT_FOUR, **own})
    assert 'write numbering = "alternating"; in the present numbers' in line
    assert warnings({**FLAT_FOUR, "numbering": "alternating", **own}) == []


def test_a_vee_with_a_more_even_numbering_is_reported() -> None:
    (line,) = warnings(ODD_SIX)
    assert "fires after 30, 120, 120, 210, 120, 120 deg" in line
    assert (
        'write numbering = "alternating", throws = [0, 240, 120]; in the present numbers the order is 1-6-3-5-2-4'
        in line
    )
    mended = {**ODD_SIX, "numbering": "alternating", "throws": [0, 240, 120]}
    assert warnings(mended) == []
    assert np.degrees(loaded(mended).engine.firing_intervals) == pytest.approx([150, 90] * 3)
    assert warnings({**ODD_SIX, "numbering": "one bank after the other"}) == []


def refusal(engine: Table) -> str:
    with pytest.raises(InputError) as refused:
        loaded(engine)
    assert "\n" not in str(refused.value)
    return str(refused.value)


FORD: Table = {"layout": "vee", "bank_angle": 90, "throws": "cross-plane", "firing_order": [1, 5, 4, 2, 6, 3, 7, 8]}


def test_a_refused_order_names_the_numbering_that_fits() -> None:
    line = refusal(FORD)
    assert 'write first_bank = "right"; in the present numbers the order is 1-8-6-2-7-3-4-5' in line
    for mended in ({**FORD, "first_bank": "right"}, {**FORD, "firing_order": [1, 8, 6, 2, 7, 3, 4, 5]}):
        assert np.degrees(loaded(mended).engine.firing_intervals) == pytest.approx([90.0] * 8)
    back = refusal({**FORD, "first_bank": "right", "firing_order": [1, 8, 6, 2, 7, 3, 4, 5]})
    assert 'write first_bank = "left"; in the present numbers' in back


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ({"numbering": "alternating", "firing_order": [1, 6, 5, 4, 3, 2]}, "are split, write split_pin_angle = 30"),
        ({"firing_order": [1, 4, 2, 5, 3, 6]}, 'write first_bank = "right", split_pin_angle = 30;'),
        ({"bank_angle": 60, "numbering": "alternating", "firing_order": [1, 2, 3, 4, 5, 6]},
         'write first_bank = "right", split_pin_angle = 60;'),
    ],
)  # fmt: skip
def test_an_order_that_needs_split_pins_names_their_angle(keys: Table, line: str) -> None:
    """Three V6 engines typed without their pins: Buick 3800, Ford Essex, and that of GM with 60 degrees."""
    assert line in refusal({"layout": "vee", "bank_angle": 90, **keys})


def test_a_crank_typed_against_the_rotation_is_named() -> None:
    five = {"layout": "inline", "throws": [0, 216, 144, 72, 288], "firing_order": [1, 3, 5, 4, 2]}
    assert "count against the rotation, write throws = [0, 144, 216, 288, 72]" in refusal(five)
    assert loaded({**five, "throws": [0, 144, 216, 288, 72]})


@pytest.mark.parametrize(
    ("typed", "keys", "fitting"),
    [
        ("flat-plane", {"numbering": "alternating", "firing_order": [1, 8, 4, 3, 6, 5, 7, 2]}, "cross-plane"),
        ("cross-plane", {"first_bank": "right", "firing_order": [1, 8, 2, 7, 4, 5, 3, 6]}, "flat-plane"),
    ],
)
def test_the_other_crank_that_an_order_fits_is_named(typed: str, keys: Table, fitting: str) -> None:
    engine = {"layout": "vee", "bank_angle": 90, **keys}
    assert f"it fits a {fitting} crank: if that is meant, leave out throws" in refusal({**engine, "throws": typed})
    assert loaded({**engine, "throws": fitting})


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ({"numbering": "odd"}, 'is neither a list nor "one bank after the other" nor "alternating"'),
        ({"numbering": [1, 2, 3, 4, 5, 6, 7, 7]}, "is no permutation of 1 to 8; number every cylinder"),
        ({"numbering": [1, 2, 3, 4, 5, 6, 7, 8], "first_end": "front"}, "means nothing beside a list of numbers"),
        ({"first_bank": "port"}, "is not allowed; use one of: left, right"),
        ({"rotation": "left"}, "is not allowed; use one of: clockwise, counter-clockwise"),
    ],
)
def test_bad_numbers_get_one_line(keys: Table, line: str) -> None:
    assert line in refusal({**FORD, **keys})


@pytest.mark.parametrize(
    ("engine", "line"),
    [
        ({"layout": "inline", "firing_order": [1, 3, 2], "numbering": "alternating"}, "layout 'inline' has one"),
        ({"layout": "inline", "firing_order": [1, 3, 2], "first_bank": "right"}, "engine.first_bank: means nothing"),
        (
            {"layout": "parts", "slider_cranks": [{"x": "0 mm"}], "rotation": "clockwise"},
            "engine.rotation: means nothing",
        ),
    ],
)
def test_numbers_that_mean_nothing_are_refused(engine: Table, line: str) -> None:
    assert line in refusal(engine)


class TestIntervals:
    TWIN: ClassVar[Table] = {"layout": "vee", "bank_angle": 60, "throws": [30], "firing_order": [1, 2]}

    @pytest.mark.parametrize(
        ("first_bank", "intervals"),
        [
            ("left", [300, 420]),
            ("left", [660, 60]),
            ("right", [60, 660]),
            ("right", [420, 300]),
        ],
    )
    def test_a_twin_on_one_pin_fires_in_either_turn(self, first_bank: str, intervals: list[int]) -> None:
        """A cylinder that waits for the next turn changes half orders of gas alone: by |1 + e^{-i h delta}|."""
        throws = [30 if first_bank == "left" else -30]
        engine = {**self.TWIN, "throws": throws, "first_bank": first_bank, "firing_intervals": intervals}
        problem = loaded(engine, gas=GAS)
        assert np.degrees(problem.engine.firing_intervals) == pytest.approx(intervals)
        both = crank_torque(problem.engine, problem.points[0], problem.fidelity).coefficients
        single = loaded({"layout": "inline", "cylinders": 1, "throws": [0]}, gas=GAS)
        alone = crank_torque(single.engine, single.points[0], single.fidelity).coefficients
        for half in (1, 3, 5):
            wave = 1.0 + np.exp(-0.5j * half * math.radians(intervals[0]))
            assert abs(both[half]) == pytest.approx(abs(alone[half] * wave), rel=1e-9)

    def test_a_crank_follows_from_intervals(self) -> None:
        engine = {"layout": "inline", "firing_order": [1, 3, 2, 4], "firing_intervals": [270, 180, 90, 180]}
        built = loaded(engine).engine
        assert [round(math.degrees(part.throw)) % 360 for part in built.cylinders] == [0, 270, 90, 180]
        assert np.degrees(built.firing_intervals) == pytest.approx([270, 180, 90, 180])

    def test_an_even_crank_may_fire_unevenly(self) -> None:
        engine = {"layout": "inline", "throws": [0, 0], "firing_order": [1, 2], "firing_intervals": [0, 720]}
        assert loaded({**engine, "fires_together": True}).engine.firing_intervals == pytest.approx((0.0, 4.0 * math.pi))

    @pytest.mark.parametrize(
        ("keys", "line"),
        [
            (
                {"firing_intervals": [60, 660], "throws": None},
                "cylinder 2 needs its throw at 270 deg, cylinder 1 on the same throw at 30 deg; correct the intervals",
            ),
            ({"firing_intervals": [60, 660]}, "its dead centre is 300 or 660 deg after it"),
            ({"firing_intervals": [300, 300]}, "adds up to 600 deg; give intervals that make the 720 deg of a cycle"),
            ({"firing_intervals": [-60, 780]}, "has a negative interval"),
            ({"firing_intervals": [720]}, "give one interval for each cylinder"),
            ({"firing_order": None, "firing_intervals": [300, 420]}, "needs a firing_order"),
            ({"throws": "open", "cylinders": 2, "firing_intervals": [300, 420]}, "give intervals in [phasing]"),
        ],
    )
    def test_impossible_intervals_get_one_line(self, keys: Table, line: str) -> None:
        engine = {key: value for key, value in {**self.TWIN, **keys}.items() if value is not None}
        assert line in refusal(engine)


class TestRows:
    def test_pistons_fire_at_their_true_dead_centre(self) -> None:
        """The effective angle of a row is half the angle between rows and that of the offset on crank and rod."""
        engine = loaded(
            {"layout": "inline", "row_angle": -15, "offset": "12 mm", "firing_order": [1, 5, 3, 6, 2, 4]}
        ).engine
        radius, rod = engine.cylinders[0].crank_radius, engine.cylinders[0].rod_length
        effective = math.radians(7.5) + math.asin(0.012 / (rod + radius))
        for k, part in enumerate(engine.cylinders):
            side = -1.0 if k % 2 == 0 else 1.0
            assert math.degrees(part.bank) == pytest.approx(7.5 * side)
            crank = part.firing_angle + np.radians(np.linspace(-1.0, 1.0, 2001)) + part.throw
            pin_y, pin_z = radius * np.sin(crank - part.bank), radius * np.cos(crank - part.bank)
            height = pin_z + np.sqrt(rod**2 - (pin_y - 0.012 * side) ** 2)
            assert np.argmax(height) == 1000
            assert math.remainder(part.firing_angle + part.throw - effective * side, math.tau) == pytest.approx(
                0.0, abs=1e-9
            )
        assert np.degrees(engine.firing_intervals) == pytest.approx([120.0] * 6)

    def test_uneven_open_throws_are_refused(self) -> None:
        engine = {"layout": "inline", "row_angle": 15, "cylinders": 6, "throws": [0, *[{"between": [0, 360]}] * 5]}
        assert "engine.row_angle: puts the dead centres of throws at different angles" in refusal(engine)


def test_a_free_list_may_have_a_firing_order_and_a_mass_for_each_piston() -> None:
    """Two rows of radial cylinders, and pistons that are each weighed."""
    rows: list[Table] = [
        {"x": f"{50 - 100 * (k % 2)} mm", "bank_angle": 72 * k, "throw": 180 * (k % 2), "reciprocating_mass": "1 kg"}
        for k in range(5)
    ]
    sizes = {key: value for key, value in SIZES.items() if key != "reciprocating_mass"}
    points = [{"speed": "3000 rpm"}]
    engine: Table = {**sizes, "layout": "parts", "slider_cranks": rows}
    centres = [(72 * k - 180 * (k % 2)) % 360 for k in range(5)]
    order = [1, 3, 2, 5, 4]
    parts = laufruhe.load(
        {"title": "t", "engine": {**engine, "firing_order": order}, "operating_points": points}
    ).engine
    fires = [math.degrees(part.firing_angle) for part in parts.cylinders]
    assert sorted(range(1, 6), key=lambda k: fires[k - 1]) == order
    assert [round(angle) % 360 for angle in fires] == centres
    rows[0]["firing_angle"] = 360
    with pytest.raises(InputError, match=r"slider_cranks\[1\].firing_angle: is given twice"):
        laufruhe.load({"title": "t", "engine": {**engine, "firing_order": order}, "operating_points": points})
    del rows[0]["firing_angle"], rows[1]["reciprocating_mass"]
    with pytest.raises(InputError, match="reciprocating_mass: is missing"):
        laufruhe.load({"title": "t", "engine": engine, "operating_points": points})


def test_the_stroke_is_the_travel_of_the_piston_with_an_offset_too() -> None:
    """First order of a single: m w^2 times the first harmonic of a motion whose travel is the stroke."""
    engine = {
        "layout": "inline",
        "cylinders": 1,
        "stroke": "90 mm",
        "rod_length": "160 mm",
        "offset": "20 mm",
        "reciprocating_mass": "0.5 kg",
        "rotating_mass": "0 kg",
    }
    problem = laufruhe.load({"title": "t", "engine": {**SIZES, **engine}, "operating_points": [{"speed": "6000 rpm"}]})
    angles = np.linspace(0.0, math.tau, 4096, endpoint=False)

    def travel(radius: float) -> np.ndarray:
        return radius * np.cos(angles) + np.sqrt(0.16**2 - (radius * np.sin(angles) - 0.02) ** 2)

    low, high = 0.04, 0.045
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.ptp(travel(middle)) < 0.09 else (low, middle)
    speed = 6000.0 * math.tau / 60.0
    first = 0.5 * speed**2 * abs(np.fft.rfft(travel(low))[1]) * 2.0 / 4096
    force = abs(shaking_loads(problem.engine, problem.points[0]).at(1)[2])
    assert force == pytest.approx(first, rel=1e-6)
    assert force == pytest.approx(8881.1, abs=0.05)


def test_pistons_that_are_all_weighed_need_no_common_mass() -> None:
    """First order of two opposed throws: the difference of the masses, times crank radius and speed squared."""
    rows: list[Table] = [
        {"x": "300 mm", "reciprocating_mass": "40 kg"},
        {"x": "-300 mm", "throw": 180, "reciprocating_mass": "44 kg"},
    ]
    engine: Table = {
        "layout": "parts",
        "cycle": "two-stroke",
        "stroke": "200 mm",
        "rod_length": "400 mm",
        "slider_cranks": rows,
    }
    problem = laufruhe.load({"title": "t", "engine": engine, "operating_points": [{"speed": "600 rpm"}]})
    force = abs(shaking_loads(problem.engine, problem.points[0]).at(1)[2])
    assert force == pytest.approx(4.0 * 0.1 * (20.0 * math.pi) ** 2, rel=1e-9)


def test_a_piston_without_a_bore_has_no_gas_and_does_not_fire() -> None:
    """Two pistons together and a third rod below that drives a weight: the mean torque is that of two cylinders."""
    rows: list[Table] = [
        {"x": "0 mm", "bank_angle": 180, "throw": 90, "reciprocating_mass": "0.9 kg", "bore": "0 mm"},
        {"x": "45 mm"},
        {"x": "-45 mm"},
    ]
    engine: Table = {"layout": "parts", "slider_cranks": rows, "firing_order": [2, 3]}
    problem = loaded(engine, gas=GAS)
    single = loaded({"layout": "inline", "cylinders": 1, "throws": [0]}, gas=GAS)
    mean, alone = (crank_torque(p.engine, p.points[0], p.fidelity).coefficients[0].real for p in (problem, single))
    assert mean == pytest.approx(2.0 * alone, rel=1e-9)
    assert [part.name for part in problem.engine.cylinders] == ["cylinder 2", "cylinder 3"]
    assert problem.engine.firing_intervals == pytest.approx((math.tau, math.tau))
    assert "firing order 2-3, every 360 deg" in fired(laufruhe.evaluate(problem)).lower()
    with pytest.raises(InputError, match="does not name cylinders 2, 3 once each"):
        loaded({**engine, "firing_order": [1, 2, 3]}, gas=GAS)


def test_rows_load_the_block_as_a_free_list_with_their_offsets() -> None:
    """Inertia forces of a VR six are those of slider-cranks with tilted axes and offsets of either sign."""
    vr = {"layout": "inline", "row_angle": 15, "offset": "12 mm", "firing_order": [1, 5, 3, 6, 2, 4]}
    rows = loaded(vr)
    free = [
        {
            "x": f"{1e3 * part.x!r} mm", "bank_angle": 7.5 * side, "offset": f"{12 * side} mm",
            "throw": math.degrees(part.throw), "rotating_mass": "0.4 kg",
        }
        for part, side in zip(rows.engine.cylinders, [1, -1] * 3, strict=True)
    ]  # fmt: skip
    listed = loaded({"layout": "parts", "slider_cranks": free})
    # throws of a layout carry their rotating mass as rotors
    loads = [shaking_loads(p.engine, p.points[0], p.fidelity).coefficients for p in (rows, listed)]
    count = min(map(len, loads))
    np.testing.assert_allclose(loads[0][:count], loads[1][:count], atol=1e-9 * np.abs(loads[0]).max())


def test_gas_in_rows_does_the_work_that_the_file_says() -> None:
    """The mean torque is imep times displacement over the angle of the cycle."""
    vr = {"layout": "inline", "row_angle": 15, "offset": "12 mm", "firing_order": [1, 5, 3, 6, 2, 4]}
    problem = loaded(vr, gas=GAS)
    mean = crank_torque(problem.engine, problem.points[0], problem.fidelity).coefficients[0].real
    displacement = 6 * math.pi * 0.09**2 / 4 * 0.088
    assert mean == pytest.approx(8e5 * displacement / (4.0 * math.pi), rel=1e-3)
