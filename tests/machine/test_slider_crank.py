"""The mechanism: a rod as two masses, strokes, and cranks that cannot turn."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from laufruhe.errors import ModelError
from laufruhe.machine import Rod, SliderCrank
from laufruhe.machine.drives import DRIVES, Sizes

POSITIVE = st.floats(1e-3, 10.0)


def radius_for_stroke(
    stroke: float, offset: float, *, rod_length: float | None = None, rod_ratio: float | None = None
) -> float:
    return DRIVES["slider-crank"].radius(Sizes(stroke, offset, rod_length, rod_ratio, {}))


class TestRod:
    @given(POSITIVE, POSITIVE, st.floats(0.0, 1.0), POSITIVE)
    def test_two_masses_keep_mass_and_centre_of_gravity(
        self, length: float, mass: float, share: float, inertia: float
    ) -> None:
        """Check eqs. (9), (10) for mass and centre of gravity, and the deficit of the inertia."""
        rod = Rod(length, mass, share * length, inertia)
        pin, crank = rod.reciprocating_mass, rod.rotating_mass
        assert pin + crank == pytest.approx(mass)
        assert pin * length == pytest.approx(mass * rod.centre_of_gravity)
        s1, s2 = length - rod.centre_of_gravity, rod.centre_of_gravity
        expected = inertia - pin * s1**2 - crank * s2**2
        assert rod.inertia_deficit == pytest.approx(expected, abs=1e-12 * (inertia + mass * length**2))

    def test_masses_at_the_pins_have_no_deficit(self) -> None:
        """A dumbbell is two masses."""
        rod = Rod(0.2, 3.0, 0.2 / 3, 2.0 * (0.2 / 3) ** 2 + 1.0 * (0.4 / 3) ** 2)
        assert (rod.reciprocating_mass, rod.rotating_mass) == pytest.approx((1.0, 2.0))
        assert rod.inertia_deficit == pytest.approx(0.0, abs=1e-16)


def stroke_by_search(part: SliderCrank) -> float:
    """Return the stroke between dead centres, where crank and rod are in line, on the triangle itself."""
    r, l, e = part.crank_radius, part.rod_length, part.offset
    best = math.asin(e / (l + r)), math.pi + math.asin(e / (l - r))
    alpha = np.concatenate([np.linspace(0, math.tau, 721), best])
    s = r * np.cos(alpha) + np.sqrt(l**2 - (r * np.sin(alpha) - e) ** 2)
    return float(s.max() - s.min())


class TestStroke:
    @given(st.floats(0.01, 0.5), st.floats(0.01, 0.7), st.floats(-0.9, 0.9))
    def test_between_the_dead_centres(self, radius: float, ratio: float, share: float) -> None:
        length = radius / ratio
        part = SliderCrank("c", 0.0, radius, length, 1.0, offset=share * (length - radius))
        assert part.stroke == pytest.approx(stroke_by_search(part), rel=1e-9)
        assert part.stroke >= 2.0 * radius * (1.0 - 1e-15)

    @given(st.floats(0.01, 0.5), st.floats(0.0, 0.7), st.floats(-0.9, 0.9), st.booleans())
    def test_radius_for_stroke_is_its_inverse(self, radius: float, ratio: float, share: float, by_ratio: bool) -> None:
        """Compare the crank radius with that from its own stroke, with the rod given by length or by ratio."""
        length = radius / ratio if ratio > 1e-3 else math.inf
        offset = share * (length - radius) if math.isfinite(length) else 0.0
        part = SliderCrank("c", 0.0, radius, length, 1.0, offset=offset)
        if by_ratio:
            # a long rod with a large offset has the stroke of a second, smaller crank too
            result = radius_for_stroke(part.stroke, offset, rod_ratio=part.rod_ratio)
            other = SliderCrank("c", 0.0, result, result / part.rod_ratio if part.rod_ratio else math.inf, 1.0)
            assume(abs(offset) < other.rod_length - result)
            again = SliderCrank("c", 0.0, result, other.rod_length, 1.0, offset=offset)
            assert again.stroke == pytest.approx(part.stroke, rel=1e-9)
        else:
            result = radius_for_stroke(part.stroke, offset, rod_length=length)
            assert result == pytest.approx(radius, rel=1e-9)

    @pytest.mark.parametrize("rod", [{"rod_length": 0.2}, {"rod_ratio": 0.26}, {"rod_ratio": 0.0}, {}])
    def test_without_offset_half_the_stroke_exactly(self, rod: dict[str, float]) -> None:
        assert radius_for_stroke(0.12, 0.0, **rod) == 0.06

    @pytest.mark.parametrize(
        ("stroke", "offset", "rod"),
        [
            (0.12, 0.3, {"rod_length": 0.2}),
            (0.5, 0.01, {"rod_length": 0.2}),
            (0.12, 0.5, {"rod_ratio": 0.3}),
        ],
    )
    def test_strokes_that_no_crank_makes(self, stroke: float, offset: float, rod: dict[str, float]) -> None:
        with pytest.raises(ModelError, match=r"no crank makes a stroke of \d+ mm with an offset of \d+ mm on this rod"):
            radius_for_stroke(stroke, offset, **rod)


class TestRefusals:
    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"crank_radius": 0.0}, "crank radius 0.0 m must be positive"),
            ({"crank_radius": math.nan}, "crank radius nan m must be positive"),
            ({"rod_length": -0.2}, "rod length -0.2 m must be positive"),
            ({"rod_length": math.nan}, "rod length nan m must be positive"),
            ({"reciprocating_mass": -1.0}, "masses must not be negative"),
            ({"rotating_mass": -1e-9}, "masses must not be negative"),
            (
                {"rod_length": math.inf, "offset": 0.01},
                "an offset has no effect with an infinite rod",
            ),
            ({"rod_length": 0.06}, r"the crank cannot turn, \(r \+ \|e\|\) / l = 1 must be under 1"),
            ({"offset": 0.14}, r"the crank cannot turn, \(r \+ \|e\|\) / l = 1 must be under 1"),
            ({"offset": -0.15}, r"the crank cannot turn, .* = 1\.05"),
        ],
    )
    def test_message(self, change: dict[str, float], message: str) -> None:
        values = {"crank_radius": 0.06, "rod_length": 0.2, "reciprocating_mass": 1.0} | change
        with pytest.raises(ModelError, match=f"cylinder 7: {message}"):
            SliderCrank("cylinder 7", 0.0, **values)

    def test_gas_needs_a_bore(self) -> None:
        with pytest.raises(ModelError, match="c: gas forces need a bore"):
            _ = SliderCrank("c", 0.0, 0.06, 0.2, 1.0).piston_area
        assert SliderCrank("c", 0.0, 0.06, 0.2, 1.0, bore=0.1).piston_area == pytest.approx(math.pi * 0.0025)

    def test_almost_locked_cranks_turn(self) -> None:
        """Check ratios up to the last float below one."""
        part = SliderCrank("c", 0.0, 0.06, 0.06 / math.nextafter(1.0, 0.0), 1.0)
        assert part.rod_ratio < 1.0
