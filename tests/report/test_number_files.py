"""Tables and curves as CSV and as a workbook, compared with the numbers of the result."""

from __future__ import annotations

import csv
import gc
import math
from dataclasses import replace
from inspect import getsource
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest

from cli import scenes
from laufruhe.errors import LaufruheWarning
from laufruhe.extensions.flywheel.torque import torque_parts
from laufruhe.files.reader import load
from laufruhe.present.tables import Table
from laufruhe.problem.evaluation import place_measures
from laufruhe.report.files import TABLES, result_files
from laufruhe.report.sections import SECTIONS
from laufruhe.report.table_files import write_book, write_csv
from laufruhe.report.tables import number_tables, write_tables
from laufruhe.solvers import Result, evaluate_only
from problem_files import PROBLEMS, loaded
from ready import initial_tables, solved

WHOLE = {"crank_stars", "decisions", "limits", "places", "modes", "orders"}
"""Sections whose numbers are files in full precision."""


def write_all(result: Result, folder: Path) -> None:
    write_tables(result, folder)


@pytest.fixture(scope="module")
def result() -> Result:
    return scenes.solved(scenes.TWO_POINTS)


@pytest.fixture(scope="module")
def folder(result: Result, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("tables")
    write_all(result, place)
    return place


FORMULAS = ["=1+1", "@SUM(A1)", "+A1", "-A1", "-1+cmd|' /C calc'!A0", "\t=1", "＝1", "-5 =1", "+4 (=1)"]
PLAIN = ["-5", "+5 %", "-3.2 N m", "-1e-5 kg m^2", "-", "a=1", "1-3-4-2", " =1", "-3 N/mm²"]


@pytest.mark.parametrize("text", FORMULAS)
def test_no_text_is_computed_by_a_spreadsheet(text: str, tmp_path: Path) -> None:
    sheet = Table([text, "x"], [[text, -1.5], ["a", 2]])
    write_csv(sheet, tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.reader(stream))
    assert rows == [[f"'{text}", "x"], [f"'{text}", "-1.5"], ["a", "2"]]
    # a workbook knows texts from formulas
    write_book({"t": sheet}, tmp_path / "t.xlsx")
    cells = [cell for row in openpyxl.load_workbook(tmp_path / "t.xlsx")["t"] for cell in row]
    assert [cell.data_type for cell in cells] == ["s", "s", "s", "n", "s", "n"]


@pytest.mark.parametrize("text", PLAIN)
def test_plain_texts_are_left_alone(text: str, tmp_path: Path) -> None:
    write_csv(Table([text], [[text]]), tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_text(encoding="utf-8") == f"{text}\n{text}\n"


def test_forces_over_the_crank_angle_have_the_measures_of_the_result(result: Result, folder: Path) -> None:
    table = pd.read_csv(folder / "forces.csv")
    assert list(table.columns[:2]) == ["point", "angle [deg]"]
    for design, found in result.designs.items():
        for k, point in enumerate(result.problem.points):
            rows = table[table["point"] == point.name]
            assert rows["angle [deg]"].tolist() == np.arange(720.0).tolist()
            for name, own in zip(found.mount_names, place_measures(found, k), strict=True):
                sizes = np.linalg.norm([rows[f"{design}: force on {name} {axis} [N]"] for axis in "xyz"], axis=0)
                assert math.sqrt((sizes**2).mean()) == pytest.approx(own.rms, rel=1e-6)
                assert sizes.max() == pytest.approx(own.max, rel=1e-3)


def test_orders_are_those_of_the_curves(result: Result, folder: Path) -> None:
    """Amplitudes by order against a Fourier transform of the forces in the other file, one axis at a time."""
    curves, orders = (pd.read_csv(folder / f"{name}.csv") for name in ("forces", "orders"))
    point = result.problem.points[1].name
    force = curves[curves["point"] == point]["initial: shaking force z [N]"].to_numpy()
    found = 2.0 * np.abs(np.fft.rfft(force)) / len(force)
    own = orders[orders["point"] == point].set_index("order")["initial: shaking force [N]"]
    for order in (2.0, 4.0):
        # two turns are transformed
        assert own[order] == pytest.approx(found[int(2 * order)], rel=1e-6)


def test_all_orders_that_are_not_zero_are_listed(result: Result, folder: Path) -> None:
    orders = pd.read_csv(folder / "orders.csv")
    numbers = orders.drop(columns=["point", "order", *orders.filter(like="frequency")])
    assert (numbers.ne(0.0).any(axis=1) | (orders["order"] == 0.0)).all()
    for point, loads in zip(result.problem.points, result.final.loads, strict=True):
        present = loads.wrench.orders[loads.wrench.coefficients.any(axis=1)]
        assert {0.0, *present} <= {*orders.loc[orders["point"] == point.name, "order"]}


def test_components_by_order_make_the_curves(result: Result, folder: Path) -> None:
    """Compare each curve with the sum of its orders: amplitude times cosine of order times angle plus phase."""
    curves, orders = (pd.read_csv(folder / f"{name}.csv") for name in ("forces", "orders"))
    for point in result.problem.points:
        curve, rows = (table[table["point"] == point.name] for table in (curves, orders))
        turns = np.outer(np.radians(curve["angle [deg]"]), rows["order"])
        for axis in "yz":
            size, phase = (
                rows[f"final: {what} of shaking force {axis} [{unit}]"].to_numpy()
                for what, unit in (("amplitude", "N"), ("phase", "deg"))
            )
            expected = curve[f"final: shaking force {axis} [N]"].to_numpy()
            summed = np.cos(turns + np.radians(phase)) @ size
            assert summed == pytest.approx(expected, abs=1e-6 * np.abs(expected).max() + 1e-9)
        hertz = rows["order"] * point.speed / math.tau
        assert rows["final: frequency [Hz]"].to_numpy() == pytest.approx(hertz.to_numpy())


def test_decisions_are_in_full_precision(result: Result, folder: Path) -> None:
    with (folder / "decisions.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["name"], float(row["value"])) for row in rows] == [(d.name, d.value) for d in result.decisions]


def test_the_workbook_has_a_sheet_for_every_file(result: Result, folder: Path) -> None:
    book = openpyxl.load_workbook(folder / "tables.xlsx", read_only=True)
    assert set(book.sheetnames) == {path.stem for path in folder.glob("*.csv")} == set(number_tables(result))
    rows = list(book["orders"].iter_rows(values_only=True))
    table = pd.read_csv(folder / "orders.csv")
    assert list(rows[0]) == list(table.columns)
    for row, (_, own) in zip(rows[1:], table.iterrows(), strict=True):
        assert row[0] == own.iloc[0]
        assert list(row[1:]) == pytest.approx(own.tolist()[1:])


def test_the_same_numbers_make_the_same_files(result: Result, folder: Path, tmp_path: Path) -> None:
    write_all(result, tmp_path)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == {
        path.name: path.read_bytes() for path in tmp_path.iterdir()
    }


def test_points_of_one_name_have_a_column_each() -> None:
    problem = load(PROBLEMS / "inline-five-elastic.toml")
    point = problem.points[0]
    points = (point, replace(point, speed=1.5 * point.speed))
    one, two = (
        number_tables(evaluate_only(problem.changed(points=points[:count])))["transmissibility"] for count in (1, 2)
    )
    assert len(two.head) - 1 == 2 * (len(one.head) - 1)


@pytest.mark.slow
def test_elastic_mounts_have_modes_travel_and_curves_over_speed(tmp_path: Path) -> None:
    result = evaluate_only(load(PROBLEMS / "study-soft-mounts.toml"))
    actual, block = number_tables(result), result.final.engine.block
    assert block is not None
    rows = [dict(zip(actual["mounts"].head, row, strict=True)) for row in actual["mounts"].rows]
    # the springs carry the weight, and the block sags on them without tilt
    assert sum(row["stiffness z [N/mm]"] * row["sag [mm]"] for row in rows) == pytest.approx(9.80665 * block.mass)
    (mounting,) = actual["mounting"].rows
    assert mounting[1] == pytest.approx(rows[0]["sag [mm]"])
    assert {"modes", "transmissibility", "forces"} <= set(actual)
    assert any(head.startswith("travel at front left") for head in actual["forces"].head)
    assert len(actual["modes"].rows) == 6
    criticals = actual["mount-critical-speeds"]
    # an order meets a frequency where it shakes as often
    assert all(row[6] / 60.0 * row[5] == pytest.approx(row[3]) for row in criticals.rows)


@pytest.mark.slow
def test_ranked_stars_are_a_sheet() -> None:
    result = number_tables(solved("inline-five-open"))
    assert result["rankings"].rows[0][0] == 1
    assert result["rankings"].rows[0][3] is True
    # an even five-cylinder star has no free force of any order shown
    forces = [k for k, head in enumerate(result["rankings"].head) if head.startswith("free force of order")]
    assert forces
    assert all(abs(result["rankings"].rows[0][k]) < 1e-12 for k in forces)
    # no throw may leave its step, so that nothing is known of what that buys
    assert "uneven-firing" not in result
    assert all(sheet.rows for sheet in result.values())


def test_a_name_that_looks_like_a_formula_stays_text(tmp_path: Path) -> None:
    text = scenes.GIVEN.replace("positions", 'names = ["=1+1", "b", "c", "d"]\npositions')
    write_all(evaluate_only(loaded(tmp_path, text)), tmp_path)
    book = openpyxl.load_workbook(tmp_path / "tables.xlsx")
    cells = [cell for row in book["measures"].iter_rows() for cell in row if cell.value and "1+1" in str(cell.value)]
    assert cells
    assert all(cell.data_type != "f" for cell in cells)
    # as it is, also a dash
    assert {cell.value for cell in cells} == {"=1+1"}
    write_book({"one": Table(["a", "b"], [["-", "-26.8 %"]])}, tmp_path / "dash.xlsx")
    assert [cell.value for cell in openpyxl.load_workbook(tmp_path / "dash.xlsx")["one"][2]] == ["-", "-26.8 %"]


@pytest.mark.parametrize("text", ["<r>a & b</r>", "<r><t>bold</t></r>", "<r></r>", " <r>", "<r>", "</r>"])
def test_a_text_that_looks_like_marks_of_formatting_is_a_text(text: str, tmp_path: Path) -> None:
    write_book({"one": Table([text, "b"], [[text, 1.0], [1.0, text]])}, tmp_path / "marks.xlsx")
    cells = list(openpyxl.load_workbook(tmp_path / "marks.xlsx")["one"].iter_rows(values_only=True))
    assert cells == [(text, "b"), (text, 1.0), (1.0, text)]


def test_names_are_known_before_anything_is_made(result: Result) -> None:
    assert {f"{name}.csv" for name in number_tables(result)} <= {*result_files()}
    assert len({*TABLES}) == len(TABLES)
    # every section of a report is a file: in full precision, or as it is printed
    named = {section.__name__: getsource(section).count('file="') for section in SECTIONS}
    assert {name for name, count in named.items() if not count} == WHOLE


def test_a_file_is_named_after_the_table_that_it_holds() -> None:
    result = number_tables(solved("tractor-single"))
    assert result["weights"].head[0] == "weight"
    assert result["balance-factors"].head[0] == "throw of"


@pytest.mark.slow
def test_tables_of_the_report_are_files() -> None:
    result, found = initial_tables("inline-five-torsion")
    assert "crankshaft-torque" in found
    assert set(found) <= {name.removesuffix(".csv") for name in result_files()}
    assert any(isinstance(cell, float) for row in found["crankshaft-torque"].rows for cell in row)
    work = np.array([row[found["torque"].head.index("initial: work stored [J]")] for row in found["torque"].rows])
    whole = np.array([row[found["torque"].head.index("initial: torque of all [N m]")] for row in found["torque"].rows])
    # the work is what the torque does beyond its mean
    half = len(work) // len(result.problem.points)
    step = result.final.engine.cycle.angle / half
    beyond = whole[:half] - whole[:half].mean()
    done = np.cumsum(0.5 * (beyond + np.roll(beyond, 1))) * step
    assert np.ptp(done - work[:half]) < 1e-3 * np.ptp(work[:half])


def test_pages_of_a_workbook_have_names_that_it_takes(tmp_path: Path) -> None:
    names = ["mean force over 'speed'", "a" * 40, "A" * 40, "n/a [kg]", "'quoted'"]
    write_book({name: Table(["x"], [[1.5], [None], [float("nan")]]) for name in names}, tmp_path / "book.xlsx")
    book = openpyxl.load_workbook(tmp_path / "book.xlsx")
    assert book.sheetnames == ["mean force over 'speed-", "a" * 31, "A" * 29 + " 2", "n-a -kg-", "-quoted-"]
    assert [cell.value for cell in book["n-a -kg-"]["A"]] == ["x", 1.5]


def test_cells_of_a_workbook_are_those_of_the_sheet(tmp_path: Path) -> None:
    """Check numbers, truths and texts; a number that is not finite is empty."""
    numbers = [1.5e-300, 1 / 3, 12, np.float64(0.1), np.int64(7)]
    row = [*numbers, True, np.False_, "a < b", "https://a", "12", "", None, math.inf, math.nan, np.float64("nan")]
    head = [f"column {k}" for k in range(len(row))]
    write_book({"one": Table(head, [row, row[::-1]])}, tmp_path / "book.xlsx")
    found = [[cell.value for cell in cells] for cells in openpyxl.load_workbook(tmp_path / "book.xlsx")["one"]]
    expected = [*numbers, True, False, "a < b", "https://a", "12", *[None] * 5]
    assert found == [head, pytest.approx(expected), pytest.approx(expected[::-1])]
    assert [type(cell) for cell in found[1][5:7]] == [bool, bool]


def test_a_text_that_is_no_unicode_is_spelled_out(tmp_path: Path) -> None:
    write_book({"one": Table(["x"], [["a\udce9"]])}, tmp_path / "book.xlsx")
    assert openpyxl.load_workbook(tmp_path / "book.xlsx")["one"]["A2"].value == "a\\udce9"


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_workbook_that_cannot_be_written_is_an_error_of_files(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        write_book({"one": Table(["x"], [[1.0]])}, tmp_path / "nowhere" / "book.xlsx")
    # XlsxWriter leaves rows open that it could not write
    gc.collect()


@pytest.mark.slow
def test_indicator_diagrams_enclose_the_work_of_the_gas() -> None:
    """Compare the work of rod forces over a turn with that of the gas torque."""
    result = evaluate_only(load(PROBLEMS / "waterworks-steam-pump.toml"))
    sheet = number_tables(result)["indicator"]
    stroke = {part.name: part.stroke for part in result.final.engine.slider_cranks}
    work = 0.0
    for name in stroke:
        rows = np.array([row[2:6] for row in sheet.rows if row[1] == name])
        if len(rows):
            travel, force = (np.append(column, column[0]) for column in rows[:, 1:3].T)
            work += np.trapezoid(force, travel) * stroke[name]
    torque = torque_parts(result.final.engine, result.problem.points[0], result.problem.fidelity)["gas"]
    assert work == pytest.approx(abs(float(torque.at(0).real)) * math.tau, rel=5e-3)
    # the low pressure has its own cylinder: the other's cells are empty
    assert {math.isnan(row[-1]) for row in sheet.rows} == {True, False}


@pytest.mark.slow
def test_a_willans_line_is_a_file_with_its_readings() -> None:
    """The line of the file is that of NumPy's least squares, and meets no fuel at the friction."""
    result = evaluate_only(load(PROBLEMS / "car-four-willans.toml"))
    sheet, test = number_tables(result)["willans"], result.problem.friction[0]
    rows = [row for row in sheet.rows if row[0] == test.at]
    measured_rows = np.array([row[2:] for row in rows if row[1] == "measured"], dtype=float)
    assert len(measured_rows) == len(test.x)
    x, y = measured_rows[:, 1 if test.is_motored else 0], measured_rows[:, 3 if test.is_motored else 2]
    slope, intercept = np.polyfit(x, y, 1)
    assert measured_rows[:, 4] == pytest.approx(intercept + slope * x, rel=1e-9)
    friction_row = next(row for row in rows if row[1] == "friction")
    assert friction_row[2] == pytest.approx(-intercept / slope, rel=1e-9)
    assert friction_row[7] == test.friction.deviation


@pytest.mark.slow
def test_wear_and_forces_on_the_crank_are_those_of_the_forces() -> None:
    """Wear counted load by load, and lengths that no turn changes, against the forces of the other file."""
    result = number_tables(evaluate_only(load(PROBLEMS / "tractor-four-bearings.toml")))
    forces, crank, wear = result["forces"], result["bearings-on-crank"], result["wear"]
    name = wear.head[3].removeprefix("wear of ").removesuffix(" [-]")
    point = crank.rows[0][0]
    lateral, vertical = (
        np.array([row[forces.head.index(f"force on {name} {axis} [N]")] for row in forces.rows if row[0] == point])
        for axis in "yz"
    )
    along, across = (
        np.array(
            [row[crank.head.index(f"force on {name} {way} the crank [N]")] for row in crank.rows if row[0] == point]
        )
        for way in ("along", "across")
    )
    step = len(along) // len(lateral)
    assert np.hypot(along, across)[::step] == pytest.approx(np.hypot(lateral, vertical), rel=1e-6)
    assert across[0] == pytest.approx(lateral[0], abs=1e-6 * np.hypot(lateral, vertical).max())
    shares = {row[2]: row[3] for row in wear.rows if row[1] == point}
    assert max(shares.values()) == 1.0
    turned = np.arange(len(along)) * (720.0 / len(along))
    place = np.degrees(np.arctan2(across, along)) + turned
    sizes = np.hypot(along, across)
    sums = {at: sizes[np.abs((place - at + 180.0) % 360.0 - 180.0) <= 60.0].sum() for at in shares}
    maximum = max(sums.values())
    assert {at: total / maximum for at, total in sums.items()} == pytest.approx(shares, abs=2e-3)


@pytest.mark.slow
def test_forward_and_backward_parts_add_up_to_the_order() -> None:
    """Largest and least length of an order's ellipse are the sum and the difference of its two circles."""
    result = evaluate_only(load(PROBLEMS / "twin-vee-offset-pins.toml"))
    sheet = number_tables(result)["turning-parts"]
    loads = result.final.loads[0]
    row = next(row for row in sheet.rows if row[1] == loads.point.name and row[2] == "force" and row[3] == 1)
    angles = np.radians(np.arange(0.0, 360.0, 0.05))
    lateral, vertical = ((coefficient * np.exp(1j * angles)).real for coefficient in loads.wrench.at(1)[1:3])
    sizes = np.hypot(lateral, vertical)
    assert sizes.max() == pytest.approx(row[4] + row[6], rel=1e-5)
    assert sizes.min() == pytest.approx(abs(row[4] - row[6]), abs=1e-5 * sizes.max() + 1e-9)


def test_old_names_of_designs_are_read_with_a_warning(result: Result) -> None:
    for old, new in (("as given", "initial"), ("as decided", "final")):
        with pytest.warns(LaufruheWarning, match=f"'{old}' is now '{new}'"):
            assert result.designs[old] is result.designs[new]
    with pytest.raises(KeyError):
        result.designs["before"]
