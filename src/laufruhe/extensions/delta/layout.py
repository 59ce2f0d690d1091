"""Rows of three cylinders in a triangle, two pistons in each, on three cranks geared to each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from laufruhe.errors import KeyedError, ModelError
from laufruhe.machine.engine import Cycle
from laufruhe.machine.layouts.banks import in_banks
from laufruhe.machine.layouts.base import CRANK_DISTANCE, OF_CYLINDER, SPACING, LayoutInput, LayoutKey, LayoutKind
from laufruhe.machine.layouts.build import Throw, throw_unbalance
from laufruhe.machine.layouts.places import Layout
from laufruhe.machine.rotor import CRANKSHAFT, Shaft
from laufruhe.machine.slider_crank import SliderCrank
from laufruhe.numerics.exact_angles import Turn, angle_of, as_turn, cis, reduced_turn


@dataclass(frozen=True)
class Triangle:
    """Three cranks at the corners of a triangle that stands on one corner, and the dead centres of their pistons.

    Bank k lies between corner k and the next one. Corners count from below with the clock, as seen from the front. The
    first piston of bank k works on corner k.

    Attributes
    ----------
    side
        Distance of two cranks [m].
    ratios
        Speed ratios of the cranks, 1 or -1; the first is the crankshaft.
    leads
        Crank angle by which the first piston of every bank comes to its dead centre first, as parts of a turn.
    """

    side: float
    ratios: tuple[int, int, int]
    leads: tuple[Turn, Turn, Turn]

    @property
    def shafts(self) -> tuple[Shaft, Shaft, Shaft]:
        """Crankshafts: below, left and right."""
        half, height = 0.5 * self.side, math.sqrt(0.75) * self.side
        _, left, right = self.ratios
        return (
            CRANKSHAFT,
            Shaft("left crankshaft", float(left), half, height),
            Shaft("right crankshaft", float(right), -half, height),
        )

    @staticmethod
    def axis(corner: int, bank: int) -> Turn:
        """Return the angle of a bank's cylinder axis in turns, seen from the crank at its end `corner` (C5)."""
        away = Fraction(1, 12) - Fraction(bank, 3)
        return away if corner == bank else away + Fraction(1, 2)

    def centre(self, corner: int, bank: int) -> Turn:
        """Return the crank angle of the dead centre of a bank's piston on a corner's crank, in turns.

        The throw of the lower crank is upright at a crank angle of zero.
        """
        at: Turn = self.axis(0, 0)
        for k in range(bank):
            # step over to the other piston of bank k, then to the next bank on its crank
            at = at + self.leads[k] + self.ratios[(k + 1) % 3] * (self.axis(k + 1, k + 1) - self.axis(k + 1, k))
        return at if corner == bank else at + self.leads[bank]


# indexed by the crank that is reversed; the crankshaft turns forward, so if it is reversed, the others turn back
_RATIOS = ((1, 1, 1), (1, -1, -1), (1, -1, 1), (1, 1, -1))


class Delta(LayoutKind):
    """Two-stroke engine with rows of three cylinders in a triangle."""

    name = "delta"
    keys = (
        SPACING,
        CRANK_DISTANCE,
        LayoutKey(
            "reversed_crank",
            "cylinder",
            "Crank of a triangle against the other two: 1 below, 2 left, 3 right; none by default.",
        ),
        LayoutKey(
            "crank_leads",
            "angles",
            "Angles by which the first pistons of the first two banks of a triangle lead; by default the least lead "
            "that all banks may share.",
        ),
    )
    lists = ("throws", "firing_order")
    openable = ("throws",)
    cylinders_per_throw = 3
    banks = 3
    fires_evenly = True
    single = OF_CYLINDER

    def place(self, inputs: LayoutInput) -> Layout:
        """Return the layout: throws of the lower crank, and banks at the dead centres of their first pistons."""
        triangle = self._triangle(inputs)
        turns = [angle_of(reduced_turn(triangle.centre(bank, bank), 1)) for bank in range(3)]
        return in_banks(self.name, inputs.cylinders, inputs.spacing(inputs.cylinders // 3), turns)

    def _triangle(self, inputs: LayoutInput) -> Triangle:
        if inputs.cycle is not Cycle.TWO_STROKE:
            rule = 'has ports in a triangle of cranks, which work every turn; write "two-stroke"'
            raise KeyedError("cycle", rule, str(inputs.cycle))
        reversed_one = inputs.options["reversed_crank"] or 0
        if reversed_one > 3:
            raise KeyedError(
                "reversed_crank", "is not one of the three cranks of the triangle; give 1, 2 or 3", str(reversed_one)
            )
        ratios = _RATIOS[reversed_one]
        leads = inputs.options["crank_leads"]
        if leads is not None and len(leads) != 2:
            raise KeyedError("crank_leads", f"has {len(leads)} angles; give those of two banks, the third follows")
        # the least lead that all banks may share is 20 deg with one crank reversed, and 60 deg with none (K18)
        first, second = map(as_turn, leads) if leads is not None else (-Fraction(sum(ratios), 18),) * 2
        # the lead of the third bank closes the angles round the triangle (K18)
        third = -Fraction(sum(ratios), 6) - first - second
        return Triangle(inputs.crank_distance, ratios, (first, second, third))

    def parts(
        self, inputs: LayoutInput, layout: Layout, throws: Sequence[float]
    ) -> tuple[tuple[SliderCrank, ...], tuple[Throw, ...]]:
        """Return the pistons of a delta engine, those at first corners of banks first, and the throws of all cranks."""
        triangle, order = self._triangle(inputs), inputs.firing_order
        mechanisms = [inputs.of(k).mechanism for k in range(inputs.cylinders)] * 2
        pistons: list[SliderCrank] = []
        cranks: list[Throw] = []
        for turned in (0, 1):
            for bank in range(3):
                corner = (bank + turned) % 3
                shaft, axis = triangle.shafts[corner], triangle.axis(corner, bank)
                for x, throw in zip(layout.throw_positions, throws, strict=True):
                    centre = reduced_turn(triangle.centre(corner, bank) - as_turn(throw), 1)
                    angle = reduced_turn(axis - triangle.ratios[corner] * centre, 1)
                    angles = (angle_of(angle), angle_of(reduced_turn(axis, 1)), angle_of(centre))
                    pistons.append(mechanisms[len(pistons)].cylinder(len(pistons) + 1, x, *angles, shaft=shaft))
        for shaft in triangle.shafts:
            for x in layout.throw_positions:
                piston_numbers = tuple(k for k, part in enumerate(pistons) if part.shaft == shaft and part.x == x)
                angle = pistons[piston_numbers[0]].throw
                unbalance = throw_unbalance([mechanisms[k] for k in piston_numbers]) * cis(as_turn(angle))
                cranks.append(Throw(x, angle, piston_numbers, unbalance, shaft))
        if order is not None:
            fires = [as_turn(part.firing_angle) for part in pistons[: inputs.cylinders]]
            turns = [reduced_turn(fires[k - 1] - fires[order[0] - 1], 1) for k in order]
            if turns != sorted(turns):
                fired = sorted(range(1, len(fires) + 1), key=lambda k: fires[k - 1])
                raise ModelError(f"these throws fire in the order {fired}, not {list(order)}")
        return tuple(pistons), tuple(cranks)


DELTA = Delta()
