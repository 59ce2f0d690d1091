"""Reductions of problems with tolerances or measured parts to problems of a drawing."""

from __future__ import annotations

from functools import partial

from laufruhe.extensions.robust.assembly import Assembly
from laufruhe.extensions.robust.tolerance import Robust
from laufruhe.numerics.processes import call_by_name
from laufruhe.solvers.methods import Reduction

_HERE = "laufruhe.extensions.robust"

# solvers are imported when a problem needs them
ASSEMBLY = Reduction(
    "assembly", lambda problem: problem.extra(Assembly) is not None,
    partial(call_by_name, f"{_HERE}.assembly_solver:solve_assembly"),
    partial(call_by_name, f"{_HERE}.assembly_solver:refuse"), "constant limits",
)  # fmt: skip
TOLERANCES = Reduction(
    "tolerances", lambda problem: problem.extra(Robust) is not None,
    partial(call_by_name, f"{_HERE}.solver:solve_built"), partial(call_by_name, f"{_HERE}.solver:refuse"),
    "constant limits",
)  # fmt: skip
