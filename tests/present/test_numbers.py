"""Numbers and units as every table and picture words them."""

from __future__ import annotations

import pytest

from laufruhe.present.numbers import aligned, fixed, number, percent, trimmed, with_unit


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (383.42917, "383.4"), (0.00991682, "0.009917"), (1234567.0, "1234567"), (999.96, "1000"),
     (-12.3456, "-12.35"), (1.5e-9, "1.500e-09"), (float("nan"), "-"), (float("inf"), "-"), (2e8, "2.000e+08")],
)  # fmt: skip
def test_numbers(value: float, text: str) -> None:
    assert number(value) == text


def test_roundings_beside_large_numbers_are_zero() -> None:
    assert number(1e-11, scale=500.0) == "0"
    assert number(1e-3, scale=500.0) == "0.001000"


def test_units_are_readable() -> None:
    assert trimmed(3.0) == "3"
    assert with_unit(3.141592653589793, "rad") == "180 deg"
    assert with_unit(0.3125, "m") == "312.5 mm"
    assert with_unit(0.5, "") == "0.5"


def test_columns_share_their_decimals() -> None:
    assert [aligned(value, 5439.4) for value in (5439.4, 95.17, 1.862)] == ["5439.4", "95.2", "1.9"]


def test_nothing_is_printed_with_a_sign_or_decimals() -> None:
    assert [fixed(value, 2) for value in (-1e-9, 0.0, 0.005001, -2.0)] == ["0", "0", "0.01", "-2.00"]
    assert [percent(share) for share in (-1e-9, 0.0, -0.25)] == ["0 %", "0 %", "-25.0 %"]
    assert aligned(1e-9, 5439.4) == "0"
