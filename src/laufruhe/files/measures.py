"""[objective] and [[constraints]] of a problem file, and the measures that they name."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, TypeAlias, TypeVar

from pydantic import Field, ValidationError

from laufruhe import units
from laufruhe.errors import ModelError
from laufruhe.extension import HOMES, missing_extension
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key, nearest, require_one_of, si_value
from laufruhe.files.engine import EngineTable
from laufruhe.files.fields import Name, Open, Table
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.problem import channels
from laufruhe.problem.channels import Channel
from laufruhe.problem.measure import (
    MEAN_MOUNT_FORCE,
    MEASURES,
    Limit,
    Measure,
    PriorityLevel,
    Term,
    counted_rotors,
    counterweight_masses,
    radius_of,
)

T = TypeVar("T")
QuantityName: TypeAlias = Annotated[str, Field(json_schema_extra={"enum": list(MEASURES)})]
Motion = Literal["fore-aft", "lateral", "bounce", "roll", "pitch", "yaw"]
PLACES = {
    "mounts": "mount",
    "bearings": "main bearing",
    "cylinders": "cylinder",
    "sections": "shaft section",
    "webs": "web",
    "receivers": "receiver",
    "electric_machines": "electric machine",
}
SIDES = {"max": "at most", "min": "at least"}
EDGES = (*SIDES, "outside")
"""Keys of the bounds of a limit."""
# channels that need a stiffness independent of frequency
_OF_CONSTANT_STIFFNESS = frozenset({
    channels.FREQUENCIES, channels.MOTION_FREQUENCIES, channels.DECOUPLING, channels.DECOUPLING_SHORTFALL,
    channels.TORQUE_ROLL, channels.RAW_TORQUE_ROLL,
})  # fmt: skip
_OF_OPEN_FREQUENCY = frozenset({channels.RAW_TORQUE_ROLL})
_ROUNDING = 1e-9


class QuantityTable(Table):
    """Keys that narrow a quantity."""

    closed: ClassVar[str] = "defines the objective or a limit, not the engine"

    mounts: list[str] | None = None
    bearings: list[str] | None = None
    cylinders: list[str] | None = None
    sections: list[str] | None = f.optional(
        "Sections of the crankshaft that count, named after the discs that they join; all by default."
    )
    webs: list[str] | None = f.optional(
        "Webs, with the journals beside them, that count: cylinder 1 front, cylinder 1 rear ..."
    )
    receivers: list[str] | None = f.optional("Receivers that count, by name; all by default.")
    electric_machines: list[str] | None = f.optional("Electric machines that count, by name; all by default.")
    operating_points: list[str] | None = None
    orders: list[f.NonNegative] | None = None
    alternating: bool | None = f.optional(
        "Whether the mean of a load over the cycle is left out, and with it the steady reaction to the mean torque; "
        "false by default."
    )
    direction_weights: f.Three[f.NonNegative] | None = None
    load_cases: list[str] | None = f.optional("Load cases that count, by name; all by default.")
    motions: list[Motion] | None = f.optional("Motions that should have a mode of their own; all by default.")
    wanted: f.Part | None = f.optional("Share of a motion in a mode of its own that is enough; 1 by default.")
    frequency: f.OpenFrequency | None = f.optional(
        "Wanted natural frequency about the torque-roll axis; of a raw residual it may be open, or left out."
    )

    def measure(self, quantity: str) -> Measure:
        """Return the measure of a quantity of `MEASURES` with these keys; no engine has checked it yet."""
        weights = self.direction_weights
        return Measure(
            *MEASURES[quantity], at=as_tuple(next((names for key in PLACES if (names := getattr(self, key))), None)),
            points=as_tuple(self.operating_points), rotors=as_tuple(getattr(self, "of", None)),
            cases=as_tuple(self.load_cases), orders=as_tuple(self.orders), motions=as_tuple(self.motions),
            direction_weights=None if weights is None else (weights[0], weights[1], weights[2]),
            frequency=(0.0, math.inf) if self.frequency is None else Open.from_value(self.frequency).bounds,
            wanted=1.0 if self.wanted is None else self.wanted, alternating=bool(self.alternating),
        )  # fmt: skip


class TermTable(QuantityTable):
    """Term of a weighted objective."""

    quantity: QuantityName
    weight: f.Positive = 1.0


class ObjectiveTable(QuantityTable):
    """Objective: one quantity, or a weighted sum of terms."""

    minimise: QuantityName | None = None
    terms: list[TermTable] = Field(default_factory=list)
    within: f.NonNegative | None = f.optional("Share by which objectives after it may exceed its least value.")


class ConstraintTable(QuantityTable):
    """A limit on a quantity."""

    limit: QuantityName
    max: f.Side | None = Field(
        default=None, description="Largest value allowed, in the unit of the quantity.", examples=["6 kg"]
    )
    min: f.Side | None = f.optional("Smallest value allowed, of natural frequencies, decoupling, sag or distance.")
    outside: f.Pair[f.Side] | None = Field(
        default=None,
        description="Band in which no natural frequency or critical speed may lie.",
        examples=[["12 Hz", "20 Hz"]],
    )
    name: Name | None = None
    of: list[str] | None = f.optional("Names of the counterweights or balancers whose mass counts, or of shafts.")


# other words for the norm "maximum"
_HIGHEST = re.compile(r"\b(peak|largest|greatest|highest|max)\b(?! to )")


@dataclass(frozen=True)
class MeasureContext:
    """Engine and operating points that measures refer to."""

    engine: Engine
    points: tuple[OperatingPoint, ...]

    def measure(self, name: str, table: QuantityTable, where: str) -> Measure:
        """Return the measure of a quantity with the keys of its table, checked for this engine."""
        if name not in MEASURES:
            adders = [
                *((text, home, str.endswith) for text, home in HOMES["channels"].items()),
                *((text, home, str.startswith) for text, home in HOMES["norms"].items()),
            ]
            homes = [
                home for text, home, has in adders
                if has(name, text) and not any(has(known, text) for known in MEASURES)
            ]  # fmt: skip
            if homes:
                raise Refused(where, name, *missing_extension(homes[0]))
            words = name.rpartition(".")[2].replace("_", " ")
            if words.replace(" ", "_") in EngineTable.model_fields and words not in MEASURES:
                rule = "is a number of the file, and no quantity"
                remedy = "limit it by its bounds, or compare its values by laufruhe.evaluate_many in Python"
                raise Refused(where, name, rule, remedy)
            usual = _HIGHEST.sub("maximum", words)
            raise Refused(where, name, "is no quantity", nearest(usual, list(MEASURES)))
        channel, key = MEASURES[name][0], where.rsplit(".", 1)[0]
        if not channel.needs.of(self.engine):
            raise Refused(where, name, f"needs {channel.needs.what}", channel.needs.remedy)
        with errors_at_key(where):
            channel.check_sizes(self.engine, self.points[0])
        for mount in self.engine.mounts if channel in _OF_CONSTANT_STIFFNESS else ():
            if mount.depends_on_frequency:
                rule = f"needs a constant stiffness, and that of mount '{mount.name}' depends on frequency"
                raise Refused(where, name, rule, "use transmissibility, mount force or mount travel")
        self._check_keys(channel, table, key)
        for places in PLACES:
            if places in channel.keys:
                _check_known(getattr(table, places), channel.places(self.engine), f"{key}.{places}", PLACES[places])
        measure = table.measure(name)
        names = getattr(table, "of", None)
        if measure.is_mass:
            self._check_masses(measure, names, key)
        elif "of" in channel.keys:
            _check_known(names, channel.places(self.engine), f"{key}.of", channel.display.place)
        return measure

    def _check_keys(self, channel: Channel, table: QuantityTable, where: str) -> None:
        """Raise `Refused` for keys that do not apply to a channel, and for unknown names in them."""
        for key in (*QuantityTable.model_fields, "of"):
            value = getattr(table, key, None)
            if value == []:
                raise Refused(f"{where}.{key}", [], "is empty", "remove this key to count all")
            if value is not None and key not in channel.keys:
                raise Refused(f"{where}.{key}", None, f"means nothing for {channel}", "leave it out")
        points, cases = ([named.name for named in listed] for listed in (self.points, self.engine.load_cases))
        _check_known(table.operating_points, points, f"{where}.operating_points", "operating point")
        _check_known(table.load_cases, cases, f"{where}.load_cases", "load case")
        if "frequency" in channel.keys and channel not in _OF_OPEN_FREQUENCY:
            remedy = "give the desired natural frequency about the axis"
            if table.frequency is None:
                raise Refused(f"{where}.frequency", None, "is missing", remedy)
            if isinstance(table.frequency, Open):
                rule = f"is open, and {channel} needs one frequency"
                raise Refused(
                    f"{where}.frequency", None, rule, f"{remedy}, or use the measure raw torque-roll residual"
                )
        base = self.engine.cycle.base_order
        for order in table.orders or ():
            # loads repeat with the cycle (C6)
            multiple = float(round(order / base) * base)
            if abs(order - multiple) > _ROUNDING:
                rule = f"contains {order:.10g}, and orders of this cycle are multiples of {base}"
                raise Refused(f"{where}.orders", table.orders, rule, f"did you mean {multiple:g}?")
        if table.alternating and 0.0 in (table.orders or ()):
            rule = "contains order 0, which alternating leaves out"
            raise Refused(f"{where}.orders", table.orders, rule, "remove 0, or alternating")

    def _check_masses(self, measure: Measure, of: list[str] | None, where: str) -> None:
        """Raise `Refused` for an empty sum of masses, and for rotors without a radius."""
        rotors = self.engine.rotors
        _check_known(of, [rotor.name for rotor in rotors], f"{where}.of", "counterweight or balancer")
        counted = counted_rotors(measure, rotors)
        if not counted and not counterweight_masses(measure, self.engine.slider_cranks):
            remedy = "add a counterweight or balancer shaft to the engine, or remove this measure"
            raise Refused(where, measure.name, "counts the mass of no part of this engine", remedy)
        for rotor in counted:
            try:
                radius_of(rotor)
            except ModelError:
                rule = f"counts the mass of '{rotor.name}', which has no radius"
                raise Refused(where, measure.name, rule, "give it a radius") from None


def _check_known(names: list[str] | None, allowed: Sequence[str], where: str, kind: str) -> None:
    for name in names or ():
        if name not in allowed:
            raise Refused(where, name, f"is no {kind} here", nearest(name, list(allowed)) if allowed else "add it")


def as_tuple(entries: Sequence[T] | None) -> tuple[T, ...] | None:
    """Return the entries of a list, or None."""
    return None if entries is None else tuple(entries)


def objectives_of(
    tables: Sequence[ObjectiveTable] | None, context: MeasureContext, single: Sequence[str]
) -> tuple[PriorityLevel, ...]:
    """Return the objectives in order of priority; without [objective] the mean mount force of an engine on mounts.

    The keys of the file in `single` require a single objective.
    """
    if tables is None:
        return (PriorityLevel((Term(MEAN_MOUNT_FORCE),)),) if context.engine.mounts else ()
    if not tables:
        raise Refused("objective", [], "is empty", 'remove it, or add minimise = "mount force"')
    if len(tables) > 1 and single:
        rule = f"needs a single objective, and there are {len(tables)}"
        raise Refused(single[0], None, rule, "remove this key, or keep the first objective alone")
    ranks = []
    for k, table in enumerate(tables, 1):
        where, is_last = f"objective[{k}]" if len(tables) > 1 else "objective", k == len(tables)
        terms = _terms(table, context, where)
        if is_last and table.within is not None:
            raise Refused(f"{where}.within", table.within, "is for all objectives except the last", "leave it out")
        if not is_last and len(terms) > 1:
            rule = "is a weighted sum, which only the last objective may be"
            raise Refused(f"{where}.terms", None, rule, "make this objective the last, or split it into several")
        if not is_last and "max" not in terms[0].measure.channel.sides:
            rule = "cannot be limited from above, so only the last objective may minimise it"
            raise Refused(f"{where}.minimise", terms[0].measure.name, rule, "put it last")
        ranks.append(PriorityLevel(terms, table.within or 0.0))
    return tuple(ranks)


def _terms(table: ObjectiveTable, context: MeasureContext, where: str) -> tuple[Term, ...]:
    # norms of loads come before numbers of the mounts
    require_one_of(table, where, "minimise", "terms", value=table.minimise, named=f"[[{where.split('[')[0]}.terms]]")
    if table.minimise is not None:
        return (Term(_minimised(table.minimise, table, f"{where}.minimise", context)),)
    terms = [
        Term(_minimised(term.quantity, term, f"{where}.terms[{k}].quantity", context), term.weight)
        for k, term in enumerate(table.terms, 1)
    ]
    return tuple(sorted(terms, key=lambda term: term.measure.channel.is_number))


def _minimised(name: str, table: QuantityTable, where: str, context: MeasureContext) -> Measure:
    measure = context.measure(name, table, where)
    if not measure.channel.minimised:
        remedy = f"limit it ([[constraints]], limit = '{name}'), and minimise a force, a moment or a mass"
        raise Refused(where, name, "can be limited but not minimised", remedy)
    return measure


def limits_of(tables: Sequence[ConstraintTable], context: MeasureContext) -> tuple[Limit, ...]:
    """Return the limits of loads and masses, and after them those of single numbers such as sag."""
    limits = [_limit(table, f"constraints[{k}]", context) for k, table in enumerate(tables, 1)]
    _check_unique(limits)
    limits.sort(key=lambda limit: limit.measure.channel.is_number)
    numbers = [limit for limit in limits if limit.measure.channel.is_number]
    for low in numbers:
        for high in numbers:
            if low.measure == high.measure and low.minimum > high.maximum:
                lower, upper = (units.quantity_text(value, low.measure.unit) for value in (low.minimum, high.maximum))
                both = f"'{low.name}' and '{high.name}' contradict each other"
                subject = both if low is not high else f"'{low.name}' contradicts itself"
                rule = f"{subject}: at least {lower} and at most {upper}"
                raise Refused("constraints", None, rule, "move the limits apart")
    return tuple(limits)


def _limit(table: ConstraintTable, where: str, context: MeasureContext) -> Limit:
    measure = context.measure(table.limit, table, f"{where}.limit")
    sides, channel = measure.channel.sides, measure.channel
    norm, remedy = not channel.is_number, "give " + " or ".join(sides)
    for key in EDGES:
        if getattr(table, key) is not None and key not in sides:
            rule = f"{channel}, which has a largest value only" if norm else table.limit
            raise Refused(f"{where}.{key}", None, f"cannot stand beside {rule}", remedy)
    if all(getattr(table, key) is None for key in sides):
        raise Refused(f"{where}.{sides[0]}", None, "is missing", "add it" if norm else remedy)
    low, high = (
        None if getattr(table, key) is None else _bound(getattr(table, key), measure, f"{where}.{key}")
        for key in ("min", "max")
    )
    if not norm and "max" not in sides and low is not None and low > 1.0:
        raise Refused(f"{where}.min", table.min, "is a share of energy above 1", "give a share under 1")
    band = None
    if table.outside is not None:
        first, last = (_bound(text, measure, f"{where}.outside") for text in table.outside)
        if not first < last:
            raise Refused(f"{where}.outside", table.outside, "has its ends reversed", "write the lower frequency first")
        band = first, last
    upper, lower = math.inf if high is None else high, -math.inf if low is None else low
    return Limit(table.name or measure.name, measure, upper, lower, band)


def _bound(text: str | float, measure: Measure, where: str) -> float:
    value = si_value(text, measure.unit, where)
    if value < 0.0:
        rule = "is negative" if measure.channel.is_number else "is negative, and a limit on a norm cannot be"
        raise Refused(where, text, rule, "give a value of zero or more")
    return value


def _check_unique(limits: Sequence[Limit]) -> None:
    # two limits on one side of one measure need different names; several bands are allowed
    first: dict[tuple[Any, ...], int] = {}
    for k, limit in enumerate(limits):
        sides = (("max", limit.maximum < math.inf), ("min", limit.minimum > -math.inf), ("outside", limit.outside))
        for side in (side for side, is_given in sides if is_given):
            band = limit.outside if side == "outside" else None
            previous = first.setdefault((limit.measure, limit.name, side, band), k)
            if previous != k:
                other = f"constraints[{previous + 1}] ('{limits[previous].name}')"
                rule = f"limits '{limit.name}' once more, beside {other}"
                raise Refused(f"constraints[{k + 1}].{side}", None, rule, "keep the tighter one, or name each")


def limit_name(entry: Mapping[str, Any]) -> str | None:
    """Return the name by which results show a limit of a file; None if the table is no limit."""
    try:
        table = ConstraintTable.model_validate(entry)
    except ValidationError:
        return None
    return table.name if table.name or table.limit not in MEASURES else table.measure(table.limit).name
