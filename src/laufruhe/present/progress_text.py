"""Progress of a search as text."""

from __future__ import annotations

import math
from collections.abc import Iterator

from laufruhe.numerics.progress import Step
from laufruhe.present.numbers import figure
from laufruhe.prove.certificate import USELESS_GAP


def progress_text(step: Step, valued: Step, unit: str) -> str:
    """Return a step as one line, with best value, bound and gap of the search that knows a value [`unit`]."""
    count = f"{step.done} of {step.whole}" if step.whole else f"{step.done}" if step.done else ""
    return ", ".join([*step.within, f"{step.what}: {count}" if count else step.what, *_values(valued, unit)])


def _values(step: Step, unit: str) -> Iterator[str]:
    if math.isfinite(step.value):
        yield f"best {figure(step.value, unit)}"
    if math.isfinite(step.bound) and step.bound > 0.0:
        yield f"bound {figure(step.bound, unit)}"
    if step.gap < USELESS_GAP:
        yield f"gap {100.0 * step.gap:.2g} %"
