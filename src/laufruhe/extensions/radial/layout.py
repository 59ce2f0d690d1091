"""Row of cylinders around one crank pin: a master rod carries the others on knuckle pins."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from laufruhe.errors import KeyedError, ModelError, counted
from laufruhe.extensions.radial.mechanism import ArticulatedCrank, Knuckle
from laufruhe.machine.layouts.base import NUMBERING, LayoutInput, LayoutKey, LayoutKind, rod_of
from laufruhe.machine.layouts.build import Throw, build
from laufruhe.machine.layouts.places import Layout
from laufruhe.machine.slider_crank import SliderCrank, as_kind


class Radial(LayoutKind):
    """Master rod and articulated rods on one crank pin; cylinder 1 is upright, numbers follow the rotation."""

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
        *NUMBERING,
    )
    lists = ("firing_order", "firing_intervals")
    openable = ("firing_order",)
    single = ("bore", "reciprocating_mass", "knuckle_mass", "articulated_rod")
    needs_rod = True

    def place(self, inputs: LayoutInput) -> Layout:
        """Return the layout of a radial engine: cylinders at equal angles around one throw.

        A crank angle of zero is the true dead centre of cylinder 1 (C5). Articulated rods delay the other dead centres.
        """
        count, none = inputs.cylinders, (0.0,) * inputs.cylinders
        _check(inputs)
        banks, places = tuple(math.tau * k / count for k in range(count)), inputs.places
        try:
            # master rod and knuckle pins go by number
            on_crank = [inputs.of(k).mechanism.cylinder(k + 1, 0.0, 0.0, banks[at], 0.0) for k, at in enumerate(places)]
            by_number = _hinged(inputs, on_crank)
        except KeyedError:
            raise
        except ModelError as error:
            key = "articulated_rod_length" if inputs.options["articulated_rod_length"] else "knuckle_radius"
            raise KeyedError(key, str(error)) from None
        delays = tuple(by_number[places.index(at)].fires_at for at in range(count))
        throw = banks[places[0]] + by_number[0].fires_at
        return Layout("radial", none, banks, (0,) * count, none, (0.0,), firing_delays=delays, throws=(throw,))

    def parts(
        self, inputs: LayoutInput, layout: Layout, throws: Sequence[float]
    ) -> tuple[tuple[SliderCrank, ...], tuple[Throw, ...]]:
        """Return the slider-cranks of master and articulated rods; on four strokes every second one fires."""
        turns, count, places = inputs.cycle.turns, inputs.cylinders, inputs.places
        order = [
            1 + places.index((places[0] + k) % count) for start in range(turns) for k in range(start, count, turns)
        ]
        order = list(inputs.firing_order or order)
        mechanisms = [inputs.of(k).mechanism for k in range(count)]
        on_crank, cranks = build(inputs.cycle, layout, mechanisms, throws, order, inputs.firing_intervals)
        return _hinged(inputs, on_crank), cranks


def _check(inputs: LayoutInput) -> None:
    options, count = inputs.options, inputs.cylinders
    master, knuckle_angles = options["master_cylinder"] or 1, options["knuckle_angles"]
    if options["knuckle_radius"] is None:
        raise KeyedError("knuckle_radius", "is missing; add it, 0 mm puts all rods on the crank pin")
    if type(inputs.mechanism.part) is not SliderCrank:
        raise KeyedError("drive", "moves more than a piston, and this layout needs a master rod; leave it out")
    if math.isinf(inputs.mechanism.part.rod_length):
        raise KeyedError("rod_ratio", "makes a Scotch yoke, which has no master rod; give more", "0")
    if master > count:
        raise KeyedError("master_cylinder", f"is not one of the {count} cylinders; count cylinders from 1", str(master))
    if inputs.rod is not None and options["articulated_rod"] is None:
        raise KeyedError("articulated_rod", "is missing beside [engine.rod]; add it, or leave both out")
    if knuckle_angles is not None and len(knuckle_angles) != count - 1:
        rule = f"has {counted(len(knuckle_angles), 'angle')} for {counted(count - 1, 'articulated rod')}"
        raise KeyedError("knuckle_angles", f"{rule}; give one each, by cylinder")


def _hinged(inputs: LayoutInput, on_crank: Sequence[SliderCrank]) -> tuple[SliderCrank, ...]:
    """Return the slider-cranks with articulated rods: all but the master rod are on its knuckle pins.

    Without a length of articulated rods every piston comes as high as the master's; a knuckle radius of zero leaves
    all rods on the crank pin.
    """
    options, mechanism, index = inputs.options, inputs.mechanism.part, (inputs.options["master_cylinder"] or 1) - 1
    radius, length, master_bank = mechanism.crank_radius, mechanism.rod_length, on_crank[index].bank
    master = SliderCrank("master rod", 0.0, radius, length, 0.0, 0.0, master_bank, mechanism.offset)
    top = complex(math.sqrt((length + radius) ** 2 - mechanism.offset**2), mechanism.offset)
    parts = list(on_crank)
    for k, part in enumerate(on_crank):
        if k == index:
            continue
        angles = options["knuckle_angles"]
        angle = part.bank - master_bank if angles is None else angles[k - (k > index)]
        knuckle = Knuckle(master, options["knuckle_radius"], angle)
        length = options["articulated_rod_length"] or knuckle.length_to(top, part.bank)
        of_cylinder = inputs.of(k).options
        articulated = replace(part, rod_length=length, rotating_mass=of_cylinder["knuckle_mass"])
        if of_cylinder["articulated_rod"] is not None:
            rod = rod_of("articulated_rod", of_cylinder["articulated_rod"], length, "knuckle pin")
            articulated = replace(
                articulated,
                reciprocating_mass=inputs.of(k).piston_mass + rod.reciprocating_mass,
                rotating_mass=of_cylinder["knuckle_mass"] + rod.rotating_mass,
                rod_inertia_deficit=rod.inertia_deficit,
            )
        parts[k] = as_kind(ArticulatedCrank, articulated, knuckle=knuckle) if knuckle.radius else articulated
    return tuple(parts)


RADIAL = Radial()
