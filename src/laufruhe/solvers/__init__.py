"""Solvers: methods propose designs, the exact model evaluates them, and lower bounds prove them.

Names of this package are imported at first use, because readers of results do not need the table of methods.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from laufruhe.solvers.conclusion import evaluate_only
    from laufruhe.solvers.methods import METHODS, solve
    from laufruhe.solvers.result import Result, Status
else:
    _HOMES = dict.fromkeys(("METHODS", "solve"), "methods")
    _HOMES |= {"evaluate_only": "conclusion", "Result": "result", "Status": "result"}

    def __getattr__(name: str) -> object:
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


__all__ = ["METHODS", "Result", "Status", "evaluate_only", "solve"]
