"""Processors that work may be shared among."""

from __future__ import annotations

import os


def processors() -> int:
    """As many processes as may run side by side."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
