"""Base class of layouts, and the keys of [engine] that they take."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from laufruhe import units
from laufruhe.errors import KeyedError, ModelError, counted
from laufruhe.machine.bodies import Rod
from laufruhe.machine.engine import Cycle
from laufruhe.machine.layouts.build import Mechanism, Throw, build
from laufruhe.machine.layouts.places import Layout
from laufruhe.machine.slider_crank import SliderCrank


@dataclass(frozen=True)
class LayoutKey:
    """A key of [engine] that a layout or a drive takes.

    Attributes
    ----------
    kind
        "length", "positive length", "positive lengths", "non-negative length", "angle", "open angle", "open lead",
        "angles", "cylinder", "sign", "inertia", "ratio", "mass", "open mass", "rod" of a mass, centre of gravity and
        inertia, or "numbering", "bank", "end" or "rotation" of cylinder numbers.
    default
        Value if the file leaves the key out.
    """

    name: str
    kind: str
    description: str = ""
    default: Any = None


SPACING = LayoutKey(
    "cylinder_spacing",
    "positive lengths",
    "Distance between neighbouring throws; in a boxer between neighbours of a bank. A list has each, from the front.",
)
NUMBERING = (
    LayoutKey(
        "numbering",
        "numbering",
        "Numbers of the cylinders in this file: by bank, alternating between banks, or the number of each cylinder in "
        "a list, bank by bank from the front, the left bank first.",
    ),
    LayoutKey("rotation", "rotation", "Sense of rotation of the crank, seen from the front; clockwise by default."),
)
ROW_ANGLE = LayoutKey(
    "row_angle",
    "angle",
    "Angle between the two rows of a bank whose cylinders lean alternately to the left and right (VR and W engines); "
    "negative if the front cylinder leans to the right. By default a bank has one row.",
)
FIRST_END = LayoutKey("first_end", "end", "End of the engine at which cylinder 1 stands; the front by default.")
FIRST_BANK = LayoutKey(
    "first_bank", "bank", "Bank of cylinder 1, seen from the flywheel towards the front; left by default."
)
OF_CYLINDER = (
    "bore", "stroke", "rod_ratio", "rod_length", "reciprocating_mass", "rotating_mass", "rod", "rod_inertia_deficit",
)  # fmt: skip
"""Keys of [engine] that a cylinder of any layout on plain cranks may have of its own; the offset is one more."""
CRANK_DISTANCE = LayoutKey("crank_distance", "positive length", "Distance of the two cranks of opposed pistons.")


@dataclass(frozen=True)
class LayoutInput:
    """Engine description that a layout is given.

    Attributes
    ----------
    options
        Values of the keys of this layout alone in SI; None for a key that is left out or open.
    places
        Index of the place of each cylinder by its number, where places are counted as in C3.
    firing_intervals
        Crank angles from each firing of the order to the next [rad]; empty if each is at the first dead centre.
    piston_mass
        Reciprocating mass without the share of `rod` [kg].
    rod
        Connecting rod, if the file gives it as a rigid body.
    gas
        True if gas acts on the pistons.
    single
        Description of each cylinder that has numbers of its own, by its index.
    """

    cycle: Cycle
    cylinders: int
    mechanism: Mechanism
    options: Mapping[str, Any]
    places: tuple[int, ...]
    firing_order: tuple[int, ...] | None = None
    firing_intervals: tuple[float, ...] = ()
    piston_mass: float = 0.0
    rod: Rod | None = None
    gas: bool = False
    single: Mapping[int, LayoutInput] = field(default_factory=dict)

    def spacing(self, places: int) -> float | tuple[float, ...]:
        """Return the distance between neighbouring throws along the crank, or each distance from the front [m].

        It is 1 for a single throw.
        """
        distances = self.options["cylinder_spacing"]
        if distances is None:
            if places > 1:
                raise KeyedError("cylinder_spacing", 'is missing; add it, for example "125 mm"')
            return 1.0
        if len(distances) == 1:
            return float(distances[0])
        if len(distances) != places - 1:
            rule = f"has {counted(len(distances), 'distance')} between {counted(places, 'place')} along the crank"
            raise KeyedError("cylinder_spacing", f"{rule}; give {places - 1}, or one for all")
        return tuple(distances)

    def of(self, k: int) -> LayoutInput:
        """Return the description of cylinder k (from zero), which may have numbers of its own."""
        return self.single.get(k, self)

    def at_place(self, place: int) -> LayoutInput:
        """Return the description of the cylinder at a place of the layout (C3)."""
        return self.of(self.places.index(place))

    @property
    def crank_distance(self) -> float:
        """Distance of the two cranks of opposed pistons [m], whose axes have no offset."""
        distance, offset = self.options["crank_distance"], self.mechanism.part.offset
        if distance is None:
            raise KeyedError("crank_distance", "is missing; add the distance between two cranks")
        if offset:
            rule = "means nothing for pistons on one axis; leave it out"
            raise KeyedError("offset", rule, units.quantity_text(offset, "m"))
        return float(distance)


def rod_of(key: str, table: Mapping[str, float], length: float, end: str) -> Rod:
    """Return the rod that a table of [engine] describes; its centre of gravity counts from the pin `end`."""
    if not 0.0 <= table["centre_of_gravity"] <= length:
        rule = f"does not lie on the rod of {units.quantity_text(length, 'm')}; count it from the {end}"
        raise KeyedError(f"{key}.centre_of_gravity", rule, units.quantity_text(table["centre_of_gravity"], "m"))
    return Rod(length, **table)


class LayoutKind(ABC):
    """Layout of cylinders: keys, open numbers and construction; a new one is a file and a line in `LAYOUTS`.

    Attributes
    ----------
    keys
        Keys of [engine] in addition to those of every layout.
    lists
        Keys among `throws`, `firing_order`, `firing_intervals`, `slider_cranks` and `shafts` that the layout takes.
    openable
        Keys that may be left open.
    banks
        Number of banks, which each have a cylinder at every place along the crank.
    is_free
        True if the file lists every slider-crank with its place.
    fires_evenly
        True if open throws take the steps of even firing only, and loads on the block distinguish them.
    needs_rod
        True if the layout needs a drive with a connecting rod.
    has_pistons
        True if [engine] gives pistons, rods and strokes; else keys of the layout alone give the mechanism.
    single
        Keys of [engine] that a single cylinder may have of its own.
    """

    name: ClassVar[str]
    keys: ClassVar[tuple[LayoutKey, ...]] = (SPACING,)
    lists: ClassVar[tuple[str, ...]] = ("throws", "firing_order", "firing_intervals")
    openable: ClassVar[tuple[str, ...]] = ()
    cylinders_per_throw: ClassVar[int] = 1
    banks: ClassVar[int] = 1
    is_free: ClassVar[bool] = False
    fires_evenly: ClassVar[bool] = False
    needs_rod: ClassVar[bool] = False
    has_pistons: ClassVar[bool] = True
    single: ClassVar[tuple[str, ...]] = (*OF_CYLINDER, "offset")

    def takes(self, key: str) -> bool:
        """Return True if the layout takes a key."""
        return key in self.lists or any(layout_key.name == key for layout_key in self.keys)

    def cycle(self, said: Cycle) -> Cycle:
        """Return the cycle in which loads repeat, from the cycle of the chambers, `said` (C6)."""
        return said

    def mechanism(self, options: Mapping[str, Any], **shared: Any) -> Mechanism:
        """Return the shared numbers of cylinders of a layout without pistons, from options as in `LayoutInput`.

        `rotating_mass` and `big_end` are what [engine] says of all mechanisms.
        """
        raise NotImplementedError(f"layout '{self.name}' has pistons")

    @abstractmethod
    def place(self, inputs: LayoutInput) -> Layout:
        """Return the layout: positions, banks and pins of the cylinders.

        Raises
        ------
        ModelError
            If there is no such layout; a `KeyedError` if one key is the cause.
        """

    def parts(
        self, inputs: LayoutInput, layout: Layout, throws: Sequence[float]
    ) -> tuple[tuple[SliderCrank, ...], tuple[Throw, ...]]:
        """Return the slider-cranks and the throws that they work on."""
        mechanisms = [inputs.of(k).mechanism for k in range(inputs.cylinders)]
        return build(inputs.cycle, layout, mechanisms, throws, inputs.firing_order, inputs.firing_intervals)

    def layout(self, inputs: LayoutInput) -> Layout:
        """Return the layout by cylinder numbers, with the dead centres of cylinders of different offset."""
        layout = _with_dead_centres(self.place(inputs), inputs)
        return layout if list(inputs.places) == sorted(inputs.places) else layout.renumbered(inputs.places)


def _with_dead_centres(layout: Layout, inputs: LayoutInput) -> Layout:
    """Return the layout with the offset and true dead centre of every cylinder, if these differ."""
    mechanisms = [inputs.at_place(place).mechanism for place in range(inputs.cylinders)]
    offsets = layout.offsets or tuple(mechanism.part.offset for mechanism in mechanisms)
    fires = tuple(mechanism.part.fires_at for mechanism in mechanisms)
    if layout.firing_delays or not any((*offsets, *fires)):
        return layout
    if any(fires) and not layout.offsets:
        return replace(layout, firing_delays=fires)
    if any(type(mechanism.part) is not SliderCrank for mechanism in mechanisms):
        if layout.offsets or inputs.single:
            raise KeyedError("offset", "needs a slider-crank if cylinders differ; leave the offset out")
        return layout
    parts = (replace(mechanism.part, offset=offset) for mechanism, offset in zip(mechanisms, offsets, strict=True))
    delays = tuple(part.dead_centres[0] for part in parts)
    if len(set(delays)) == 1 and not layout.offsets:
        return layout
    return replace(layout, offsets=offsets, firing_delays=delays)


class Parts(LayoutKind):
    """Layout by a free list of slider-cranks, each with its own position."""

    name = "parts"
    keys = ()
    lists = ("slider_cranks", "shafts", "firing_order", "firing_intervals")
    is_free = True

    def place(self, inputs: LayoutInput) -> Layout:
        """Raise ModelError: the list of slider-cranks gives every position."""
        raise ModelError(f"a list of {counted(inputs.cylinders, 'slider-crank')} has no layout; fix the throws")
