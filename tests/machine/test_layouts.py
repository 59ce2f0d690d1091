"""Layouts: who stands where, on which throw, and when it fires."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import laufruhe
from laufruhe.errors import ModelError
from laufruhe.machine import CRANKSHAFT, Cycle, Engine, Role, Shaft
from laufruhe.machine.layouts import (
    Layout,
    Throw,
    angles_in_order,
    boxer,
    build,
    even_throws,
    facing_pistons,
    inline,
    stations,
    throw_rotors,
    vee,
)
from laufruhe.physics.shaking_loads import reciprocating_loads
from mechanisms import mechanism_of

FOUR, TWO = Cycle.FOUR_STROKE, Cycle.TWO_STROKE


def firing_angles(
    cycle: Cycle, layout: Layout, throws: Sequence[float], order: Sequence[int], intervals: Sequence[float] = ()
) -> tuple[float, ...]:
    centres = [layout.dead_centre(throws, k) for k in range(len(layout.positions))]
    return angles_in_order(cycle, centres, order, intervals)


MECHANISM = mechanism_of(0.06, 0.06 / 0.26, 1.25, rotating_mass=0.8, rod_rotating_mass=0.5, bore=0.1)


def degrees(angles: tuple[float, ...], whole: float = 360.0) -> list[float]:
    """Return the angles within one turn, with a whole turn as zero [deg]."""
    return [round(math.degrees(angle) % whole, 9) % whole for angle in angles]


def engine(cycle: Cycle, layout: Layout, throws: tuple[float, ...], order: list[int] | None = None) -> Engine:
    cylinders, parts = build(cycle, layout, MECHANISM, throws, order)
    return Engine(layout.name, cycle, cylinders, throw_rotors(parts))


class TestPlaces:
    @pytest.mark.parametrize(
        ("layout", "own", "maximum"),
        [
            ("inline", {}, 1),
            ("vee", {"bank_angle": 90}, 2),
            ("boxer", {"bank_stagger": "40 mm", "firing_order": [1, 2]}, 2),
        ],
    )
    def test_neighbours_alone_need_a_spacing(self, layout: str, own: dict[str, object], maximum: int) -> None:
        """Cylinders of one place along the crank have no distance to a next place."""
        shared = {"cycle": "four-stroke", "stroke": "90 mm", "rod_ratio": 0.3, "reciprocating_mass": "0.5 kg"}
        problem_keys = {"title": "t", "operating_points": [{"speed": "3000 rpm"}]}
        engine = {"layout": layout, **own, **shared, "cylinders": maximum}
        problem = laufruhe.load({**problem_keys, "engine": engine}).engine
        away = laufruhe.load({**problem_keys, "engine": {**engine, "cylinder_spacing": "1 m"}}).engine
        assert [part.x for part in problem.cylinders] == [part.x for part in away.cylinders]
        with pytest.raises(laufruhe.InputError, match="cylinder_spacing: is missing"):
            laufruhe.load({**problem_keys, "engine": {**engine, "cylinders": 4, "firing_order": [1, 3, 4, 2]}})

    @given(st.integers(1, 48), st.floats(1e-3, 10.0))
    def test_stations(self, count: int, spacing: float) -> None:
        """Check the distance of stations from the front backwards, with the middle exactly at x = 0 (C2)."""
        places = stations(count, spacing)
        assert len(places) == count
        assert [-x for x in reversed(places)] == list(places)
        np.testing.assert_allclose(-np.diff(places), spacing, rtol=1e-12)

    def test_inline(self) -> None:
        layout = inline(4, 0.1)
        assert layout.positions == pytest.approx((0.15, 0.05, -0.05, -0.15))
        assert layout.throw_positions == layout.positions
        assert layout.pins == (0, 1, 2, 3)
        assert layout.banks == layout.pin_offsets == (0.0,) * 4

    def test_vee(self) -> None:
        """The left bank has the first numbers, leans to +y and stands forward; a throw serves one of each bank."""
        layout = vee(6, 0.1, math.radians(90), math.radians(30), 0.02)
        assert layout.throw_positions == pytest.approx((0.1, 0.0, -0.1))
        assert layout.positions == pytest.approx((0.11, 0.01, -0.09, 0.09, -0.01, -0.11))
        assert np.degrees(layout.banks) == pytest.approx([45.0] * 3 + [-45.0] * 3)
        assert layout.pins == (0, 1, 2, 0, 1, 2)
        assert np.degrees(layout.pin_offsets) == pytest.approx([-15.0] * 3 + [15.0] * 3)

    def test_boxer(self) -> None:
        """Check that every piston has its own throw, and that opposed ones are the stagger apart."""
        layout = boxer(4, 0.12, 0.05)
        assert layout.positions == pytest.approx((0.085, -0.035, 0.035, -0.085))
        assert layout.throw_positions == layout.positions
        assert layout.pins == (0, 1, 2, 3)
        assert np.degrees(layout.banks) == pytest.approx([90, 90, -90, -90])

    def test_opposed_pistons_in_step_balance(self) -> None:
        """A flat twin with throws half a turn apart has no shaking force at all."""
        flat = engine(FOUR, boxer(2, 0.12, 0.05), (math.pi / 2, -math.pi / 2), [1, 2])
        loads = reciprocating_loads(flat, 300.0)
        assert (loads.coefficients[:, :3] == 0.0).all()
        assert abs(loads.at(1)[5]) == pytest.approx(1.25 * 0.06 * 300.0**2 * 0.05)

    @pytest.mark.parametrize("count", [0, 1, 3, 5])
    def test_banks_need_pairs(self, count: int) -> None:
        for build_layout, name in ((lambda n: vee(n, 0.1, 1.0), "vee"), (lambda n: boxer(n, 0.1, 0.05), "boxer")):
            with pytest.raises(ModelError, match=f"is no multiple of the 2 banks of layout '{name}'"):
                build_layout(count)


class TestOpposedPistons:
    """Two pistons in one cylinder, the upper crank geared to the lower one."""

    @staticmethod
    def of(ratio: float, lead: float = 0.0, count: int = 3) -> Engine:
        throws = even_throws(TWO, inline(count, 0.1), list(range(1, count + 1)))
        lower, _ = build(TWO, inline(count, 0.1), MECHANISM, throws)
        upper = facing_pistons(lower, Shaft("upper", ratio, 0.0, 0.6), lead)
        return Engine("opposed", TWO, (*lower, *upper))

    @pytest.mark.parametrize("ratio", [1.0, -1.0])
    def test_pistons_mirror_each_other(self, ratio: float) -> None:
        """Whatever the cranks' sense, their inertia is no force and no couple across the engine."""
        for part in (loads := reciprocating_loads(self.of(ratio), 300.0).coefficients)[:, [0, 1, 2, 4, 5]]:
            assert np.abs(part).max() <= 1e-12 * 1.25 * 0.06 * 300.0**2
        assert np.isfinite(loads).all()

    @pytest.mark.parametrize("ratio", [1.0, -1.0])
    def test_the_upper_crank_leads(self, ratio: float) -> None:
        """Its pistons come to their inner dead centre by the lead sooner."""
        engine = self.of(ratio, math.radians(12.0))
        for low, high in zip(engine.slider_cranks[:3], engine.slider_cranks[3:], strict=True):
            assert math.degrees(low.firing_angle - high.firing_angle) == pytest.approx(12.0)

    def test_two_pistons_are_one_cylinder(self) -> None:
        engine = self.of(-1.0)
        assert engine.cylinders == engine.slider_cranks[:3]
        assert np.degrees(engine.firing_intervals) == pytest.approx([120.0] * 3)

    def test_pistons_back_to_back_share_no_chamber(self) -> None:
        """Check a boxer, and cranks with pistons that move away from each other."""
        boxed, _ = build(FOUR, boxer(2, 0.1, 0.0), MECHANISM, (math.pi / 2, -math.pi / 2))
        assert not boxed[0].faces(boxed[1])
        low, high = (self.of(-1.0).slider_cranks[k] for k in (0, 3))
        assert low.faces(high)
        assert high.faces(low)
        assert not replace(low, shaft=high.shaft).faces(replace(high, shaft=CRANKSHAFT))
        assert not low.faces(replace(high, shaft=replace(high.shaft, y=0.05)))

    @pytest.mark.parametrize(("ratio", "height"), [(2.0, 0.6), (-1.0, -0.6)])
    def test_cranks_that_do_not_fit(self, ratio: float, height: float) -> None:
        lower = self.of(1.0).slider_cranks[:3]
        with pytest.raises(ModelError, match="opposed-piston"):
            facing_pistons(lower, Shaft("upper", ratio, 0.0, height))


class TestFiring:
    @pytest.mark.parametrize(
        ("cycle", "layout", "throws", "order", "fires"),
        [
            (FOUR, inline(4, 0.1), (0, 180, 180, 0), [1, 3, 4, 2], [0, 540, 180, 360]),
            (FOUR, inline(4, 0.1), (0, 180, 180, 0), [1, 2, 4, 3], [0, 180, 540, 360]),
            (FOUR, inline(2, 0.1), (0, 180), [1, 2], [0, 180]),
            (FOUR, inline(2, 0.1), (0, 0), [1, 2], [0, 360]),
            (FOUR, inline(3, 0.1), (0, 240, 120), [1, 3, 2], [0, 480, 240]),
            (TWO, inline(2, 0.1), (0, 180), [1, 2], [0, 180]),
            (FOUR, inline(1, 0.1), (0,), [1], [0]),
            (FOUR, vee(2, 0.1, math.radians(90)), (45,), [1, 2], [0, 270]),
            (FOUR, boxer(2, 0.1, 0.05), (90, -90), [1, 2], [0, 360]),
        ],
    )
    def test_known_engines(
        self, cycle: Cycle, layout: Layout, throws: tuple[int, ...], order: list[int], fires: list[int]
    ) -> None:
        """Compare firing angles of every cylinder, counted from cylinder 1."""
        result = firing_angles(cycle, layout, tuple(map(math.radians, throws)), order)
        assert np.degrees(result) == pytest.approx(fires, abs=1e-9)

    def test_given_intervals_are_those_of_the_dead_centres(self) -> None:
        """Check three throws that fire at 0, 200 and 450 deg in any order; another interval is refused."""
        for order in ([1, 2, 3], [1, 3, 2]):
            fires = dict(zip(order, (0.0, 200.0, 450.0), strict=True))
            throws = tuple(math.radians(-fires[k]) for k in (1, 2, 3))
            intervals = [math.radians(x) for x in (200.0, 250.0, 270.0)]
            result = firing_angles(FOUR, inline(3, 0.1), throws, order, intervals)
            assert np.degrees(result) == pytest.approx([fires[k] for k in (1, 2, 3)], abs=1e-9)
            with pytest.raises(ModelError, match=f"cylinder {order[1]} would fire 190 deg after cylinder 1"):
                firing_angles(FOUR, inline(3, 0.1), throws, order, [math.radians(x) for x in (190.0, 260.0, 270.0)])

    def test_four_stroke_four_cylinder_has_four_orders(self) -> None:
        """Check that two orders of the flat crank 0-180-180-0 fire evenly among those that begin with 1."""
        even = []
        for rest in permutations((2, 3, 4)):
            try:
                flat = engine(FOUR, inline(4, 0.1), (0.0, math.pi, math.pi, 0.0), [1, *rest])
            except ModelError:
                continue
            if np.allclose(flat.firing_intervals, math.pi):
                even.append(rest)
        assert even == [(2, 4, 3), (3, 4, 2)]

    @pytest.mark.parametrize(
        ("cycle", "throws", "order"),
        [
            (FOUR, (0, 180, 180, 0), [1, 2, 3, 4]),
            (TWO, (0, 0), [1, 2]),
            (TWO, (0, 120, 240), [1, 2, 3]),
        ],
    )
    def test_impossible_orders(self, cycle: Cycle, throws: tuple[int, ...], order: list[int]) -> None:
        """Throws that would need another turn are refused, with the cylinder and the order."""
        with pytest.raises(ModelError, match=r"cannot fire in the order .* within \d turns?: cylinder \d"):
            firing_angles(cycle, inline(len(throws), 0.1), tuple(map(math.radians, throws)), order)

    @given(st.integers(1, 10), st.sampled_from(Cycle), st.randoms(use_true_random=False))
    def test_even_throws_fire_evenly(self, count: int, cycle: Cycle, random: object) -> None:
        """Check any order of any in-line engine, cylinder 1 at phi = 0, the others a step apart."""
        order = list(range(2, count + 1))
        random.shuffle(order)  # type: ignore[attr-defined]
        order = [1, *order]
        layout = inline(count, 0.1)
        throws = even_throws(cycle, layout, order)
        whole = engine(cycle, layout, throws, order)
        step = cycle.angle / count
        fires = [whole.slider_cranks[number - 1].firing_angle for number in order]
        np.testing.assert_allclose(fires, step * np.arange(count), atol=1e-12)
        assert whole.firing_intervals == pytest.approx((step,) * count)

    @given(st.integers(1, 4), st.floats(0.1, 3.0))
    def test_split_pins_make_any_vee_fire_evenly(self, throws: int, bank: float) -> None:
        """Pins split by the firing interval less the bank angle; the angle need not be a part of a turn (C5)."""
        count = 2 * throws
        step = FOUR.angle / count
        pairs = [(k + 1, throws + k + 1) for k in range(throws)]
        order = [number for pair in pairs for number in pair]
        layout = vee(count, 0.1, bank, -bank - step)
        even = even_throws(FOUR, layout, order)
        fires = firing_angles(FOUR, layout, even, order)
        np.testing.assert_allclose([fires[n - 1] for n in order], step * np.arange(count), atol=1e-9)

    @given(st.floats(0.1, 3.0), st.floats(-0.5, 0.5))
    def test_cylinder_one_fires_at_zero(self, bank: float, split: float) -> None:
        """phi = 0 is the firing dead centre of cylinder 1 (C5), also where bank angles are no parts of a turn."""
        layout = vee(2, 0.1, bank, split)
        fires = firing_angles(FOUR, layout, (layout.banks[0] - layout.pin_offsets[0],), [1, 2])
        assert fires[0] == pytest.approx(0.0, abs=1e-9)

    def test_shared_pin_cannot_serve_two_angles(self) -> None:
        """A 60 degree V6 on three plain throws does not fire evenly, and says which cylinders disagree."""
        with pytest.raises(
            ModelError, match=r"cannot be even with these pins and banks: cylinder 4 needs .*; give the"
        ):
            even_throws(FOUR, vee(6, 0.1, math.radians(60)), [1, 4, 2, 5, 3, 6])

    def test_ninety_degree_v8(self) -> None:
        """A cross-plane crank fires evenly in the usual order, four throws a quarter apart."""
        layout = vee(8, 0.1, math.radians(90))
        throws = even_throws(FOUR, layout, [1, 8, 4, 2, 7, 3, 6, 5])
        assert sorted(degrees(throws)) == pytest.approx([45, 135, 225, 315])
        assert engine(FOUR, layout, throws, [1, 8, 4, 2, 7, 3, 6, 5]).firing_intervals == pytest.approx(
            (math.pi / 2,) * 8
        )

    def test_without_an_order_each_fires_at_its_first_dead_centre(self) -> None:
        cylinders, _ = build(FOUR, inline(3, 0.1), MECHANISM, tuple(map(math.radians, (0, 90, -30))))
        assert [math.degrees(part.firing_angle) for part in cylinders] == pytest.approx([0, 270, 30])


class TestBuild:
    def test_masses_of_a_shared_throw(self) -> None:
        """Rods count per cylinder, the throw's own mass once."""
        _, throws = build(FOUR, vee(2, 0.1, math.radians(90)), MECHANISM, (math.radians(45),))
        (throw,) = throws
        assert throw.cylinders == (0, 1)
        (rotor,) = throw_rotors(throws)
        assert rotor.role is Role.THROW
        assert rotor.name == "throw 1"
        assert rotor.unbalance == pytest.approx(0.8 * 0.06 * complex(math.sqrt(0.5), math.sqrt(0.5)))

    def test_split_pins_turn_the_cylinders_apart(self) -> None:
        cylinders, _ = build(FOUR, vee(2, 0.1, math.radians(60), math.radians(30)), MECHANISM, (0.5,))
        angles = [math.degrees(part.throw - 0.5) for part in cylinders]
        assert angles == pytest.approx([-15, 15])
        assert all(part.rotating_mass == 0.5 for part in cylinders)

    def test_massless_throws_are_no_rotors(self) -> None:
        assert throw_rotors([Throw(0.0, 0.0, (0,))]) == ()

    def test_throws_must_be_as_many_as_the_layout_has(self) -> None:
        with pytest.raises(ModelError, match=r"3 throws given, but the layout has 4"):
            build(FOUR, inline(4, 0.1), MECHANISM, (0.0, 1.0, 2.0))
