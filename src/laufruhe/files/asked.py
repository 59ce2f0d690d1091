"""[objective] and [[constraints]] of a problem file: their tables, and the measures they make of an engine."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, TypeAlias

from pydantic import Field, ValidationError

from laufruhe import units
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, measured, one_of
from laufruhe.files.fields import Name
from laufruhe.files.scene import PLACES, QuantityTable, Scene, as_tuple
from laufruhe.problem.measure import MEAN_MOUNT_FORCE, MEASURES, Limit, Measure, Rank, Term

QuantityName: TypeAlias = Annotated[str, Field(json_schema_extra={"enum": list(MEASURES)})]
SIDES = {"max": "at most", "min": "at least"}
EDGES = (*SIDES, "outside")
"""Keys of a limit that say where it stands."""


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
        remedy = f"limit it ([[constraints]], limit = '{name}'), and minimise a force, a moment or a mass"
        raise Refused(where, name, "is not minimised but limited", remedy)
    return found


def limits_of(tables: Sequence[ConstraintTable], scene: Scene) -> tuple[Limit, ...]:
    """What is forbidden, limits of loads and masses before those of numbers."""
    found = [_limit(table, f"constraints[{k + 1}]", scene) for k, table in enumerate(tables)]
    _check_once(found)
    found.sort(key=lambda limit: limit.measure.channel.is_number)
    _check_together([limit for limit in found if limit.measure.channel.is_number])
    return tuple(found)


def _limit(table: ConstraintTable, where: str, scene: Scene) -> Limit:
    measure = scene.measure(table.limit, table, f"{where}.limit")
    sides, channel = measure.channel.sides, measure.channel
    norm, remedy = not channel.is_number, "give " + " or ".join(sides)
    for key in EDGES:
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
    at = next((getattr(table, key) for key in PLACES if getattr(table, key)), None)
    found = Measure(
        channel, norm, as_tuple(at), as_tuple(table.operating_points), orders=as_tuple(table.orders),
        motions=as_tuple(table.motions), alternating=bool(table.alternating),
    )  # fmt: skip
    return found.name


def _side(text: str | float | None, measure: Measure, where: str) -> float | None:
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


def _check_once(limits: Sequence[Limit]) -> None:
    """Refuse two limits of one side of one measure, unless names tell them apart: of several bands each is its own."""
    given: dict[tuple[Any, ...], int] = {}
    for k, limit in enumerate(limits):
        sides = (("max", limit.maximum < math.inf), ("min", limit.minimum > -math.inf), ("outside", limit.outside))
        for side in (side for side, is_given in sides if is_given):
            other = given.setdefault((limit.measure, limit.name, side, limit.outside if side == "outside" else None), k)
            if other != k:
                beside = f"beside constraints[{other + 1}] ('{limits[other].name}')"
                rule, remedy = f"limits '{limit.name}' once more, {beside}", "keep the tighter one, or give each a name"
                raise Refused(f"constraints[{k + 1}].{side}", None, rule, remedy)


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
