"""Computations that no list of cases can say, by the name that a replication calls them by."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from laufruhe.problem.problem import Problem
from laufruhe.studies.replication import gas_trace
from laufruhe.studies.replication.quantities import Labelled


@dataclass(frozen=True)
class Computation:
    """From a problem and the case's numbers to quantities, and the names of these."""

    run: Callable[[Problem, Mapping[str, Any]], dict[str, Labelled]]
    gives: tuple[str, ...]


COMPUTATIONS: Mapping[str, Computation] = {
    "gas trace of a four-cylinder": Computation(gas_trace.fitted_traces, gas_trace.GIVES)
}
