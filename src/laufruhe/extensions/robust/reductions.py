"""Reductions of problems with tolerances or measured parts to problems of a drawing."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from laufruhe.extensions.robust.assembly import Assembly
from laufruhe.extensions.robust.tolerance import Robust
from laufruhe.solvers.methods import Reduction


def _from(module: str, function: str) -> Callable[..., Any]:
    # solvers are imported when a problem needs them
    return lambda *arguments: getattr(import_module(f"laufruhe.extensions.robust.{module}"), function)(*arguments)


ASSEMBLY = Reduction(
    "assembly", lambda problem: problem.extra(Assembly) is not None,
    _from("assembly_solver", "solve_assembly"), _from("assembly_solver", "refuse"), "constant limits",
)  # fmt: skip
TOLERANCES = Reduction(
    "tolerances", lambda problem: problem.extra(Robust) is not None,
    _from("solver", "solve_built"), _from("solver", "refuse"), "constant limits",
)  # fmt: skip
