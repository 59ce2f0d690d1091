"""Files of loads, and their check before a design is known."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from laufruhe.errors import ModelError, counted, refused
from laufruhe.extensions.exchange import scripts
from laufruhe.extensions.exchange.components import (
    BLOCK,
    MADE_BY,
    ExportLoads,
    export_loads,
    node_numbers,
    rows,
)  # fmt: skip
from laufruhe.extensions.exchange.nastran import bulk_data
from laufruhe.extensions.exchange.uff import universal_file
from laufruhe.present.tables import Table
from laufruhe.problem.problem import Problem
from laufruhe.report import files
from laufruhe.report.strict_json import strict
from laufruhe.report.table_files import write_csv
from laufruhe.solvers.result import Result

_HEAD = (
    "operating point", "speed [rpm]", "order", "frequency [Hz]", "place", "grid", "quantity", "direction", "unit",
    "amplitude", "phase [deg]", "real", "imaginary",
)  # fmt: skip


def checked_nodes(problem: Problem, target: str, grids: str, highest: float, millimetres: bool) -> dict[str, int]:
    """Return the node numbers of mounts and block; raise `InputError` or `ModelError` for wrong options."""
    nodes = node_numbers(problem.engine, grids)
    if not highest >= 0.0:
        raise refused("--highest-order", f"{highest:g}", "must be zero or more", "try 30")
    if millimetres and target not in ("csv", "json", "nastran"):
        raise refused("--mm", "", f"does not apply to {target}, which is in SI units", "leave it out")
    mounts = [mount.name for mount in problem.engine.mounts]
    if target == "nastran" and not nodes:
        example = ", ".join(f"{name}={k}" for k, name in enumerate(mounts or [BLOCK], 101))
        raise refused("--grids", "", "is missing, and loads act on grids", f'write --grids "{example}"')
    if target == "nastran" and BLOCK in nodes and len(nodes) > 1:
        rule = f"loads '{BLOCK}' beside mounts, which counts the loads twice"
        raise refused("--grids", grids, rule, "give the mounts for a model of what carries the engine, or the block")
    scripts.check(target, problem)
    return nodes or ({name: k for k, name in enumerate((*mounts, BLOCK), 1)} if target == "uff" else {})


def write(result: Result, target: str, nodes: Mapping[str, int], highest: float, millimetres: bool, path: Path) -> str:
    """Write a file of the final design, and return what it contains.

    Raises
    ------
    ModelError
        If the final design is on an undamped resonance.
    """
    if result.final.resonance:
        raise ModelError(f"there are no finite loads to export: {result.final.resonance}; add damping")
    if target in scripts.SCRIPTS:
        files.write(path, scripts.script(target, result))
        return f"script for {target}"
    loads = export_loads(result, nodes, highest, millimetres)
    if target == "csv":
        write_csv(Table(_HEAD, list(rows(loads))), path, loads.heading())
    elif target == "json":
        content = [dict(zip(_HEAD, row, strict=True)) for row in rows(loads)]
        files.write(path, strict({"title": loads.title, "convention": loads.convention, "loads": content}))
    elif target == "netcdf":
        _write_netcdf(loads, result, path)
    else:
        is_nastran, mounts = target == "nastran", result.final.engine.mounts
        files.write(path, bulk_data(loads) if is_nastran else universal_file(loads, mounts))
    written = [c for c in loads.components if c.node] if target in ("uff", "nastran") else loads.components
    written = [c for c in written if target != "nastran" or c.quantity != "displacement"]
    return f"{counted(len(written), 'component')} of loads, orders to {loads.orders[-1]:g}"


def _write_netcdf(loads: ExportLoads, result: Result, path: Path) -> None:
    """Write loads over the crank angle, and amplitudes and phases by order, with the attributes of CF."""
    import xarray as xr

    data, harmonics = (data.isel(design=-1, drop=True) for data in (result.forces(), result.harmonics()))
    harmonics = harmonics.sel(order=slice(None, loads.orders[-1]))
    data["frequency"] = harmonics.frequency
    for name, series in harmonics.drop_vars("frequency").items():
        words = series.attrs["long_name"]
        data[f"{name}_amplitude"] = abs(series).assign_attrs(series.attrs, long_name=f"{words}, amplitude by order")
        phase = xr.apply_ufunc(lambda c: np.degrees(np.angle(c + 0.0)), series)
        data[f"{name}_phase"] = phase.assign_attrs(units="degree", long_name=f"{words}, phase by order")
    speeds = xr.DataArray([point.speed for point in loads.points], dims="point")
    data["speed"] = speeds.assign_attrs(units="rad s-1", long_name="speed of the crankshaft")
    time = np.radians(data.angle) / speeds
    data = data.assign_coords(time=time.assign_attrs(units="s", long_name="time from crank angle zero"))
    data.angle.attrs["units"] = "degree"
    data.attrs = {
        "source": MADE_BY + " ", "Conventions": "CF-1.11", "title": loads.title, "comment": "; ".join(loads.convention)
    }  # fmt: skip
    data.to_netcdf(path, engine="scipy")
