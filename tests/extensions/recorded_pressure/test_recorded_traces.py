"""Recorded pressure files as test benches write them, of which every form gives the same torque."""

from __future__ import annotations

import io
import json
import math
import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pytest
from _pytest.mark.structures import ParameterSet
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.io import savemat
from typer.testing import CliRunner, Result

from laufruhe.cli import app
from laufruhe.errors import InputError, LaufruheError
from laufruhe.extensions.flywheel.torque import TorqueFacts, torque_facts, torque_parts, turning_torque
from laufruhe.extensions.recorded_pressure.gas import PressureTrace
from laufruhe.files import number_tables
from laufruhe.files.number_tables import Unit, number_table, unit_in
from laufruhe.files.reader import load
from laufruhe.physics.gas_facts import GasFacts, cylinder_facts, gas_facts
from laufruhe.present.gas_figures import gas_lines
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem
from recorded_cycle import BORE, DEGREES, ROD, STROKE, cycle_pressure, mean_torque

FILES = Path(__file__).parent / "traces"
Array = NDArray[np.float64]


def problem_with(
    folder: Path, file: str, gas: str = "", cycle: str = "four-stroke", engine: str = "", speed: int = 2000
) -> Problem:
    sizes = (
        engine
        or f'cylinders = 1\nbore = "{1e3 * BORE} mm"\nstroke = "{1e3 * STROKE} mm"\nrod_length = "{1e3 * ROD} mm"'
    )
    path = folder / "scene.toml"
    path.write_text(
        f'title = "Recorded"\n[engine]\nlayout = "inline"\ncycle = "{cycle}"\n{sizes}\n'
        + ("" if "reciprocating_mass" in sizes else 'reciprocating_mass = "0.45 kg"\n')
        + f'[gas]\nmodel = "trace"\nfile = "{file}"\n{gas}\n[[operating_points]]\nspeed = "{speed} rpm"\n',
        encoding="utf-8",
    )
    return load(path)


def facts_of(problem: Problem) -> tuple[GasFacts, TorqueFacts, tuple[str, ...]]:
    (point,) = problem.points
    gas = gas_facts(problem.engine, point, problem.fidelity)
    assert gas is not None
    assert isinstance(point.gas, PressureTrace)
    return gas, torque_facts(problem.engine, point, problem.fidelity), point.gas.recording


# exact figures of the curve behind these files: 80 x 90 mm, rod 150 mm, 2000 rpm, from an integration in other code
EXACT = {"mean": 47.10479261881404, "peak": 647.7534226089093, "imep": 13.084664616337232e5, "pressure": 61.483590062e5}
ENGINE = 'cylinders = 1\nbore = "80 mm"\nstroke = "90 mm"\nrod_length = "150 mm"'


@pytest.mark.parametrize(
    ("file", "tolerance", "gas", "said"),
    [
        ("plain.csv", 0.002, "", "firing dead centre"),
        ("indicating.txt", 0.002, "", "'PEIN', 'PAUS'"),
        ("columns.csv", 0.005, "", "Of 20 cycles"),
        ("stacked.txt", 0.025, "", "Of 4 cycles"),
        ("labview.lvm", 0.002, "", "'Trigger'"),
        ("simulation.csv", 0.002, "", "'Volume (Cylinder 1)'"),
        ("gauge.csv", 0.002, "", "gas exchange dead centre"),
        ("floating.csv", 0.002, 'peg = { at = "-180 deg", to = "1 bar" }', "moved by 3.2 bar"),
    ],
)
def test_files_of_benches_give_the_torque_behind_them(
    file: str, tolerance: float, gas: str, said: str, tmp_path: Path
) -> None:
    (tmp_path / file).write_bytes((FILES / file).read_bytes())
    problem = problem_with(tmp_path, file, f'crankcase_pressure = "1 bar"\n{gas}', engine=ENGINE)
    facts, _, recording = facts_of(problem)
    assert facts.torque == pytest.approx(EXACT["mean"], rel=tolerance)
    assert facts.imep == pytest.approx(EXACT["imep"], rel=tolerance)
    assert facts.power == pytest.approx(EXACT["mean"] * 2000 * math.pi / 30, rel=tolerance)
    of_gas = torque_parts(problem.engine, problem.points[0])["gas"]
    assert of_gas.sample(2880).max() == pytest.approx(EXACT["peak"], rel=tolerance)
    assert facts.peak_pressure == pytest.approx(EXACT["pressure"], rel=tolerance)
    assert math.degrees(facts.peak_angle) == pytest.approx(15.47, abs=1.0)
    assert said in " ".join(recording)
    assert not problem.plausibility_warnings


def test_a_record_over_time_is_refused_in_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "t.txt").write_bytes((FILES / "time-and-encoder.txt").read_bytes())
    with pytest.raises(
        InputError, match=r'gas\.file = "t\.txt": has no crank angles: column 1 runs from 0 to .*as a time'
    ):
        problem_with(tmp_path, "t.txt", engine=ENGINE)


FOUR = (
    'bore = "80 mm"\nstroke = "80 mm"\nrod_length = "140 mm"\ncylinder_spacing = "90 mm"\nfiring_order = [1, 3, 4, 2]\n'
    'reciprocating_mass = "0.45 kg"\n'
)
SINGLE = 'cylinders = 1\nbore = "80 mm"\nstroke = "80 mm"\nrod_length = "140 mm"\nreciprocating_mass = "0.45 kg"\n'


def bench(file: str, folder: Path, engine: str = SINGLE, gas: str = "", speed: int = 1500) -> Problem:
    (folder / file).write_bytes((FILES / file).read_bytes())
    return problem_with(folder, file, gas, engine=engine, speed=speed)


@pytest.mark.parametrize("file", ["latin-1.csv", "percent.txt", "blanks.txt", "two-headings.csv"])
def test_headings_comments_and_encodings(file: str, tmp_path: Path) -> None:
    """Compare the torque with 15.595 N m, an integration of the four files by other code."""
    assert facts_of(bench(file, tmp_path))[0].torque == pytest.approx(15.595, abs=2e-3)


def test_a_row_of_units(tmp_path: Path) -> None:
    facts, _, recording = facts_of(bench("units-row.csv", tmp_path, FOUR))
    assert facts.peak_pressure == pytest.approx(47.53e5, rel=1e-3)
    assert "because the file names no unit" not in " ".join(recording)


def test_several_cycles_are_averaged(tmp_path: Path) -> None:
    """Compare the mean and peak with 15.73 N m and 407.4 N m of other code."""
    facts, torque, recording = facts_of(bench("eight-cycles.csv", tmp_path))
    assert facts.torque == pytest.approx(15.73, abs=5e-3)
    assert torque.largest == pytest.approx(407.4, rel=1e-2)
    assert "Of 8 cycles, with peaks of 55.09 bar and a standard deviation of 2.14 bar, the mean is used." in recording


def test_noise_in_tenths_of_a_degree(tmp_path: Path) -> None:
    """Check that smoothing keeps the mean, and removes the noise that would reach 405 and -377 N m."""
    _, torque, recording = facts_of(bench("tenths-of-a-degree.csv", tmp_path, FOUR))
    assert "Noise: 0.2 bar rms, removed by a low-pass" in " ".join(recording)
    assert torque.excursion == pytest.approx(107.0, rel=1e-2)
    # means over whole degrees leave a third of the noise
    rows = np.loadtxt(FILES / "tenths-of-a-degree.csv", delimiter=",", skiprows=1)
    means = rows[:, 1].reshape(720, 10).mean(axis=1)
    (tmp_path / "means.csv").write_text(
        "".join(f"{a + 0.45},{p}\n" for a, p in zip(range(-360, 360), means, strict=True))
    )
    _, coarse, _ = facts_of(problem_with(tmp_path, "means.csv", engine=FOUR, speed=1500))
    assert torque.largest == pytest.approx(coarse.largest, rel=1e-2)
    assert torque.minimum == pytest.approx(coarse.minimum, abs=1e-2 * coarse.largest)
    raw = facts_of(bench("tenths-of-a-degree.csv", tmp_path, FOUR, "smooth = false"))[1]
    assert raw.mean == pytest.approx(torque.mean, rel=1e-7)
    assert torque.largest < raw.largest < 1.05 * torque.largest
    assert torque.minimum > raw.minimum > torque.minimum - 0.05 * torque.largest


def test_a_zero_at_the_other_dead_centre_is_doubted(tmp_path: Path) -> None:
    problem = bench("other-dead-centre.csv", tmp_path)
    (warning,) = map(str, problem.plausibility_warnings)
    assert "mean torque of the gas: is -9.5" in warning
    assert (
        "lies 191.9 deg after the firing dead centre; check angle_zero; 180 deg less would move the peak to 11.92 deg"
        in warning
    )
    assert facts_of(problem)[0].torque == pytest.approx(-9.52, abs=0.01)
    early = " ".join(map(str, bench("other-dead-centre.csv", tmp_path, gas="angle_zero = 0").plausibility_warnings))
    assert "180 deg less" in early
    late = " ".join(map(str, bench("other-dead-centre.csv", tmp_path, gas="angle_zero = 180").plausibility_warnings))
    assert "check angle_zero; 360 deg" in late
    negative = " ".join(
        map(str, bench("other-dead-centre.csv", tmp_path, gas="angle_zero = 360").plausibility_warnings)
    )
    assert "check angle_zero; 180 deg more would move the peak to 11.92 deg" in negative
    right = bench("other-dead-centre.csv", tmp_path, gas="angle_zero = -180")
    assert not right.plausibility_warnings
    assert facts_of(right)[0].torque == pytest.approx(15.60, abs=0.01)


def test_a_pressure_over_300_bar_is_doubted(tmp_path: Path) -> None:
    problem = bench("kilopascal.csv", tmp_path, speed=2500)
    warnings = " ".join(map(str, problem.plausibility_warnings))
    assert "peak pressure of the gas = 4753 bar: is more than 300 bar" in warnings
    assert "check pressure_unit; it may be kPa" in warnings
    assert "kW for each litre" in warnings
    pascal = bench("kilopascal.csv", tmp_path, gas='pressure_unit = "kbar"')
    assert "it may be Pa" in " ".join(map(str, pascal.plausibility_warnings))
    right = bench("kilopascal.csv", tmp_path, gas='pressure_unit = "kPa"')
    assert not right.plausibility_warnings
    assert facts_of(right)[0].peak_pressure == pytest.approx(47.53e5, rel=1e-3)


def rows(
    *columns: Sequence[float] | Array, by: str = ",", decimal: str = ".", form: str = "%.5f", head: str = ""
) -> str:
    lines = (by.join((form % cell).replace(".", decimal) for cell in row) for row in zip(*columns, strict=True))
    return head + "\n".join(lines) + "\n"


def workbook(*sheets: Sequence[Sequence[Any]]) -> bytes:
    book, stream = openpyxl.Workbook(), io.BytesIO()
    for cells in sheets:
        sheet = book.create_sheet()
        for row in cells:
            sheet.append(list(row))
    book.remove(book.worksheets[0])
    book.save(stream)
    return stream.getvalue()


def matlab(**variables: Any) -> bytes:
    stream = io.BytesIO()
    savemat(stream, variables)
    return stream.getvalue()


A, P = DEGREES, cycle_pressure(DEGREES)
CLOSED, CLOSED_P = np.append(A, 360.0), np.append(P, P[0])
TURNS = np.tile(np.arange(0.0, 360.0), 6)
LONG = np.arange(0.0, 3800.0)
UNEVEN = np.concatenate([np.arange(-360, -30, 2.0), np.arange(-30, 60, 0.25), np.arange(60, 360, 2.0)])
PAIRS = list(zip(A.tolist(), P.tolist(), strict=True))
NAMED = "CA,PCYL1,PCYL2\ndeg,bar,bar\n"


def form(name: str, content: str | bytes, gas: str = "", said: str = "", ending: str = "csv") -> ParameterSet:
    return pytest.param(content, gas, said, ending, id=name)


FORMS = [
    form("two columns", rows(A, P), said="Angles are taken as deg, because"),
    form("blanks and decimal commas", rows(A, P, by="   ", decimal=",")),
    form("quotes and decimal commas", "".join(f'"{a:.1f}","{p:.5f}"\n'.replace(".", ",") for a, p in PAIRS)),
    form("UTF-16", rows(A, P, by="\t", head="Winkel\tDruck\n°KW\tbar\n").encode("utf-16")),
    form("UTF-16 without a mark", rows(A, P, by="\t").encode("utf-16-le")),
    form("UTF-16, the other way round", rows(A, P, by="\t").encode("utf-16-be")),
    form("radians", rows(np.radians(A), P, form="%.8f"), said="Angles are taken as rad"),
    form("radians by unit", rows(np.radians(A), P, form="%.8f", head="theta [rad],p [bar]\n")),
    form("MPa in a row of units", rows(A, P / 10, form="%.7f", head="CA,p\n[deg],[MPa]\n")),
    form("units in names that are units too", rows(A, P, head="CA [deg],p [bar]\n"), said="from 'CA [deg]', pressure"),
    form("Pa in brackets", rows(A, 1e5 * P, head="phi (deg), p (Pa)\n")),
    form("psia", rows(A, 14.503773773 * P, head="Crank angle (deg), Pressure (psia)\n")),
    form("bar of a gauge", rows(A, P - 1, head="Crank angle (deg), Pressure (barg)\n"), said="gauge, in air of 1 bar"),
    form("mbar behind the name", rows(A, 1000 * P, by=";", head="angle_deg;p_mbar\n")),
    form("kPa in German",
         rows(A, 100 * P, by=";", decimal=",", head="Kurbelwinkel in °KW;Druck in kPa\n").encode("latin-1")),
    form("kPa by key", rows(A, 100 * P), gas='pressure_unit = "kPa"'),
    form("unit of the key before that of the file", rows(A, P, head="a [deg],p [kPa]\n"), gas='pressure_unit = "bar"',
         said="taken as bar, as the problem says; the file says kPa"),
    form("names with blanks between blanks",
         "  crank angle [deg]   cylinder pressure [kPa]\n" + rows(A, 100 * P, by="   ")),
    form("units in a comment", "# angle [deg]; p [kPa]\n" + rows(A, 100 * P, by=";")),
    form("pressure first", rows(P, A)),
    form("pressure first by names", rows(P, A, by=";", head="p in bar;KW in °\n")),
    form("falling angle", rows(A[::-1], P[::-1])),
    form("both ends", rows(CLOSED, CLOSED_P)),
    form("rows given twice", rows(np.repeat(A, 2), np.repeat(P, 2))),
    form("single precision", rows(np.float32(0.1) * np.arange(-3600, 3600, 10, dtype=np.float32), P, form="%.14f")),
    form("zero at gas exchange", rows(A + 360, P), said="gas exchange dead centre; the peak then lies"),
    form("zero at gas exchange by key", rows(A + 360, P), gas='angle_zero = "gas exchange"'),
    form("0 to 719", rows((A + 720) % 720, P)[:0] + rows(np.arange(720.0), cycle_pressure(np.arange(720.0)))),
    form("-180 to 540", rows(np.arange(-180.0, 541.0), cycle_pressure(np.arange(-180.0, 541.0)))),
    form("zero at bottom", rows(A + 180, P), gas="angle_zero = -180"),
    form("zero at bottom as text", rows(A + 180, P), gas='angle_zero = "-180 deg"'),
    form("cycles with both ends", rows(np.tile(CLOSED, 3), np.tile(CLOSED_P, 3)), said="Of 3 cycles"),
    form("many cycles with both ends", rows(np.tile(CLOSED, 30), np.tile(CLOSED_P, 30)), said="Of 30 cycles"),
    form("an angle that rises on", rows(LONG, cycle_pressure(LONG)), said="Of 5 cycles"),
    form("an angle that begins anew each turn",
         rows(TURNS, cycle_pressure(np.arange(360.0, 2520.0))), said="Of 3 cycles"),
    form("headings before every cycle",
         2 * rows(A, P, by=";", head="Cycle;Test 7\nKW;PZYL\n°;bar\n"), said="Of 2 cycles"),
    form("LabVIEW, an angle for each channel",
         "LabVIEW Measurement\t\nX_Columns\tMulti\n***End_of_Header***\t\n\t\nChannels\t2\n"
         "Y_Unit_Label\tbar\t\tV\t\nX_Dimension\tAngle\t\tAngle\t\n***End_of_Header***\n"
         "X_Value\tPressure\tX_Value\tTrigger\tComment\n"
         + rows(A, P, A, 0 * A, by="\t", decimal=",").replace("\n", "\t\n")),
    form("blank lines and remarks", "".join(f"{a};{p:.5f};{'peak' * int(a == 19)}\n\n" for a, p in PAIRS)),
    form("a footer", rows(A, P) + "end of data\n"),
    form("date and counts over the numbers", rows(A, P, head="Test of 2024-02-10\n720 2 1\n")),
    form("uneven steps", rows(UNEVEN, cycle_pressure(UNEVEN))),
    form("worst cycle", rows(A, 0.9 * P, P, 0.95 * P), gas='cycles = "worst"', said="number 2 is used"),
    form("second cycle", rows(A, 0.9 * P, P, 0.95 * P), gas="cycles = 2"),
    form("first of two cylinders", rows(A, P, cycle_pressure(A - 180), head=NAMED), said="not used: 'PCYL2'"),
    form("second of two cylinders", rows(A, cycle_pressure(A + 180), P, head=NAMED), gas='pressure_column = "pcyl2"'),
    form("columns by number", rows(np.arange(720), P, A, 0 * A), gas="angle_column = 3\npressure_column = 2"),
    form("mean of named columns",
         rows(A, 0.9 * P, 5 * P, 1.1 * P, head="CA,a,b,c\n"), gas='pressure_column = ["a", "c"]'),
    form("floating, pegged", rows(A, P - 3), gas='peg = { at = -180, to = "1 bar" }', said="moved by 3 bar"),
    form("gauge by key", rows(A, P - 1), gas="gauge = true"),
    form("workbook", workbook([["rpm", "kW"], [1600, 3.4], [1700, 3.5], ["sum", 5], [1800, 2]],
         [["TEST DATA"], [None, "PCYL1", "INJ1"], ["deg", "bar", "-"],
         *((float(np.float32(a)), float(p), 0.0) for a, p in PAIRS)]), ending="xlsx"),
    form("sheet of a workbook", workbook([["CA", "p"], *((a, 2 * p) for a, p in zip(CLOSED, CLOSED_P, strict=True))],
         [["CA", "p"], *zip(A.tolist(), P.tolist(), strict=True)]), gas='sheet = "Sheet2"', ending="xlsx"),
    form("MATLAB, cycles in columns",
         matlab(theta=A, p=np.stack([0.9 * P, 1.1 * P], axis=1)), said="Of 2 cycles", ending="mat"),
    form("MATLAB, cycles in rows", matlab(theta=A, p=np.stack([0.9 * P, 1.1 * P]), speed=2000.0), ending="mat"),
    form("MATLAB, a structure", matlab(SD={"CA": A, "CylPre": P, "n": 3}), ending="mat"),
    form("MATLAB, one matrix", matlab(M=np.stack([A, P], axis=1)), ending="mat"),
]  # fmt: skip


@pytest.mark.parametrize(("content", "gas", "said", "ending"), FORMS)
def test_every_form_gives_one_torque(content: str | bytes, gas: str, said: str, ending: str, tmp_path: Path) -> None:
    (tmp_path / f"f.{ending}").write_bytes(content if isinstance(content, bytes) else content.encode())
    problem = problem_with(tmp_path, f"f.{ending}", f'crankcase_pressure = "1 bar"\n{gas}')
    facts, _, recording = facts_of(problem)
    assert facts.torque == pytest.approx(mean_torque(), rel=1e-4)
    assert facts.peak_pressure == pytest.approx(1e5 * P.max(), rel=1e-4)
    assert math.degrees(facts.peak_angle) == pytest.approx(A[P.argmax()], abs=0.51)
    assert said in " ".join(recording)
    assert not problem.plausibility_warnings


@pytest.mark.parametrize(
    ("text", "dimension", "name", "is_gauge"),
    [
        *((text, "rad", "deg", False) for text in ("deg", "°", "[deg]", "(°CA)", "°KW", "deg. CA", "CAD", "Grad")),
        *((text, "rad", "deg", False) for text in ("deg CA aTDC", "CA°", "degCA")),
        *((text, "rad", "rad", False) for text in ("rad", "[rad]", "Radian")),
        *((text, "Pa", "bar", False) for text in ("bar", "Bar", "[bar]", "bar(a)", "bara", "bar abs", "bar_a")),
        *((text, "Pa", "bar", True) for text in ("barg", "bar(g)", "bar gauge", "barü", "bar_g")),
        *((text, "Pa", text, False) for text in ("kPa", "MPa", "Pa", "hPa", "mbar", "psi", "atm")),
        ("psig", "Pa", "psi", True), ("kg/cm²", "Pa", "kp/cm^2", False), ("N/mm^2", "Pa", "N/mm^2", False),
        ("V", "V", "v", False), ("ms", "s", "ms", False),
    ],
)  # fmt: skip
def test_units_of_headings(text: str, dimension: str, name: str, is_gauge: bool) -> None:
    assert unit_in(text) == Unit(dimension, name, is_gauge)


@pytest.mark.parametrize(
    "text", ["", "CA", "KW", "CA_deg", "PCYL1", "p", "-", "mm^3", "A", "cycle_1", "deg bTDC", "PA2"]
)
def test_words_that_are_no_units(text: str) -> None:
    """Check that an angle before the dead centre counts backwards."""
    assert unit_in(text) is None


REFUSED = {
    "nothing": ("", "", "has no columns of crank angle and pressure; give a file with both"),
    "no numbers": ("hello world\nfoo\n", "", "has no columns of crank angle and pressure"),
    "a picture": ("\x89PNG\r\n\x1a\n\x01\x02", "", "has no columns of crank angle and pressure"),
    "few rows": (rows(A[:3], P[:3]), "", "has 3 rows, too few for a cycle; give one every degree"),
    "part of a cycle": (rows(A[:500], P[:500]), "", "so 221 of the 720 deg of a four-stroke cycle are missing"),
    "a gap": (rows(np.delete(A, np.s_[20:60]), np.delete(P, np.s_[20:60])), "", "no point between -341 and -300 deg"),
    "a broken row": (rows(A[:99], P[:99]) + "oops,1\n" + rows(A[99:], P[99:]), "", "line 100 is no row of numbers"),
    "a missing cell": (rows(A[:99], P[:99]) + "-261,\n" + rows(A[100:], P[100:]), "",
                       "line 100 has no number in column 2"),
    "disorder": (rows(A[:99], P[:99]) + "-300,2\n" + rows(A[99:], P[99:]), "", "has -300 deg after -262 deg; sort"),
    "volts": (rows(A, P, head="a [deg],p [V]\n"), "", "has no pressures: 'p [V]' has another unit; convert"),
    "floating": (rows(A, P - 3), "", "has pressures down to -2 bar, which are not absolute; write"),
    "two zeros": (rows(A, P - 3), 'gauge = true\npeg = { at = 0, to = "1 bar" }', "gas.gauge: is given beside peg"),
    "two angles": (rows(np.arange(720), A, P), "", "may have its crank angles in column 1, column 2; name one"),
    "two pressures": (rows(A, 0 * P + 1, P, head="CA,PEIN,PCYL1\ndeg,bar,bar\n"), "",
                      "may have the pressure of the cylinder in 'PEIN', 'PCYL1'; name one by pressure_column"),
    "no such heading": (rows(A, P, P, head=NAMED), 'pressure_column = "PCYL"', 'column = "PCYL": is no heading'),
    "no such column": (rows(A, P), "pressure_column = 5", "pressure_column = 5: is not among 2 columns; count"),
    "no choice of cycles": (rows(A, P), 'cycles = "best"', 'gas.cycles = "best": is no choice of cycles; write "mean"'),
    "no number of a cycle": (rows(A, P), "cycles = 0", "gas.cycles = 0: is no choice of cycles"),
    "half a column": (rows(A, P), "angle_column = 1.5", "gas.angle_column = 1.5: is neither name nor number"),
    "no column": (rows(A, P), "pressure_column = []", "names no column; name one"),
    "a column twice": (rows(A, P), "pressure_column = [2, 2]", "names a column twice; name it once"),
    "angles as pressures": (rows(A, P, head="KW,p\ndeg,bar\n"), 'pressure_column = "KW"',
                            "takes the pressure from 'KW', whose unit is deg; name another column"),
    "pressures as angles": (rows(A, P, head="KW,p\ndeg,bar\n"), "angle_column = 2",
                            "gas.angle_column = 2: takes the angle from 'p', whose unit is bar; name another"),
    "a sheet of a text": (rows(A, P), 'sheet = "Data"', "is no workbook, so it has no sheets; leave out the key sheet"),
    "wide steps": (rows(A[::40], P[::40]), "", "no point between -360 and -320 deg, gaps must not exceed 30 deg"),
    "half a column among others": (rows(A, P), "pressure_column = [2.5]", "[1] = 2.5: is neither name nor number"),
    "no such cycle": (rows(A, P, P), "cycles = 3", "gas.cycles = 3: is not among 2 cycles; count them from 1"),
    "no such cycle of one": (rows(A, P), "cycles = 3", "gas.cycles = 3: is not in the file, which has one cycle"),
    "no dead centre": (rows(A, P), 'angle_zero = "OT"', 'gas.angle_zero = "OT": is no dead centre; write "firing"'),
    "no unit of pressure": (rows(A, P), 'pressure_unit = "deg"', 'gas.pressure_unit = "deg": '),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_unreadable_traces_are_refused_in_one_line(name: str, tmp_path: Path) -> None:
    content, gas, said = REFUSED[name]
    (tmp_path / "f.csv").write_text(content, encoding="latin-1")
    with pytest.raises(InputError) as refused:
        problem_with(tmp_path, "f.csv", gas)
    assert said in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1
    assert "gas." in str(refused.value)


@pytest.mark.parametrize(
    ("file", "content", "said"),
    [
        ("f.xlsx", b"abcdefgh", "is no spreadsheet that can be read; save it"),
        ("f.csv", b"PK\x03\x04abcd", "is no spreadsheet that can be read; save it"),
        ("f.mat", b"abcdefgh", "is no MATLAB file; save it with -v7"),
        ("f.mat", b"MATLAB 7.3 MAT-file", "MATLAB file"),
        ("f.xls", b"\xd0\xcf\x11\xe0", r"is a workbook of the old kind \(\.xls\); save it as text"),
        ("f.tdms", b"TDSm", "is a TDMS file; save it as text"),
        ("f.mf4", b"MDF     4.10", "is an MDF file; save it as text"),
    ],
)
def test_other_files_are_refused_by_name(file: str, content: bytes, said: str, tmp_path: Path) -> None:
    (tmp_path / file).write_bytes(content * 99)
    with pytest.raises(InputError, match=said):
        problem_with(tmp_path, file)


def test_files_are_known_by_their_bytes(tmp_path: Path) -> None:
    (tmp_path / "f.dat").write_bytes(workbook([["CA", "p"], *PAIRS]))
    assert facts_of(problem_with(tmp_path, "f.dat"))[0].peak_pressure == pytest.approx(1e5 * P.max())
    (tmp_path / "g.dat").write_bytes(matlab(theta=A, p=P))
    assert facts_of(problem_with(tmp_path, "g.dat"))[0].peak_pressure == pytest.approx(1e5 * P.max())


def test_a_small_book_that_unpacks_to_a_large_one_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "f.xlsx").write_bytes(workbook([*PAIRS]))
    monkeypatch.setattr(number_tables, "MAX_UNPACKED", 10_000)
    with pytest.raises(InputError, match="has more than 0 MB when unpacked; remove rows"):
        problem_with(tmp_path, "f.xlsx")


def test_a_sheet_that_is_not_there_is_named(tmp_path: Path) -> None:
    (tmp_path / "f.xlsx").write_bytes(workbook([[1.0, 2.0]]))
    with pytest.raises(InputError, match="has no sheet 'Data'; it has: Sheet1"):
        problem_with(tmp_path, "f.xlsx", 'sheet = "Data"')


def test_a_four_stroke_file_in_a_two_stroke_engine_is_refused(tmp_path: Path) -> None:
    (tmp_path / "f.csv").write_text(rows(A, P))
    with pytest.raises(
        InputError, match=r"has 2 cycles that differ, and 1 of them are unlike their mean; check engine\.cycle"
    ):
        problem_with(tmp_path, "f.csv", cycle="two-stroke")


def test_turns_without_gas_exchange_are_refused(tmp_path: Path) -> None:
    """Check that a record of the firing turn alone, which would give twice the work, is refused."""
    turn = np.arange(-180.0, 180.0)
    (tmp_path / "f.csv").write_text(rows(np.tile(turn, 4), np.tile(cycle_pressure(turn), 4)))
    with pytest.raises(InputError, match="has the same pressures in both turns of its four-stroke cycle; check engine"):
        problem_with(tmp_path, "f.csv")


def test_a_rotary_engine_has_its_gas_exchange_after_540_degrees(tmp_path: Path) -> None:
    text = """
title = "Rotary"
[engine]
layout = "rotary"
cycle = "four-stroke"
cylinders = 1
eccentricity = "15 mm"
rotor_radius = "105 mm"
rotor_width = "80 mm"
rotor_mass = "4 kg"
[gas]
model = "trace"
file = "f.csv"
[[operating_points]]
speed = "3000 rpm"
"""
    shaft = np.arange(-540.0, 540.0, 1.5)
    figures = []
    for late in (0.0, 540.0):
        (tmp_path / "f.csv").write_text(rows(shaft + late, cycle_pressure(shaft / 1.5)))
        (tmp_path / "r.toml").write_text(text)
        facts, _, recording = facts_of(load(tmp_path / "r.toml"))
        figures.append((facts.torque, facts.peak_angle))
        assert ("gas exchange" in " ".join(recording)) == (late > 0.0)
    assert figures[0] == pytest.approx(figures[1])
    assert math.degrees(figures[0][1]) == pytest.approx(1.5 * 19.0, abs=1.5)


def test_a_two_stroke_has_one_dead_centre(tmp_path: Path) -> None:
    turn = np.arange(-180.0, 180.0)
    (tmp_path / "f.csv").write_text(rows(turn, cycle_pressure(turn)))
    assert facts_of(problem_with(tmp_path, "f.csv", cycle="two-stroke"))[0].torque > 0.0
    with pytest.raises(InputError, match="does not suit a two-stroke cycle"):
        problem_with(tmp_path, "f.csv", 'angle_zero = "gas exchange"', cycle="two-stroke")


def test_smooth_files_are_kept_to_the_last_digit(tmp_path: Path) -> None:
    (tmp_path / "f.csv").write_text(rows(A, P))
    gas = problem_with(tmp_path, "f.csv").points[0].gas
    assert isinstance(gas, PressureTrace)
    assert gas.pressures == tuple(float(f"{p:.5f}") * 1e5 for p in P)
    assert gas.angles == pytest.approx(np.radians(A), rel=1e-15)


def test_the_side_of_a_piston_reads_the_same_files(tmp_path: Path) -> None:
    turn = np.arange(0.0, 360.0, 2.0)
    (tmp_path / "f.csv").write_text(rows(turn, 400 + 100 * np.cos(np.radians(turn)), by=";", head="KW;p\n°;kPa\n"))
    path = tmp_path / "scene.toml"
    path.write_text(
        'title = "Pump"\n[engine]\nlayout = "inline"\ncycle = "two-stroke"\ncylinders = 1\nstroke = "90 mm"\n'
        'rod_length = "170 mm"\nreciprocating_mass = "0.6 kg"\n[gas]\nmodel = "chambers"\n'
        '[[gas.chambers]]\nend = "head"\n'
        'bore = "80 mm"\ntrace = { file = "f.csv" }\n[[operating_points]]\nspeed = "300 rpm"\n'
    )
    (chamber,) = load(path).points[0].gas.chambers  # type: ignore[union-attr]
    assert isinstance(chamber.diagram, PressureTrace)
    assert max(chamber.diagram.pressures) == pytest.approx(5e5)


CHANGES: list[Callable[[random.Random, bytearray], None]] = [
    lambda dice, text: text.__setitem__(dice.randrange(len(text)), dice.randrange(256)),
    lambda dice, text: text.__delitem__(slice((k := dice.randrange(len(text))), k + dice.randrange(1, 40))),
    lambda dice, text: text.__setitem__(slice(k := dice.randrange(len(text)), k),
                                        dice.choice([b",", b"\n", b'"', b";", b"-", b"nan", b"1e999", b"\0", b"#"])),
]  # fmt: skip


@given(seed=st.integers(0, 100_000))
def test_no_bytes_make_anything_but_a_table_or_one_line(seed: int) -> None:
    dice = random.Random(seed)
    angles = np.arange(-360.0, 360.0, 10.0)
    columns = angles, cycle_pressure(angles)
    texts = rows(*columns, head="CA,PCYL1\ndeg,bar\n"), rows(*columns, by=";", decimal=","), rows(*columns, by="\t")
    text = bytearray(dice.choice(texts).encode())
    for _ in range(dice.choice([1, 2, 5, 50])):
        dice.choice(CHANGES)(dice, text)
        text = text or bytearray(b"x")
    lines = [""]
    try:
        table = number_table(bytes(text), ".csv")
        assert table.values.shape == (len(table.lines), len(table.names))
        assert len(table.units) == len(table.names)
    except LaufruheError as error:
        lines = str(error).splitlines()
    assert len(lines) == 1


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_check_solve_and_json_say_how_the_file_was_read(tmp_path: Path) -> None:
    problem = bench("eight-cycles.csv", tmp_path)
    path = tmp_path / "scene.toml"
    checked = run("check", path)
    assert checked.exit_code == 0
    lines = checked.output.splitlines()
    assert lines[0].startswith("ok: scene, 1 cylinder")
    assert "gas: Of 8 cycles, with peaks of 55.09 bar and a standard deviation of 2.14 bar, the mean is used." in lines
    assert lines[-1].startswith(
        "gas at 1500 rpm: peak 55.08 bar at 11.88 deg, imep 4.915 bar, gas torque 15.73 N m, power 2.47 kW"
    )
    solved = run("solve", path, "--out", tmp_path / "out", "--json", tmp_path / "r.json")
    assert solved.exit_code == 0, solved.output
    for text in (solved.output, (tmp_path / "out" / "report.md").read_text(encoding="utf-8")):
        assert "Gas pressure" in text
        assert "Of 8 cycles" in " ".join(text.split())
    (head, row) = (tmp_path / "out" / "gas-pressure.csv").read_text(encoding="utf-8").splitlines()
    assert head.split(",")[:4] == ["at", "peak [bar]", "peak at [deg]", "imep [bar]"]
    assert row.startswith("1500 rpm,55.08,11.88,4.915,15.73,2.47,")
    (point,) = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))["points"]
    facts, _, recording = facts_of(problem)
    assert point["gas"]["imep"] == pytest.approx(facts.imep)
    assert point["gas"]["recording"] == list(recording)


def test_other_problems_say_nothing_of_records(tmp_path: Path) -> None:
    (tmp_path / "f.toml").write_text(
        f"title = 'No gas'\n[engine]\nlayout = 'inline'\ncycle = 'four-stroke'\n{SINGLE}"
        "[[operating_points]]\nspeed = '1500 rpm'\n"
    )
    checked = run("check", tmp_path / "f.toml", "--json", "-")
    assert "gas:" not in checked.output
    assert '"recording"' not in checked.output


def in_columns(folder: Path, columns: dict[str, np.ndarray], name: str = "columns.csv") -> None:
    rows = np.column_stack([DEGREES, *columns.values()])
    head = ";".join(["angle [deg]", *(f"{column} [bar]" for column in columns)])
    np.savetxt(folder / name, rows, "%.6f", ";", header=head, comments="")


def test_statistics_of_a_test_bench_are_no_cycles(tmp_path: Path) -> None:
    for names in (("PCYL1_AVG", "_MIN", "_MAX", "_STD"), ("Mittelwert", "Minimum", "Maximum", "Standardabw.")):
        in_columns(tmp_path, dict(zip(names, (P, 0.8 * P, 1.3 * P, 0.1 * P), strict=True)))
        facts, _, recording = facts_of(problem_with(tmp_path, "columns.csv"))
        assert facts.peak_pressure == pytest.approx(1e5 * P.max(), rel=1e-4)
        assert f"Columns that are not used: '{names[1]}" in " ".join(recording)


def test_common_angles_have_one_zero(tmp_path: Path) -> None:
    """Check that a wrong firing order moves a cylinder by a turn to the same dead centre."""
    four = [np.interp(DEGREES - late, DEGREES, P, period=720.0) for late in (0.0, 540.0, 180.0, 360.0)]
    in_columns(tmp_path, {f"PCYL{k}": values for k, values in enumerate(four, 1)})
    gas = 'cylinder_columns = [2, 3, 4, 5]\ncylinder_angles = "common"'
    assert problem_with(tmp_path, "columns.csv", gas, engine=FOUR).points
    with pytest.raises(InputError, match="puts the peak of cylinder 2"):
        problem_with(tmp_path, "columns.csv", gas, engine=FOUR.replace("[1, 3, 4, 2]", "[1, 2, 4, 3]"))


def test_a_motored_column_is_no_cycle(tmp_path: Path) -> None:
    in_columns(tmp_path, {"fired": P, "motored": 1.0 + 0.6 * (P - 1.0)})
    assert facts_of(problem_with(tmp_path, "columns.csv"))[0].peak_pressure == pytest.approx(1e5 * P.max(), rel=1e-4)


def test_columns_of_cylinders_are_no_cycles(tmp_path: Path) -> None:
    for names in (("Zyl. 1", "Zyl. 2"), ("p1", "p2"), ("PCYL1", "PCYL2")):
        in_columns(tmp_path, dict.fromkeys(names, P))
        with pytest.raises(InputError, match=r"may have one cylinder in each of .*write cylinder_columns"):
            problem_with(tmp_path, "columns.csv")
    in_columns(tmp_path, {"PCYL1 Z01": P, "PCYL1 Z02": P})
    assert "as cycles of one cylinder" in facts_of(problem_with(tmp_path, "columns.csv"))[2][0]


def test_cycles_that_scatter_are_doubted(tmp_path: Path) -> None:
    in_columns(tmp_path, {"a": P, "b": 2.0 * P})
    assert "are all of one cylinder" in " ".join(facts_of(problem_with(tmp_path, "columns.csv"))[2])


def with_points(folder: Path, points: str, gas: str = "") -> Problem:
    in_columns(folder, {"p": P}, "full.csv")
    in_columns(folder, {"p": 1.0 + 0.3 * (P - 1.0)}, "idle.csv")
    text = f'title = "Recorded"\n[engine]\nlayout = "inline"\ncycle = "four-stroke"\n{SINGLE}'
    path = folder / "points.toml"
    path.write_text(f'{text}[gas]\nmodel = "trace"\nfile = "full.csv"\n{gas}\n{points}')
    return load(path)


def test_a_load_at_the_brake_leaves_the_rest_of_a_recorded_pressure_to_friction(tmp_path: Path) -> None:
    problem = with_points(
        tmp_path,
        '[[operating_points]]\nname = "idle"\nspeed = "800 rpm"\npressure_file = "idle.csv"\nbrake_torque = "0 N m"\n'
        '[[operating_points]]\nname = "full"\nspeed = "3000 rpm"\nbmep = "2 bar"\n',
    )
    for point, brake in zip(problem.points, (0.0, 2e5 * math.pi / 4.0 * 0.08**3 / (4.0 * math.pi)), strict=True):
        ((_, facts),) = cylinder_facts(problem.engine, point)
        assert facts.torque - facts.friction == pytest.approx(brake, abs=1e-9)
    assert evaluate(problem).loads[0].wrench.coefficients[0, 3].real == pytest.approx(0.0, abs=1e-9)
    idle, full = (cylinder_facts(problem.engine, point)[0][1] for point in problem.points)
    assert idle.imep == pytest.approx(0.3 * full.imep, rel=1e-3)
    lines = gas_lines(problem)
    assert lines[-2].endswith("; brake torque 0 N m")
    assert not any("One record counts" in line for line in lines)
    with pytest.raises(InputError, match=r"bmep: is more than the gas gives, whose recorded imep is"):
        with_points(tmp_path, '[[operating_points]]\nspeed = "800 rpm"\nbmep = "20 bar"\n')


def test_one_record_at_several_speeds_is_said(tmp_path: Path) -> None:
    points = "".join(f'[[operating_points]]\nspeed = "{n} rpm"\n' for n in (800, 3000))
    assert any("One record counts at 2 speeds" in line for line in gas_lines(with_points(tmp_path, points)))
    seiliger = '[[operating_points]]\nspeed = "800 rpm"\npressure_file = "none.csv"\n'
    with pytest.raises(InputError, match=r"operating_points\[1\].pressure_file.file = .none.csv."):
        with_points(tmp_path, seiliger)


def test_a_record_of_a_point_has_keys_of_its_own(tmp_path: Path) -> None:
    later = np.column_stack([DEGREES + 90.0, 1.0 + 0.3 * (P - 1.0), P])
    np.savetxt(tmp_path / "later.csv", later, "%.6f", ";", header="angle [deg];idle [bar];full [bar]", comments="")
    own = '{ file = "later.csv", pressure_column = 3, angle_zero = "-90 deg", peg = { at = -180, to = "2 bar" } }'
    point = '[[operating_points]]\nspeed = "800 rpm"\npressure_file = '
    problem = with_points(tmp_path, f'{point}"full.csv"\n{point}{own}\nname = "boosted"\n', 'angle_zero = "firing"')
    common, boosted = (cylinder_facts(problem.engine, point)[0][1] for point in problem.points)
    assert boosted.peak_angle == pytest.approx(common.peak_angle, abs=1e-3)
    rise = 2e5 - 1e5 * np.interp(-180.0, DEGREES, P)
    assert boosted.peak_pressure - common.peak_pressure == pytest.approx(rise, rel=0.02)
    for wrong, match in (
        ('{ file = "later.csv", angle_zero = "top" }', r"pressure_file.angle_zero = .top."),
        ('{ file = "later.csv", angel_zero = 0 }', r"pressure_file.angel_zero = 0: .*'angle_zero'"),
    ):
        with pytest.raises(InputError, match=match):
            with_points(tmp_path, f"{point}{wrong}\n")


def with_drag(folder: Path, motored: Array, is_motored: bool) -> Problem:
    """Return an engine with a recorded pressure of a fired and of a motored cylinder."""
    rows = np.column_stack([DEGREES, P, motored])
    np.savetxt(folder / "full.csv", rows, "%.6f", ";", header="angle [deg];fired [bar];drag [bar]", comments="")
    text = f'title = "Recorded"\n[engine]\nlayout = "inline"\ncycle = "four-stroke"\n{SINGLE}[gas]\nmodel = "trace"\n'
    text += 'file = "full.csv"\nangle_zero = "firing"\npressure_column = 2\nmotored_column = 3\n'
    path = folder / "motored.toml"
    path.write_text(text + '[[operating_points]]\nspeed = "800 rpm"\n' + "motored = true\n" * is_motored)
    return load(path)


def test_a_motored_point_takes_the_torque_of_its_compression(tmp_path: Path) -> None:
    compression = 1.0 + 20.0 * np.exp(-(np.radians(DEGREES) ** 2) / 0.1)
    problems = [with_drag(tmp_path, compression, is_motored) for is_motored in (True, False)]
    turning = [turning_torque(problem.engine, problem.points[0]) for problem in problems]
    assert turning[0] == turning[1] is not None
    assert turning[0].torque > 0.0


@pytest.mark.parametrize("is_motored", [True, False])
@pytest.mark.parametrize(("late", "is_doubted"), [(0.8, True), (-0.5, False)])
def test_a_motored_pressure_peaks_before_dead_centre(
    tmp_path: Path, late: float, is_doubted: bool, is_motored: bool
) -> None:
    since = np.radians(DEGREES - late)
    motored = 1.0 + 20.0 * np.exp(-((np.remainder(since + math.pi, 2.0 * math.pi) - math.pi) ** 2) / 0.1) * (
        np.abs(since) < 3.0
    )
    problem = with_drag(tmp_path, motored, is_motored)
    points = (*problem.points, replace(problem.points[0], name="second"))
    doubts = [str(doubt) for doubt in replace(problem, points=points).plausibility_warnings]
    assert len(doubts) == is_doubted, "one warning for all operating points"
    assert all(
        "motored pressure: has its peak 0.8 deg after dead centre; check angle_zero" in doubt for doubt in doubts
    )
