"""[objective] and [[constraints]] of a problem file: their tables, and the measures they make of an engine."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import Field, ValidationError

from laufruhe import units
from laufruhe.errors import ModelError
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, measured, nearest, one_of
from laufruhe.files.fields import Name, Table
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.machine.clearances import shafts_of
from laufruhe.problem.channels import Channel, LoadChannel, Needs
from laufruhe.problem.measure import MEAN_MOUNT_FORCE, MEASURES, Limit, Measure, Rank, Term, counted_rotors, radius_of

T = TypeVar("T")
Motion = Literal["fore-aft", "lateral", "bounce", "roll", "pitch", "yaw"]
QuantityName: TypeAlias = Annotated[str, Field(json_schema_extra={"enum": list(MEASURES)})]
_NEEDS = {
    Needs.MOUNTS: ("needs mounts", "add [mounts], or ask for a shaking force"),
    Needs.ELASTIC: ("needs elastic mounts", 'add [mounts] with kind = "elastic", and [block]'),
    Needs.BEARINGS: ("needs main bearings", "list them in [[main_bearings]]"),
    Needs.TORSION: ("needs the discs and shafts of the crankshaft", "add [torsion]"),
    Needs.DIAMETERS: ("needs the diameter of a shaft", "give one in [torsion]"),
    Needs.FLYWHEEL: (
        "needs a flywheel",
        "add [flywheel] with an inertia or a rim, [torsion], or fidelity.crank_inertia",
    ),
    Needs.ROTORS: ("needs the rotors of a rotary engine", 'take layout = "rotary"'),
    Needs.RIM: ("needs the rim of a flywheel", "add [flywheel.rim]"),
    Needs.RUN: ("needs elastic mounts that an engine is run up on", "add [run_up] and [mounts] of kind elastic"),
    Needs.ARMS: ("needs the arms of a flywheel", "add [flywheel.rim.arms]"),
}
_PLACES = {
    "mounts": "mount",
    "bearings": "main bearing",
    "cylinders": "cylinder",
    "sections": "shaft section",
    "webs": "web",
}
_KEYS = ("operating_points", "orders", *_PLACES, "direction_weights", "motions", "frequency", "of")
_ROUNDING = 1e-9
_SIDES = ("min", "max", "outside")


class QuantityTable(Table):
    """What part of a quantity counts."""

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
    direction_weights: f.Three[f.NonNegative] | None = None
    motions: list[Motion] | None = f.told("Motions that should have a mode of their own; all by default.")
    frequency: f.Frequency | None = f.told("Wanted natural frequency about the torque-roll axis.")


class TermTable(QuantityTable):
    """One part of a weighted objective."""

    quantity: QuantityName
    weight: f.Positive = 1.0


class ObjectiveTable(QuantityTable):
    """What is minimised: one quantity, or a weighted sum of terms."""

    minimise: QuantityName | None = None
    terms: list[TermTable] = Field(default_factory=list)
    within: f.NonNegative | None = f.told("Share by which objectives after it may exceed its least value.")


class ConstraintTable(QuantityTable):
    """A limit on a quantity."""

    limit: QuantityName
    max: f.Side | None = Field(
        default=None, description="Largest value allowed, in the unit of the quantity.", examples=["6 kg"]
    )
    min: f.Side | None = f.told("Smallest value allowed, of natural frequencies, decoupling, sag or distance.")
    outside: f.Pair[f.Side] | None = Field(
        default=None,
        description="Band in which no natural frequency or critical speed may lie.",
        examples=[["12 Hz", "20 Hz"]],
    )
    name: Name | None = None
    of: list[str] | None = f.told("Names of the counterweights or balancers whose mass counts, or of shafts.")


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
        if not self._has(channel.needs):
            raise Refused(where, name, *_NEEDS[channel.needs])
        self._check_keys(channel, table, at)
        weights = table.direction_weights
        found = Measure(
            channel, norm, self._places(channel, table, at), _tuple(table.operating_points), _tuple(of),
            _tuple(table.orders), None if weights is None else (weights[0], weights[1], weights[2]),
            _tuple(table.motions), table.frequency or 0.0,
        )  # fmt: skip
        if found.is_mass:
            self._counts(found, of, at)
        if channel.is_placing:
            shafts = shafts_of(self.engine)
            _known(of, shafts, f"{at}.of", "shaft")
            if not shafts:
                raise Refused(f"{at}", name, "counts balancer shafts, and there are none", "add one, or leave it out")
        return found

    def _has(self, needs: Needs) -> bool:
        """Whether the engine has what a channel needs."""
        engine, chain, wheel = self.engine, self.engine.torsion, self.engine.flywheel
        rim = wheel.rim if wheel else None
        has = {
            Needs.NOTHING: True,
            Needs.MOUNTS: bool(engine.mounts),
            Needs.ELASTIC: engine.block is not None,
            Needs.BEARINGS: bool(engine.bearings),
            Needs.TORSION: chain is not None,
            Needs.DIAMETERS: chain is not None and any(s.diameter is not None for s in chain.sections),
            Needs.FLYWHEEL: wheel is not None or chain is not None,
            Needs.RIM: rim is not None,
            Needs.RUN: engine.run is not None,
            Needs.ROTORS: any(not part.has_rod for part in engine.slider_cranks),
            Needs.ARMS: rim is not None and rim.arms is not None,
        }
        return has[needs]

    def _check_keys(self, channel: Channel, table: QuantityTable, at: str) -> None:
        """Refuse keys that mean nothing for a channel, and names of what is not there."""
        of = getattr(table, "of", None)
        for key in _KEYS:
            if getattr(table, key, None) == []:
                raise Refused(f"{at}.{key}", [], "is empty", "leave it out to count all")
            if getattr(table, key, None) is not None and key not in channel.keys:
                raise Refused(f"{at}.{key}", of if key == "of" else None, _stray(key, channel), "leave it out")
        points = [point.name for point in self.points]
        _known(table.operating_points, points, f"{at}.operating_points", "operating point")
        if "frequency" in channel.keys and table.frequency is None:
            remedy = "say which natural frequency about the axis is wanted"
            raise Refused(f"{at}.frequency", None, "is missing", remedy)
        self._orders(table.orders, f"{at}.orders")

    def _places(self, channel: Channel, table: QuantityTable, at: str) -> tuple[str, ...] | None:
        """Names of the places that count; all where none are named."""
        for key, what in _PLACES.items():
            if isinstance(channel, LoadChannel) and key in channel.keys:
                names = getattr(table, key)
                _known(names, channel.places(self.engine), f"{at}.{key}", what)
                return _tuple(names)
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
        if not counted:
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
    if channel.is_load and key in _PLACES:
        return f"means nothing for a {channel}, which has no {_PLACES[key]} of its own"
    if channel.is_load and key == "direction_weights":
        return f"is for forces and travels at places, not for a {channel}"
    return f"means nothing for {channel}" if channel.is_mounting else f"means nothing for a {channel}"


def _known(names: list[str] | None, known: Sequence[str], where: str, what: str) -> None:
    for name in names or ():
        if name not in known:
            raise Refused(where, name, f"is no {what} here", nearest(name, list(known)) if known else "add it")


def _tuple(entries: Sequence[T] | None) -> tuple[T, ...] | None:
    return None if entries is None else tuple(entries)


def objectives_of(tables: Sequence[ObjectiveTable] | None, scene: Scene, single: Sequence[str]) -> tuple[Rank, ...]:
    """What is to be least, in order of rank; the mean mount force where nothing is said.

    Parameters
    ----------
    single
        Keys of the file that go with one objective only.
    """
    if tables is None:
        return (Rank((Term(MEAN_MOUNT_FORCE),)),) if scene.engine.mounts else ()
    if not tables:
        raise Refused("objective", [], "is empty", "leave it out, or say what is to be minimised")
    last = len(tables) - 1
    if last and single:
        rule = f"needs a single objective, and there are {len(tables)} in order"
        raise Refused(single[0], None, rule, "leave it out, or keep the first of them")
    return tuple(
        _ranked(table, scene, f"objective[{k + 1}]" if last else "objective", k == last)
        for k, table in enumerate(tables)
    )


def _ranked(table: ObjectiveTable, scene: Scene, where: str, is_last: bool) -> Rank:
    """One objective, which limits those after it."""
    terms = _terms(table, scene, where)
    if is_last and table.within is not None:
        raise Refused(f"{where}.within", table.within, "is for an objective that others follow", "leave it out")
    if not is_last and len(terms) > 1:
        rule = "is a weighted sum before other objectives, and no limit is one"
        raise Refused(f"{where}.terms", None, rule, "put it last, or rank its parts")
    if not is_last and "max" not in terms[0].measure.channel.sides:
        rule = "stands before other objectives, and has no largest value to limit"
        raise Refused(f"{where}.minimise", terms[0].measure.name, rule, "put it last")
    return Rank(terms, table.within or 0.0)


def _terms(table: ObjectiveTable, scene: Scene, where: str) -> tuple[Term, ...]:
    """Its measures with their weights, norms of loads before numbers of the mounts."""
    one_of(table, where, "minimise", "terms", shown=table.minimise, named=f"[[{where.split('[')[0]}.terms]]")
    if table.minimise is not None:
        return (Term(_minimised(table.minimise, table, f"{where}.minimise", scene)),)
    found = [
        Term(_minimised(term.quantity, term, f"{where}.terms[{k + 1}].quantity", scene), term.weight)
        for k, term in enumerate(table.terms)
    ]
    return tuple(sorted(found, key=lambda term: term.measure.channel.is_number))


def _minimised(name: str, table: QuantityTable, where: str, scene: Scene) -> Measure:
    found = scene.measure(name, table, where)
    if not found.channel.minimised:
        others = [n for n, (channel, _) in MEASURES.items() if channel.is_number and channel.minimised]
        raise Refused(where, name, "is not minimised but limited", "use one of: " + ", ".join(others))
    return found


def limits_of(tables: Sequence[ConstraintTable], scene: Scene) -> tuple[Limit, ...]:
    """What is forbidden, limits of loads and masses before those of numbers."""
    found = [_limit(table, f"constraints[{k + 1}]", scene) for k, table in enumerate(tables)]
    found.sort(key=lambda limit: limit.measure.channel.is_number)
    _check_together([limit for limit in found if limit.measure.channel.is_number])
    return tuple(found)


def _limit(table: ConstraintTable, where: str, scene: Scene) -> Limit:
    measure = scene.measure(table.limit, table, f"{where}.limit")
    sides, channel = measure.channel.sides, measure.channel
    norm, remedy = not channel.is_number, "give " + " or ".join(sides)
    for key in _SIDES:
        if getattr(table, key) is not None and key not in sides:
            rule = f"{channel}, which has a largest value only" if norm else table.limit
            raise Refused(f"{where}.{key}", None, f"cannot stand beside {rule}", remedy)
    if all(getattr(table, key) is None for key in sides):
        raise Refused(f"{where}.{sides[0]}", None, "is missing", "add it" if norm else remedy)
    low, high = (_side(getattr(table, key), measure, f"{where}.{key}") for key in ("min", "max"))
    if not norm and "max" not in sides and low is not None and low > 1.0:
        raise Refused(f"{where}.min", table.min, "is more than the whole energy", "give a share under 1")
    largest, least = math.inf if high is None else high, -math.inf if low is None else low
    return Limit(table.name or measure.name, measure, largest, least, _band(table, measure, where))


def limit_name(entry: Mapping[str, Any]) -> str | None:
    """The name by which results show a limit of a file; None where it is no limit."""
    try:
        table = ConstraintTable.model_validate(entry)
    except ValidationError:
        return None
    if table.name or table.limit not in MEASURES:
        return table.name
    channel, norm = MEASURES[table.limit]
    at = next((getattr(table, key) for key in _PLACES if getattr(table, key)), None)
    points, motions = _tuple(table.operating_points), _tuple(table.motions)
    return Measure(channel, norm, _tuple(at), points, None, _tuple(table.orders), None, motions).name


def _side(text: str | None, measure: Measure, where: str) -> float | None:
    if text is None:
        return None
    value = measured(text, measure.unit, where)
    if value < 0.0:
        rule = "is negative" if measure.channel.is_number else "is negative, and no norm is"
        raise Refused(where, text, rule, "give a value of zero or more")
    return value


def _band(table: ConstraintTable, measure: Measure, where: str) -> tuple[float, float] | None:
    if table.outside is None:
        return None
    low, high = (_side(text, measure, f"{where}.outside") or 0.0 for text in table.outside)
    if not low < high:
        raise Refused(f"{where}.outside", table.outside, "is no band", "write the smaller one first")
    return low, high


def _check_together(limits: Sequence[Limit]) -> None:
    """Refuse a least value above a largest one of the same measure."""
    for low in limits:
        for high in limits:
            if low.measure != high.measure or low.minimum <= high.maximum:
                continue
            unit = low.measure.unit
            rule = f"at least {units.shown(low.minimum, unit)} and at most {units.shown(high.maximum, unit)}"
            both = f"'{low.name}' and '{high.name}' contradict each other"
            said = both if low is not high else f"'{low.name}' contradicts itself"
            raise Refused("constraints", None, f"{said}: {rule}", "let the limits leave room")
