"""What every layout says of itself: the keys that it takes, what may be open, and what it builds."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from laufruhe import units
from laufruhe.errors import KeyedError
from laufruhe.machine.bodies import Rod
from laufruhe.machine.engine import Cycle
from laufruhe.machine.layouts.build import Mechanism, Throw, build
from laufruhe.machine.layouts.places import Layout
from laufruhe.machine.slider_crank import SliderCrank


@dataclass(frozen=True)
class Key:
    """A key of [engine] that a layout or a drive takes.

    Attributes
    ----------
    kind
        "length", "positive length", "non-negative length", "angle", "open angle", "open lead", "angles", "cylinder",
        "sign", "inertia", "ratio", "mass", "open mass", or "rod" of a mass, centre of gravity and inertia.
    default
        Where it is left out.
    """

    name: str
    kind: str
    description: str = ""
    default: Any = None


SPACING = Key(
    "cylinder_spacing",
    "positive length",
    "Distance between neighbouring throws; in a boxer between neighbours of a bank.",
)


@dataclass(frozen=True)
class Asked:
    """What is said of an engine.

    Attributes
    ----------
    own
        The layout's own keys in SI, None where left out or open.
    piston_mass
        Reciprocating mass without the share of `rod` [kg].
    rod
        Where it is given as a rigid body.
    gas
        Whether gas acts on the pistons.
    """

    cycle: Cycle
    cylinders: int
    mechanism: Mechanism
    own: Mapping[str, Any]
    firing_order: tuple[int, ...] | None = None
    piston_mass: float = 0.0
    rod: Rod | None = None
    gas: bool = False

    def spacing(self, places: int) -> float:
        """Between so many places along the crank [m]; beside one alone there is no other."""
        given = self.own["cylinder_spacing"]
        if given is None and places > 1:
            raise KeyedError("cylinder_spacing", 'is missing; add it, for example "125 mm"')
        return 1.0 if given is None else float(given)


def rod_of(key: str, table: Mapping[str, float], length: float, end: str) -> Rod:
    """The rod of a table of [engine] with mass, centre of gravity counted from the pin `end`, and inertia."""
    if not 0.0 <= table["centre_of_gravity"] <= length:
        rule = f"does not lie on the rod of {units.shown(length, 'm')}; count it from the {end}"
        raise KeyedError(f"{key}.centre_of_gravity", rule, units.shown(table["centre_of_gravity"], "m"))
    return Rod(length, **table)


class LayoutKind(ABC):
    """What a layout takes and builds: a new one is a file of its own and a line in `LAYOUTS`.

    Attributes
    ----------
    keys
        Of [engine], beside those of every layout.
    lists
        Of the keys `throws`, `firing_order`, `slider_cranks` and `shafts` those that it takes.
    openable
        Keys that may be left open.
    cylinders_per_throw
        Cylinders that share a throw.
    banks
        Of which each has a cylinder at every place along the crank.
    is_free
        Whether every slider-crank is listed, and nothing is placed.
    fires_evenly
        Whether open throws stand on the steps of even firing alone, and are told apart by loads on the block.
    needs_rod
        Whether a drive without a connecting rod means nothing here.
    has_pistons
        Whether [engine] says what its pistons, rods and strokes are; else the layout's own keys make the mechanism.
    """

    name: ClassVar[str]
    keys: ClassVar[tuple[Key, ...]] = (SPACING,)
    lists: ClassVar[tuple[str, ...]] = ("throws", "firing_order")
    openable: ClassVar[tuple[str, ...]] = ()
    cylinders_per_throw: ClassVar[int] = 1
    banks: ClassVar[int] = 1
    is_free: ClassVar[bool] = False
    fires_evenly: ClassVar[bool] = False
    needs_rod: ClassVar[bool] = False
    has_pistons: ClassVar[bool] = True

    def takes(self, key: str) -> bool:
        """Whether a key means anything here."""
        return key in self.lists or any(own.name == key for own in self.keys)

    def cycle(self, said: Cycle) -> Cycle:
        """In which the loads of an engine repeat whose chambers work in this one (C6)."""
        return said

    def mechanism(self, own: Mapping[str, Any], **shared: Any) -> Mechanism:
        """What cylinders share in a layout without pistons.

        Parameters
        ----------
        own
            As in `Asked`.
        shared
            What [engine] says of all mechanisms: `rotating_mass` and `big_end`.
        """
        raise NotImplementedError(f"layout '{self.name}' has pistons")

    @abstractmethod
    def place(self, asked: Asked) -> Layout:
        """Places, banks and pins.

        Raises
        ------
        ModelError
            A `KeyedError` where one key is to blame.
        """

    def parts(
        self, asked: Asked, layout: Layout, throws: Sequence[float]
    ) -> tuple[tuple[SliderCrank, ...], tuple[Throw, ...]]:
        """Slider-cranks and the throws that they work on."""
        return build(asked.cycle, layout, asked.mechanism, throws, asked.firing_order)
