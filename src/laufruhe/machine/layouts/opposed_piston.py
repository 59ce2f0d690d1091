"""Two pistons in each cylinder, on two geared cranks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from laufruhe import units
from laufruhe.errors import KeyedError, ModelError
from laufruhe.machine.layouts.banks import Inline
from laufruhe.machine.layouts.base import CRANK_DISTANCE, OF_CYLINDER, LayoutInput, LayoutKey
from laufruhe.machine.layouts.build import Throw, throw_unbalance
from laufruhe.machine.layouts.places import Layout
from laufruhe.machine.rotor import Shaft
from laufruhe.machine.slider_crank import SliderCrank
from laufruhe.numerics.exact_angles import as_turn, cis


def facing_pistons(lower: Sequence[SliderCrank], crank: Shaft, lead: float = 0.0) -> tuple[SliderCrank, ...]:
    """Return the second pistons of opposed-piston cylinders, upside down on a crank of their own.

    The lower ones stand upright on the crankshaft; the second ones come to their dead centre first by the lead [rad].
    """
    if abs(crank.ratio) != 1.0:
        raise ModelError(f"an opposed-piston engine needs a crank ratio of 1 or -1, got {crank.ratio:g}")
    if not crank.z > 0.0:
        raise ModelError(f"the second crank of an opposed-piston engine lies above the first, not at {crank.z:g} m")
    return tuple(
        replace(
            part,
            name=f"{part.name} upper",
            bank=math.pi,
            throw=math.pi + crank.ratio * (part.throw + lead),
            firing_angle=part.firing_angle - lead,
            shaft=crank,
        )
        for part in lower
    )


class OpposedPiston(Inline):
    """Inline layout with a second crank above."""

    name = "opposed-piston"
    keys = (
        *Inline.keys,
        CRANK_DISTANCE,
        LayoutKey(
            "crank_ratio",
            "sign",
            "Speed ratio of the second crank of opposed pistons; -1 by default, against the first.",
        ),
        LayoutKey(
            "crank_lead", "open lead", "Angle by which the pistons of the second crank of opposed pistons lead.", 0.0
        ),
        LayoutKey(
            "second_reciprocating_mass",
            "open mass",
            "Reciprocating mass of each piston of the second crank; by default that of the others.",
        ),
        LayoutKey("port_arc", "angle", "Crank angle for which the ports of a piston are open; a lead has to be less."),
    )
    openable = ()
    single = (*OF_CYLINDER, "second_reciprocating_mass")

    def parts(
        self, inputs: LayoutInput, layout: Layout, throws: Sequence[float]
    ) -> tuple[tuple[SliderCrank, ...], tuple[Throw, ...]]:
        """Return the lower pistons, then the upper ones, and the throws of both cranks."""
        lower, cranks = super().parts(inputs, layout, throws)
        lead, ports = inputs.options["crank_lead"], inputs.options["port_arc"]
        if ports is not None and abs(lead) >= ports:
            rule = f"is beyond the ports, which are open for {units.quantity_text(ports, 'rad')} and never together"
            raise KeyedError("crank_lead", f"{rule}; lessen it", units.quantity_text(lead, "rad"))
        crank = Shaft("second crankshaft", float(inputs.options["crank_ratio"] or -1), 0.0, inputs.crank_distance)
        upper, above = list[SliderCrank](), list[Throw]()
        for k, second in enumerate(facing_pistons(lower, crank, lead)):
            of_cylinder = inputs.of(k)
            second_mass = of_cylinder.options["second_reciprocating_mass"]
            heavier = 0.0 if second_mass is None else second_mass - of_cylinder.piston_mass
            upper.append(replace(second, reciprocating_mass=second.reciprocating_mass + heavier))
            unbalance = throw_unbalance([of_cylinder.mechanism]) * cis(as_turn(second.throw))
            above.append(Throw(second.x, second.throw, (len(lower) + k,), unbalance, crank))
        return (*lower, *upper), (*cranks, *above)
