"""Labelled arrays of designs: loads over the crank angle and by order, and natural modes.

Scripts get them as xarray datasets, files as columns of a table.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from laufruhe.errors import ModelError, check_integer
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.spectrum import Spectrum, common_base, order_amplitude
from laufruhe.physics.modes import MOTIONS
from laufruhe.problem.channels import load_channels, mounting_in
from laufruhe.problem.evaluation import Evaluation, with_common_base
from laufruhe.problem.loads import PointLoads

if TYPE_CHECKING:
    import xarray as xr

MAX_STEPS = 1_000_000
_PREPOSITIONS = (" on", " at", " of", " in")
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
    values: Array | ComplexArray

    @property
    def long_name(self) -> str:
        """Name with that of its place, such as force on mount."""
        return f"{self.words} {self.own_axes[0].name}" if self.words.endswith(_PREPOSITIONS) else self.words

    def columns(self) -> Iterator[tuple[str, tuple[int, ...]]]:
        """Yield heading and array index of each table column of the field: one for each combination of its axes."""
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
                {"units": field.unit or "1", "long_name": field.long_name},
            )
            for field in self.fields
        }
        axes = {axis.name: axis for axis in (*shared, *(axis for field in self.fields for axis in field.own_axes))}
        units = {name: {"units": axis.unit} if axis.unit else {} for name, axis in axes.items()}
        coords = {name: ([name], list(axis.labels), units[name]) for name, axis in axes.items()}
        return labelled(xr.Dataset(variables, coords, {"title": self.title}))

    def table(self) -> tuple[list[str], Iterator[list[Any]]]:
        """Return headings and rows of a table: one row for each index of the row axes, columns for each design."""
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


def labelled(data: xr.Dataset) -> xr.Dataset:
    """Give each variable of a dataset a long name, and each count or order the unit 1, where these are missing.

    A variable that has several units names the coordinate of its units as `unit_of`.
    """
    words = {"angle": "crank angle", "order": "order of crank speed", "point": "operating point"}
    for name, values in data.variables.items():
        values.attrs.setdefault("long_name", words.get(str(name), str(name).replace("_", " ")))
        if values.dtype.kind in "iu" or name == "order":
            values.attrs.setdefault("units", "1")
    return data


def forces_of(designs: Mapping[str, Evaluation], steps: int = STEPS) -> Fields:
    """Return the loads on block, mounts and bearings, and the mount travel, at `steps` angles of the cycle (C7)."""
    check_integer("steps", steps, 1, MAX_STEPS)
    first = next(iter(designs.values()))
    cycle, fields = first.engine.cycle, []
    for name, words, unit, axes, signal, part in _signals(first):
        spectra = [[with_common_base(cycle.base_order, [signal(x)])[0] for x in d.loads] for d in designs.values()]
        values = np.array([[spectrum.sample(steps) for spectrum in row] for row in spectra])[..., part]
        fields.append(_vector_field(name, words, unit, axes, values))
    angles = CurveAxis("angle", tuple(float(k) for k in np.degrees(cycle.angle) * np.arange(steps) / steps), "deg")
    rows = (CurveAxis("point", tuple(loads.point.name for loads in first.loads)), angles)
    return Fields("Loads over the crank angle", CurveAxis("design", tuple(designs)), rows, tuple(fields))


def orders_of(designs: Mapping[str, Evaluation]) -> Fields:
    """Return the amplitudes by order of the loads on block, mounts and bearings (C8)."""
    return _amplitudes(harmonics_of(designs))


def _amplitudes(harmonics: Fields) -> Fields:
    force, moment, *places, _ = harmonics.fields
    parts = (replace(moment, name=name.replace(" ", "_"), words=name, values=moment.values[..., part])
             for name, part in _MOMENTS)  # fmt: skip
    fields = []
    for field in (force, moment, *parts, *places):
        is_vector = _is_vector(field)
        # a resonance has no finite amplitude
        with np.errstate(invalid="ignore"):
            values = order_amplitude(np.asarray(field.values if is_vector else field.values[..., None], complex))
        values = np.where(np.isfinite(values), values, math.inf)
        fields.append(replace(field, own_axes=field.own_axes[:-1] if is_vector else field.own_axes, values=values))
    return replace(harmonics, title="Amplitudes by order", fields=tuple(fields))


def harmonics_of(designs: Mapping[str, Evaluation]) -> Fields:
    """Return the complex coefficients c by order h of the same loads: f(phi) = Re sum c e^{i h phi} (C8)."""
    first = next(iter(designs.values()))
    base = common_base([loads.wrench.base for design in designs.values() for loads in design.loads])
    signals = list(_signals(first))
    spectra = [
        [[signal(loads).with_finer_base(base) for loads in design.loads] for design in designs.values()]
        for *_, signal, _ in signals
    ]
    count = max(len(spectrum.coefficients) for of_signal in spectra for row in of_signal for spectrum in row)

    def padded(series: ComplexArray) -> ComplexArray:
        return np.pad(series, [(0, count - len(series))] + [(0, 0)] * (series.ndim - 1))

    fields = [
        _vector_field(
            name, words, unit, axes, np.array([[padded(s.coefficients[..., part]) for s in row] for row in rows])
        )
        for (name, words, unit, axes, _, part), rows in zip(signals, spectra, strict=True)
    ]
    orders = CurveAxis("order", tuple(float(k * base) for k in range(count)))
    points = CurveAxis("point", tuple(loads.point.name for loads in first.loads))
    frequencies = np.outer([loads.point.speed for loads in first.loads], orders.labels) / math.tau
    fields.append(Field("frequency", "frequency", "Hz", (), np.array([frequencies] * len(designs))))
    return Fields("Complex coefficients by order", CurveAxis("design", tuple(designs)), (points, orders), tuple(fields))


def _vector_field(name: str, words: str, unit: str, axes: tuple[CurveAxis, ...], values: Any) -> Field:
    # values are numbers if their last axis has length 1, else vectors
    if values.shape[-1] == 1:
        return Field(name, words, unit, axes, values[..., 0])
    return Field(name, words, unit, (*axes, CurveAxis("direction", ("x", "y", "z"))), values)


def _is_vector(field: Field) -> bool:
    return any(axis.name == "direction" for axis in field.own_axes)


def orders_with_phases(designs: Mapping[str, Evaluation]) -> Fields:
    """Return the fields of `orders_of`, amplitude and phase [deg] of every component, and the frequency [Hz].

    A component is its amplitude times the cosine of order times crank angle plus phase.
    """
    harmonics = harmonics_of(designs)
    orders, fields = _amplitudes(harmonics), list[Field]()
    for field in filter(_is_vector, harmonics.fields):
        # a resonance has no finite amplitude
        sizes = np.where(np.isfinite(field.values), np.abs(field.values), math.inf)
        phases = np.degrees(np.angle(np.where(sizes > 0.0, field.values, 1.0)))
        fields.append(replace(field, name=f"{field.name}_amplitude", words=f"amplitude of {field.words}", values=sizes))
        fields.append(
            replace(field, name=f"{field.name}_phase", words=f"phase of {field.words}", unit="deg", values=phases)
        )
    return replace(orders, fields=(*orders.fields, *fields, harmonics.fields[-1]))


def modes_of(designs: Mapping[str, Evaluation]) -> Fields:
    """Return natural frequencies [Hz], loss factors, energy shares and shapes of a block on elastic mounts (E6, E7).

    Shapes have a modal mass of one.

    Raises
    ------
    ModelError
        If the engine stands on rigid mounts, or on none.
    """
    if any(design.engine.block is None or not design.engine.mounts for design in designs.values()):
        raise ModelError(
            "stands on no elastic mounts, so it has no natural modes; give [block] and elastic [mounts]", "mounts"
        )
    modes = [mounting_in(design.engine).modes for design in designs.values()]
    motion, direction = CurveAxis("motion", tuple(MOTIONS)), CurveAxis("direction", ("x", "y", "z"))
    shapes = np.array([one.shapes.T for one in modes])
    fields = (
        Field("frequency", "natural frequency", "Hz", (), np.array([one.frequencies for one in modes])),
        Field("loss_factor", "loss factor", "", (), np.array([one.loss for one in modes])),
        Field("energy", "share of kinetic energy", "", (motion,), np.array([one.energy.T for one in modes])),
        Field("shift", "shift of the centre of gravity", "kg^-1/2", (direction,), shapes[..., :3]),
        Field("turn", "turn of the block", "kg^-1/2 m^-1", (direction,), shapes[..., 3:]),
    )
    return Fields(
        "Natural modes", CurveAxis("design", tuple(designs)), (CurveAxis("mode", tuple(range(1, 7))),), fields
    )


_Signal: TypeAlias = tuple[str, str, str, tuple[CurveAxis, ...], Callable[[PointLoads], Spectrum], slice]
"""Name, words, unit, axis of places, spectrum of a load at an operating point, and its components."""
_WRENCH = (("shaking force", "N", slice(0, 3)), ("shaking moment", "N m", slice(3, 6)))
_MOMENTS = (("roll moment", slice(0, 1)), ("rocking couple", slice(1, 3)))


def _signals(design: Evaluation) -> Iterator[_Signal]:
    # parts of the wrench, then each load with several places
    for words, unit, part in _WRENCH:
        yield words.replace(" ", "_"), words, unit, (), lambda loads: loads.wrench, part
    for load in load_channels():
        if load.display.curve and load.is_displayed(design.engine, design.fidelity):
            axis, name = CurveAxis(load.display.place, tuple(load.places(design.engine))), load.name.replace("-", " ")
            yield name.replace(" ", "_"), load.display.curve, load.unit, (axis,), load.signal, slice(None)
