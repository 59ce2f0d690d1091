"""Weightings against the printed factors of the standards, which name the frequencies that these belong to."""

from __future__ import annotations

import numpy as np
import pytest

from laufruhe.extensions.receivers.weightings import WEIGHTINGS

# kind of frequencies, index n of the first band of a third of an octave at 10^(n/10) Hz, factors times 1000
TABLES = {
    # ISO 2631-1:1997, table 3, at nominal frequencies from 0.5 Hz
    "Wk": ("nominal", -3, [
        418, 459, 477, 482, 484, 494, 531, 631, 804, 967, 1039, 1054, 1036, 988, 902, 768, 636, 513, 405, 314, 246, 186,
        132,
    ]),
    # the factor 212 at 10 Hz is a misprint of 1997; later tables print 202
    "Wd": ("nominal", 0, [
        1011, 1008, 968, 890, 776, 642, 512, 409, 323, 253, 202, 161, 125, 100, 80.0, 63.2, 49.4, 38.8, 29.5, 21.1,
    ]),
    # ISO 5349-1, table A.2, at exact frequencies from 4 Hz
    "Wh": ("exact", 6, [
        375, 545, 727, 873, 951, 958, 896, 782, 647, 519, 411, 324, 256, 202, 160, 127, 101, 79.9, 63.4, 50.3, 39.8,
        31.4, 24.5, 18.6, 13.5, 8.94, 5.36, 2.95,
    ]),
}  # fmt: skip
# IEC 61672-1, table 3, in dB from 10 Hz to 20 kHz
A_WEIGHTING = [
    -70.4, -63.4, -56.7, -50.5, -44.7, -39.4, -34.6, -30.2, -26.2, -22.5, -19.1, -16.1, -13.4, -10.9, -8.6, -6.6, -4.8,
    -3.2, -1.9, -0.8, 0.0, 0.6, 1.0, 1.2, 1.3, 1.2, 1.0, 0.5, -0.1, -1.1, -2.5, -4.3, -6.6, -9.3,
]  # fmt: skip
# nominal frequencies of a decade, in Hz
DECADE = [1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0]


def band(index: int, kind: str) -> float:
    """Return the frequency of a band: 10^(n/10) Hz, or its nominal value."""
    decade, place = divmod(index, len(DECADE))
    return 10.0 ** (index / 10.0) if kind == "exact" else DECADE[place] * 10.0**decade


@pytest.mark.parametrize("name", TABLES)
def test_factors_are_the_printed_ones(name: str) -> None:
    kind, first, printed = TABLES[name]
    factors = [abs(WEIGHTINGS[name].at(np.array(band(first + k, kind)))) for k in range(len(printed))]
    # printed to three digits, each of a formula whose parameters are rounded
    assert factors == pytest.approx([1e-3 * one for one in printed], rel=3.5e-3)


def test_sound_has_the_printed_decibels() -> None:
    levels = [20.0 * np.log10(abs(WEIGHTINGS["A"].at(np.array(band(10 + k, "exact"))))) for k in range(34)]
    assert [round(float(level), 1) + 0.0 for level in levels] == pytest.approx(A_WEIGHTING, abs=1e-9)


@pytest.mark.parametrize("name", WEIGHTINGS)
def test_a_weighting_is_causal(name: str) -> None:
    """A real filter has conjugate factors at negative frequencies, and its poles decay."""
    at = WEIGHTINGS[name].at(np.array([-3.0, 3.0]))
    assert at[0] == pytest.approx(at[1].conjugate(), rel=1e-12)
    for _, denominator in WEIGHTINGS[name].sections:
        assert np.all(np.roots(denominator[::-1]).real < 0.0)
