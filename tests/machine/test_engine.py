"""Engines that cannot exist, refused with a remedy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import ClassVar

import pytest

import laufruhe.machine
from laufruhe.errors import LaufruheWarning, ModelError
from laufruhe.extension import MOVED
from laufruhe.extensions.bearing_loads.machine import Bearing, MainBearings
from laufruhe.machine import CRANKSHAFT, Cycle, Engine, Mount, Rotor, Shaft, SliderCrank
from laufruhe.machine.dynamic import FluidTrack
from laufruhe.machine.extra import Extra

PART = SliderCrank("cylinder 1", 0.0, 0.06, 0.2, 1.0)
OTHER = replace(PART, name="cylinder 2", x=0.1)


def engine(*parts: SliderCrank, cycle: Cycle = Cycle.FOUR_STROKE, rotors: tuple[Rotor, ...] = ()) -> Engine:
    return Engine("any", cycle, parts, rotors)


class TestCycle:
    @pytest.mark.parametrize(
        ("cycle", "turns", "base"), [(Cycle.TWO_STROKE, 1, Fraction(1)), (Cycle.FOUR_STROKE, 2, Fraction(1, 2))]
    )
    def test_turns_and_orders(self, cycle: Cycle, turns: int, base: Fraction) -> None:
        """A two-stroke works every turn, a four-stroke every second one, with half orders (C6)."""
        assert (cycle.turns, cycle.base_order) == (turns, base)
        assert cycle.angle == turns * math.tau


class TestRefusals:
    @pytest.mark.parametrize(
        ("make", "message"),
        [
            (lambda: engine(PART, replace(PART, x=1.0)), r"two slider-cranks are called 'cylinder 1'; give each"),
            (
                lambda: engine(PART, rotors=(Rotor("w", 0.0, 1.0), Rotor("w", 0.1, 1.0))),
                r"two rotors are called 'w'; give each its own name",
            ),
            (
                lambda: Engine("any", Cycle.TWO_STROKE, (PART,), mounts=(Mount("m", (0, 0, 0)), Mount("m", (1, 0, 0)))),
                r"two mounts are called 'm'; give each its own name",
            ),
            (
                lambda: engine(PART, replace(OTHER, x=0.0)),
                r"cylinder 2 has the same position as cylinder 1; move one of them",
            ),
            (
                lambda: engine(PART, replace(OTHER, x=0.0, bank=math.tau, throw=0.0)),
                r"cylinder 2 has the same position as cylinder 1",
            ),
            (
                lambda: engine(PART, rotors=(Rotor("w", 0.0, 1.0, Shaft("s", 0.3)),)),
                r"shaft 's' with ratio 0\.3 does not return within the cycle of 2 turns; use a multiple of 1/2",
            ),
            (
                lambda: engine(PART, cycle=Cycle.TWO_STROKE, rotors=(Rotor("w", 0.0, 1.0, Shaft("s", 0.5)),)),
                r"use a multiple of 1/1",
            ),
            (
                lambda: engine(replace(PART, firing_angle=0.1)),
                r"cylinder 1 fires at 5\.7\d* deg, 5\.7\d* deg from its dead centre",
            ),
            (lambda: Shaft("still", 0.0), r"shaft 'still' has ratio 0"),
            (
                lambda: FluidTrack(2, 0.0, 2e5),
                r"the fluid track of a hydraulic mount needs a mass and a bulge stiffness above zero",
            ),
            (
                lambda: FluidTrack(2, 30.0, 0.0),
                r"the fluid track of a hydraulic mount needs a mass and a bulge stiffness above zero",
            ),
            (
                lambda: FluidTrack(2, 30.0, 2e5, damping=-1.0),
                r"the fluid track of a hydraulic mount has a negative stiffness or damping; give zero or more",
            ),
        ],
        ids=range(12),
    )
    def test_message(self, make: Callable[[], object], message: str) -> None:
        with pytest.raises(ModelError, match=message):
            make()

    def test_cylinders_in_one_place_on_geared_cranks(self) -> None:
        """Shafts of two names on one axis do not make room for two cylinders."""
        second = replace(OTHER, x=0.0, shaft=Shaft("crank 2", 1.0))
        with pytest.raises(ModelError, match="has the same position as"):
            engine(PART, second)

    @pytest.mark.parametrize("ratio", [0.5, 1.5, -2.0, 4.0])
    def test_shafts_that_return_are_taken(self, ratio: float) -> None:
        assert engine(PART, rotors=(Rotor("w", 0.0, 1.0, Shaft("s", ratio)),)).shafts[1].ratio == ratio

    def test_opposed_cylinders_share_a_place_along_the_crank(self) -> None:
        """Check that two banks, or two cranks, at one x are no collision."""
        opposite = replace(OTHER, x=0.0, bank=math.pi, throw=math.pi)
        second = replace(OTHER, x=0.0, shaft=Shaft("crank 2", -1.0, y=0.3), name="cylinder 3")
        assert len(engine(PART, opposite, second).shafts) == 2

    def test_every_dead_centre_may_fire(self) -> None:
        assert engine(replace(PART, firing_angle=math.tau)).slider_cranks[0].firing_angle == math.tau


class TestFiringIntervals:
    @pytest.mark.parametrize(
        ("fires", "cycle", "intervals"),
        [
            ((0, 180), Cycle.FOUR_STROKE, (180, 540)),
            ((0, 360), Cycle.FOUR_STROKE, (360, 360)),
            ((0,), Cycle.TWO_STROKE, (360,)),
            ((450, 0, 270, 180), Cycle.FOUR_STROKE, (270, 180, 90, 180)),
        ],
    )
    def test_from_each_firing_to_the_next(
        self, fires: tuple[int, ...], cycle: Cycle, intervals: tuple[int, ...]
    ) -> None:
        """Check the intervals in firing order from cylinder 1 around to it; they add up to the cycle."""
        parts = tuple(
            replace(PART, name=f"{k}", x=float(k), throw=math.radians(-f), firing_angle=math.radians(f))
            for k, f in enumerate(fires)
        )
        result = engine(*parts, cycle=cycle).firing_intervals
        assert [math.degrees(a) for a in result] == pytest.approx(intervals)
        assert sum(result) == pytest.approx(cycle.angle)

    def test_nothing_that_fires(self) -> None:
        assert engine().firing_intervals == ()


class TestRotor:
    def test_mass_at_its_radius(self) -> None:
        rotor = Rotor("w", 0.0, complex(0.03, 0.04), radius=0.02)
        assert rotor.mass == pytest.approx(2.5)
        assert rotor.shaft is CRANKSHAFT

    def test_mass_needs_a_radius(self) -> None:
        with pytest.raises(ModelError, match="rotor 'w' has no radius, so its mass is not known"):
            _ = Rotor("w", 0.0, 0.05).mass


@pytest.mark.parametrize("ratio", [1.0, -2.0])
def test_a_bearing_rubs_by_friction_times_the_speed_of_its_journal(ratio: float) -> None:
    """mu F v by hand, v of a journal of 70 mm, whichever way it turns (B7)."""
    bearing = Bearing("1", 0.0, diameter=0.07, width=0.03, friction=0.012, shaft=Shaft("s", ratio))
    speed, force = 300.0, 5000.0
    assert bearing.drag * force * speed == pytest.approx(0.012 * force * 0.035 * abs(ratio) * speed)


class Steady(Extra):
    """A part of a package that supports the crankshaft in one place."""

    supports: ClassVar = {"crankshaft": [5.0], "second": [2.0]}


def test_parts_that_support_one_shaft_add_up() -> None:
    bearings = MainBearings((Bearing("1", 0.0), Bearing("2", 1.0)))
    engine = Engine("one", Cycle.FOUR_STROKE, (PART,), extras=(bearings, Steady()))
    assert engine.supports == {"crankshaft": [0.0, 1.0, 5.0], "second": [2.0]}


def test_bearings_have_names_of_their_own() -> None:
    with pytest.raises(ModelError, match="two bearings are called '1'; give each its own name"):
        MainBearings((Bearing("1", 0.0), Bearing("1", 1.0)))


@pytest.mark.parametrize("name", MOVED)
def test_classes_that_extensions_have_now_are_found_with_a_warning(name: str) -> None:
    with pytest.warns(LaufruheWarning, match=f"laufruhe.machine.{name} is now laufruhe.extensions"):
        assert getattr(laufruhe.machine, name).__name__ == name
