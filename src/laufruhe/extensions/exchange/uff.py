"""Universal files in ASCII: units, nodes, and functions at nodes (datasets 164, 15 and 58).

The format is that of the Structural Dynamics Research Laboratory of the University of Cincinnati.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from laufruhe.extensions.exchange.components import MADE_BY, Component, ExportLoads, plain, speed_text
from laufruhe.machine import Mount
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.present.numbers import RPM

_TIME_RESPONSE, _SPECTRUM = 1, 12
_REAL, _COMPLEX, _EVEN = 4, 6, 1
_KINDS = {"force": 13, "moment": 13, "displacement": 8}
"""Specific data types of ordinates: excitation force, displacement."""
_TINY = 1e-99
"""Least size of a number whose exponent has two digits, so that it leaves a blank in its field."""


def universal_file(loads: ExportLoads, mounts: Sequence[Mount]) -> str:
    """Return every component with a node as time response (type 1) and as complex spectrum (type 12)."""
    places = {mount.name: mount.position for mount in mounts}
    nodes = {c.node: places.get(c.place, (0.0, 0.0, 0.0)) for c in loads.components if c.node}
    units = [f"{1:10d}{MADE_BY[:20]:20s}{2:10d}", f"{1.0:25.17E}" * 3, f"{273.15:25.17E}"]
    positions = (f"{node:10d}{0:10d}{0:10d}{8:10d}{x:13.5E}{y:13.5E}{z:13.5E}" for node, (x, y, z) in nodes.items())
    lines = [*_dataset(164, units), *_dataset(15, positions)]
    for k, point in enumerate(loads.points):
        step = loads.cycle / point.speed
        hertz = float(loads.frequencies(k)[min(1, len(loads.orders) - 1)])
        for c in (c for c in loads.components if c.node):
            heads = (f"{c.quantity} {c.axis} at {c.place}", loads.title, MADE_BY, speed_text(point),
                     f"peak amplitudes, exp(+i w t), {loads.zero}")  # fmt: skip
            texts, speed = [plain(head)[:80] for head in heads], point.speed * RPM
            time = _function(c, _TIME_RESPONSE, speed, (17, "time", "s"), step / c.values.shape[1], c.values[k])
            spectrum = _function(c, _SPECTRUM, speed, (18, "frequency", "Hz"), hertz, c.series[k])
            lines += [*_dataset(58, (*texts, *time)), *_dataset(58, (*texts, *spectrum))]
    return "\n".join(lines) + "\n"


def _dataset(number: int, records: Iterable[str]) -> list[str]:
    return [f"{-1:6d}", f"{number:6d}", *records, f"{-1:6d}"]


def _function(
    c: Component, kind: int, speed: float, abscissa: tuple[int, str, str], step: float, values: Array | ComplexArray
) -> Iterator[str]:
    """Yield records 6 to 12 of dataset 58, for values at even steps of the abscissa from zero."""
    place = f"{plain(c.place)[:10]:10s}{c.node:10d}{c.direction:4d}"
    yield f"{kind:5d}{0:10d}{0:5d}{0:10d} {place} {'NONE':10s}{0:10d}{0:4d}"
    form = _COMPLEX if kind == _SPECTRUM else _REAL
    yield f"{form:10d}{len(values):10d}{_EVEN:10d}{0.0:13.5E}{step:13.5E}{speed:13.5E}"
    ordinate = (_KINDS[c.quantity], c.quantity, c.unit)
    for number, label, unit in (abscissa, ordinate, (0, "NONE", "NONE"), (19, "speed", "rpm")):
        yield f"{number:10d}{0:5d}{0:5d}{0:5d} {label:20s} {unit:20s}"
    numbers = np.column_stack([values.real, values.imag]).ravel() if form == _COMPLEX else values
    numbers = np.where(np.abs(numbers) < _TINY, 0.0, numbers)
    for start in range(0, len(numbers), 4):
        yield "".join(f"{number:20.11E}" for number in numbers[start : start + 4])
