"""Bulk data of Nastran: loads on grids by frequency, and their means, in large fields."""

from __future__ import annotations

from typing import Any

import numpy as np

from laufruhe.extensions.exchange.components import BLOCK, ExportLoads, plain, speed_text

_SETS, _MEANS, _LOADS = 9_000_000, 9_500_000, 9_100_000
"""Numbers before the first set of frequencies and dynamic loads, of static loads, and of tables and their loads."""
_NOTES = (
    "displacement coordinate system of the grids: 1 forward, 2 left, 3 up",
    "solve at the frequencies of FREQ alone, not between them",
    "LOAD has the means of gas and moving masses, without the weight of the engine",
)
_ON_MOUNTS = "forces of mounts act on a model of what carries the engine"
_TINY = 1e-99
"""Least size of a number that fits into 16 characters."""


def bulk_data(loads: ExportLoads) -> str:
    """Return the loads on grids: orders above zero as RLOAD1, means as FORCE and MOMENT, for each operating point.

    Orders without an amplitude are left out.
    """
    components = [c for c in loads.components if c.node and c.quantity != "displacement"]
    units = ", ".join(dict.fromkeys(c.unit for c in components))
    grids = dict.fromkeys(f"grid {c.node}: {c.place}" for c in components)
    on_mounts = () if components and components[0].place == BLOCK else (_ON_MOUNTS,)
    lines = [f"$ {plain(line)}" for line in (*loads.heading(), f"units: {units}, Hz", *_NOTES, *on_mounts, *grids)]
    number = _LOADS
    for k, point in enumerate(loads.points):
        dynamic, static = _SETS + k + 1, _MEANS + k + 1
        means: dict[tuple[str, int], list[float]] = {}
        for c in components:
            means.setdefault((c.quantity.upper(), c.node), []).append(c.series[k, 0].real)
        mean = f"mean: LOAD = {static}" if any(map(any, means.values())) else "no mean loads"
        lines.append(f"$ {speed_text(point)}: DLOAD = FREQUENCY = {dynamic}; {mean}")
        waves = np.array([c.series[k, 1:] for c in components])
        excited = waves.any(axis=0)
        hertz, members = loads.frequencies(k)[1:][excited], list[Any]()
        for c, wave in zip(components, waves[:, excited], strict=True):
            if wave.any():
                number += 2
                lines.append(_card("DAREA", number, c.node, c.direction, 1.0))
                lines.append(_card("RLOAD1", number, number, None, None, number, number + 1, "LOAD"))
                for table, values in ((number, wave.real), (number + 1, wave.imag)):
                    # a table needs two points; at rest there is no load
                    pairs = np.column_stack([hertz, values]).ravel()
                    lines.append(_card("TABLED1", table, *[None] * 7, 0.0, 0.0, *pairs, "ENDT"))
                members += [1.0, number]
        if members:
            lines += [_card("DLOAD", dynamic, 1.0, *members), _card("FREQ", dynamic, *hertz)]
        lines += [_card(name, static, node, None, 1.0, *parts) for (name, node), parts in means.items() if any(parts)]
    return "\n".join(lines) + "\n"


def _card(name: str, *fields: Any) -> str:
    # large fields: four a line, an even number of lines
    texts = [*map(_field, fields), *[_field(None)] * (-len(fields) % 8)]
    rows = ("".join(texts[k : k + 4]) for k in range(0, len(texts), 4))
    return f"{name + '*':8s}" + "*\n*       ".join(rows)


def _field(value: Any) -> str:
    if isinstance(value, float):
        return f"{value if abs(value) >= _TINY else 0.0:16.9E}"
    return f"{'' if value is None else value:>16}"
