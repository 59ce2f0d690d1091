"""The kinds of study parts by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import get_args

from laufruhe.extension import extended
from laufruhe.studies.part import Part
from laufruhe.studies.percentile import PercentilePart

KINDS: Mapping[str, type[Part]] = extended(
    "study_kinds",
    Part,
    (PercentilePart,),
    lambda kind: str(get_args(kind.model_fields["kind"].annotation)[0]),
)
