"""What a problem file asks of mounts and modes: terms of its objective, and its limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from laufruhe import units
from laufruhe.files.assemble_mounts import MountsFound
from laufruhe.files.complaints import Refused, measured, nearest
from laufruhe.files.file_models import ConstraintTable, ProblemFile, QuantityTable
from laufruhe.problem.mount_design import MOUNT_NAMES, MountDesign, MountLimit, MountMeasure, MountQuantity

_SIDES = {
    MountMeasure.TRANSMISSIBILITY: ("max",),
    MountMeasure.SAG: ("min", "max"),
    MountMeasure.FREQUENCIES: ("min", "max", "outside"),
    MountMeasure.DECOUPLING: ("min",),
    MountMeasure.TORQUE_ROLL: ("max",),
    MountMeasure.TOTAL_STIFFNESS: ("min", "max"),
}
_MINIMISED = (
    MountMeasure.TRANSMISSIBILITY, MountMeasure.SAG, MountMeasure.TORQUE_ROLL, MountMeasure.TOTAL_STIFFNESS,
)  # fmt: skip
_GOES_WITH = {
    "orders": (MountMeasure.TRANSMISSIBILITY,),
    "operating_points": (MountMeasure.TRANSMISSIBILITY,),
    "motions": (MountMeasure.DECOUPLING,),
    "frequency": (MountMeasure.TORQUE_ROLL,),
    "mounts": (),
    "direction_weights": (),
}


def asked_of_mounts(file: ProblemFile, found: MountsFound, points: Sequence[str]) -> MountDesign:
    """Decisions on mounts as found, with the terms and limits that speak of mounts and modes."""
    wanted = file.objective
    terms: list[tuple[MountQuantity, float]] = []
    if wanted is not None and wanted.minimise in MOUNT_NAMES:
        terms.append((_minimised(str(wanted.minimise), wanted, "objective.minimise", found, points), 1.0))
    for k, term in enumerate(wanted.terms if wanted is not None else []):
        if term.quantity in MOUNT_NAMES:
            where = f"objective.terms[{k + 1}].quantity"
            terms.append((_minimised(term.quantity, term, where, found, points), term.weight))
    limits = [
        _limit(table, f"constraints[{k + 1}]", found, points)
        for k, table in enumerate(file.constraints)
        if table.limit in MOUNT_NAMES
    ]
    _check_together(limits)
    return replace(
        found.design,
        terms=tuple(terms),
        limits=tuple(limits),
        starts=file.search.starts,
        seed=file.search.seed,
        boxes=file.search.boxes,
    )


def _quantity(name: str, table: QuantityTable, where: str, found: MountsFound, points: Sequence[str]) -> MountQuantity:
    measure, at = MountMeasure(name), where.rsplit(".", 1)[0]
    if found.block is None:
        raise Refused(where, name, "needs elastic mounts", 'add [mounts] with kind = "elastic", and [block]')
    for key, measures in _GOES_WITH.items():
        if getattr(table, key) is not None and measure not in measures:
            raise Refused(f"{at}.{key}", None, f"means nothing for {name}", "leave it out")
    for point in table.operating_points or ():
        if point not in points:
            raise Refused(f"{at}.operating_points", point, "is no operating point here", nearest(point, list(points)))
    if measure is MountMeasure.TORQUE_ROLL and table.frequency is None:
        raise Refused(f"{at}.frequency", None, "is missing", "say which natural frequency about the axis is wanted")
    return MountQuantity(
        measure,
        points=None if table.operating_points is None else tuple(table.operating_points),
        orders=None if table.orders is None else tuple(table.orders),
        motions=None if table.motions is None else tuple(table.motions),
        frequency=table.frequency or 0.0,
    )


def _minimised(name: str, table: QuantityTable, where: str, found: MountsFound, points: Sequence[str]) -> MountQuantity:
    quantity = _quantity(name, table, where, found, points)
    if quantity.measure not in _MINIMISED:
        raise Refused(where, name, "is not minimised but limited", "use one of: " + ", ".join(_MINIMISED))
    return quantity


def _limit(table: ConstraintTable, where: str, found: MountsFound, points: Sequence[str]) -> MountLimit:
    quantity = _quantity(table.limit, table, f"{where}.limit", found, points)
    if table.of is not None:
        raise Refused(f"{where}.of", table.of, "goes with masses only", "leave it out")
    allowed = _SIDES[quantity.measure]
    for key in ("min", "max", "outside"):
        if getattr(table, key) is not None and key not in allowed:
            raise Refused(f"{where}.{key}", None, f"does not go with {table.limit}", "give " + " or ".join(allowed))
    if all(getattr(table, key) is None for key in allowed):
        raise Refused(f"{where}.{allowed[0]}", None, "is missing", "give " + " or ".join(allowed))
    band = None
    if table.outside is not None:
        low, high = (_side(text, quantity.unit, f"{where}.outside") for text in table.outside)
        if not low < high:
            raise Refused(f"{where}.outside", table.outside, "is no band", "write the smaller one first")
        band = (low, high)
    limit = MountLimit(
        table.name or quantity.name,
        quantity,
        None if table.min is None else _side(table.min, quantity.unit, f"{where}.min"),
        None if table.max is None else _side(table.max, quantity.unit, f"{where}.max"),
        band,
    )
    if quantity.measure is MountMeasure.DECOUPLING and limit.minimum is not None and limit.minimum > 1.0:
        raise Refused(f"{where}.min", table.min, "is more than the whole energy", "give a share under 1")
    return limit


def _side(text: str, unit: str, where: str) -> float:
    value = measured(text, unit, where)
    if value < 0.0:
        raise Refused(where, text, "is negative", "give a value of zero or more")
    return value


def _check_together(limits: Sequence[MountLimit]) -> None:
    """Refuse a least value above a largest one of the same quantity."""
    pairs = [(low, high) for low in limits for high in limits if low.quantity == high.quantity]
    for low, high in pairs:
        if low.minimum is not None and high.maximum is not None and low.minimum > high.maximum:
            unit = low.quantity.unit
            rule = f"at least {units.shown(low.minimum, unit)} and at most {units.shown(high.maximum, unit)}"
            said = (
                f"'{low.name}' and '{high.name}' contradict each other"
                if low is not high
                else f"'{low.name}' contradicts itself"
            )
            raise Refused("constraints", None, f"{said}: {rule}", "let the limits leave room")
