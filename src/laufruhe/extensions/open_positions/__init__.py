"""Positions of shafts and of their unbalances: boxes of open positions (P8, P20), and limits on distances of shafts.

Without it open positions are decided by local programs, without a bound.
"""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.open_positions"
EXTENSION = Extension(
    "open_positions",
    channels=tuple(f"{_HERE}.channels:{name}" for name in ("SHAFT_DISTANCE", "SHAFT_CLEARANCE", "ENVELOPE_RADIUS")),
    dependences=(
        "shaft distance   0 0 0  s 0 0  0  0 0  flywheel=0 torsion=0 electric_machines=0",
        "shaft clearance  0 0 0  s 0 0  0  0 0  flywheel=0 torsion=0 electric_machines=0",
        "envelope radius  0 0 0  c 0 0  0  0 0  flywheel=0 torsion=0 electric_machines=0",
    ),
    methods=(f"{_HERE}.methods:BOXES", f"{_HERE}.methods:CORNERS"),
    reductions=(f"{_HERE}.shafts:COLLISIONS",),
)
