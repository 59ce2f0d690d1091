"""What measures of a problem file may refer to, and the keys that narrow them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, TypeVar

from laufruhe.errors import ModelError
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, blamed_on, nearest
from laufruhe.files.fields import Open, Table
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.machine.clearances import shafts_of
from laufruhe.problem.channels import Channel
from laufruhe.problem.measure import MEASURES, Measure, counted_parts, counted_rotors, radius_of

T = TypeVar("T")
Motion = Literal["fore-aft", "lateral", "bounce", "roll", "pitch", "yaw"]
PLACES = {
    "mounts": "mount",
    "bearings": "main bearing",
    "cylinders": "cylinder",
    "sections": "shaft section",
    "webs": "web",
}
_ROUNDING = 1e-9


class QuantityTable(Table):
    """What part of a quantity counts."""

    closed: ClassVar[str] = "says what is asked of a design, and a search would ask for what is easiest"

    mounts: list[str] | None = None
    bearings: list[str] | None = None
    cylinders: list[str] | None = None
    sections: list[str] | None = f.told(
        "Sections of the crankshaft that count, named after the discs that they join; all by default."
    )
    webs: list[str] | None = f.told(
        "Webs, with the journals beside them, that count: cylinder 1 front, cylinder 1 rear ..."
    )
    operating_points: list[str] | None = None
    orders: list[f.NonNegative] | None = None
    alternating: bool | None = f.told(
        "Whether the mean of a load over the cycle is left out: the steady reaction to the mean torque is then no part."
    )
    direction_weights: f.Three[f.NonNegative] | None = None
    load_cases: list[str] | None = f.told("Load cases that count, by name; all by default.")
    motions: list[Motion] | None = f.told("Motions that should have a mode of their own; all by default.")
    wanted: f.Part | None = f.told("Share of a motion in a mode of its own that is enough; 1 by default.")
    frequency: f.OpenFrequency | None = f.told(
        "Wanted natural frequency about the torque-roll axis; of a raw residual it may be open, or left out."
    )


@dataclass(frozen=True)
class Scene:
    """What measures may refer to."""

    engine: Engine
    points: tuple[OperatingPoint, ...]

    def measure(self, name: str, table: QuantityTable, where: str) -> Measure:
        """The measure that a name and its keys mean for this engine."""
        if name not in MEASURES:
            raise Refused(where, name, "is no quantity", nearest(name, list(MEASURES)))
        channel, norm = MEASURES[name]
        at, of = where.rsplit(".", 1)[0], getattr(table, "of", None)
        if not channel.needs.of(self.engine):
            raise Refused(where, name, f"needs {channel.needs.what}", channel.needs.remedy)
        with blamed_on(where):
            channel.check_sizes(self.engine, self.points[0])
        self._check_stiffness(channel, name, where)
        self._check_keys(channel, table, at)
        weights = table.direction_weights
        found = Measure(
            channel, norm, self._places(channel, table, at), as_tuple(table.operating_points), as_tuple(of),
            as_tuple(table.orders), None if weights is None else (weights[0], weights[1], weights[2]),
            as_tuple(table.motions), (0.0, math.inf) if table.frequency is None else Open.of(table.frequency).bounds,
            1.0 if table.wanted is None else table.wanted, as_tuple(table.load_cases), bool(table.alternating),
        )  # fmt: skip
        if found.is_mass:
            self._counts(found, of, at)
        if channel.is_placing:
            shafts = shafts_of(self.engine)
            _known(of, shafts, f"{at}.of", "shaft")
            if not shafts:
                raise Refused(f"{at}", name, "counts balancer shafts, and there are none", "add one, or leave it out")
        return found

    def _check_stiffness(self, channel: Channel, name: str, where: str) -> None:
        """Refuse what is of one stiffness where mounts have another at every frequency."""
        for mount in self.engine.mounts if channel.of_constant_stiffness else ():
            if mount.depends_on_frequency:
                rule = f"is of one stiffness, and that of mount '{mount.name}' depends on frequency"
                raise Refused(where, name, rule, "ask for transmissibility, mount force or mount travel")

    def _check_keys(self, channel: Channel, table: QuantityTable, at: str) -> None:
        """Refuse keys that mean nothing for a channel, and names of what is not there."""
        of = getattr(table, "of", None)
        for key in (*QuantityTable.model_fields, "of"):
            if getattr(table, key, None) == []:
                raise Refused(f"{at}.{key}", [], "is empty", "leave it out to count all")
            if getattr(table, key, None) is not None and key not in channel.keys:
                raise Refused(f"{at}.{key}", of if key == "of" else None, _stray(key, channel), "leave it out")
        points = [point.name for point in self.points]
        _known(table.operating_points, points, f"{at}.operating_points", "operating point")
        cases = [case.name for case in self.engine.load_cases]
        _known(table.load_cases, cases, f"{at}.load_cases", "load case")
        if "frequency" in channel.keys and not channel.open_frequency:
            remedy = "say which natural frequency about the axis is wanted"
            if table.frequency is None:
                raise Refused(f"{at}.frequency", None, "is missing", remedy)
            if isinstance(table.frequency, Open):
                rule = f"is open, and {channel} is of one frequency"
                raise Refused(f"{at}.frequency", None, rule, f"{remedy}, or ask for the raw torque-roll residual")
        self._orders(table.orders, f"{at}.orders")
        if table.alternating and 0.0 in (table.orders or ()):
            rule = "holds 0, which alternating leaves out"
            raise Refused(f"{at}.orders", table.orders, rule, "take 0 out, or alternating")

    def _places(self, channel: Channel, table: QuantityTable, at: str) -> tuple[str, ...] | None:
        """Names of the places that count; all where none are named."""
        for key, what in PLACES.items():
            if key in channel.keys:
                names = getattr(table, key)
                _known(names, channel.places(self.engine), f"{at}.{key}", what)
                return as_tuple(names)
        return None

    def _orders(self, orders: list[float] | None, where: str) -> None:
        """Refuse what no load can have: all that turns returns within the cycle (C6)."""
        base = self.engine.cycle.base_order
        for order in orders or ():
            nearby = float(round(order / base) * base)
            if abs(order - nearby) > _ROUNDING:
                rule = f"holds {order:.10g}, and the orders of its cycle are multiples of {base}"
                raise Refused(where, orders, rule, f"did you mean {nearby:g}?")

    def _counts(self, measure: Measure, of: list[str] | None, at: str) -> None:
        """Refuse masses of nothing, and of what has no radius."""
        rotors = self.engine.rotors
        _known(of, [rotor.name for rotor in rotors], f"{at}.of", "counterweight or balancer")
        counted = counted_rotors(measure, rotors)
        if not counted and not counted_parts(measure, self.engine.slider_cranks):
            raise Refused(f"{at}", measure.name, "counts nothing in this engine", "add what it counts, or leave it out")
        for rotor in counted:
            try:
                radius_of(rotor)
            except ModelError:
                rule = f"counts the mass of '{rotor.name}', which has no radius"
                raise Refused(f"{at}", measure.name, rule, "give it one") from None


def _stray(key: str, channel: Channel) -> str:
    """Why a key means nothing for a channel."""
    if key == "of":
        return "is for masses and places of shafts only"
    if channel.is_mass:
        return "means nothing for a mass"
    if channel.is_load and key == "alternating":
        return f"means nothing for {channel}: its steady part rubs as well"
    if channel.is_load and key in PLACES:
        return f"means nothing for a {channel}, which has no {PLACES[key]} of its own"
    if channel.is_load and key == "direction_weights":
        return f"is for forces and travels at places, not for a {channel}"
    return f"means nothing for {channel}" if channel.is_mounting else f"means nothing for a {channel}"


def _known(names: list[str] | None, known: Sequence[str], where: str, what: str) -> None:
    for name in names or ():
        if name not in known:
            raise Refused(where, name, f"is no {what} here", nearest(name, list(known)) if known else "add it")


def as_tuple(entries: Sequence[T] | None) -> tuple[T, ...] | None:
    """Entries of a list; all count where there is none."""
    return None if entries is None else tuple(entries)
