"""Table of static load cases."""

from __future__ import annotations

import numpy as np

from laufruhe.physics.static_cases import settled
from laufruhe.present.mounting import is_elastic
from laufruhe.present.numbers import DASH, number
from laufruhe.present.tables import Table
from laufruhe.problem.channels import mounting_in
from laufruhe.solvers.result import Result

HEAD = ("load case", "mount", "travel x [mm]", "y [mm]", "z [mm]", "force [N]", "on its stop")


def tables(result: Result) -> list[Table]:
    """Return travel and force of every mount under each load case."""
    if not is_elastic(result) or not result.final.engine.load_cases:
        return []
    mounting, rows = mounting_in(result.final.engine), []
    for case in result.final.engine.load_cases:
        state = settled(mounting, case)
        for mount, travel, force in zip(mounting.mounts, state.travel, state.force, strict=True):
            travels = (number(1e3 * along) for along in travel)
            on_stop = "yes" if mount.name in state.on_stops else DASH
            rows.append((case.name, mount.name, *travels, number(float(np.linalg.norm(force))), on_stop))
    note = "Travel is measured from the position without these loads."
    return [Table(HEAD, tuple(rows), title="Load cases", left=2, note=note, file="load-cases")]
