"""The kinds of study parts: one module each, one line each in this table."""

from __future__ import annotations

from collections.abc import Mapping

from laufruhe.files.study_parts import PartTable
from laufruhe.studies.kinds import (
    balancer_sizing,
    counterweight_fraction,
    economics,
    free_forces,
    layout_comparison,
    tolerance,
)
from laufruhe.studies.kinds.kind import Kind, Record

__all__ = ["KINDS", "Kind", "Record", "kind_of"]

KINDS: Mapping[str, Kind] = {
    "counterweight fraction": counterweight_fraction.KIND,
    "balancer sizing": balancer_sizing.KIND,
    "layout comparison": layout_comparison.KIND,
    "economics": economics.KIND,
    "tolerance": tolerance.KIND,
    "free forces": free_forces.KIND,
}


def kind_of(part: PartTable) -> Kind:
    """How a part is computed."""
    return KINDS[part.settings()["kind"]]
