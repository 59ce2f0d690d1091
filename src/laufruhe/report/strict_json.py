"""JSON as scripts can rely on it: no NaN, and one line feed at the end."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np


def strict(content: Any, indent: int = 2) -> str:
    """Text of plain Python and NumPy values, null in place of what is no finite number."""
    return json.dumps(finite(content), indent=indent, ensure_ascii=False, allow_nan=False) + "\n"


def finite(value: Any) -> Any:
    """Null in place of what is no finite number."""
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [finite(entry) for entry in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value
