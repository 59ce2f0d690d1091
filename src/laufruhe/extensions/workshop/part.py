"""Bodies of an engine's weights and the space around them, as a part of the engine."""

from __future__ import annotations

import cmath
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import ClassVar

from laufruhe.errors import ModelError
from laufruhe.extensions.workshop.bodies import Body, BodyFit, BodyRange
from laufruhe.extensions.workshop.crankcase import Clearance, Crankcase, Seat, clearances, is_clear
from laufruhe.machine import Engine, Rotor, SliderCrank
from laufruhe.machine.extra import Extra

_DIGITS = 9


@dataclass(frozen=True)
class Workshop(Extra):
    """Sizes of the bodies of weights by the names of their rotors, and the crankcase."""

    name: ClassVar[str] = "workshop"
    sizes: tuple[tuple[str, BodyRange], ...] = ()
    crankcase: Crankcase = field(default_factory=Crankcase)


@dataclass(frozen=True)
class Weight:
    """Body of a rotor in a design.

    Attributes
    ----------
    body
        Body of least mass with the rotor's unbalance, or the nearest one within the range of sizes.
    fault
        Reason why no body has the unbalance; empty if `body` has it.
    """

    rotor: Rotor
    seat: Seat
    body: Body
    fault: str = ""


def seat_of(rotor: Rotor, unbalance: complex) -> Seat:
    """Return the seat of a rotor's body with this unbalance [kg m]."""
    return Seat(rotor.x, rotor.shaft, round(cmath.phase(unbalance), _DIGITS))


@lru_cache(maxsize=512)
def fit_of(sizes: BodyRange, crankcase: Crankcase, parts: tuple[SliderCrank, ...], cycle: float, seat: Seat) -> BodyFit:
    """Return the bodies of least mass that keep the clearances on a seat."""
    return BodyFit(sizes, partial(is_clear, crankcase, parts, cycle, sizes.largest, seat))


def weights_of(engine: Engine) -> list[Weight]:
    """Return the bodies of an engine's weights; those without an unbalance are left out."""
    workshop = engine.extra(Workshop)
    rotors = {rotor.name: rotor for rotor in engine.rotors}
    weights = []
    for name, sizes in workshop.sizes if workshop else ():
        if name in rotors and rotors[name].unbalance:
            weights.append(_weight(engine, rotors[name], sizes, workshop.crankcase if workshop else Crankcase()))
    return weights


def _weight(engine: Engine, rotor: Rotor, sizes: BodyRange, crankcase: Crankcase) -> Weight:
    seat = seat_of(rotor, rotor.unbalance)
    if not sizes.is_open:
        return Weight(rotor, seat, sizes.smallest)
    fit = fit_of(sizes, crankcase, engine.slider_cranks, engine.cycle.angle, seat)
    try:
        return Weight(rotor, seat, fit.body_of(abs(rotor.unbalance)))
    except ModelError as error:
        low, high = fit.bounds if fit.fits or not sizes.has_open_shape else (0.0, 0.0)
        nearest = sizes.smallest if abs(rotor.unbalance) <= low or not high else fit.largest
        return Weight(rotor, seat, nearest, str(error))


def clearances_of(engine: Engine, weights: Sequence[Weight]) -> Iterator[tuple[Weight, list[Clearance]]]:
    """Yield every weight with its clearances from all parts and from weights on other shafts, least first."""
    workshop = engine.extra(Workshop)
    crankcase = workshop.crankcase if workshop else Crankcase()
    for k, weight in enumerate(weights):
        others = [
            (other.rotor.name, other.body, other.seat)
            for other in weights[:k]
            if other.rotor.shaft.name != weight.rotor.shaft.name
        ]
        distances = clearances(crankcase, engine.slider_cranks, engine.cycle.angle, weight.body, weight.seat, others)
        yield weight, sorted(distances, key=lambda clearance: clearance.minimum.distance)
