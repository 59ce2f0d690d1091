"""Row of cylinders around one crank pin: a master rod carries the others on knuckle pins."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from laufruhe.errors import KeyedError, ModelError, counted
from laufruhe.machine.articulated import ArticulatedCrank, Knuckle
from laufruhe.machine.layouts.base import LayoutInput, LayoutKey, LayoutKind, rod_of
from laufruhe.machine.layouts.build import Mechanism, Throw, build
from laufruhe.machine.layouts.places import Layout
from laufruhe.machine.slider_crank import SliderCrank, as_kind


@dataclass(frozen=True, kw_only=True)
class MasterRod(Mechanism):
    """Shared numbers of the cylinders of a radial, and the articulated rods.

    Attributes
    ----------
    master
        Number of the cylinder on the master rod.
    master_bank
        Its bank angle [rad].
    knuckle_radius
        [m]; 0 puts all rods on the crank pin.
    knuckle_angles
        Of every cylinder's knuckle pin from the master rod [rad], that of the master not used.
    length
        Of the articulated rods [m]; without one every piston comes as high as the master's.
    piston_mass
        Without any rod's share [kg], where `rod` is given.
    knuckle_mass
        At every knuckle pin, without the rod's share [kg].
    rod
        Mass, centre of gravity from the knuckle pin and inertia of an articulated rod.
    """

    master: int
    master_bank: float
    knuckle_radius: float
    knuckle_angles: tuple[float, ...]
    length: float | None
    piston_mass: float
    knuckle_mass: float
    rod: Mapping[str, float] | None

    def cylinder(self, number: int, *place: Any, **others: Any) -> SliderCrank:
        """Return the master's slider-crank, or an articulated one."""
        plain = super().cylinder(number, *place, **others)
        if number == self.master:
            return plain
        rod_of_master = SliderCrank(
            "master rod", 0.0, self.crank_radius, self.rod_length, 0.0, 0.0, self.master_bank, self.offset
        )
        knuckle = Knuckle(rod_of_master, self.knuckle_radius, self.knuckle_angles[number - 1])
        top = complex(math.sqrt((self.rod_length + self.crank_radius) ** 2 - self.offset**2), self.offset)
        length = self.length or knuckle.length_to(top, plain.bank)
        rod = None if self.rod is None else rod_of("articulated_rod", self.rod, length, "knuckle pin")
        articulated = replace(
            plain,
            rod_length=length,
            reciprocating_mass=self.reciprocating_mass if rod is None else self.piston_mass + rod.reciprocating_mass,
            rotating_mass=self.knuckle_mass + (0.0 if rod is None else rod.rotating_mass),
            rod_inertia_deficit=self.rod_inertia_deficit if rod is None else rod.inertia_deficit,
        )
        if self.knuckle_radius == 0.0:
            return articulated
        return as_kind(ArticulatedCrank, articulated, knuckle=knuckle)


class Radial(LayoutKind):
    """Master rod and articulated rods on one crank pin; cylinder 1 upright, numbers as the crank turns."""

    name = "radial"
    keys = (
        LayoutKey(
            "knuckle_radius",
            "non-negative length",
            "Distance of the knuckle pins of the master rod from the crank pin.",
        ),
        LayoutKey("master_cylinder", "cylinder", "Number of the cylinder with the master rod; 1 by default."),
        LayoutKey(
            "knuckle_angles",
            "angles",
            "Angle of every knuckle pin from the master rod; by default those of the cylinders.",
        ),
        LayoutKey(
            "articulated_rod_length",
            "positive length",
            "Length of the articulated rods; by default such that all pistons reach the same height.",
        ),
        LayoutKey("articulated_rod", "rod", "Articulated rod as a rigid body, counted from its knuckle pin."),
        LayoutKey("knuckle_mass", "mass", "Mass at every knuckle pin, beside the share of articulated_rod.", 0.0),
    )
    lists = ("firing_order",)
    openable = ("firing_order",)
    needs_rod = True

    def place(self, inputs: LayoutInput) -> Layout:
        """Return cylinders at equal angles around one throw; phi = 0 is the true dead centre of cylinder 1 (C5)."""
        count = inputs.cylinders
        banks, none = _banks(count), (0.0,) * count
        rods = _master_rod(inputs)
        try:
            late = tuple(rods.cylinder(k + 1, 0.0, 0.0, banks[k], 0.0).fires_at for k in range(count))
        except KeyedError:
            raise
        except ModelError as error:
            raise KeyedError("articulated_rod_length" if rods.length else "knuckle_radius", str(error)) from None
        return Layout("radial", none, banks, (0,) * count, none, (0.0,), late=late, throws=(banks[0] + late[0],))

    def parts(
        self, inputs: LayoutInput, layout: Layout, throws: Sequence[float]
    ) -> tuple[tuple[SliderCrank, ...], tuple[Throw, ...]]:
        """Return the slider-cranks of master and articulated rods; on four strokes every second one fires."""
        turns, count = inputs.cycle.turns, inputs.cylinders
        order = [k + 1 for start in range(turns) for k in range(start, count, turns)]
        return build(inputs.cycle, layout, _master_rod(inputs), throws, inputs.firing_order or order)


def _banks(count: int) -> tuple[float, ...]:
    return tuple(math.tau * k / count for k in range(count))


def _master_rod(inputs: LayoutInput) -> MasterRod:
    """Return the master rod that [engine] describes."""
    options, count = inputs.options, inputs.cylinders
    radius, master, knuckle_angles = (
        options["knuckle_radius"],
        options["master_cylinder"] or 1,
        options["knuckle_angles"],
    )
    if radius is None:
        raise KeyedError("knuckle_radius", "is missing; add it, 0 mm puts all rods on the crank pin")
    if math.isinf(inputs.mechanism.rod_length):
        raise KeyedError("rod_ratio", "makes a Scotch yoke, which has no master rod; give more", "0")
    if master > count:
        raise KeyedError("master_cylinder", f"is none of {count} cylinders; count them from 1", str(master))
    if inputs.rod is not None and options["articulated_rod"] is None:
        raise KeyedError("articulated_rod", "is missing beside [engine.rod]; add it, or leave both out")
    banks = _banks(count)
    if knuckle_angles is not None and len(knuckle_angles) != count - 1:
        rule = f"has {counted(len(knuckle_angles), 'angle')} for {counted(count - 1, 'articulated rod')}"
        raise KeyedError("knuckle_angles", f"{rule}; give one each, by cylinder")
    even = [bank - banks[master - 1] for bank in banks]
    angles = even if knuckle_angles is None else [*knuckle_angles[: master - 1], 0.0, *knuckle_angles[master - 1 :]]
    shared = {number.name: getattr(inputs.mechanism, number.name) for number in fields(inputs.mechanism)}
    return MasterRod(
        **shared,
        master=master,
        master_bank=banks[master - 1],
        knuckle_radius=radius,
        knuckle_angles=tuple(angles),
        length=options["articulated_rod_length"],
        piston_mass=inputs.piston_mass,
        knuckle_mass=options["knuckle_mass"],
        rod=options["articulated_rod"],
    )
