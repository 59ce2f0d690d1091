"""Labelled arrays of designs: loads over the crank angle and by order, and natural modes.

Scripts get them as xarray datasets, files as columns of a table.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from laufruhe.errors import ModelError, check_integer
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum, common_base, order_amplitude
from laufruhe.physics.bearing_loads import has_bearing_loads
from laufruhe.physics.modes import MOTIONS
from laufruhe.problem.channels import (
    CRANK_PIN_FORCE,
    CRANK_TORQUE,
    MAIN_BEARING_FORCE,
    MOUNT_FORCE,
    MOUNT_TRAVEL,
    LoadChannel,
    mounting_in,
)
from laufruhe.problem.evaluation import Evaluation, with_common_base
from laufruhe.problem.loads import PointLoads

if TYPE_CHECKING:
    import xarray as xr

MAX_STEPS = 1_000_000
STEPS = 720
"""Default number of samples over the cycle."""


@dataclass(frozen=True)
class CurveAxis:
    """Dimension of an array: its name, labels, and their unit."""

    name: str
    labels: tuple[Any, ...]
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Field:
    """Quantity as an array along the common axes of all fields and along further axes.

    Attributes
    ----------
    name, words
        Name in datasets, and name in headings.
    unit
        SI unit; empty for a ratio.
    own_axes
        Axes of this quantity alone, after the common ones.
    values
        Values, shape (common axes ..., own axes ...).
    """

    name: str
    words: str
    unit: str
    own_axes: tuple[CurveAxis, ...]
    values: Array

    def columns(self) -> Iterator[tuple[str, tuple[int, ...]]]:
        """Yield heading and index of each column, one for each index of its own axes."""
        for index in itertools.product(*(range(len(axis.labels)) for axis in self.own_axes)):
            labels = [(axis.name, axis.labels[k]) for axis, k in zip(self.own_axes, index, strict=True)]
            texts = [f"{name} {label}" if isinstance(label, int | float) else str(label) for name, label in labels]
            yield f"{' '.join([self.words, *texts])} [{self.unit or '-'}]", index


@dataclass(frozen=True, eq=False)
class Fields:
    """Fields on common axes.

    Attributes
    ----------
    designs
        First common axis: the designs.
    rows
        Further common axes: those of the rows of a table.
    """

    title: str
    designs: CurveAxis
    rows: tuple[CurveAxis, ...]
    fields: tuple[Field, ...]

    def dataset(self) -> xr.Dataset:
        """Return an xarray dataset with units and words as attributes."""
        import xarray as xr

        shared = (self.designs, *self.rows)
        variables = {
            field.name: (
                [axis.name for axis in (*shared, *field.own_axes)],
                field.values,
                {"units": field.unit or "1", "long_name": field.words},
            )
            for field in self.fields
        }
        axes = {axis.name: axis for axis in (*shared, *(axis for field in self.fields for axis in field.own_axes))}
        units = {name: {"units": axis.unit} if axis.unit else {} for name, axis in axes.items()}
        coords = {name: ([name], list(axis.labels), units[name]) for name, axis in axes.items()}
        return xr.Dataset(variables, coords, {"title": self.title})

    def table(self) -> tuple[list[str], Iterator[list[Any]]]:
        """Return headings and rows: one row for each index of the row axes, with the designs in columns."""
        named = len(self.designs.labels) > 1
        columns = [
            (f"{design}: {head}" if named else head, field.values[k][..., *index])
            for field in self.fields
            for head, index in field.columns()
            for k, design in enumerate(self.designs.labels)
        ]
        heads = [f"{axis.name} [{axis.unit}]" if axis.unit else axis.name for axis in self.rows]
        flat = [values.reshape(-1).tolist() for _, values in columns]
        leads = itertools.product(*(axis.labels for axis in self.rows))
        rows = ([*lead, *cells] for lead, *cells in zip(leads, *flat, strict=True))
        return [*heads, *(head for head, _ in columns)], rows


def forces_of(designs: Mapping[str, Evaluation], steps: int = STEPS) -> Fields:
    """Return the loads on block, mounts and bearings, and the mount travel, over the cycle (C7).

    Parameters
    ----------
    steps
        Number of samples over the cycle.
    """
    check_integer("steps", steps, 1, MAX_STEPS)
    first = next(iter(designs.values()))
    turn = first.engine.cycle.angle
    angles = CurveAxis("angle", tuple(float(k) for k in np.degrees(turn) * np.arange(steps) / steps), "deg")
    axes, names = ("x", "y", "z"), [loads.point.name for loads in first.loads]

    def sampled(signals: list[list[Spectrum]]) -> Array:
        base = first.engine.cycle.base_order
        return np.array(
            [[with_common_base(base, [one])[0].sample(steps) for one in of_design] for of_design in signals]
        )

    wrenches = sampled([[loads.wrench for loads in design.loads] for design in designs.values()])
    direction = CurveAxis("direction", axes)
    fields = [
        Field("shaking_force", "shaking force", "N", (direction,), wrenches[..., :3]),
        Field("shaking_moment", "shaking moment", "N m", (direction,), wrenches[..., 3:]),
    ]
    for name, words, place, channel in _places(first):
        values = sampled([[channel.signal(loads) for loads in design.loads] for design in designs.values()])
        places = CurveAxis(place, tuple(channel.places(first.engine)))
        if values.shape[-1] == len(axes):
            fields.append(Field(name, words, channel.unit, (places, direction), values))
        else:
            fields.append(Field(name, words, channel.unit, (places,), values[..., 0]))
    rows = (CurveAxis("point", tuple(names)), angles)
    return Fields("Loads over the crank angle", CurveAxis("design", tuple(designs)), rows, tuple(fields))


def orders_of(designs: Mapping[str, Evaluation]) -> Fields:
    """Return the amplitudes by order of the loads on block, mounts and bearings (C8)."""
    first = next(iter(designs.values()))
    base = common_base([loads.wrench.base for design in designs.values() for loads in design.loads])
    signals: dict[str, tuple[str, str, tuple[CurveAxis, ...], Callable[[PointLoads], Spectrum]]] = {
        "shaking_force": ("shaking force", "N", (), lambda loads: loads.wrench.mapped(lambda c: c[..., :3])),
        "shaking_moment": ("shaking moment", "N m", (), lambda loads: loads.wrench.mapped(lambda c: c[..., 3:])),
        "roll_moment": ("roll moment", "N m", (), lambda loads: loads.wrench.mapped(lambda c: c[..., 3:4])),
        "rocking_couple": ("rocking couple", "N m", (), lambda loads: loads.wrench.mapped(lambda c: c[..., 4:])),
    }
    for name, words, place, channel in _places(first):
        axes = (CurveAxis(place, tuple(channel.places(first.engine))),)
        signals[name] = (words, channel.unit, axes, channel.signal)
    spectra = {
        name: [[signal(loads).with_finer_base(base) for loads in design.loads] for design in designs.values()]
        for name, (_, _, _, signal) in signals.items()
    }
    count = max(len(spectrum.coefficients) for rows in spectra.values() for row in rows for spectrum in row)

    def amplitudes(spectrum: Spectrum) -> Array:
        # a resonance has no finite amplitude
        with np.errstate(invalid="ignore"):
            values = order_amplitude(spectrum.coefficients)
        values = np.pad(values, [(0, count - len(values))] + [(0, 0)] * (values.ndim - 1))
        return np.where(np.isfinite(values), values, math.inf)

    fields = [
        Field(name, words, unit, axes, np.array([[amplitudes(spectrum) for spectrum in row] for row in spectra[name]]))
        for name, (words, unit, axes, _) in signals.items()
    ]
    orders = CurveAxis("order", tuple(float(k * base) for k in range(count)))
    points = CurveAxis("point", tuple(loads.point.name for loads in first.loads))
    return Fields("Amplitudes by order", CurveAxis("design", tuple(designs)), (points, orders), tuple(fields))


def modes_of(designs: Mapping[str, Evaluation]) -> Fields:
    """Return natural frequencies [Hz], loss factors and shares of kinetic energy of a block on elastic mounts.

    Raises
    ------
    ModelError
        If the engine stands on rigid mounts, or on none.
    """
    if any(design.engine.block is None or not design.engine.mounts for design in designs.values()):
        raise ModelError("has no natural modes; give [block] and elastic [mounts]", "mounts")
    modes = [mounting_in(design.engine).modes for design in designs.values()]
    motion = CurveAxis("motion", tuple(MOTIONS))
    fields = (
        Field("frequency", "natural frequency", "Hz", (), np.array([one.frequencies for one in modes])),
        Field("loss_factor", "loss factor", "", (), np.array([one.loss for one in modes])),
        Field("energy", "share of kinetic energy", "", (motion,), np.array([one.energy.T for one in modes])),
    )
    return Fields(
        "Natural modes", CurveAxis("design", tuple(designs)), (CurveAxis("mode", tuple(range(1, 7))),), fields
    )


def _places(design: Evaluation) -> Iterator[tuple[str, str, str, LoadChannel]]:
    # name, words, name of the place axis, and channel of each load with several places
    if design.engine.mounts:
        yield "mount_force", "force on", "mount", MOUNT_FORCE
    if design.engine.mounts and design.engine.block is not None:
        yield "mount_travel", "travel at", "mount", MOUNT_TRAVEL
    if has_bearing_loads(design.engine, design.fidelity):
        yield "crank_torque", "torque of", "shaft", CRANK_TORQUE
        if design.engine.bearings:
            yield "main_bearing_force", "force on", "bearing", MAIN_BEARING_FORCE
            yield "crank_pin_force", "force on pin of", "cylinder", CRANK_PIN_FORCE
