"""Reductions: measured parts are chosen, and designs decided for built engines, before the core sees a drawing."""

from __future__ import annotations

from functools import partial

from laufruhe.extensions.robust.assembly import Assembly
from laufruhe.extensions.robust.tolerance import Robust
from laufruhe.numerics.processes import call_by_name
from laufruhe.solvers.methods import Reduction

_HOME, _NEXT = "laufruhe.extensions.robust", "limits that nothing open moves"

ASSEMBLY = Reduction(
    "assembly", lambda p: p.extra(Assembly) is not None,
    partial(call_by_name, f"{_HOME}.assembly_solver:solve_assembly"),
    partial(call_by_name, f"{_HOME}.assembly_solver:refuse"), _NEXT,
)  # fmt: skip
TOLERANCES = Reduction(
    "tolerances", lambda p: p.extra(Robust) is not None, partial(call_by_name, f"{_HOME}.solver:solve_built"),
    partial(call_by_name, f"{_HOME}.solver:refuse"), _NEXT,
)  # fmt: skip
