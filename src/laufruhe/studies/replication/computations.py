"""Computations that no list of cases can say, by the name that a replication calls them by, and what they give."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from laufruhe.problem.problem import Problem
from laufruhe.studies.replication import gas_trace
from laufruhe.studies.replication.quantities import Labelled

Computation: TypeAlias = Callable[[Problem, Mapping[str, Any]], dict[str, Labelled]]

COMPUTATIONS: Mapping[str, tuple[Computation, tuple[str, ...]]] = {
    "gas trace of a four-cylinder": (gas_trace.fitted_traces, gas_trace.GIVES),
}
