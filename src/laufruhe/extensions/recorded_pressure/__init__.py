"""Recorded cylinder pressure: columns, zeros, gauges and noise of test benches, and what motored pressure shows."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.recorded_pressure"
EXTENSION = Extension("recorded_pressure", gas_models=(f"{_HERE}.table:TraceTable",), advice=(f"{_HERE}.table:ADVICE",))
