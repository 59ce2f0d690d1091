"""Reduction of problems with speed ranges to problems with finitely many operating points."""

from functools import partial

from laufruhe.extensions.speed_ranges.ranges import SpeedRanges
from laufruhe.numerics.processes import call_by_name
from laufruhe.solvers.methods import Reduction

_HERE = "laufruhe.extensions.speed_ranges.exchange"
REDUCTION = Reduction(
    "speed ranges", lambda problem: problem.extra(SpeedRanges) is not None,
    partial(call_by_name, f"{_HERE}:solve_ranges"), partial(call_by_name, f"{_HERE}:refuse"), "refined sampling",
)  # fmt: skip
