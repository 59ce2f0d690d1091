"""Quantities of a case: any measure of a problem file, and the entries of `RESULTS`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from laufruhe.extensions.replication.expressions import check_name
from laufruhe.files import fields as f
from laufruhe.files.measures import MeasureContext, QuantityTable
from laufruhe.numerics.spectrum import order_amplitude
from laufruhe.physics.modes import MOTIONS
from laufruhe.physics.rigid_body import turning_parts
from laufruhe.problem.channels import CHANNELS, mounting_in
from laufruhe.problem.evaluation import channel_samples, place_measures
from laufruhe.problem.measure import MEASURES, Measure
from laufruhe.solvers.result import Result

ORDERS = (1.0, 2.0, 4.0, 6.0)
FORCE, COUPLE = slice(0, 3), slice(4, 6)
DECISION = "decision "
PLACES = ("mount", "bearing", "cylinder", "section", "web")
_AXES = ("forward", "left", "up")
DIRECTIONS = {
    1: ("", ()),
    2: ("axis", ("along", "across")),
    3: ("direction", _AXES),
    4: ("direction", (*_AXES, "torsion")),
}
"""Names of the components of a load, by how many it has."""
DIMENSIONS = (
    "angle", "axis", "bearing", "cylinder", "direction", "firing", "mode", "motion", "mount", "number", "order",
    "section", "turns", "web",
)  # fmt: skip
"""Names of the dimensions of quantities."""


class QuantityQuery(QuantityTable):
    """A quantity of every case, narrowed."""

    quantity: str
    of: list[str] | None = f.optional("Names of the counterweights or balancers whose mass counts.")


class Labelled(NamedTuple):
    """Numbers along named dimensions as JSON holds them: nested lists, and the labels of each dimension."""

    values: Any
    coords: dict[str, list[Any]]


def check_quantity(what: str | QuantityQuery) -> None:
    """Raise `ExpressionError` with the nearest known name if a quantity does not exist."""
    name = what if isinstance(what, str) else what.quantity
    if not name.startswith(DECISION):
        check_name(name, [*RESULTS, *MEASURES], "quantity")


def quantity_value(result: Result, what: str | QuantityQuery) -> Labelled:
    """Return a quantity of the final design of a case [SI]; raise `ModelError` if its engine lacks the quantity."""
    table = QuantityQuery(quantity=what) if isinstance(what, str) else what
    name = table.quantity
    if name in RESULTS:
        return RESULTS[name](result, table)
    if name.startswith(DECISION):
        values = {decision.name: decision.value for decision in result.decisions}
        return Labelled(values.get(name.removeprefix(DECISION), math.nan), {})
    scene = MeasureContext(result.final.engine, result.problem.points)
    numbers = list(result.final.values(scene.measure(name, table, "quantities.quantity")))
    labels = {"number": list(range(1, len(numbers) + 1))}
    return Labelled(numbers, labels) if len(numbers) > 1 else Labelled(numbers[0], {})


def _signal(result: Result, _: QuantityQuery) -> Labelled:
    values = channel_samples(result.final, 0)[:, :, 1:]
    turns = result.final.engine.cycle.turns
    angle = (360.0 * turns * np.arange(len(values)) / len(values)).tolist()
    names = result.final.mount_names
    return Labelled(values.tolist(), {"angle": angle, "mount": names, "direction": ["lateral", "vertical"]})


def _over_cycle(measure: Measure, result: Result, _: QuantityQuery) -> Labelled:
    """Return a load over the cycle at each mount, bearing or other place (C2); a single place has no label."""
    channel = measure.load
    values = channel_samples(result.final, 0, channel)
    degrees = 360.0 * result.final.engine.cycle.turns
    labels: dict[str, list[Any]] = {"angle": (degrees * np.arange(len(values)) / len(values)).tolist()}
    place = next((name for name in PLACES if f"{name}s" in channel.keys), "")
    if place:
        labels[place] = list(channel.places(result.final.engine))
    dimension, names = DIRECTIONS[values.shape[-1]]
    if dimension:
        labels[dimension] = list(names)
    return Labelled(values.reshape([len(labels_of_dim) for labels_of_dim in labels.values()]).tolist(), labels)


def _by_mount(measure: str, result: Result, _: QuantityQuery) -> Labelled:
    values = [getattr(measures, measure) for measures in place_measures(result.final, 0)]
    return Labelled(values, {"mount": result.final.mount_names})


def _by_order(part: slice, result: Result, table: QuantityQuery) -> Labelled:
    orders = table.orders or ORDERS
    wrench = result.final.loads[0].wrench
    return Labelled([float(order_amplitude(wrench.at(order)[part])) for order in orders], {"order": list(orders)})


def _turning(part: slice, result: Result, table: QuantityQuery) -> Labelled:
    orders = table.orders or ORDERS
    wrenches = [result.final.loads[0].wrench.at(order)[part] for order in orders]
    values = [[float(abs(turning)) for turning in turning_parts(*wrench[-2:])] for wrench in wrenches]
    return Labelled(values, {"order": list(orders), "turns": ["with the crank", "against the crank"]})


def _firing_intervals(result: Result, _: QuantityQuery) -> Labelled:
    values = [math.degrees(angle) for angle in result.final.engine.firing_intervals]
    return Labelled(values, {"firing": list(range(1, len(values) + 1))})


RESULTS: Mapping[str, Callable[[Result, QuantityQuery], Labelled]] = {
    "mount forces": _signal,
    "mean force by mount": partial(_by_mount, "mean"),
    "maximum force by mount": partial(_by_mount, "max"),
    "free force": partial(_by_order, FORCE),
    "free couple": partial(_by_order, COUPLE),
    "turning force": partial(_turning, FORCE),
    "turning couple": partial(_turning, COUPLE),
    "firing intervals": _firing_intervals,
    "energy shares": lambda result, _: Labelled(
        mounting_in(result.final.engine).modes.energy.tolist(), {"motion": list(MOTIONS), "mode": list(range(1, 7))}
    ),
    "lower bound": lambda result, _: Labelled(result.certificate.lower_bound if result.certificate else math.nan, {}),
    **{f"{c} over the cycle": partial(_over_cycle, Measure(c)) for c in CHANNELS.values() if c.is_load},
}
"""Quantities in addition to the measures."""
