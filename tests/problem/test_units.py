"""Text with a unit in, SI inside, readable text out (C1)."""

from __future__ import annotations

import contextlib
import math
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import laufruhe.units
from laufruhe import units as module
from laufruhe.errors import InputError
from laufruhe.files.reader import load_tables
from laufruhe.units import COMMON, UnitError, dimension_name, dimension_of, example, parse, quantity_text
from problem_files import FOUR

GRAVITY = 9.80665
DIMENSIONS = ["m", "kg", "kg m", "kg m^2", "Pa", "N", "N m", "N/m", "rad", "rad/s", "m/s", ""]


class TestParse:
    @pytest.mark.parametrize(
        ("text", "unit", "value"),
        [
            ("120 mm", "m", 0.12),
            ("12cm", "m", 0.12),
            ("  0.12   m  ", "m", 0.12),
            ("5 in", "m", 0.127),
            ("1.25 kg", "kg", 1.25),
            ("750 g", "kg", 0.75),
            ("20 kg mm", "kg m", 0.02),
            ("20 kg*mm", "kg m", 0.02),
            ("4.2 kg cm^2", "kg m^2", 4.2e-4),
            ("4.2 kg cm**2", "kg m^2", 4.2e-4),
            ("80 bar", "Pa", 8e6),
            ("5.5 kp/cm^2", "Pa", 5.5e4 * GRAVITY),
            ("5.5 kp/cm2", "Pa", 5.5e4 * GRAVITY),
            ("27 kg m2", "kg m^2", 27.0),
            ("1 mmHg", "Pa", 133.322387415),
            ("1 at", "Pa", 1e4 * GRAVITY),
            ("1 atm", "Pa", 101_325.0),
            ("100 kp", "N", 100 * GRAVITY),
            ("1 kilopond", "N", GRAVITY),
            ("70 PS", "W", 70 * 75 * GRAVITY),
            ("300 N/mm", "N/m", 3e5),
            ("2500 rpm", "rad/s", 2500 * math.tau / 60),
            ("90 deg", "rad", math.pi / 2),
            ("90°", "rad", math.pi / 2),
            ("1/3 turn", "rad", math.tau / 3),
            ("-1/4 turn", "rad", -math.pi / 2),
            ("10 m/s", "m/s", 10.0),
            ("36 km/h", "m/s", 10.0),
            ("0.26", "", 0.26),
            ("26 %", "", 0.26),
            ("1e-3 m", "m", 1e-3),
            ("1E3 mm", "m", 1.0),
            (".5 m", "m", 0.5),
            ("5. m", "m", 5.0),
            ("+5 m", "m", 5.0),
            ("25 µm", "m", 25e-6),
            ("1 kp/cm²", "Pa", 1e4 * GRAVITY),
            ("1 N/mm²", "Pa", 1e6),
            *(
                (f"2500{unit}", "rad/s", 2500 * math.tau / 60)
                for unit in (" 1/min", "/min", " U/min", " RPM", " min^-1", " r/min")
            ),
            ("25 Hz", "rad/s", 25 * math.tau),
            ("3 oz in", "kg m", 3 * 0.45359237 / 16 * 0.0254),
            ("3 oz·in", "kg m", 3 * 0.45359237 / 16 * 0.0254),
            ("300 gcm", "kg m", 3e-3),
            ("300 gmm", "kg m", 3e-4),
            ("3 kg cm", "kg m", 0.03),
            ("3 g-mm", "kg m", 3e-6),
            ("3 lbm in", "kg m", 3 * 0.45359237 * 0.0254),
            ("3 lb-in", "N m", 3 * 0.45359237 * GRAVITY * 0.0254),
            ("3 mkp", "N m", 3 * GRAVITY),
            ("3 lbs", "N", 3 * 0.45359237 * GRAVITY),
            ("3 kg/cm2", "Pa", 3e4 * GRAVITY),
            ("3 rev/s", "rad/s", 6 * math.pi),
            ("30 min⁻¹", "rad/s", math.pi),
            ("100 lb ft", "N m", 100 * 0.45359237 * GRAVITY * 0.3048),
            ("100 ft-lb", "N m", 100 * 0.45359237 * GRAVITY * 0.3048),
            ("100 psi", "Pa", 100 * 0.45359237 * GRAVITY / 0.0254**2),
            ("100 PSI", "Pa", 100 * 0.45359237 * GRAVITY / 0.0254**2),
            ("100 kPa", "Pa", 1e5),
            ("10 °KW", "rad", math.radians(10)),
            ("90 Grad", "rad", math.pi / 2),
            *(
                (text, "m", 0.0254 * 53 / 16)
                for text in ("3 5/16 Zoll", '3.3125"', '3 5/16"', "3.3125″", "+3  5/16 in")
            ),
            ("-1 1/2 in", "m", -0.0381),
            ("3 Pfund", "kg", 1.5),
            ("10:1", "", 10.0),
            ("1 : 4", "", 0.25),
            ("2 HP", "W", 2 * 550 * 0.3048 * 0.45359237 * GRAVITY),
        ],
    )
    def test_units_of_the_field(self, text: str, unit: str, value: float) -> None:
        assert parse(text, unit) == pytest.approx(value, rel=1e-13, abs=0.0)

    @pytest.mark.parametrize(
        "unit",
        ["m**9**9**9**9", "m*9**9**9", "m*m**-9**9**9", "m^99999999999", "m^1e9", "m^-1^-1", "m m" + " m" * 11, "m/0",
         "m*1e400", "m//m", "m%**m", "m^2^-1", "m**10", "m²⁹", "m2⁹⁹⁹⁹⁹⁹", "m²³**9", "m - m", "m" + "*m" * 48],
    )  # fmt: skip
    def test_no_unit_is_computed(self, unit: str, monkeypatch: pytest.MonkeyPatch) -> None:
        """The registry would evaluate any expression: these do not end, or count as a unit by chance."""
        monkeypatch.setattr(laufruhe.units, "_registry", None)
        with pytest.raises(UnitError, match=re.escape(f"unit '{unit}' is not known")):
            parse(f"1 {unit}", "m")

    @pytest.mark.parametrize(
        ("text", "value"),
        [("1 mm^2/m", 1e-6), ("1 mm²/m", 1e-6), ("1 m ** 2 * mm ^ -1", 1e3), ("2 m^2.0 mm^-1", 2e3),
         ("1 m*m*m*m/m/m/m", 1.0),          ("1 m^9 / km^8", 1e-24), ("1 m" + " m/m" * 5, 1.0)],
    )  # fmt: skip
    def test_products_and_powers(self, text: str, value: float) -> None:
        assert parse(text, "m") == pytest.approx(value, rel=1e-12)

    @pytest.mark.parametrize(
        ("text", "unit", "rule"),
        [
            ("120", "m", "has no unit, a length needs one"),
            ("6 barg", "N", "unit 'barg' is not known"),
            ("120 kg", "m", "'kg' is not a unit of a length"),
            ("120 mmm", "m", "unit 'mmm' is not known"),
            ("mm", "m", "is not a number with a unit"),
            ("", "m", "is not a number with a unit"),
            ("nan mm", "m", "is not a number with a unit"),
            ("inf mm", "m", "is not a number with a unit"),
            ("1e999 mm", "m", "is not finite"),
            ("1/0 mm", "m", "divides by zero"),
            ("1.5.2 mm", "m", "is not a number with a unit"),
            ("0x10 mm", "m", "unit 'x10 mm' is not known"),
            ("5 mm", "", "'mm' is not a unit of a plain number"),
            ("20 degC", "m", "'degC' is not a unit of a length"),
            ("20 kg", "kg m", "'kg' is not a unit of an unbalance"),
            ("5 N m", "Pa", "'N m' is not a unit of a pressure"),
            ("x", "", "is not a number"),
            ("20 degC", "K", "unit 'degC' is not known"),
            pytest.param("1/" + "9" * 400 + " mm", "m", "is", id="a divisor beyond floats"),
            pytest.param("1/" + "9" * 5000 + " mm", "m", "is", id="a divisor beyond integers"),
        ],
    )
    def test_refusals_name_the_rule_and_an_example(self, text: str, unit: str, rule: str) -> None:
        with pytest.raises(UnitError) as caught:
            parse(text, unit)
        said, _, remedy = str(caught.value).partition("; ")
        assert said.startswith(rule)
        assert remedy.startswith(f'write for example "{example(unit)}"' if unit else "write for example 0.26")

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("6 barg", 'is a gauge pressure, above that of the air; write "7.013 bar", or "6 bar" for a mean pressure'),
            (
                "6 bar(g)",
                'is a gauge pressure, above that of the air; write "7.013 bar", or "6 bar" for a mean pressure',
            ),
            ("5 atü", 'is a gauge pressure, above that of the air; write "5.917 bar", or "5 at" for a mean pressure'),
            (
                "60 psi gauge",
                'is a gauge pressure, above that of the air; write "5.15 bar", or "60 psi" for a mean pressure',
            ),
            ("2 bar (abs)", 'has a mark, and pressures are absolute without one; write "2 bar"'),
        ],
    )
    def test_marks_of_gauges(self, text: str, said: str) -> None:
        with pytest.raises(UnitError) as caught:
            parse(text, "Pa")
        assert str(caught.value) == said

    @pytest.mark.parametrize(
        ("tables", "is_mean"),
        [
            ({"operating_points": [{"speed": "900 rpm", "imep": "100 psig"}]}, True),
            ({"friction": {"fmep": "100 psig"}}, True),
            ({"operating_points": [{"speed": "900 rpm", "peak_pressure": "100 psig"}]}, False),
        ],
    )
    def test_marks_of_gauges_suggest_a_mean_pressure_where_the_key_is_one(
        self, tables: dict[str, Any], is_mean: bool
    ) -> None:
        with pytest.raises(InputError) as caught:
            load_tables({**tomllib.loads(FOUR), **tables}, Path("f"))
        mean = '"100 psig": is a gauge pressure, and a mean effective pressure counts from no other; write "100 psi"'
        absolute = '"100 psig": is a gauge pressure, above that of the air; write "7.908 bar"'
        assert (mean if is_mean else absolute) in str(caught.value)

    def test_plain_numbers_are_shown_as_a_file_has_them(self) -> None:
        """Without quotes, and without a unit that they have not."""
        for text, said in (("x", "is not a number; write for example 0.26"), ("0,1", "write 0.1")):
            with pytest.raises(UnitError) as caught:
                parse(text, "")
            assert str(caught.value).endswith(said)

    def test_an_unknown_unit_names_common_ones(self) -> None:
        with pytest.raises(UnitError, match=r'"120 mm", in m, mm, cm \.\.\.$'):
            parse("120 x", "m")

    def test_a_decimal_comma_is_explained(self) -> None:
        with pytest.raises(UnitError, match=r'has a comma, and decimals follow a point; write "12\.5 mm"'):
            parse("12,5 mm", "m")
        with pytest.raises(UnitError, match=r'decimals follow a point; write for example "12\.5 mm"'):
            parse("12,5", "m")
        for text, said in (("6,000 rpm", 'write "6000 rpm" or "6.000 rpm"'), ("0,125 rpm", 'write "0.125 rpm"')):
            with pytest.raises(UnitError, match=said):
                parse(text, "rad/s")

    @pytest.mark.parametrize("text", ["50 Hz", "3000 min^-1", "50 s^-1", "3000/min"])
    def test_a_frequency_is_no_angular_speed(self, text: str) -> None:
        """Turns a second are either read as turns or refused, never taken for radians."""
        with contextlib.suppress(UnitError):
            assert parse(text, "rad/s") == pytest.approx(50 * math.tau)

    @pytest.mark.parametrize("text", ["50 s^-1", "50 1/s"])
    def test_a_number_a_second_is_refused(self, text: str) -> None:
        """It may be turns or radians."""
        with pytest.raises(UnitError):
            parse(text, "rad/s")

    def test_spellings_have_their_own_dimension_only(self) -> None:
        """A torque in lb ft is no unbalance of so many pounds, and rpm are no frequency of mounts."""
        assert parse("1 lb ft", "kg m") == pytest.approx(0.45359237 * 0.3048)
        for text, unit in (
            ("1500 1/min", "Hz"),
            ("1500 U/min", "Hz"),
            ("5 1/min", "s"),
            ("1 gcm", "N m"),
            ("3 psi", "N"),
        ):
            with pytest.raises(UnitError):
                parse(text, unit)

    def test_newton_metres_in_one_word(self) -> None:
        """Check "Nm", which a registry may take for a count of yarn."""
        assert parse("120 Nm", "N m") == 120.0

    @pytest.mark.parametrize("expected", COMMON)
    def test_common_units_are_those_of_the_registry(self, expected: str, monkeypatch: pytest.MonkeyPatch) -> None:
        """Compare all common units with the registry to the last bit, refused units included."""
        common = dict(COMMON)
        monkeypatch.setattr(module, "COMMON", {})
        for unit in {unit for row in common.values() for unit in row}:
            try:
                known = module._factor.__wrapped__(unit, expected)
            except UnitError:
                known = None
            assert common[expected].get(unit) == known, unit

    def test_the_dimension_of_a_common_unit_needs_no_registry(self, monkeypatch: pytest.MonkeyPatch) -> None:
        dimensions = {unit: dimension_of(f"1 {unit}") for row in COMMON.values() for unit in row}
        assert all(unit in COMMON[expected] for unit, expected in dimensions.items())
        monkeypatch.setattr(module, "_registry", None)
        module._factor.cache_clear()
        assert dimensions == {unit: dimension_of(f"1 {unit}") for unit in dimensions}

    @given(st.floats(-1e300, 1e300), st.sampled_from(["m", "kg", "Pa", "N m"]))
    def test_every_float_in_its_own_unit(self, value: float, unit: str) -> None:
        """SI numbers come back to the last bit."""
        assert parse(f"{value!r} {unit}", unit) == value

    @pytest.mark.parametrize("unit", DIMENSIONS)
    def test_examples_are_right(self, unit: str) -> None:
        """Check that the example of every unit can be read."""
        assert math.isfinite(parse(example(unit), unit))
        assert dimension_name(unit)


class TestShown:
    @pytest.mark.parametrize(
        ("value", "unit", "text"),
        [
            (0.12, "m", "120 mm"),
            (math.pi / 2, "rad", "90 deg"),
            (2500 * math.pi / 30, "rad/s", "2500 rpm"),
            (1.25, "kg", "1.25 kg"),
            (0.123456, "", "0.1235"),
            (1234.56, "N", "1235 N"),
            (0.0, "kg", "0 kg"),
        ],
    )
    def test_as_a_report_prints_it(self, value: float, unit: str, text: str) -> None:
        assert quantity_text(value, unit) == text

    @given(st.floats(-1e6, 1e6, allow_subnormal=False), st.sampled_from(["m", "rad", "rad/s", "kg", "N m", ""]))
    def test_a_printed_quantity_is_read_back(self, value: float, unit: str) -> None:
        assert parse(quantity_text(value, unit, 17), unit) == pytest.approx(value, rel=1e-14, abs=0.0)
